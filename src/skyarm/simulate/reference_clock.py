"""Clock of a reference whose phases wait for guards: a state of the loop.

It counts control periods of the reference, goes on with the flight's own, stands still at the
planned end of a phase with a guard until the flight shows what the guard requires, and skips what is left of a phase
that may end early. Guards know what the law knows: the measurement, and the force that the law observes.

Where no phase waits the clock is ``()``: structure, without an operation.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import (
    Scalar,
    floor,
    logical_and,
    logical_not,
    logical_or,
    minimum,
    sqrt,
    where,
)
from skyarm.control.law_estimates import observed_push
from skyarm.dynamics.kinematics import frame_pose
from skyarm.records.leaves import blend, leaves, mismatch
from skyarm.reference.path_time import offset_reference
from skyarm.reference.task_records import Guard
from skyarm.reference.tip_motion import counted_error
from skyarm.reference.trajectory import PASSED, Reference
from skyarm.scenario.in_flight import Overrides
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.measurement import Measurement
from skyarm.simulate.loop_state import LoopState, Row
from skyarm.simulate.tip_and_goal import goal_of, tip_at


@dataclass(frozen=True, kw_only=True, slots=True)
class PathClock:
    """The reference's clock between two control periods; all times are control periods.

    Attributes:
        place: of the reference, now. held: of the sample that is held; () where each period publishes one.
        guard: number of the guard that comes next. waited: at its end. reached: for which it has held.
        origin: m, world axes, the tip where the phase began. failed: 1 once a phase has failed that must not.
        offset: m, of the reference since a phase ended early while it moved. since: place from which on.
        held_offset, held_since: those of the sample that is held.
    """

    place: Scalar
    held: Scalar | tuple[()]
    guard: Scalar
    waited: Scalar
    reached: Scalar
    origin: Vec3 | tuple[()]
    failed: Scalar
    offset: Vec3 | tuple[()]
    since: Scalar | tuple[()]
    held_offset: Vec3 | tuple[()]
    held_since: Scalar | tuple[()]


@dataclass(frozen=True, kw_only=True, slots=True)
class Seen:
    """Inputs of the guards in a control period.

    Attributes:
        tip: as measured, m, world axes. goal: its desired position by the held reference. push: of that reference.
        force: on the tip as the law observes it, N, world axes; None of a law that observes none.
        felt: the same as a force sensor reads it, where a guard asks for that. switches: 1 closed, in the order of
            those that ``Waits`` looks at.
    """

    tip: Vec3
    goal: Vec3
    push: tuple[Any, ...]
    force: Vec3 | None
    felt: Vec3 | None = None
    switches: tuple[Any, ...] = ()


WHOLE = 1e-9
"""Control periods that are rounding."""

NEVER = 1e30
"""Control periods that no flight has."""

BEGUN = -1.0
"""``waited`` of a clock that has just taken over."""


class Waits:
    """The guards of a scenario and its reference's clock, over any scalar.

    Args:
        scenario: whose numbers may be traced.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._trajectory = scenario.reference
        self.guards: tuple[Guard, ...] = scenario.reference.guards
        self.loads = frozenset(name for guard in self.guards for name in guard.loads)
        self._believed = tuple(each for each in scenario.payloads if each.believed)
        self._rate = float(scenario.rates.control)
        self._ratio = scenario.rates.control // scenario.rates.reference
        self._vehicle = scenario.controller.par.model.vehicle
        self._ends = tuple(guard.at * self._rate for guard in self.guards)
        self._moves = any(guard.early for guard in self.guards)
        self.switches = tuple(
            dict.fromkeys(name for guard in self.guards for name in (guard.closed, guard.open) if name)
        )
        self._sensed = any(guard.sensed for guard in self.guards)
        self._measures = any(guard.distance is not None for guard in self.guards)
        self._stops = self._stops_of_early_phases() if self._moves else ()

    def _stops_of_early_phases(self) -> tuple[Vec3, ...]:
        """Position of the base's reference at the end of each phase with a guard, m."""
        return tuple(self._trajectory.at(guard.at).position for guard in self.guards)

    def first(self) -> PathClock | tuple[()]:
        """The clock before the first period."""
        if not self.guards:
            return ()
        zero, apart = Vec3(0.0, 0.0, 0.0), self._moves and self._ratio > 1
        return PathClock(
            place=0.0,
            held=() if self._ratio == 1 else 0.0,
            guard=0.0,
            waited=0.0,
            reached=0.0,
            origin=zero if self._measures else (),
            failed=0.0,
            offset=zero if self._moves else (),
            since=0.0 if self._moves else (),
            held_offset=zero if apart else (),
            held_since=0.0 if apart else (),
        )

    def begun_at(self, ticks: Any) -> PathClock | tuple[()]:
        """The clock of a task that starts during the flight: at its first guard to come.

        The distance of a phase that is under way then counts from there on.
        """
        first = self.first()
        if not isinstance(first, PathClock):
            return ()
        guard: Scalar = 0.0
        for end in self._ends:
            guard = guard + where(ticks > end + WHOLE, 1.0, 0.0)
        held = () if self._ratio == 1 else ticks
        return dataclasses.replace(first, place=ticks, held=held, guard=guard, waited=BEGUN)

    def lead(self, clock: Any, ticks: Scalar, row: Row) -> Row:
        """Inputs of a period, with the reference at its own clock."""
        if clock == () or row.reference != ():
            return row
        path_time, reference = self.path_time(clock), self.held_reference(clock, ticks)
        if self._trajectory.load is not None:  # the hand's command is of this period, not of a sample
            reference = dataclasses.replace(reference, load=(self._trajectory.load.derivatives(path_time)[0],))
        return dataclasses.replace(row, reference=reference, path_time=path_time)

    def is_sound(self, clock: Any) -> Scalar:
        """True while no phase has failed that must not."""
        return clock.failed < 0.5 if self.guards else True

    def log_values(self, clock: Any, ticks: Scalar) -> tuple[Scalar, ...]:
        """Columns of the clock in a log; () without a clock."""
        return () if clock == () else self.times(clock, ticks)

    def advance(self, clock: Any, ticks: Scalar, measurement: Measurement, row: Row, memory: Any) -> Any:
        """The clock one control period later, from the law's measurement and memory."""
        if clock == ():
            return ()
        return self.following(clock, ticks, self.guard_inputs(measurement, row.reference, observed_push(memory)))

    def _hold_sample(self, clock: Any, ticks: Any) -> dict[str, Any]:
        """The sample that holds in a period, taken in it where it publishes one; () where each publishes one."""
        found: dict[str, Any] = {"held": (), "held_offset": (), "held_since": ()}
        if self._ratio > 1:
            fresh = due(ticks, self._ratio)
            found["held"] = where(fresh, clock.place, clock.held)
            if self._moves:
                found["held_offset"] = _either(fresh, clock.offset, clock.held_offset)
                found["held_since"] = where(fresh, clock.since, clock.held_since)
        return found

    def times(self, clock: PathClock, ticks: Scalar) -> tuple[Any, ...]:
        """Logged values of the clock.

        Times of the reference and of its held sample, s, its offset, m, and since when; those of the sample.
        """
        sample = self._hold_sample(clock, ticks)
        held = clock.place if self._ratio == 1 else sample["held"]
        own, its = leaves((clock.offset, clock.since)), leaves((sample["held_offset"], sample["held_since"]))
        return self.path_time(clock), held / self._rate, *own, *its

    def instants(self, times: Sequence[Scalar]) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Time and offset of the held reference and of the reference now, each as :meth:`reference` takes them."""
        path_time, held, *rest = times
        own, its = rest[:4], rest[4:]
        return (held, its or own), (path_time, own)

    def held_reference(self, clock: PathClock, ticks: Scalar) -> Reference:
        """The sample of the reference that holds in a period."""
        return self.reference(*self.instants(self.times(clock, ticks))[0])

    def path_time(self, clock: PathClock) -> Any:
        """Time of the reference, s."""
        return clock.place / self._rate

    def phase(self, path_time: Any) -> Scalar:
        """Number of the phase that is flown at a time of the reference, s; 0 where no phase waits."""
        found: Scalar = 0.0
        for each in self._trajectory.phases:
            found = found + where(path_time > each.end + PASSED, 1.0, 0.0)
        return found

    def reference(self, time: Scalar, offset: Sequence[Any] = ()) -> Reference:
        """The reference at its own time, s; ``offset`` as :meth:`instants` has it."""
        found = self._trajectory.at(time)
        if not offset:
            return found
        *moved, since = offset
        return offset_reference(found, Vec3(*moved), self._trajectory.returns, since / self._rate, time)

    def with_task_loads(self, par: Any, path_time: Any) -> Any:
        """The law's constants, with the payloads in its model that the task carries at a time of the reference (s)."""
        vehicle = par.model.vehicle
        for payload in self._believed:
            held = logical_and(path_time >= payload.pick, path_time < payload.drop)
            vehicle = vehicle.with_payload(where(held, payload.mass, 0.0), payload.frame or None)
        if not self._believed:
            return par
        return dataclasses.replace(par, model=dataclasses.replace(par.model, vehicle=vehicle))

    def guard_inputs(self, measurement: Measurement, reference: Reference, force: Vec3 | None) -> Seen:
        """Inputs of the guards."""
        tip = tip_at(self._vehicle, measurement.position, measurement.quaternion, measurement.joints)
        goal, felt = goal_of(self._vehicle, reference).tool, None
        if self._sensed:
            turned = frame_pose(self._vehicle, self._vehicle.frame(), measurement.joints).R
            felt = measurement.quaternion.rotation().apply(turned.apply(Vec3(*measurement.tip_force)))
        switches = measurement.switches if self.switches else ()
        return Seen(tip=tip, goal=goal, push=reference.push, force=force, felt=felt, switches=switches)

    def following(self, clock: PathClock, ticks: Scalar, seen: Seen) -> Any:
        """The clock one control period later."""
        n, end = clock.guard, self._select(clock.guard, self._ends, NEVER)
        begin = self._select(n, [guard.begin * self._rate for guard in self.guards])
        there = clock.place >= end - WHOLE
        fresh = logical_and(logical_or(clock.place <= begin + WHOLE, clock.waited < 0.5 * BEGUN), clock.waited < 0.5)
        origin = clock.origin if not self._measures else _either(fresh, seen.tip, clock.origin)
        looks = there
        if self._moves:
            early = self._select(n, [1.0 if guard.early else 0.0 for guard in self.guards], 0.0) > 0.5
            looks = logical_or(there, logical_and(early, logical_not(fresh)))
        reached = where(logical_and(looks, self._holds(n, seen, origin)), clock.reached + 1.0, 0.0)
        enough = reached > self._select(n, [guard.hold * self._rate for guard in self.guards]) + (1.0 - 1e-6)
        late = logical_and(
            there, clock.waited >= self._select(n, [guard.timeout * self._rate for guard in self.guards]) - 1e-6
        )
        passed = logical_or(enough, late)
        fails = self._select(n, [1.0 if guard.fails else 0.0 for guard in self.guards]) > 0.5
        failed = logical_and(logical_and(late, logical_not(enough)), fails)
        number = where(passed, n + 1.0, n)
        gone = where(passed, where(there, clock.place, end), clock.place) + 1.0
        return PathClock(
            place=minimum(gone, self._select(number, self._ends, NEVER)),
            **self._hold_sample(clock, ticks),
            guard=number,
            waited=where(passed, 0.0, where(there, clock.waited + 1.0, 0.0)),
            reached=where(passed, 0.0, reached),
            origin=_either(passed, seen.tip, origin) if self._measures else origin,
            failed=where(failed, 1.0, clock.failed),
            **self._skip(clock, enough, end),
        )

    def _skip(self, clock: PathClock, skips: Scalar, end: Scalar) -> dict[str, Any]:
        """Offset of the reference, which keeps its position when the rest of a phase is skipped."""
        if not self._moves:
            return {"offset": (), "since": ()}
        now = self.reference(self.path_time(clock), (*clock.offset, clock.since)).position
        stop = Vec3(*(self._select(clock.guard, column) for column in zip(*self._stops, strict=True)))
        return {
            "offset": _either(skips, now - stop, clock.offset),
            "since": where(skips, end, clock.since),
        }

    def _holds(self, n: Scalar, seen: Seen, origin: Any) -> Any:
        """True if the flight meets all conditions of the guard."""
        found: Any = n > -1.0
        if any(guard.error is not None for guard in self.guards):
            away = counted_error(seen.tip - seen.goal, seen.push, seen.tip)
            found = logical_and(found, sqrt(away.dot(away)) <= self._threshold(n, "error", NEVER))
        if any(guard.force is not None or guard.force_below is not None for guard in self.guards):
            found = logical_and(found, self._force_holds(n, seen))
        for name, wanted in (("closed", 1.0), ("open", 0.0)):
            if any(getattr(guard, name) for guard in self.guards):
                found = logical_and(found, self._switch_state(n, seen, name, wanted) > 0.5)
        if self._measures:
            moved = self._direction(n).dot(origin - seen.tip)
            found = logical_and(found, moved >= self._threshold(n, "distance", -NEVER))
        return found

    def _force_holds(self, n: Scalar, seen: Seen) -> Scalar:
        """True if the force, observed or read by a sensor, meets the guard's condition."""
        out = self._direction(n)
        least, most = self._threshold(n, "force", -NEVER), self._threshold(n, "force_below", NEVER)

        def holds(force: Vec3 | None) -> Scalar:
            if force is None:  # of a law that observes no force nobody knows that there is none
                return logical_and(least < 0.0, most > 0.5 * NEVER)
            along = out.dot(force)
            return logical_and(along >= least, along <= most)

        if not self._sensed:
            return holds(seen.force)
        hears = self._select(n, [1.0 if guard.sensed else 0.0 for guard in self.guards]) > 0.5
        return logical_or(logical_and(hears, holds(seen.felt)), logical_and(logical_not(hears), holds(seen.force)))

    def _switch_state(self, n: Any, seen: Seen, name: str, wanted: float) -> Any:
        """1 if the guard's switch has the required state, or if the guard has no switch."""
        found = []
        for guard in self.guards:
            asked = getattr(guard, name)
            told = seen.switches[self.switches.index(asked)] if asked else 1.0
            found.append(told if wanted or not asked else 1.0 - told)
        return self._select(n, found)

    def _direction(self, n: Scalar) -> Vec3:
        return Vec3(
            *(self._select(n, column) for column in zip(*(each.direction for each in self.guards), strict=True))
        )

    def _threshold(self, n: Scalar, name: str, nothing: float) -> Scalar:
        given = [getattr(guard, name) for guard in self.guards]
        return self._select(n, [nothing if value is None else value for value in given])

    def _select(self, n: Scalar, values: Sequence[Scalar], beyond: Scalar | None = None) -> Scalar:
        """The value for guard number n; after the last guard ``beyond``, by default the last value."""
        found = values[-1] if beyond is None else beyond
        for i in reversed(range(len(values))):
            found = where(n < i + 0.5, values[i], found)
        return found


def _either(condition: Any, a: Vec3, b: Any) -> Vec3:
    return Vec3(*(where(condition, x, y) for x, y in zip(a, b, strict=True)))


def due(ticks: Scalar, every: int) -> Any:
    """True in every ``every``-th period; half a period of slack, since a quotient may be rounded."""
    return ticks - floor(ticks / float(every) + 0.5 / every) * float(every) < 0.5


def is_other_reference(now: Overrides, then: Overrides) -> bool:
    """True if a change has replaced the whole reference between two instants of a flight."""
    parts, old = ([pair for pair in each.parts if pair[0].split(".")[0] == "reference"] for each in (now, then))
    return parts != old


def clock_of_change(scenario: Scenario, first: LoopState, now: LoopState, *, anew: bool) -> Any:
    """The clock at its start in the present period; () if the one before continues, or if there is none.

    Args:
        scenario: after the change.
        first: its first loop state.
        now: the loop where the change came; it may be that of many lanes, of which some have ended.
        anew: the reference is another one.
    """
    other = mismatch(first.clock, now.clock, "clock")
    if first.clock == () or not (anew or other):
        return ()
    begun: Any = Waits(scenario).begun_at(now.ticks)
    return begun if other else blend(now.alive > 0.5, begun, now.clock)
