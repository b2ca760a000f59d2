"""A session for a hand: every number that it may move is a parameter of the machine code from the start.

:class:`skyarm.Session` compiles when a number changes that has not changed before, and keeps what was flown under each
value; that is right for a flight that is planned, and stalls one that is watched. Here a change writes a number.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.dynamics import State
from skyarm.log.flight_log import Log
from skyarm.scenario.numbers import DERIVED, known_as, number_at, require_apart, with_numbers
from skyarm.scenario.scenario_checks import require_flight
from skyarm.scenario.scenario_record import Change, Scenario, ScenarioError, in_order
from skyarm.simulate.assemble_log import joined
from skyarm.simulate.check_endings import Ended, going_on
from skyarm.simulate.engine import Engine, EpisodeCode
from skyarm.simulate.lane_numbers import require_latencies, require_paths, require_values, require_within_queue
from skyarm.simulate.loop_state import LoopState


@dataclass(frozen=True, slots=True)
class LiveSnapshot:
    """A live session at an instant.

    Attributes:
        scenario, numbers: as they were then. moves: made so far. tick: control periods flown.
        engine, held: what flew it, what it keeps.
    """

    scenario: Scenario
    numbers: Mapping[str, float]
    moves: tuple[Change, ...]
    tick: int
    engine: Engine
    held: Any


class LiveSession:
    """A session that flies a traceable law on the rigid-body plant while numbers of its scenario are moved.

    The numbers are those of :func:`skyarm.run` with the same changes, to the last bit; changes of the scenario
    (:attr:`skyarm.Scenario.changes`) take hold in their control periods.

    Args:
        scenario: what is flown; its duration is the longest the session can get.
        paths: numbers that may be moved; a change of these compiles nothing, unless it asks for shorter integration
            steps.

    Raises:
        ScenarioError: not a scenario, or a path that leads to no number of it.
        NoMachineCodeError: machine code cannot be made here, or not for a change of the scenario: of a whole part, of a
            latency, of several numbers of which another path is one.
    """

    def __init__(self, scenario: Scenario, paths: Sequence[str]) -> None:
        require_flight(scenario)
        known = require_paths(paths)
        require_apart(scenario, known)
        require_latencies(scenario, known)
        self._scheduled: dict[int, dict[str, float]] = {}
        for change in in_order(scenario.changes, scenario.rates.control):
            if not isinstance(change.value, float):
                raise NoMachineCodeError(f"changes: {change.path} is no number; a Session changes whole parts")
            path = known_as(scenario, change.path, known)
            if path not in known:
                known = (*known, path)
                try:
                    require_apart(scenario, known)
                    require_latencies(scenario, [path])
                except ScenarioError as error:  # a Session flies it
                    raise NoMachineCodeError(f"changes: {error}") from None
            self._scheduled.setdefault(change.tick(scenario.rates.control), {})[path] = change.value
        self._paths = known
        data = {path: number_at(scenario, path) for path in self._paths if not path.startswith(DERIVED)}
        self._origin = self.scenario = with_numbers(scenario, data)
        self._numbers: dict[str, float] = {}
        self._moves: tuple[Change, ...] = ()
        self._engine = self._make_engine(self._origin, {})
        self._follow_schedule()

    @property
    def tick(self) -> int:
        """Control periods flown."""
        return self._engine.tick

    @property
    def time(self) -> float:
        """Time of the period that comes next, s."""
        return self.tick / self.scenario.rates.control

    @property
    def ended(self) -> Ended | None:
        """Why the episode has ended before its time, or None."""
        return self._engine.ended

    @property
    def running(self) -> bool:
        """Whether another period can be flown."""
        return self.ended is None and self.tick < self.scenario.steps

    @property
    def state(self) -> State:
        """The plant's state now."""
        return self._engine.state()

    @property
    def now(self) -> LoopState:
        """What the next period begins with: state, commands and readings on their way, every memory."""
        return self._engine.now

    @property
    def plan(self) -> Scenario:
        """The scenario that :func:`skyarm.run` flies to the bits of what was flown: as it began, with all changes."""
        rate = self._origin.rates.control
        flown = (move for move in self._moves if move.tick(rate) < self.tick)
        return dataclasses.replace(self._origin, changes=(*self._origin.changes, *flown))

    @property
    def log(self) -> Log:
        """What was flown so far: of :attr:`plan`; references are those of the scenario as it is now."""
        return joined(self.plan, [self._engine.piece], self.ended or going_on(self.scenario, self.tick))

    def step(self) -> bool:
        """Fly one control period; whether the episode goes on."""
        going = self._engine.step()
        if going:
            self._follow_schedule()
        return going

    def _follow_schedule(self) -> None:
        """Make the changes of the scenario that the next period begins with."""
        if self.tick in self._scheduled:
            self._set(self._scheduled[self.tick])

    def change(self, values: Mapping[str, float]) -> None:
        """Give numbers by path other values, from the next period on; they replace, and do not add up.

        Raises:
            ScenarioError, ValueError: a path that is not one of the session's, or a number that cannot be; nothing is
                changed then.
        """
        for path in require_values(values):
            if path not in self._paths:
                raise ScenarioError(f"path = {path!r}: must be one of those that the session was made for")
        self._set(values)
        kept = (move for move in self._moves if move.at != self.time or move.path not in values)
        self._moves = (*kept, *(Change(at=self.time, path=path, value=float(value)) for path, value in values.items()))

    def _set(self, values: Mapping[str, float]) -> None:
        """Fly on with other numbers."""
        numbers = {**self._numbers, **{path: float(value) for path, value in values.items()}}
        scenario = with_numbers(self._origin, numbers)
        require_within_queue(self._origin, {path: np.array([value]) for path, value in numbers.items()})
        if not self._engine.give(scenario, self._all(numbers), tuple(values), None):
            engine = self._make_engine(scenario, numbers)
            engine.continue_log(self._engine)
            self._engine = engine
        self._engine.begun = 0  # one piece, of the references as they are now
        self.scenario, self._numbers = scenario, numbers

    def _all(self, numbers: Mapping[str, float]) -> dict[str, float]:
        """The numbers of every path: those that were changed, and the scenario's own."""
        return {path: number_at(self._origin, path) for path in self._paths} | dict(numbers)

    def _make_engine(self, scenario: Scenario, numbers: Mapping[str, float]) -> Engine:
        def vary(values: Sequence[Any]) -> Scenario:
            return with_numbers(self._origin, dict(zip(self._paths, values, strict=True)))

        own = any(path.startswith("reference.") for path in self._paths)
        # a hand waits for it: code that is made in a hurry gives the same bits
        options: Any = {"commands": False, "own_reference": own, "effort": 0}
        return Engine(EpisodeCode(scenario, vary, self._all(numbers), **options))

    def snapshot(self) -> LiveSnapshot:
        """The session now."""
        held = self._engine.snapshot()
        return LiveSnapshot(self.scenario, self._numbers, self._moves, self.tick, self._engine, held)

    def restore(self, snapshot: LiveSnapshot) -> None:
        """Go back, or forward again, to a snapshot of this session."""
        self._engine = snapshot.engine
        self._engine.restore(snapshot.held)
        self.scenario, self._numbers = snapshot.scenario, dict(snapshot.numbers)
        self._moves = snapshot.moves
