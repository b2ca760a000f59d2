"""Thousands of episodes stepped together, one control period a call, with actions per lane."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from skyarm.compile import leaves, rebuild, trace
from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.lane_stepper import LaneStepper
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.array_evaluation import evaluate
from skyarm.compile.tracing.stepped_loop import trace_loop
from skyarm.dynamics import State
from skyarm.files import shown
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.largest_step import lanes_step
from skyarm.scalars import floor
from skyarm.scenario.numbers import number_at, require_apart, with_numbers
from skyarm.scenario.scenario_checks import require_flight
from skyarm.scenario.scenario_record import Scenario, ScenarioError, noise_key
from skyarm.simulate.draws import draw_plan, draws_needed, start_draws
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.simulate.lane_numbers import (
    LaneRules,
    lane_actions,
    lane_mask,
    lane_numbers,
    require_count,
    require_latencies,
    require_paths,
    require_rigid_body,
    require_short_steps,
    require_values,
    require_within_queue,
)
from skyarm.simulate.loop_state import LoopState, Row, structure_of
from skyarm.simulate.period import make_period
from skyarm.simulate.plant_steps import RigidBodySteps
from skyarm.simulate.stages import Stages
from skyarm.simulate.user_code import require_shapes


class LanePrograms:
    """Programs of a scenario whose numbers at some paths differ from lane to lane.

    Args:
        scenario: on the rigid-body plant. paths: of those numbers.
        stiffest: the scenario whose joint friction, air, forces and drives fix the integration steps.
        law: fly the scenario's law in place of actions.

    Attributes:
        base: the scenario's own numbers at the paths. first: its first loop state, as an example.
        largest_step: the longest integration step that ``stiffest`` bears, s.
        start: (numbers, draws of each component) -> the first loop state.
        check: (numbers, ticks, state, clock) -> 1 where no ending has come, else 0.
    """

    def __init__(self, scenario: Scenario, paths: Sequence[str], stiffest: Scenario, *, law: bool) -> None:
        self._scenario, self._paths, self._law = scenario, paths, law
        self._ratio = scenario.rates.control // scenario.rates.reference
        self.base = tuple(number_at(scenario, path) for path in paths)
        self.first: LoopState = first_loop_state(scenario)
        around = first_surroundings(stiffest, self.first if stiffest is scenario else first_loop_state(stiffest))
        self._plant = RigidBodyPlant(stiffest.plant, around, scenario.integrator, 1.0 / scenario.rates.physics)
        self.largest_step = lanes_step(around, euler=scenario.integrator == "euler")
        counts = [2 * count for _, count in draw_plan(scenario).components]
        self.start = trace(self._starting, self.base, *((0.5,) * count for count in counts))
        found = structure_of(self.first.state), structure_of(self.first.clock)
        self.check = trace(self._sound, self.base, 0.0, *found)

    def period(self) -> Any:
        """One control period as a loop, whose parameters are the numbers at the paths and the actions."""

        def step(now: LoopState, values: Any, _fed: Any, drawn: Any) -> tuple[LoopState, tuple[()]]:
            numbers, command = values
            varied = self._varied(numbers)
            stages = Stages(varied, None if self._law else command)
            row = self._row(stages.scenario, now.ticks)
            following, _ = make_period(stages, RigidBodySteps(stages, self._plant.substeps))(now, row, drawn)
            return following, ()

        values = (self.base, structure_of(self.first.queue[0]))
        return trace_loop(step, structure_of(self.first), values, (), draws_needed(self._scenario), loops=True)

    def _varied(self, numbers: Sequence[Any]) -> Scenario:
        return with_numbers(self._scenario, dict(zip(self._paths, numbers, strict=True)))

    def _row(self, scenario: Scenario, ticks: Any) -> Row:
        """A lane's own time and held reference; the loop has that of a task whose phases wait."""
        rate = float(self._scenario.rates.control)
        if scenario.reference.guards:
            return Row(time=ticks / rate, reference=())
        held = floor((ticks + 0.5) / float(self._ratio)) * float(self._ratio)
        return Row(time=ticks / rate, reference=scenario.reference.at(held / rate).dense())

    def _starting(self, numbers: tuple[Any, ...], *draws: tuple[Any, ...]) -> LoopState:
        return first_loop_state(self._varied(numbers), draws)

    def _sound(self, numbers: tuple[Any, ...], ticks: Any, state: State, clock: Any) -> Any:
        """1 where no ending has come, else 0."""
        stages = Stages(self._varied(numbers))
        now = dataclasses.replace(self.first, ticks=ticks, state=state, clock=clock)
        return stages.alive(now, stages.led(now, self._row(stages.scenario, ticks)).reference)


