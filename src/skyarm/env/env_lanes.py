"""Many episodes of a task stepped together: the core of the single and of the vector environment."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compile import rebuild
from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.lane_stepper import LaneStepper
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.dynamics import State
from skyarm.env.env_program import EnvProgram
from skyarm.env.env_task import Task
from skyarm.env.episode_starts import EpisodeStarts
from skyarm.env.given_arguments import require_actions
from skyarm.files import shown
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.check_endings import endings_of

Array = npt.NDArray[Any]


class EnvLanes:
    """Episodes of a task side by side. A lane's episodes depend on its seed alone, not on the other lanes.

    Args:
        task: what is flown. lanes: how many. threads: most that work.

    Attributes:
        observation: (numbers, lanes) view that each step and each beginning writes anew. reward: (lanes,) view.
        ended, truncated: (lanes,) True where the episode has ended before its time, or has flown its duration.
        ending: (lanes,) view, 0 or the number of the ending that came; :attr:`statuses` has their words.
        state: the plant's state, a record of (lanes,) views: the truth, which no observation holds.
        actions: (numbers, lanes) view on the actions of the next step. episodes: (lanes,) number of each lane's.
    """

    def __init__(self, task: Task, lanes: int, *, threads: int = 1) -> None:
        self.task, self.lanes = task, lanes
        self.program = EnvProgram(task)
        single = task.precision == "single"
        shape = Lanes(host_width(single=single), single=single, contract=task.precision != "bit_exact")
        kernel = Kernel(self.program.loop, shape, logging=True)
        self._stepper = LaneStepper(kernel, lanes, threads=threads)
        self._starts = EpisodeStarts(self.program, lanes, kernel.dtype)
        self.dtype = kernel.dtype
        count = self._stepper.logged.shape[0] - 3
        self.observation = self._stepper.logged[:count]
        self.reward, self._truncated, self.ending = self._stepper.logged[count:]
        varied = len(self.program.paths)
        self._numbers, self.actions = self._stepper.parameters[:varied], self._stepper.parameters[varied:]
        self._carry = self._stepper.carry
        now: Any = rebuild(self.program.first, iter(list(self._carry)))
        self.loop = now.loop
        self.state: State = now.loop.state
        self.episodes: Array = np.zeros(lanes, dtype=np.int64)
        self.seeds: Array = np.zeros(lanes, dtype=np.uint64)
        self.ended, self.truncated = np.zeros(lanes, dtype=bool), np.zeros(lanes, dtype=bool)
        words = (ending.status for ending in endings_of(task.scenario))
        self.statuses = np.array(["", *words, "diverged"], dtype=object)
        self._every = np.arange(lanes)
        self.reseed(self._every, np.zeros(lanes, dtype=np.uint64))

    def reseed(self, lanes: Array, seeds: Array) -> None:
        """Begin episode 0 of these lanes under other seeds."""
        self.seeds[lanes] = seeds
        self._starts.seed(lanes, seeds)
        self._begin(lanes, np.zeros(len(lanes), dtype=np.int64))

    def begin(self, lanes: Array) -> None:
        """Begin the next episode of these lanes."""
        self._begin(lanes, self.episodes[lanes] + 1)

    def _begin(self, lanes: Array, episodes: Array) -> None:
        starts = self._starts
        self.episodes[lanes] = episodes
        with np.errstate(over="ignore"):
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
        self._stepper.fill()

    def act(self, actions: Array) -> None:
        """Take the actions of the next step, (lanes, numbers).

        Raises:
            ScenarioError: another shape, no numbers, or numbers that are not finite; nothing is taken then.
        """
        held = self.actions
        try:
            found = np.asarray(actions)
        except (TypeError, ValueError):
            raise ScenarioError(f"actions = {shown(actions)}: must be an array") from None
        require_actions("actions", found, held.shape[::-1])
        if not np.isfinite(found).all():
            lane = int(np.flatnonzero(~np.isfinite(found).all(axis=1))[0])
            raise ScenarioError(f"actions[{lane}] = {shown(found[lane].tolist())}: must be finite")
        np.clip(found.T, -1.0, 1.0, out=held)  # a larger one than 32 bits hold counts as the bound, too

    def step(self) -> bool:
        """Fly one control period in every lane; returns whether an episode is over in any of them."""
        self._stepper.step()
        np.greater(self.ending, 0.5, out=self.ended)
        np.greater(self._truncated, 0.5, out=self.truncated)
        return bool(self.ended.any() or self.truncated.any())

    def hold(self, lanes: Array) -> tuple[Array, ...]:
        """What :meth:`put_back` makes good of a step that these lanes are not to make."""
        kept = (self._carry, self.observation, self._truncated[None], self.ending[None])
        return tuple(rows[:, lanes].copy() for rows in kept)

    def put_back(self, lanes: Array, held: tuple[Array, ...]) -> None:
        """Put lanes back as they were; the reward of the step that they did not make is 0."""
        for rows, old in zip(
            (self._carry, self.observation, self._truncated[None], self.ending[None]), held, strict=True
        ):
            rows[:, lanes] = old
        self.reward[lanes] = 0.0
        self.ended[lanes], self.truncated[lanes] = self.ending[lanes] > 0.5, self._truncated[lanes] > 0.5

    def numbers(self) -> dict[str, Array]:
        """Path -> (lanes,) randomised numbers that the lanes fly with."""
        return {path: row.copy() for path, row in zip(self.program.paths, self._numbers, strict=True)}

    def flown(self, lane: int) -> Scenario:
        """The scenario with the numbers that were drawn for a lane's episode."""
        return with_numbers(self.task.scenario, {path: float(row[lane]) for path, row in self.numbers().items()})

    def close(self) -> None:
        """End the threads."""
        self._stepper.close()
