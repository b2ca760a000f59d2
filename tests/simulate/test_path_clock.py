"""The clock of a reference that waits, one period at a time, on every engine, against
plain Python.
"""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.law_estimates import observed_push
from skyarm.records.leaves import leaves, rebuild
from skyarm.reference.path_time import offset_reference
from skyarm.reference.signals import Constant, Sum
from skyarm.reference.splines import minimum_snap
from skyarm.reference.task_records import Guard, Phase
from skyarm.reference.trajectory import PASSED, Reference, Trajectory, phase_numbers
from skyarm.scenario.in_flight import Overrides
from skyarm.simulate.first_state import component_places, first_loop_state
from skyarm.simulate.loop_state import carry_over
from skyarm.simulate.reference_clock import (
    GuardInputs,
    PathClock,
    Waits,
    clocks_of_change,
    due,
    other_references,
)
from support.cases import sampled
from support.engines import ENGINES, evaluate

OUT = (0.6, 0.0, 0.8)
"""Out of the surface."""

GUARDS = (
    Guard(at=0.1, begin=0.05, phase=0, error=0.01, hold=0.01, timeout=0.05),
    Guard(
        at=0.2,
        begin=0.1,
        phase=1,
        force=0.5,
        force_below=2.0,
        direction=OUT,
        hold=0.0,
        timeout=0.02,
        fails=True,
    ),
    Guard(
        at=0.2125,
        begin=0.2,
        phase=2,
        distance=0.004,
        direction=OUT,
        hold=0.01,
        timeout=1.0,
        early=True,
    ),
    Guard(
        at=0.4,
        begin=0.4,
        phase=3,
        force=0.1,
        distance=0.002,
        direction=OUT,
        hold=0.005,
        timeout=0.01,
        fails=True,
    ),
)
PHASES = (
    Phase(name="a", end=0.1),
    Phase(name="b", end=0.2),
    Phase(name="c", end=0.2125),
    Phase(name="d", end=0.4),
)

RATE = 200

NO_OFFSET = (0.0,) * 8
"""Of the reference and of the sample that is held, and since when."""


@pytest.fixture(scope="module")
def scenario():
    base = skyarm.load_scenario("case1", duration=1.0)
    way = Sum((Constant(0.1), minimum_snap((0.15, 0.3), (0.0, 0.02))))
    trajectory = Trajectory(
        x=way,
        z=Constant(1.0),
        joints=base.reference.joints,
        guards=GUARDS,
        phases=PHASES,
    )
    return dataclasses.replace(
        base, reference=trajectory, rates=dataclasses.replace(base.rates, reference=50)
    )


def oracle(
    clock: PathClock, ticks: float, tip: Any, goal: Any, push: Any, force: Any
) -> dict[str, Any]:
    """The same in words of a programme: what happens to the clock in one period."""
    place, n = clock.place, round(clock.guard)
    held = place if round(ticks) % 4 == 0 else clock.held
    guard = GUARDS[n] if n < len(GUARDS) else None
    if guard is None:
        fresh = place <= GUARDS[-1].begin * RATE + 1e-9 and clock.waited < 0.5
        still = {
            "origin": tip if fresh else clock.origin,
            "failed": clock.failed,
            "reached": 0.0,
            "waited": 0.0,
        }
        return {"place": place + 1.0, "held": held, "guard": float(n), **still}
    end, begin = guard.at * RATE, guard.begin * RATE
    there = place >= end - 1e-9
    fresh = place <= begin + 1e-9 and clock.waited < 0.5
    origin = tip if fresh else clock.origin
    asked = []
    if guard.error is not None:
        away = [a - b for a, b in zip(tip, goal, strict=True)]
        if push[0] > 0.0:
            along = sum(a * b for a, b in zip(away, push[2:], strict=True))
            away = [a - along * b for a, b in zip(away, push[2:], strict=True)]
        asked.append(math.hypot(*away) <= guard.error)
    felt = sum(a * b for a, b in zip(force, OUT, strict=True))
    if guard.force is not None:
        asked.append(felt >= guard.force)
    if guard.force_below is not None:
        asked.append(felt <= guard.force_below)
    if guard.distance is not None:
        asked.append(
            sum((a - b) * c for a, b, c in zip(origin, tip, OUT, strict=True))
            >= guard.distance
        )
    looks = there or (guard.early and not fresh)
    reached = clock.reached + 1.0 if looks and all(asked) else 0.0
    enough = reached > 0.0 and (reached - 1.0) / RATE >= guard.hold - 1e-9
    late = there and clock.waited / RATE >= guard.timeout - 1e-9
    following = {"held": held, "origin": origin, "failed": clock.failed}
    if not (enough or late):
        waited = clock.waited + 1.0 if there else 0.0
        return following | {
            "place": min(place + 1.0, end),
            "guard": float(n),
            "reached": reached,
            "waited": waited,
        }
    stop = GUARDS[n + 1].at * RATE if n + 1 < len(GUARDS) else math.inf
    gone = min((place if there else end) + 1.0, stop)
    failed = 1.0 if late and not enough and guard.fails else clock.failed
    return following | {
        "origin": tip,
        "place": gone,
        "guard": n + 1.0,
        "reached": 0.0,
        "waited": 0.0,
        "failed": failed,
    }


