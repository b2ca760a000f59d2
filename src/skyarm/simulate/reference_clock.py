"""Clock of a reference whose task phases wait for conditions (guards), such as a
contact force.

It counts control periods of the reference, goes on with the flight's own, stands still
at the planned end of a phase with a guard until the flight shows what the guard
requires, and skips what is left of a phase that may end early. Guards use the law's
measurement and the force that the law observes.

Where no phase waits the clock is ``()``: structure, without an operation.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any, TypeVar, cast

from skyarm.algebra import ZERO3_DATA, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    absolute,
    data,
    floor,
    logical_and,
    logical_not,
    logical_or,
    minimum,
    sqrt,
    where,
)
from skyarm.control.controller import preview_leads
from skyarm.control.law_estimates import observed_push
from skyarm.dynamics.kinematics import frame_pose
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree, blend, leaves, mismatch
from skyarm.records.path_names import agent_of, word_of
from skyarm.reference.path_time import offset_reference
from skyarm.reference.preview import with_preview
from skyarm.reference.task_records import Guard
from skyarm.reference.tip_motion import counted_error
from skyarm.reference.trajectory import PASSED, Reference
from skyarm.scenario.in_flight import Overrides
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.measurement import Measurement
from skyarm.simulate.loop_state import (
    AgentLoop,
    Clock,
    GivenRow,
    InputRow,
    LoopState,
    PathClock,
    Shift,
)
from skyarm.simulate.tip_and_goal import goal_of, tip_at

Instant = tuple[Scalar, Sequence[Scalar]]
T = TypeVar("T")


@immutable
class GuardInputs:
    """Measured quantities by which the conditions (guards) that end task phases are
    evaluated.

    Attributes:
        tip: measured position of the tip, m, world axes. goal: its desired position by
            the held reference.
        push: contact request of that reference.
        force: tip force as the law observes it, N, world axes; None of a law that
            observes none.
        felt: tip force as a force sensor measures it, for guards that require it.
            switches: 1 closed, in the order of those that ``Waits`` looks at.
    """

    tip: Vec3
    goal: Vec3
    push: Scalars
    force: Vec3 | None
    felt: Vec3 | None = None
    switches: Scalars = ()


@immutable
class GuardTerms:
    """Times and flags of the condition (guard) that ends a task phase; times in control
    periods, flags 1 or 0.

    Attributes:
        stop: position of the base's reference at its end, m; () where no phase ends
            early.
    """

    end: Scalar
    begin: Scalar
    hold: Scalar
    timeout: Scalar
    early: Scalar
    fails: Scalar
    stop: Vec3 | tuple[()]


WHOLE = 1e-9
"""Number of control periods that counts as rounding."""

NEVER = 1e30
"""Number of control periods longer than any flight."""

BEGUN = -1.0
"""Value of ``waited`` of a clock that has just taken over."""


class Waits:
    """Evaluator of the conditions (guards) that end task phases, and of the clock of
    the waiting reference.

    Args:
        scenario: scenario, whose numbers may be traced.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._trajectory = scenario.agent.law_reference
        self._leads = preview_leads(scenario.agent.controller.par)
        self.guards: tuple[Guard, ...] = scenario.agent.reference.guards
        self.loads = frozenset(name for guard in self.guards for name in guard.loads)
        self._believed = tuple(
            each
            for each in scenario.agent.payloads
            if each.believed and each.name in self.loads
        )
        self._rate = float(scenario.rates.control)
        self._ratio = scenario.rates.control // scenario.rates.reference
        self._vehicle = scenario.agent.model.vehicle
        self._moves = any(guard.early for guard in self.guards)
        switches = [
            each for guard in self.guards for each in (guard.closed, guard.open)
        ]
        self.switches = tuple(dict.fromkeys(filter(None, switches)))
        self._sensed = any(guard.sensed for guard in self.guards)
        self._measures = any(guard.distance is not None for guard in self.guards)
        self._terms = tuple(map(self._terms_of, self.guards))

    def _terms_of(self, guard: Guard) -> GuardTerms:
        rate = self._rate
        return GuardTerms(
            end=guard.at * rate,
            begin=guard.begin * rate,
            hold=guard.hold * rate,
            timeout=guard.timeout * rate,
            early=float(guard.early),
            fails=float(guard.fails),
            # terms of all guards have the same fields, as one is chosen by a traced
            # number
            stop=(
                Vec3(*map(data, self._trajectory.at(guard.at).position))
                if self._moves
                else ()
            ),
        )

    def terms(self, n: Scalar) -> GuardTerms:
        """Times and flags of guard number ``n``; beyond the last guard, those of a
        guard that is never reached.
        """
        return _select(
            n, (*self._terms, replace(self._terms[-1], end=NEVER, early=0.0))
        )

    def first(self) -> Clock:
        """Initial state of the reference clock; () for a task without guards."""
        if not self.guards:
            return ()
        still: Shift = (ZERO3_DATA, 0.0) if self._moves else ()
        return PathClock(
            place=0.0,
            held=0.0,
            guard=0.0,
            waited=0.0,
            reached=0.0,
            origin=ZERO3_DATA if self._measures else (),
            failed=0.0,
            shift=still,
            held_shift=still,
        )

    def begun_at(self, ticks: Scalar) -> Clock:
        """Reference clock of a task that starts in mid-flight; guards whose planned
        times have passed are skipped.

        The distance of a phase that is under way then counts from there on.
        """
        first = self.first()
        if not first:
            return ()
        guard: Scalar = 0.0
        for terms in self._terms:
            # counted, not searched: the number may be traced, of many lanes at once
            guard = guard + where(ticks > terms.end + WHOLE, 1.0, 0.0)
        return replace(first, place=ticks, held=ticks, guard=guard, waited=BEGUN)

    def lead(self, clock: Clock, ticks: Scalar, row: GivenRow) -> InputRow[Reference]:
        """Closed-loop inputs of a control period, with the reference evaluated at the
        reference clock's time.
        """
        if not clock or row.reference != ():
            # without a clock the reference is in the row
            return cast("InputRow[Reference]", row)
        path_time = self.path_time(clock)
        reference = self.previewed_reference(clock, ticks)
        # the hand's command is of this period, not of a sample
        if self._trajectory.load is not None:
            reference = replace(
                reference, load=(self._trajectory.load.derivatives(path_time)[0],)
            )
        return InputRow(
            time=row.time, reference=reference, scaled=row.scaled, path_time=path_time
        )

    def is_sound(self, clock: Clock) -> Scalar:
        """True while no mandatory task phase has timed out."""
        return clock.failed < 0.5 if clock else True

    def log_values(self, clock: Clock, ticks: Scalar) -> Scalars:
        """Logged values of the reference clock; () for a task without guards."""
        return self.times(clock, ticks) if clock else ()

    def advance(
        self,
        clock: Clock,
        ticks: Scalar,
        measurement: Measurement,
        row: InputRow[Reference],
        memory: Tree,
    ) -> Clock:
        """State of the reference clock after a control period, from the law's
        measurement and observed force.
        """
        if not clock:
            return ()
        return self.following(
            clock,
            ticks,
            self.guard_inputs(measurement, row.reference, observed_push(memory)),
        )

    def _hold_sample(self, clock: PathClock, ticks: Scalar) -> PathClock:
        """Reference clock with its held sample renewed if the reference rate requires a
        new sample now.
        """
        fresh = due(ticks, self._ratio)
        sampled = where(fresh, clock.place, clock.held)
        shift = blend(fresh, clock.shift, clock.held_shift)
        return replace(clock, held=sampled, held_shift=shift)

    def times(self, clock: PathClock, ticks: Scalar) -> Scalars:
        """Path times (s) and position offsets (m) of the current reference and of its
        held sample, for the log.

        Times of the reference and of its held sample, s, its offset, m, and since when;
        those of the sample.
        """
        sample = self._hold_sample(clock, ticks)
        offsets = leaves((clock.shift, sample.held_shift))
        return self.path_time(clock), sample.held / self._rate, *offsets

    def instants(self, times: Sequence[Scalar]) -> tuple[Instant, Instant]:
        """Path time and position offset of the held reference, then of the current
        reference.
        """
        path_time, sampled, *offsets = times
        return (sampled, offsets[4:]), (path_time, offsets[:4])

    def held_reference(self, clock: PathClock, ticks: Scalar) -> Reference:
        """Reference sample that is held in a control period, at the reference clock's
        time.
        """
        return self.reference(*self.instants(self.times(clock, ticks))[0])

    def previewed_reference(self, clock: PathClock, ticks: Scalar) -> Reference:
        """Held reference sample with preview samples, which end at the next condition
        (guard) of the task.
        """
        sample = self.held_reference(clock, ticks)
        end = self.end(clock)
        time, offset = self.instants(self.times(clock, ticks))[0]
        return with_preview(
            sample,
            self._leads,
            lambda lead: self.reference(minimum(time + lead, end), offset),
        )

    def end(self, clock: PathClock) -> Scalar:
        """Path time (s) at which the reference waits for its next condition (guard)."""
        return self.terms(clock.guard).end / self._rate

    def path_time(self, clock: PathClock) -> Scalar:
        """Path time (s) of the reference, by the reference clock."""
        return clock.place / self._rate

    def task_time(self, row: InputRow[Reference]) -> Scalar:
        """Time (s) of events of the task: that along a reference whose phases wait,
        else the flight's.
        """
        return (
            row.path_time
            if self.guards and not isinstance(row.path_time, tuple)
            else row.time
        )

    def phase(self, path_time: Scalar) -> Scalar:
        """Index of the task phase at a path time (s); 0 for a task without phases."""
        index: Scalar = 0.0
        for each in self._trajectory.phases:
            index = index + where(path_time > each.end + PASSED, 1.0, 0.0)
        return index

    def reference(self, time: Scalar, offset: Sequence[Scalar] = ()) -> Reference:
        """Reference at a path time (s), shifted by a position offset."""
        planned = self._trajectory.at(time)
        if not offset:
            return planned
        *moved, since = offset
        return offset_reference(
            planned, Vec3(*moved), self._trajectory.returns, since / self._rate, time
        )

    def with_task_loads(self, par: Any, path_time: Scalar | tuple[()]) -> Any:
        """Parameters of the law with the payloads carried at a path time (s) added to
        its vehicle model.
        """
        vehicle = par.model.vehicle
        for payload in self._believed:
            carried = logical_and(path_time >= payload.pick, path_time < payload.drop)
            vehicle = vehicle.with_payload(
                where(carried, payload.mass, 0.0), payload.frame or None
            )
        if not self._believed:
            return par
        return replace(par, model=replace(par.model, vehicle=vehicle))

    def guard_inputs(
        self, measurement: Measurement, reference: Reference, force: Vec3 | None
    ) -> GuardInputs:
        """Measured and desired tip position, forces and tactile switches, for
        evaluating conditions (guards).
        """
        tip = tip_at(
            self._vehicle,
            measurement.position,
            measurement.quaternion,
            measurement.joints,
        )
        goal = goal_of(self._vehicle, reference).tool
        felt = None
        if self._sensed:
            turned = frame_pose(
                self._vehicle, self._vehicle.frame(), measurement.joints
            ).R
            felt = measurement.rotation.apply(
                turned.apply(Vec3(*measurement.tip_force))
            )
        switches = measurement.switches if self.switches else ()
        return GuardInputs(
            tip=tip,
            goal=goal,
            push=reference.push,
            force=force,
            felt=felt,
            switches=switches,
        )

    def following(
        self, clock: PathClock, ticks: Scalar, seen: GuardInputs
    ) -> PathClock:
        """Evaluate a task phase's condition (guard); return the reference clock a
        period later, advanced or waiting.
        """
        n = clock.guard
        now = self.terms(clock.guard)
        there = clock.place >= now.end - WHOLE
        # a phase begins where the clock reaches it, or where a change takes over in its
        # middle
        begins = logical_or(
            clock.place <= now.begin + WHOLE, clock.waited < 0.5 * BEGUN
        )
        # a phase of no length waits at its beginning: its first period alone is fresh
        fresh = logical_and(begins, clock.waited < 0.5)
        origin = (
            blend(fresh, seen.tip, clock.origin) if self._measures else clock.origin
        )
        # one that may end early is looked at from its second period on, as distances
        # count from the first
        looks = (
            logical_or(there, logical_and(now.early > 0.5, logical_not(fresh)))
            if self._moves
            else there
        )
        holds = (
            _select(n, [self._holds(guard, seen, origin) for guard in self.guards])
            > 0.5
        )
        reached = where(logical_and(looks, holds), clock.reached + 1.0, 0.0)
        # held for so many periods after the first that met it; 1e-6 of one is rounding
        enough = reached > now.hold + (1.0 - 1e-6)
        late = logical_and(there, clock.waited >= now.timeout - 1e-6)
        passed = logical_or(enough, late)
        failed = logical_and(logical_and(late, logical_not(enough)), now.fails > 0.5)
        number = where(passed, n + 1.0, n)
        # an early end skips what is left of the phase, by the jump of the offset below
        gone = where(passed, where(there, clock.place, now.end), clock.place) + 1.0
        shift = clock.shift
        # the reference keeps its position when the rest of a phase is skipped
        if self._moves:
            position = self.reference(self.path_time(clock), leaves(shift)).position
            shift = blend(enough, (position - Vec3(*now.stop), now.end), shift)
        return replace(
            self._hold_sample(clock, ticks),
            # the clock stands still at the end of the next phase that waits
            place=minimum(gone, self.terms(number).end),
            guard=number,
            waited=where(passed, 0.0, where(there, clock.waited + 1.0, 0.0)),
            reached=where(passed, 0.0, reached),
            origin=blend(passed, seen.tip, origin) if self._measures else origin,
            failed=where(failed, 1.0, clock.failed),
            shift=shift,
        )

    def _holds(
        self, guard: Guard, seen: GuardInputs, origin: Vec3 | tuple[()]
    ) -> Scalar:
        """1.0 if all conditions of a guard are met by the measured quantities, else
        0.0.
        """
        met: list[Scalar] = []
        direction = Vec3(*map(data, guard.direction))
        force = seen.felt if guard.sensed else seen.force
        if guard.error is not None:
            away = counted_error(seen.tip - seen.goal, seen.push, seen.tip)
            met.append(sqrt(away.dot(away)) <= guard.error)
        if guard.force is not None:  # a law that observes no force does not know of any
            met.append(force is not None and direction.dot(force) >= guard.force)
        if guard.force_below is not None:
            met.append(force is not None and direction.dot(force) <= guard.force_below)
        for name, state in ((guard.closed, 1.0), (guard.open, 0.0)):
            if name:
                met.append(
                    absolute(seen.switches[self.switches.index(name)] - state) < 0.5
                )
        if guard.distance is not None:
            met.append(direction.dot(Vec3(*origin) - seen.tip) >= guard.distance)
        # where, because a traced number has no truth value for all()
        all_met: Scalar = 1.0
        for each in met:
            all_met = where(each, all_met, 0.0)
        return all_met


