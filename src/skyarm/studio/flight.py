"""One vehicle under one law: a session, what a hand changed in it, and the way back to any instant before."""

from __future__ import annotations

import bisect
import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.drawing.pose_program import Placed, PoseProgram
from skyarm.dynamics import State
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.live_session import LiveSession
from skyarm.simulate.session import Session
from skyarm.studio.sights import Load, Sight, goal_of, held_loads, sight

SAMPLES = 20.0
"""Hz of what the plots keep."""

SNAPSHOTS = 240
"""Snapshots that are kept; beyond that every second one goes."""


@dataclass(frozen=True, slots=True)
class Moved:
    """A number that a hand changed.

    Attributes:
        tick: control periods flown before it holds. path, value: of the number.
    """

    tick: int
    path: str
    value: float


class Flight:
    """A flight goes forward period by period, and back; what a hand changed in it comes again at its own period.

    A change at an instant takes the place of all that were made later: the flight goes another way from there.

    Args:
        law: name that it is chosen by; None is the scenario's own.
        scenario: prepared, under the law.
        paths: numbers that are changed without compiling anew.
    """

    def __init__(self, law: str | None, scenario: Scenario, paths: Sequence[str]) -> None:
        self.law, self.first = law, scenario
        self.session = _session(scenario, paths)
        self.program = PoseProgram(scenario.world.vehicle)
        self.moved: list[Moved] = []
        self.sights: list[Sight] = []
        self._every = max(1, round(scenario.rates.control / SAMPLES))
        self._apart = round(scenario.rates.control)
        self._kept: list[Any] = []
        self._note()
        self._start = self._kept[0]

    @property
    def title(self) -> str:
        """Name of the law."""
        return self.law or self.first.controller.name

    @property
    def tick(self) -> int:
        """Control periods flown."""
        return self.session.tick

    @property
    def lost(self) -> str:
        """Why the vehicle is lost, in words; empty while it flies."""
        ended = self.session.ended
        return "" if ended is None else ended.cause

    @property
    def values(self) -> Mapping[str, float]:
        """Every number that has been changed so far, as it is now."""
        return {moved.path: moved.value for moved in self.moved if moved.tick <= self.tick}

    @property
    def loads(self) -> tuple[Load, ...]:
        """Payloads that are held, and the mass that a hand has hung at the tip."""
        scenario, mass = self.session.scenario, self.values.get("plant.payload.mass", 0.0)
        held = held_loads(scenario.components, self.session.now.components) if scenario.payloads else ()
        return (*held, Load(mass)) if mass > 0.0 else held

    def placed(self, state: State) -> Placed:
        """Where the bodies are in a state."""
        return self.program(tuple(state.position), tuple(state.quaternion), state.joints)

    def goal(self) -> Placed:
        """Where they should be now."""
        return goal_of(self.program, self.session.scenario.trajectory.at(self.session.time))

    def move(self, values: Mapping[str, float]) -> None:
        """Change numbers from the next period on.

        Raises:
            ScenarioError: a number that cannot be; nothing is changed then.
        """
        now = self.tick
        self.session.change(values)
        kept = [each for each in self.moved if each.tick < now or (each.tick == now and each.path not in values)]
        self.moved = [*kept, *(Moved(now, path, float(value)) for path, value in values.items())]
        # what was flown beyond this instant was flown with other numbers
        self._kept = [snapshot for snapshot in self._kept if snapshot.tick <= now]
        self.sights = [seen for seen in self.sights if seen.tick <= now]

    def step(self) -> bool:
        """Fly one control period; False once the flight has ended."""
        if not self.session.running:
            return False
        going = self.session.step()
        if going:
            self._again()
            self._note()
        return going

    def begin(self) -> None:
        """Begin again, with the numbers of the scenario."""
        self.moved = []
        self.session.restore(self._start)
        self._kept, self.sights = [self._start], self.sights[:1]

    def to(self, tick: int) -> None:
        """Go to an instant: back by a snapshot, then forward by what was changed."""
        if tick < self.tick:
            at = bisect.bisect_right([snapshot.tick for snapshot in self._kept], tick) - 1
            self.session.restore(self._kept[max(at, 0)])
            self._again()
        while self.tick < tick and self.step():
            pass

    def _again(self) -> None:
        """Change what a hand changed at this instant before."""
        now = self.tick
        at = bisect.bisect_left(self.moved, now, key=lambda each: each.tick)
        values = {}
        while at < len(self.moved) and self.moved[at].tick == now:
            values[self.moved[at].path] = self.moved[at].value
            at += 1
        if values:
            self.session.change(values)

    def _note(self) -> None:
        """Keep a snapshot and what the plots show, each at its own rate."""
        tick = self.tick
        if tick % self._apart == 0 and (not self._kept or self._kept[-1].tick < tick):
            self._kept.append(self.session.snapshot())
            if len(self._kept) > SNAPSHOTS:
                self._kept, self._apart = self._kept[::2], 2 * self._apart
        if tick % self._every == 0 and (not self.sights or self.sights[-1].tick < tick):
            self.sights.append(sight(self.session, self.program))

    @property
    def last(self) -> Sight:
        """The latest of what the plots show."""
        return self.sights[bisect.bisect_right(self.sights, self.tick, key=lambda each: each.tick) - 1]

    def seen(self, seconds: float) -> list[Sight]:
        """What the plots show of the last seconds."""
        now, rate = self.tick, self.first.rates.control
        first = bisect.bisect_left(self.sights, now - seconds * rate, key=lambda each: each.tick)
        return self.sights[first : bisect.bisect_right(self.sights, now, key=lambda each: each.tick)]


def _session(scenario: Scenario, paths: Sequence[str]) -> LiveSession | Session:
    """Machine code in which every number may move, or the stages one by one."""
    if scenario.plant == "rigid_body" and scenario.controller.compiled:
        with contextlib.suppress(NoMachineCodeError):
            return LiveSession(scenario, paths)
    return Session(scenario, machine_code=False)


def as_changes(moved: Sequence[Moved], rate: float) -> list[dict[str, Any]]:
    """Tables of ``[[changes]]``: at (s), path, value, in the order in which they hold."""
    return [{"at": each.tick / rate, "path": each.path, "value": each.value} for each in moved]