def drawn(count: int) -> list[list[float]]:
    """Clocks at and beside every threshold: place, held, guard, waited, reached ...
    force, push.
    """
    rng, found = np.random.default_rng(5), []
    for _ in range(count):
        n = int(rng.integers(0, 5))
        guard = GUARDS[min(n, 3)]
        ends = [
            guard.at * RATE,
            guard.at * RATE - 1,
            guard.at * RATE - 0.5,
            guard.begin * RATE,
            guard.begin * RATE + 1,
        ]
        place = float(rng.choice(ends))
        waited = (
            float(rng.choice([0, 1, 2, 3, 4, 9, 10, 11, 200]))
            if place == ends[0]
            else 0.0
        )
        tip = np.array([0.1, 0.0, 1.0]) + rng.choice(
            [0.0, 0.0035, 0.0099, 0.0101], 3
        ) * rng.choice([-1.0, 1.0], 3)
        force = np.array(OUT) * rng.choice(
            [0.05, 0.11, 0.49, 0.51, 1.99, 2.01]
        ) + 0.3 * np.array([-0.8, 0.0, 0.6])
        origin = tip + np.array(OUT) * rng.choice([0.0019, 0.0021, 0.0039, 0.0041])
        reached, failed, tick = (
            rng.integers(0, 5),
            rng.integers(0, 2),
            rng.integers(0, 9),
        )
        push = (float(rng.choice([0.0, 1.0])), 0.1, *OUT)
        found.append(
            [
                place,
                place - 2,
                n,
                waited,
                reached,
                *origin,
                failed,
                tick,
                *tip,
                *force,
                *push,
            ]
        )
    return [[float(c) for c in row] for row in found]


def following(waits: Waits, row: Any) -> list[Any]:
    place, held, guard, waited, reached, *rest = row
    example = waits.first()
    numbers = [place, held, guard, waited, reached, *rest[:4], *NO_OFFSET]
    clock = rebuild(example, iter(numbers))
    goal = Vec3(0.1, 0.0, 1.0)
    seen = GuardInputs(
        tip=Vec3(*rest[5:8]),
        goal=goal,
        push=tuple(rest[11:16]),
        force=Vec3(*rest[8:11]),
    )
    after = waits.following(clock, rest[4], seen)
    return [
        after.place,
        after.held,
        after.guard,
        after.waited,
        after.reached,
        *after.origin,
        after.failed,
    ]


ROWS = drawn(400)


@pytest.fixture(scope="module")
def wanted(scenario):
    rows = []
    for row in ROWS:
        clock = rebuild(Waits(scenario).first(), iter([*row[:9], *NO_OFFSET]))
        clock = dataclasses.replace(clock, origin=tuple(row[5:8]))
        found = oracle(
            clock, row[9], row[10:13], (0.1, 0.0, 1.0), row[16:21], row[13:16]
        )
        names = ("place", "held", "guard", "waited", "reached", "origin", "failed")
        rows.append(
            [
                c
                for name in names
                for c in (found[name] if name == "origin" else [found[name]])
            ]
        )
    return np.array(rows)