Array = npt.NDArray[Any]


def _beyond() -> np.errstate:
    """What 32 bits do not hold is infinite there, without a warning."""
    return np.errstate(over="ignore")


class BatchSession:
    """A batch session steps many episodes of a scenario by actions: rotor speeds and joint setpoints of every lane.

    A lane that ends, or has flown the scenario's duration, keeps its last state until the next step, which begins its
    next episode from the first state. With ``autoreset`` off it stays until :meth:`reset` begins its next episode:
    state, number of the episode, ``ended`` and ``truncated`` are those of its last period, whatever steps come. Time
    counts anew in each episode, and so does noise: it depends on ``seed`` and the number of the episode alone, not on
    when the lane began it.

    Args:
        scenario: on the rigid-body plant; its law is not asked.
        lanes: how many.
        paths: numbers that differ from lane to lane (:mod:`skyarm.scenario.numbers`); :meth:`set` gives them.
        single: 32-bit floats. bit_exact: every episode equals a :class:`skyarm.Session` of the scenario with this seed
            and the episode's number bit for bit; else a multiplication and an addition may be rounded once.
        threads: most that work, kept until :meth:`close`; the numbers do not depend on it. seed: key of the noise.
        autoreset: begin again by itself. law: step the scenario's law in place of actions.
        stiffest: a scenario with the stiffest joint friction of the batch, and the shortest largest step that its air,
            forces and drives state; both fix the integration steps.

    Attributes:
        state: the plant's state, a record of (lanes,) views that each step writes anew.
        ended: (lanes,) True where the last step flown ended the episode before its time.
        truncated: (lanes,) True where the last step flown was the last of the scenario's duration and no ending has
            come.
        episodes: (lanes,) number of the episode that each lane flies.
    """

    def __init__(
        self,
        scenario: Scenario,
        lanes: int,
        paths: Sequence[str] = (),
        *,
        single: bool = False,
        bit_exact: bool = False,
        threads: int = 1,
        seed: int = 0,
        autoreset: bool = True,
        law: bool = False,
        stiffest: Scenario | None = None,
    ) -> None:
        require_flight(scenario)
        require_rigid_body(scenario)
        if scenario.changes:
            raise ScenarioError("changes: must be left out for lanes that are stepped; set() gives them other numbers")
        lanes, threads = require_count("lanes", lanes), require_count("threads", threads)
        paths, seed = require_paths(paths), noise_key("seed", seed)
        require_shapes(scenario)
        require_apart(scenario, paths)
        require_latencies(scenario, paths)
        self.scenario, self.paths, self._autoreset, self._seed = scenario, paths, autoreset, seed
        self._rules = LaneRules(scenario, paths)
        self._programs = programs = LanePrograms(scenario, paths, stiffest or scenario, law=law)
        self._first, self._base = programs.first, programs.base
        kernel = Kernel(programs.period(), Lanes(host_width(single=single), single=single, contract=not bit_exact))
        self._stepper = LaneStepper(kernel, lanes, seed=seed, threads=threads)
        self._parameters = self._stepper.parameters
        self._actions = self._parameters[len(self._base) :]
        with _beyond():
            self._parameters[: len(self._base)] = np.array(self._base)[:, None]
        self._carry = self._stepper.carry
        now: LoopState = rebuild(self._first, iter(list(self._carry)))
        self.state: State = now.state
        self._alive, self._ticks = self._carry[0], self._carry[1]
        self.episodes: Array = np.zeros(lanes, dtype=np.int64)
        self._next, self._over = 0, False
        self.ended, self.truncated = np.zeros(lanes, dtype=bool), np.zeros(lanes, dtype=bool)
        self.reset()

    @property
    def lanes(self) -> int:
        """How many episodes fly side by side."""
        return int(self._carry.shape[1])

    @property
    def now(self) -> LoopState:
        """What the next period begins with: every number of it a (lanes,) view that the next step writes anew."""
        now: LoopState = rebuild(self._first, iter(list(self._carry)))
        return now

    def set(self, values: Mapping[str, Any], mask: Array | None = None) -> None:
        """Give lanes other numbers by path; they hold from the next step on, a start from the next episode on.

        Args:
            values: path -> one number for all lanes, or (lanes,).
            mask: (lanes,) True where they hold; everywhere if left out.

        Raises:
            ScenarioError: a path that is not one of the session's, or numbers that cannot be; none is taken then.
        """
        among, columns = lane_mask(mask, self.lanes), {}
        for path, value in require_values(values).items():
            if path not in self.paths:
                raise ScenarioError(f"path = {shown(path)}: must be one of {', '.join(self.paths) or 'none'}")
            columns[path] = lane_numbers(f"values[{path!r}]", value, self.lanes)
        # with all numbers that a lane has: some are bounded by others
        now = {path: self._parameters[i][among].astype(float) for i, path in enumerate(self.paths)}
        numbers = now | {path: column[among] for path, column in columns.items()}
        require_within_queue(self.scenario, numbers)
        self._rules.require(numbers)
        require_short_steps(self.scenario, numbers, self._programs.largest_step)
        for path, column in columns.items():
            with _beyond():
                self._parameters[self.paths.index(path)][among] = column[among]
        self._stepper.fill()

    def reset(self, mask: Array | None = None, *, seed: int | None = None) -> State:
        """Begin new episodes in all lanes, or where the mask is true; returns the state.

        Args:
            mask: (lanes,) True where; everywhere if left out.
            seed: key of the noise from now on, with episodes numbered from 0 again; not together with a mask.

        Raises:
            ScenarioError: a mask or a seed that cannot be.
        """
        lanes = np.flatnonzero(lane_mask(mask, self.lanes))
        if seed is not None:
            if mask is not None:
                raise ScenarioError(f"seed = {shown(seed)}: must be left out with a mask, since all lanes have one")
            self._seed, self._next = noise_key("seed", seed), 0
            self._stepper.seed(self._seed)
        self.episodes[lanes] = np.arange(self._next, self._next + len(lanes))
        self._next += len(lanes)
        self._stepper.begin(lanes, self.episodes[lanes])
        columns = [*self._parameters[: len(self._base), lanes]]
        for draws in start_draws(self.scenario, self._seed, self.episodes[lanes]):
            columns += [*draws.T]
        with _beyond():
            self._carry[:, lanes] = evaluate(self._programs.start, columns, len(lanes))
        self.ended[lanes] = self.truncated[lanes] = False
        self._over = bool((self.ended | self.truncated).any())
        self._stepper.fill()
        return self.state

    def step(self, actions: Array | None = None) -> State:
        """Fly one control period in every lane.

        Args:
            actions: (rotors + joints, lanes): rotor speeds (rad/s), then joint setpoints, then a row of angles for
                each rotor that tilts; (rotors + joints, 1) are those of every lane. Those of the last step if left out.

        Returns:
            ``state``: views that the next step writes anew.

        Raises:
            ScenarioError: actions of another shape, or no numbers; nothing is flown then.
        """
        if actions is not None:
            self._take(actions)
        if not self._over:
            self._fly()
        elif self._autoreset:
            self.reset(self.ended | self.truncated)
            self._fly()
        else:
            self._fly_those_that_go_on()
        return self.state

    def _fly(self) -> None:
        """One control period in every lane, and how the episodes stand after it."""
        self._stepper.step()
        np.less(self._alive, 0.5, out=self.ended)
        np.greater_equal(self._ticks, self.scenario.steps, out=self.truncated)
        self._over = bool((self.ended | self.truncated).any())
        if self._over:
            self._tell_apart()

    def _fly_those_that_go_on(self) -> None:
        """One control period; lanes whose episode is over are put back as they were."""
        over = np.flatnonzero(self.ended | self.truncated)
        held = self._carry[:, over].copy(), self.ended[over], self.truncated[over]
        if over.size < self.lanes:
            self._fly()
        self._carry[:, over], self.ended[over], self.truncated[over] = held

    def _take(self, actions: Array) -> None:
        """Actions of the next step."""
        held = self._actions
        if isinstance(actions, np.ndarray) and actions.dtype == held.dtype and actions.shape == held.shape:
            held[:] = actions
            return
        given = lane_actions(actions, held.shape)
        with _beyond():
            held[:] = given

    def _tell_apart(self) -> None:
        """An ending that comes in the very last period counts as one, as in a single run."""
        last = np.flatnonzero(self.truncated & ~self.ended)
        if last.size:
            # against the held reference of the last period, as a single run does
            ticks = np.full(last.size, self.scenario.steps - 1.0)
            left = leaves((self.state, self.now.clock))
            columns = [*self._parameters[: len(self._base), last], ticks, *(leaf[last] for leaf in left)]
            with np.errstate(all="ignore"):
                sound = evaluate(self._programs.check, [column.astype(float) for column in columns], last.size)[0]
            self.ended[last] = sound < 0.5
        self.truncated &= ~self.ended

    def close(self) -> None:
        """End the threads, which otherwise wait for the next step as long as the session lives."""
        self._stepper.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
