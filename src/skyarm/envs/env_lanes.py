"""Parallel episodes of a learning task in SIMD lanes, with precomputed initial
states.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra.scalars.philox import uniforms
from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.lane_stepper import LaneStepper
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.array_evaluation import evaluate
from skyarm.dynamics import State
from skyarm.envs.env_program import EnvProgram
from skyarm.envs.env_task import LearningTask
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.files import shown
from skyarm.records.leaves import rebuild
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.draws import start_draws
from skyarm.simulate.lane_numbers import checked_array
from skyarm.simulate.pictures import ArrivingPictures, Present

AHEAD = 8192
"""Number of episodes, over all lanes, that are made at once; NumPy then takes about a
microsecond for each."""


class EpisodeStarts:
    """Precomputed initial data of many parallel episodes: randomised parameters, states
    and observations.

    Precomputed, because a lane must restart between two steps of some microseconds
    each.

    Args:
        program: program of the environment. lanes: number of lanes. dtype: type of the
            numbers.

    Attributes:
        varies: True if episodes begin differently.
    """

    def __init__(self, program: EnvProgram, lanes: int, dtype: npt.DTypeLike) -> None:
        self._program, self._dtype = program, dtype
        self._start = program.trace_start()
        self.varies = bool(self._start.inputs)
        # 1 to 64 episodes ahead, chosen
        self._depth = int(np.clip(AHEAD // lanes, 1, 64)) if self.varies else 1
        self._seeds = np.zeros(lanes, dtype=np.uint64)
        self._first = np.zeros(lanes, dtype=np.int64)
        rows = len(program.paths) + len(self._start.outputs)
        self._table = np.zeros((rows, lanes if self.varies else 1, self._depth), dtype)
        if not self.varies:
            self._table[:, :, 0] = self._compute(
                np.zeros(1, dtype=np.uint64), np.zeros(1, dtype=np.int64)
            )

    def seed(self, lanes: Array, seeds: Sequence[int]) -> None:
        """Assign new random seeds to parallel episodes and restart their episode count
        at 0.
        """
        self._seeds[lanes] = seeds
        # as far as could be from any episode that is asked for: made when it is
        self._first[lanes] = -(2**40)

    def take(self, lanes: Array, episodes: Array) -> Array:
        """Randomised parameters, initial state and first observation of given episodes,
        as array (values, episodes).
        """
        if not self.varies:
            # all episodes begin alike, and one of them is kept
            return self._table[:, np.zeros(len(lanes), dtype=np.intp), 0]
        at = episodes - self._first[lanes]
        missing = (at < 0) | (at >= self._depth)
        if missing.any():
            self._fill(lanes[missing], episodes[missing])
            at = episodes - self._first[lanes]
        return self._table[:, lanes, at]

    def _fill(self, lanes: Array, episodes: Array) -> None:
        """Compute and store the initial data of the next several episodes of some SIMD
        lanes.
        """
        self._first[lanes] = episodes
        numbers = (episodes[:, None] + np.arange(self._depth)).ravel()
        columns = self._compute(np.repeat(self._seeds[lanes], self._depth), numbers)
        self._table[:, lanes] = columns.reshape(len(columns), len(lanes), self._depth)

    def _compute(self, seeds: Array, episodes: Array) -> Array:
        """Compute the initial data of episodes with given seeds and episode numbers, as
        array (values, episodes).
        """
        program = self._program
        columns = program.task.randomised.draw(seeds, episodes)
        # numbers are what 32 bits hold of them, where that is what the code flies
        with np.errstate(over="ignore"):
            columns = [
                np.asarray(column, self._dtype).astype(float) for column in columns
            ]
        inputs: list[Array] = [*columns]
        for channel, count in program.uniforms:
            inputs += [*uniforms(seeds[:, None], episodes, channel, 0, count).T]
        several: Any = seeds[:, None, None]
        for draws in start_draws(program.task.scenario, several, episodes):
            inputs += [*draws.T]
        starts = evaluate(self._start, inputs, len(episodes))
        return np.concatenate(
            [np.array(columns).reshape(len(columns), len(episodes)), starts]
        )

    @property
    def state(self) -> slice:
        """Slice of an episode's initial data that holds the initial state of the closed
        loop.
        """
        begin = len(self._program.paths)
        return slice(begin, begin + self._program.loop.carry)

    @property
    def observation(self) -> slice:
        """Slice of an episode's initial data that holds the first observation."""
        return slice(self.state.stop, len(self._table))