def test_the_draws_meet_every_branch(scenario, wanted):
    before, after = np.array(ROWS), wanted
    passed = after[:, 2] > before[:, 2]
    assert 40 < passed.sum() < 300
    assert (after[:, 8] > before[:, 8]).sum() > 5
    skipped = passed & (
        before[:, 0] < [GUARDS[min(int(n), 3)].at * RATE - 0.5 for n in before[:, 2]]
    )
    assert set(before[skipped, 2]) == {2.0}
    assert (after[:, 0] == before[:, 0]).sum() > 20


@pytest.mark.parametrize("engine", sampled(ENGINES, 4))
def test_one_period_is_that_of_plain_python(scenario, wanted, engine):
    waits = Waits(scenario)
    found = evaluate(engine, lambda *row: following(waits, row), ROWS)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-9)


def test_a_reference_that_ends_early_goes_on_from_where_it_is(scenario):
    # a phase before has taken another offset back, and what is skipped would take this
    # one: neither counts
    phases = [
        dataclasses.replace(phase, back=back)
        for phase, back in zip(
            PHASES, ((0.05, 0.1), None, (0.2075, 0.2125), None), strict=True
        )
    ]
    trajectory = dataclasses.replace(scenario.reference, phases=tuple(phases))
    waits, shift = (
        Waits(dataclasses.replace(scenario, reference=trajectory)),
        1.0 / RATE,
    )
    clock = dataclasses.replace(
        waits.first(),
        place=41.0,
        guard=2.0,
        reached=2.0,
        origin=Vec3(0.1, 0.0, 1.0),
    )
    there = Vec3(0.1, 0.0, 1.0) - Vec3(*OUT) * 0.005
    seen = GuardInputs(tip=there, goal=there, push=(), force=Vec3(0.0, 0.0, 0.0))
    after = waits.following(clock, 41.0, seen)
    assert (after.place, after.guard) == (GUARDS[2].at * RATE + 1.0, 3.0)

    now, then = waits.held_reference(clock, 40.0), waits.held_reference(after, 44.0)
    assert (
        now.position.x
        < float(scenario.reference.at(after.place * shift).position.x) - 1e-5
    )
    # the plan has moved on by a period only
    speed = float(scenario.reference.at(GUARDS[2].at).velocity.x)
    assert then.position.x - now.position.x == pytest.approx(speed * shift, rel=0.2)
    # a sample is held with the offset that it was published with, until the next one
    before = waits.held_reference(clock, 41.0)
    for tick in (42.0, 43.0):
        assert waits.held_reference(after, tick) == before
        after = waits.following(after, tick, seen)
    moved = waits.instants(waits.times(after, 44.0))
    offset, since = after.shift
    assert moved[0][1] == moved[1][1] == [*offset, since]
    assert waits.held_reference(after, 44.0) == waits.reference(*moved[1]) != before


def test_a_held_sample_keeps_its_offset_while_a_phase_is_skipped(scenario):
    """Of two offsets one after the other: what a phase between them takes back counts
    for the first one alone.
    """
    phases = (PHASES[0], dataclasses.replace(PHASES[1], back=(0.15, 0.19)), *PHASES[2:])
    trajectory = dataclasses.replace(scenario.reference, phases=phases)
    waits = Waits(dataclasses.replace(scenario, reference=trajectory))
    shift = Vec3(0.003, 0.0, 0.0), 20.0
    begun = {
        "place": 41.0,
        "held": 40.0,
        "guard": 2.0,
        "reached": 2.0,
        "origin": Vec3(0.1, 0.0, 1.0),
    }
    clock = dataclasses.replace(waits.first(), **begun, shift=shift, held_shift=shift)
    there = Vec3(0.1, 0.0, 1.0) - Vec3(*OUT) * 0.005
    seen = GuardInputs(tip=there, goal=there, push=(), force=Vec3(0.0, 0.0, 0.0))
    before = waits.held_reference(clock, 41.0)
    # the phase has taken the first one back
    assert before.position.x == pytest.approx(
        trajectory.at(40.0 / RATE).position.x, abs=1e-12
    )
    for tick in (41.0, 42.0):
        clock = waits.following(clock, tick, seen)
        assert clock.shift[1] > 42.0
        assert waits.held_reference(clock, tick + 1.0) == before
    clock = waits.following(clock, 43.0, seen)
    assert (
        trajectory.at(clock.place / RATE).position.x
        - waits.held_reference(clock, 44.0).position.x
        > 1e-5
    )