def _select(n: Scalar, values: Sequence[T]) -> T:
    """Element ``n`` of a sequence for a traced index ``n``; the last element beyond the
    end.
    """
    element = values[-1]
    # the last test wins, so the smallest index comes last
    for i in reversed(range(len(values) - 1)):
        element = blend(n < i + 0.5, values[i], element)
    return element


def due(ticks: Scalar, every: int) -> Scalar:
    """True in every ``every``-th control period; ``ticks`` is the number of the
    period.
    """
    # half a period, so that rounding of the quotient never loses a multiple
    late = ticks - floor(ticks / float(every) + 0.5 / every) * float(every)
    fresh: Scalar = late < 0.5
    return fresh


def other_references(
    scenario: Scenario, now: Overrides, then: Overrides
) -> tuple[str, ...]:
    """Names of the vehicles whose whole reference scheduled changes have replaced
    between two instants.
    """

    def of(overrides: Overrides, name: str) -> list[tuple[str, object]]:
        named = [
            (agent_of(path), word_of(path), value) for path, value in overrides.parts
        ]
        return [
            (word, value)
            for of, word, value in named
            if of in ("", name) and word.split(".")[0] == "reference"
        ]

    return tuple(name for name in scenario.agents if of(now, name) != of(then, name))


def clocks_of_change(
    scenario: Scenario, first: LoopState, now: LoopState, *, anew: Collection[str]
) -> list[Clock]:
    """Reference clocks restarted after a change of the scenario; () for a vehicle whose
    old clock continues.

    Args:
        scenario: scenario after the change.
        first: its first loop state.
        now: state of the loop where the change came; it may be that of many lanes, of
            which some have ended.
        anew: names of the vehicles whose reference is another one.
    """
    rows = zip(scenario.agents, first.agents, now.agents, strict=True)
    return [
        _clock_of_change(scenario.of(name), new, old, now, anew=name in anew)
        for name, new, old in rows
    ]


def _clock_of_change(
    scenario: Scenario, first: AgentLoop, own: AgentLoop, now: LoopState, *, anew: bool
) -> Clock:
    """Reference clock of one vehicle restarted after a change of the scenario; () if
    the old clock continues.
    """
    other = mismatch(first.clock, own.clock, "clock")
    if first.clock == () or not (anew or other):
        return ()
    begun = Waits(scenario).begun_at(now.ticks)
    # lanes that have ended keep the clock that ended them, which names the cause
    clock = begun if other else blend(now.alive > 0.5, begun, own.clock)
    return clock