class EnvLanes:
    """Parallel episodes of a learning task, each in a SIMD lane with its own random
    seed.

    Args:
        task: learning task of the episodes. lanes: their number. threads: largest
            number of threads.

    Attributes:
        observation: (numbers, lanes) view that each step and each beginning writes
            anew. reward: (lanes,) view.
        ended, truncated: (lanes,) True where the episode has ended before its time, or
            has flown its duration.
        ending: (lanes,) view, 0 or the number of the ending that came; :attr:`statuses`
            has their words.
        pictures: sensor -> (lanes, rows, columns, 1), observed beside the numbers.
        state: the plant's state, a record of (lanes,) views: the truth, which no
            observation holds.
        actions: (numbers, lanes) view on the actions of the next step. episodes:
            (lanes,) number of each lane's.
    """

    def __init__(self, task: LearningTask, lanes: int, *, threads: int = 1) -> None:
        self.task, self.lanes = task, lanes
        self.program = EnvProgram(task)
        single = task.precision == "single"
        shape = Lanes(
            host_width(single=single),
            single=single,
            # fused multiply-add rounds once instead of twice, so the bits differ
            contract=task.precision != "bit_exact",
        )
        kernel = Kernel(self.program.loop, shape, logging=True)
        self._stepper = LaneStepper(kernel, lanes, threads=threads)
        self._starts = EpisodeStarts(self.program, lanes, kernel.dtype)
        self.dtype = kernel.dtype
        # behind the observation: reward, truncated, ending
        count = self._stepper.logged.shape[0] - 3
        self.observation = self._stepper.logged[:count]
        self.reward, self._truncated, self.ending = self._stepper.logged[count:]
        varied = len(self.program.paths)
        self._numbers = self._stepper.parameters[:varied]
        self.actions = self._stepper.parameters[varied:]
        self._carry = self._stepper.carry
        now: Any = rebuild(self.program.first, list(self._carry))
        self.loop = now.loop
        self.state: State = now.loop.agent.state
        self._depths: dict[str, Any] = {
            each.sees: each for each in task.observation if each.sees
        }
        self._pictures = ArrivingPictures(task.scenario, [*self._depths], lanes)
        cameras = task.scenario.agent.cameras
        self.pictures = {
            name: np.zeros((lanes, *cameras[name].shape, 1), self.dtype)
            for name in self._depths
        }
        self.episodes: Array = np.zeros(lanes, dtype=np.int64)
        self.seeds: Array = np.zeros(lanes, dtype=np.uint64)
        self.ended = np.zeros(lanes, dtype=bool)
        self.truncated = np.zeros(lanes, dtype=bool)
        self.statuses = np.array(self.program.statuses, dtype=object)
        self._every = np.arange(lanes)
        self.reseed(self._every, [0] * lanes)

    def reseed(self, lanes: Array, seeds: Sequence[int]) -> None:
        """Start episode 0 with new random seeds in some SIMD lanes."""
        self.seeds[lanes] = seeds
        self._starts.seed(lanes, seeds)
        self._begin(lanes, np.zeros(len(lanes), dtype=np.int64))

    def begin(self, lanes: Array) -> None:
        """Start the next episode in some SIMD lanes."""
        self._begin(lanes, self.episodes[lanes] + 1)

    def _begin(self, lanes: Array, episodes: Array) -> None:
        starts = self._starts
        self.episodes[lanes] = episodes
        with np.errstate(over="ignore"):
            # what 32 bits do not hold becomes infinite there, without a warning
            columns = starts.take(lanes, episodes)
        self._numbers[:, lanes] = columns[: len(self._numbers)]
        self._carry[:, lanes] = columns[starts.state]
        self.observation[:, lanes] = columns[starts.observation]
        self.reward[lanes] = 0.0
        self._truncated[lanes] = 0.0
        self.ending[lanes] = 0.0
        self.ended[lanes] = self.truncated[lanes] = False
        # the first step measures what the second period begins with
        self._stepper.begin(lanes, episodes, self.seeds[lanes], first=1)
        # unused places of the last vector copy the last lane, which may have changed
        self._stepper.fill()
        # NaN marks a lane that has taken no picture yet
        for taken in self._pictures.taken.values():
            taken[:, lanes] = np.nan
        self._look(lanes)

    def _look(self, lanes: Array) -> None:
        """Show the pictures that have arrived in some lanes."""
        if not self.pictures:
            return

        def present(some: Array) -> Present:
            numbers = zip(self.program.paths, self._numbers[:, some], strict=True)
            keys = self.seeds[some], self.episodes[some]
            return rebuild(self.loop, self._carry[:, some]), keys, dict(numbers)

        ticks = np.asarray(self.loop.ticks)[lanes].astype(int)
        newest = self._pictures.look(self.task.scenario, ticks, lanes, present)
        for (name, image), rows in zip(self.pictures.items(), newest, strict=True):
            shares = self._depths[name].share(rows[:, 1:])
            image[lanes] = shares.reshape(-1, *image.shape[1:])

    def view(self, lanes: int | slice, *, copy: bool = True) -> Any:
        """Observation of one lane or of several: the numbers, or a table of them and of
        pictures.
        """
        every = {"state": self.observation.T, **self.pictures}
        # the numbers of a lane lie together then, and apart in the transposed array
        seen = {
            name: each[lanes].copy(order="C") if copy else each[lanes]
            for name, each in every.items()
        }
        return seen if self.pictures else seen["state"]

    def act(self, actions: Array) -> None:
        """Set the actions of all parallel episodes for the next step, an array (lanes,
        components).

        Raises:
            ScenarioError: another shape, no numbers, or numbers that are not finite;
                nothing is taken then.
        """
        buffer = self.actions
        shape = buffer.shape[::-1]
        checked = checked_array(
            "actions", actions, [shape], f"of real numbers, of shape {shape}"
        )
        if not np.isfinite(checked).all():
            lane = int(np.flatnonzero(~np.isfinite(checked).all(axis=1))[0])
            raise ScenarioError(
                f"actions[{lane}] = {shown(checked[lane].tolist())}: must be finite"
            )
        # a larger one than 32 bits hold counts as the bound, too
        np.clip(checked.T, -1.0, 1.0, out=buffer)

    def step(self) -> None:
        """Simulate one control period of all parallel episodes."""
        self._stepper.step()
        self._look(self._every)
        np.greater(self.ending, 0.5, out=self.ended)
        np.greater(self._truncated, 0.5, out=self.truncated)

    def numbers(self) -> dict[str, Array]:
        """Randomised parameters of the running episodes, as a dictionary from parameter
        path to array (lanes,).
        """
        return {
            # a copy, since the row is written anew when a lane begins again
            path: row.copy()
            for path, row in zip(self.program.paths, self._numbers, strict=True)
        }

    def lane_scenario(self, lane: int) -> Scenario:
        """Scenario of one parallel episode, with its randomised parameters."""
        return with_numbers(
            self.task.scenario,
            {path: float(row[lane]) for path, row in self.numbers().items()},
        )

    def close(self) -> None:
        """Stop the worker threads that simulate the parallel episodes."""
        self._stepper.close()