def test_an_offset_is_taken_back_smoothly_in_the_phase_that_returns(scenario):
    phases = (*PHASES[:3], dataclasses.replace(PHASES[3], back=(0.25, 0.4)))
    trajectory = dataclasses.replace(scenario.reference, phases=phases)
    waits = Waits(dataclasses.replace(scenario, reference=trajectory))
    offset, step = (0.003, -0.002, 0.001), 5e-4
    rows = [
        waits.reference(t, (*offset, 0.2125 * RATE))
        for t in np.arange(0.2, 0.45, step).tolist()
    ]
    plan = [trajectory.at(t) for t in np.arange(0.2, 0.45, step).tolist()]
    left = np.array(
        [
            [float(a - b) for a, b in zip(r.position, p.position, strict=True)]
            for r, p in zip(rows, plan, strict=True)
        ]
    )
    np.testing.assert_allclose(left[:100], np.tile(offset, (100, 1)), atol=1e-12)
    np.testing.assert_allclose(left[401:], 0.0, atol=1e-12)
    for name, less in (
        ("velocity", "position"),
        ("acceleration", "velocity"),
        ("jerk", "acceleration"),
        ("snap", "jerk"),
    ):
        below, own = (
            np.array([[float(c) for c in getattr(r, each)] for r in rows])
            for each in (less, name)
        )
        slope = np.gradient(below, step, axis=0)
        # where a motion of least snap begins and ends its snap jumps
        assert np.quantile(np.abs(slope - own)[5:-5], 0.95) < 1e-2 * np.abs(own).max()
    # of an offset that began after the phase nothing is taken back
    late = waits.reference(0.42, (*offset, 0.3 * RATE))
    assert float(late.position.y) == pytest.approx(-0.002)
    # of one that began where the phase does, all
    assert float(
        waits.reference(0.42, (*offset, 0.25 * RATE)).position.y
    ) == pytest.approx(0.0, abs=1e-12)


def test_a_tip_goes_beside_its_plan_as_the_base_does():
    plan = Reference(position=Vec3(1.0, 2.0, 3.0), tip=(1.1, 2.1, 2.5), joints=(0.3,))
    for time, left in ((0.1, 1.0), (0.3, 0.5), (0.5, 0.0)):
        moved = offset_reference(plan, Vec3(0.2, -0.1, 0.4), ((0.2, 0.4),), 0.15, time)
        assert [*(moved.position - plan.position)] == pytest.approx(
            [0.2 * left, -0.1 * left, 0.4 * left]
        )
        assert np.subtract(moved.tip, plan.tip) == pytest.approx(
            [*(moved.position - plan.position)]
        )
        assert moved.joints == plan.joints
    # what one phase has taken back stays so before, in and after the next that would
    for time in (0.5, 0.7, 0.9):
        back = offset_reference(
            plan, Vec3(0.2, -0.1, 0.4), ((0.2, 0.4), (0.6, 0.8)), 0.15, time
        )
        assert back.tip == pytest.approx(plan.tip, abs=1e-12)
    assert (
        offset_reference(
            dataclasses.replace(plan, tip=()), Vec3(0.2, 0.0, 0.0), (), 0.0, 0.1
        ).tip
        == ()
    )


