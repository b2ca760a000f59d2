"""Thousands of episodes stepped together, one control period a call, with actions per lane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.lane_stepper import LaneStepper
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.dynamics import State
from skyarm.records.files import shown
from skyarm.records.leaves import rebuild
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_checks import require_flight
from skyarm.scenario.scenario_record import Scenario, ScenarioError, noise_key
from skyarm.simulate.lane_loop import LaneLoop, lane_statuses, own_row
from skyarm.simulate.lane_numbers import (
    LaneRules,
    checked_array,
    lane_mask,
    require_count,
    require_paths,
    require_rigid_body,
    require_short_steps,
    require_values,
    require_within_queue,
)
from skyarm.simulate.loop_state import LoopState, structure_of
from skyarm.simulate.period import make_period
from skyarm.simulate.plant_steps import RigidBodySteps
from skyarm.simulate.stages import Stages
from skyarm.simulate.user_code import require_shapes

Array = npt.NDArray[Any]


def lane_numbers(field: str, values: Any, lanes: int) -> Array:
    """(lanes,) numbers of one path, of one number for all or of one a lane."""
    allowed = f"one number, or one for each of {lanes} lanes"
    found = checked_array(field, values, [(), (lanes,)], allowed).astype(float)
    if np.isnan(found).any():
        raise ScenarioError(f"{field}: nan is not a number")
    return np.broadcast_to(found, (lanes,))


def _beyond() -> np.errstate:
    """Round to 32 bits: values out of range become infinite, without a warning."""
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
        paths, seed = require_paths(scenario, paths), noise_key("seed", seed)
        require_shapes(scenario)
        self.scenario, self.paths, self._autoreset, self._seed = scenario, paths, autoreset, seed
        self._rules = LaneRules(scenario, paths)
        self._base = tuple(number_at(scenario, path) for path in paths)
        self._loop = loop = LaneLoop(scenario, self._lane_scenario, self._base, stiffest or scenario)
        self._first, self._law = loop.first, law
        program = loop.program(self._period, loop.first, (self._base, structure_of(loop.first.agent.queue[0])))
        kernel = Kernel(program, Lanes(host_width(single=single), single=single, contract=not bit_exact))
        self._stepper = LaneStepper(kernel, lanes, seed=seed, threads=threads)
        self._parameters = self._stepper.parameters
        self._actions = self._parameters[len(self._base) :]
        with _beyond():
            self._parameters[: len(self._base)] = np.array(self._base)[:, None]
        self._carry = self._stepper.carry
        now: LoopState = rebuild(self._first, iter(list(self._carry)))
        self.state: State = now.agent.state
        self._alive, self._ticks = self._carry[0], self._carry[1]
        self.episodes: Array = np.zeros(lanes, dtype=np.int64)
        self._next, self._over = 0, False
        self.ended, self.truncated = np.zeros(lanes, dtype=bool), np.zeros(lanes, dtype=bool)
        self.reset()

    def _lane_scenario(self, numbers: Sequence[Any]) -> Scenario:
        return with_numbers(self.scenario, dict(zip(self.paths, numbers, strict=True)))

    def _period(self, now: LoopState, values: Any, _fed: Any, drawn: Any) -> tuple[LoopState, tuple[()]]:
        numbers, command = values
        stages = Stages(self._lane_scenario(numbers), None if self._law else command)
        row = own_row(stages.scenario, now.ticks)
        following, _ = make_period(stages, RigidBodySteps(stages, self._loop.substeps))(now, row, drawn)
        return following, ()

    @property
    def lanes(self) -> int:
        """Number of episodes flown in parallel."""
        return int(self._carry.shape[1])

    @property
    def now(self) -> LoopState:
        """Loop state at the start of the next period; each number is a (lanes,) view that the next step overwrites."""
        now: LoopState = rebuild(self._first, iter(list(self._carry)))
        return now

    def set(self, values: Mapping[str, Any], mask: Array | None = None) -> None:
        """Set numbers of lanes by path; they hold from the next step on, initial values from the next episode on.

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
        require_short_steps(self.scenario, numbers, self._loop.largest)
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
        with _beyond():
            numbers = self._parameters[: len(self._base), lanes]
            self._carry[:, lanes] = self._loop.start(numbers, self._seed, self.episodes[lanes])
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
        """Fly one control period in every lane, and update the termination flags."""
        self._stepper.step()
        np.less(self._alive, 0.5, out=self.ended)
        np.greater_equal(self._ticks, self.scenario.steps, out=self.truncated)
        self._over = bool((self.ended | self.truncated).any())
        if self._over:
            self._tell_apart()

    def _fly_those_that_go_on(self) -> None:
        """Fly one control period; lanes whose episode is over are restored."""
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
        rows, lanes = held.shape
        allowed = f"numbers of shape {(rows, lanes)} or {(rows, 1)}: rotor speeds, then joint setpoints"
        given = checked_array("actions", actions, [(rows, lanes), (rows, 1)], allowed)
        with _beyond():
            held[:] = given

    def _tell_apart(self) -> None:
        """An ending that comes in the very last period counts as one, as in a single run."""
        last = np.flatnonzero(self.truncated & ~self.ended)
        if last.size:
            left: LoopState = rebuild(self._first, iter([leaf[last].astype(float) for leaf in self._carry]))
            values = {path: self._parameters[i, last].astype(float) for i, path in enumerate(self.paths)}
            status = lane_statuses(
                self.scenario, values, left.agent.state, left.agent.clock, left.ticks, np.zeros(last.size, dtype=bool)
            )
            self.ended[last] = status != "completed"
        self.truncated &= ~self.ended

    def close(self) -> None:
        """End the threads, which otherwise wait for the next step as long as the session lives."""
        self._stepper.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