def test_a_task_that_takes_over_in_flight_begins_at_the_flight_s_time(scenario):
    first = first_loop_state(scenario)

    def at_clock(clock):
        return dataclasses.replace(first, ticks=37.0).with_agent(
            dataclasses.replace(first.agent, clock=clock)
        )

    before = at_clock(())

    def taken(now, anew):
        places = component_places(scenario)
        clocks = clocks_of_change(
            scenario, first, now, anew=scenario.agents if anew else ()
        )
        return carry_over(first, now, (places, places), clocks).agent.clock

    # at the first guard that is not passed
    for ticks, guard in (
        (0.0, 0.0),
        (19.0, 0.0),
        (20.0, 0.0),
        (21.0, 1.0),
        (41.0, 2.0),
        (43.0, 3.0),
        (200.0, 4.0),
    ):
        found = taken(dataclasses.replace(before, ticks=ticks), False)
        assert (found.place, found.held, found.guard) == (ticks, ticks, guard)
    # the same reference goes on where it stands, another one of the same shape begins;
    # of a lane that has ended neither
    clock = dataclasses.replace(first.agent.clock, place=11.0, guard=1.0, failed=1.0)
    waiting = at_clock(clock)
    assert taken(waiting, False) == clock
    assert (taken(waiting, True).place, taken(waiting, True).failed) == (37.0, 0.0)
    assert taken(dataclasses.replace(waiting, alive=0.0), True) == clock
    assert clocks_of_change(
        scenario, before, dataclasses.replace(first, ticks=37.0), anew=scenario.agents
    ) == [()]
    # a distance counts from where the tip was then
    tip = Vec3(0.3, 0.2, 0.1)
    seen = GuardInputs(tip=tip, goal=tip, push=(), force=None)
    after = Waits(scenario).following(Waits(scenario).begun_at(41.0), 41.0, seen)
    assert after.origin == tip
    moved = dataclasses.replace(seen, tip=Vec3(0.0, 0.0, 0.0))
    assert Waits(scenario).following(after, 42.0, moved).origin == tip


def test_a_reference_is_another_one_where_it_is_replaced_as_a_whole(scenario):
    task, law = ("reference", {"base": "case1"}), ("controller.law", "indi")
    own, number = Overrides(), Overrides(numbers=(("reference.push.speed", 0.2),))
    replaced = Overrides(parts=(task,))
    for now, before, other in (
        (number, own, False),
        (Overrides(parts=(law,)), own, False),
        (replaced, own, True),
        (own, replaced, True),
        (Overrides(parts=(law, task)), replaced, False),
        (Overrides(parts=(("reference.base", {"kind": "hover"}),)), own, True),
    ):
        assert other_references(scenario, now, before) == (("main",) if other else ())


@pytest.mark.parametrize("asked", [{"force": 0.5}, {"force_below": 0.5}])
def test_who_observes_no_force_knows_of_none_that_is_gone(scenario, asked):
    guard = Guard(at=0.1, begin=0.05, direction=OUT, hold=0.0, **asked)
    waits = Waits(
        dataclasses.replace(
            scenario, reference=dataclasses.replace(scenario.reference, guards=(guard,))
        )
    )
    clock, tip = dataclasses.replace(waits.first(), place=20.0), Vec3(0.1, 0.0, 1.0)
    force = Vec3(*OUT) * (1.0 if "force" in asked else 0.0)
    found = [
        waits.following(
            clock, 20.0, GuardInputs(tip=tip, goal=tip, push=(), force=each)
        )
        for each in (force, None)
    ]
    assert [each.guard for each in found] == [1.0, 0.0]


def test_a_phase_that_has_just_begun_does_not_end_by_what_was_there_before(scenario):
    guard = Guard(at=0.1, begin=0.05, direction=OUT, hold=0.0, early=True, force=0.5)
    waits = Waits(
        dataclasses.replace(
            scenario, reference=dataclasses.replace(scenario.reference, guards=(guard,))
        )
    )
    tip = Vec3(0.1, 0.0, 1.0)
    pressed = GuardInputs(tip=tip, goal=tip, push=(), force=Vec3(*OUT))
    first, second = (
        waits.following(dataclasses.replace(waits.first(), place=p), p, pressed)
        for p in (10.0, 11.0)
    )
    assert (first.place, first.guard, first.reached) == (11.0, 0.0, 0.0)
    assert (second.place, second.guard) == (21.0, 1.0)


@pytest.mark.parametrize("periods", [1, 7, 14, 55])
def test_a_timeout_or_a_hold_of_whole_periods_lasts_so_many(scenario, periods):
    """Of 0.035 s, 7 periods of 5 ms, rounding would make a little more."""
    seconds, tip = periods / RATE, Vec3(0.1, 0.0, 1.0)
    for hold, timeout, force in ((10.0, seconds, 0.0), (seconds, 10.0, 1.0)):
        guard = Guard(
            at=0.1, begin=0.05, direction=OUT, hold=hold, timeout=timeout, force=0.5
        )
        trajectory = dataclasses.replace(scenario.reference, guards=(guard,))
        waits = Waits(dataclasses.replace(scenario, reference=trajectory))
        clock, count = dataclasses.replace(waits.first(), place=20.0), 0
        while clock.guard < 0.5:
            seen = GuardInputs(tip=tip, goal=tip, push=(), force=Vec3(*OUT) * force)
            clock, count = waits.following(clock, 20.0 + count, seen), count + 1
        assert count == periods + 1


@pytest.mark.parametrize("every", [1, 3, 4, 7, 1000, 1500])
def test_a_slower_clock_ticks_in_each_so_many_periods(every):
    ticks = np.concatenate([np.arange(4000.0), 1e7 + np.arange(3000.0)])
    assert (due(ticks, every) == (ticks % every == 0.0)).all()


def test_a_phase_is_flown_until_its_end_is_passed(scenario):
    ends = [phase.end for phase in PHASES]
    times = [
        0.0,
        *ends,
        *(end + PASSED for end in ends),
        *(end + 2.0 * PASSED for end in ends),
        0.3,
    ]
    wanted = [0.0, 0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 4.0, 3.0]
    assert phase_numbers(scenario.reference, times).tolist() == wanted
    assert [Waits(scenario).phase(time) for time in times] == wanted


def test_a_law_of_one_s_own_tells_the_force_by_a_field_of_its_memory():
    force = Vec3(1.0, 2.0, 3.0)
    own = SimpleNamespace(tip_force=force)
    assert observed_push(own) == force
    assert observed_push(SimpleNamespace(tip_force=0.0)) is None
    assert observed_push(()) is None


def test_where_no_phase_waits_the_clock_is_nothing(scenario):
    bare = dataclasses.replace(
        scenario,
        reference=dataclasses.replace(scenario.reference, guards=(), phases=()),
    )
    assert Waits(bare).first() == ()
    assert leaves(Waits(bare).first()) == []


def test_a_phase_ends_after_a_day_of_flight_as_after_a_second(scenario):
    """At 2e7 control periods the clock's rounding is more than the slack of a billionth
    of a period.
    """
    tip = Vec3(0.1, 0.0, 1.0)
    for end in (0.1, 1e5):
        guard = Guard(at=end, begin=0.05, direction=OUT, force=0.5, hold=0.0)
        waits = Waits(
            dataclasses.replace(
                scenario,
                reference=dataclasses.replace(scenario.reference, guards=(guard,)),
            )
        )
        clock = dataclasses.replace(waits.first(), place=end * RATE)
        pressed = GuardInputs(tip=tip, goal=tip, push=(), force=Vec3(*OUT))
        assert waits.following(clock, end * RATE, pressed).guard == 1.0


def test_in_single_precision_a_timeout_lasts_as_many_periods(scenario):
    """Of 100 periods a millionth is less than the rounding of 32 bits."""
    jax = pytest.importorskip("jax")
    guard = Guard(
        at=0.1, begin=0.05, direction=OUT, force=0.5, hold=0.0, timeout=100 / RATE
    )
    waits = Waits(
        dataclasses.replace(
            scenario, reference=dataclasses.replace(scenario.reference, guards=(guard,))
        )
    )
    tip = Vec3(0.1, 0.0, 1.0)

    def guard_after(waited: Any) -> Any:
        clock = dataclasses.replace(
            waits.first(), place=20.0, guard=0.0 * waited, waited=waited
        )
        return waits.following(
            clock,
            20.0,
            GuardInputs(tip=tip, goal=tip, push=(), force=Vec3(0.0, 0.0, 0.0)),
        ).guard

    assert jax.jit(guard_after)(
        jax.numpy.array([99.0, 100.0, 101.0], dtype="float32")
    ).tolist() == [0.0, 1.0, 1.0]
