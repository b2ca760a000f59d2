"""A governor that pauses in flight: the law is led more slowly where it is behind, and nothing else is other."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.actuators import Command
from skyarm.log.metrics.path_distance import path_distance
from skyarm.log.metrics.score import score
from skyarm.reference import hover
from skyarm.reference.governor.path_time import PathTime
from skyarm.reference.governor.pause import PathPause
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.path_governor import GovernorOptions, options_from
from skyarm.sensing.measurement import blank_measurement
from skyarm.simulate.batch import Batch
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.loop import run_in_python
from skyarm.simulate.loop_state import carry_over
from skyarm.simulate.reference_clock import Paces, clock_of_change
from skyarm.simulate.tip_and_goal import tip_at

POINTS = [[0, 0, 1], [2, 0, 1.5], [2, 2, 1]]
BASE = {"kind": "waypoints", "points": POINTS, "start": 0.2, "speed": 3.0, "acceleration": 4.0, "tilt": 0.6,
        "rate": 4, "spin": 30}  # fmt: skip
MASS = "plant.payload.mass"

LEVEL = Quaternion(1.0, 0.0, 0.0, 0.0)


def flight(governor, duration=4.0):
    reference = {"base": BASE} | ({"governor": governor} if governor else {})
    document = {"name": "p", "duration": duration, "plant": {"vehicle": "hummingbird_arm2_rotors"}}
    return skyarm.scenario_from(document | {"controller": {"preset": "paper_ct"}, "reference": reference})


@pytest.fixture(scope="module")
def scenario():
    return flight({"pause_error": 0.05, "pause_thrust": 0.9})


@pytest.fixture(scope="module")
def log(scenario):
    return skyarm.run(scenario)


@pytest.fixture(scope="module")
def states(scenario):
    """The loop's clock in each period."""
    session, found = skyarm.Session(scenario), []
    for _ in range(500):
        found.append(session.now.clock.now)
        session.step()
    return found


def same(a, b):
    return [name for name, array in a.arrays().items() if not np.array_equal(array, b.arrays()[name])]


def test_the_vehicle_keeps_nearer_to_the_path_and_errors_stay_errors(scenario, log):
    free = skyarm.run(dataclasses.replace(scenario, pause=None))
    assert not free.path_time.size
    off, own = (path_distance(each.tip, each.tip_reference).max() for each in (free, log))
    assert own < 0.6 * off
    # against the reference as it is commanded the lag counts in full
    np.testing.assert_array_equal(log.tip_reference, free.tip_reference)
    np.testing.assert_array_equal(log.position_held, free.position_held)
    error = np.linalg.norm(log.tip - log.tip_reference, axis=1).max()
    assert error > 2.0 * np.linalg.norm(free.tip - free.tip_reference, axis=1).max()
    lag = log.time - log.path_time
    assert lag.max() > 0.3
    assert score(log, ("reference_lag_max",))["reference_lag_max"] == lag.max()


def test_time_never_runs_backwards_and_changes_its_rate_no_faster_than_it_may(log, states):
    rate = np.diff(log.path_time) * 200.0
    assert -1e-12 < rate.min() < 0.5
    assert rate.max() < 1.0 + 1e-12
    change = np.array([state.acceleration for state in states])
    assert 0.4 < np.abs(change).max() <= 0.5 + 1e-12
    places, rates = (np.array([getattr(state, name) for state in states]) for name in ("place", "rate"))
    np.testing.assert_allclose(np.gradient(places)[1:-1], rates[1:-1], atol=2e-4)
    inside = (rates[1:-1] > 1e-6) & (rates[1:-1] < 1.0 - 1e-6)
    np.testing.assert_allclose(np.gradient(rates, 1 / 200)[1:-1][inside], change[1:-1][inside], atol=0.06)
    np.testing.assert_array_equal(places / 200.0, log.path_time[: len(places)])


def test_what_the_law_is_told_are_derivatives_by_the_flight_s_time(scenario, states):
    # published in each period, so that neighbours can be compared
    paces = Paces(dataclasses.replace(scenario, rates=dataclasses.replace(scenario.rates, reference=200)))
    first = paces.first()
    assert first.held == paces.begun_at(7.0).held == ()  # nothing is held, and nothing of it kept
    told = [paces.governed_reference(dataclasses.replace(first, now=state), 0.0) for state in states]
    for low, high, scale in (
        ("position", "velocity", 0.01),
        ("velocity", "acceleration", 0.1),
        ("acceleration", "jerk", 3.0),
    ):
        below, own = (np.array([[float(c) for c in getattr(each, name)] for each in told]) for name in (low, high))
        slope = np.gradient(below, 1 / 200, axis=0)
        assert np.abs(own).max() > 1.0
        assert np.quantile(np.abs(slope - own)[2:-2], 0.95) < scale
    moved = [float(c) for c in told[400].position]
    np.testing.assert_array_equal(moved, [float(c) for c in scenario.reference.at(states[400].place / 200.0).position])


def test_a_pause_stretches_the_time_of_a_plan(scenario):
    """By points on a straight line the plan's time is the line; what the law is told stands there."""
    plan = PathTime(points=tuple(0.05 * (k - 2) + 0.1 for k in range(12)), step=0.1)
    rates = dataclasses.replace(scenario.rates, reference=200)
    paces = Paces(dataclasses.replace(scenario, path_time=plan, rates=rates, duration=0.7))
    clock = dataclasses.replace(paces.first(), now=dataclasses.replace(paces.first().now, place=60.0, rate=0.5))
    assert paces.path_time(clock) == pytest.approx(0.1 + 0.5 * 0.3)
    told, planned = paces.governed_reference(clock, 60.0), scenario.reference.at(0.25)
    assert [*told.position] == pytest.approx([*planned.position])
    assert [*told.velocity] == pytest.approx([*(planned.velocity * 0.25)])


def test_a_rotor_s_thrust_is_the_square_of_its_speed(scenario):
    paces = Paces(scenario)
    clock = paces.first()
    half = dataclasses.replace(clock, now=dataclasses.replace(clock.now, rate=0.5))
    measurement = blank_measurement(2, 4)
    told = hover((0.0, 0.0, 0.0), joints=(0.0, 0.0))
    vehicle = scenario.controller.par.model.vehicle
    # between 0.9 and 1 of a rotor's thrust the rate falls from 1 to 0; the others idle
    for share, sign in ((0.95, 0.0), (0.93, 1.0), (0.97, -1.0)):
        speeds = [0.1 * rotor.max_speed for rotor in vehicle.rotors]
        speeds[2] = math.sqrt(share) * vehicle.rotors[2].max_speed
        command = Command(rotor_speeds=tuple(speeds), efforts=(0.0, 0.0))
        after = paces.following(half, 0.0, measurement, told.at(0.0), command).now
        assert after.rate - 0.5 == pytest.approx(sign * 20.0 * min(0.5, 5.0 * 0.2) / 200**2, abs=1e-9)


def test_along_the_normal_of_a_push_nothing_is_waited_for(scenario):
    paces = Paces(dataclasses.replace(scenario, pause=PathPause(error=0.05)))
    clock = paces.first()
    told, idle = hover((0.0, 0.0, 0.0), joints=(0.0, 0.0)).at(0.0), Command(rotor_speeds=(0.0,) * 4, efforts=(0.0,) * 2)
    tip = tip_at(scenario.controller.par.model.vehicle, Vec3(0.0, 0.0, 0.0), LEVEL, (0.0, 0.0))
    measurement = dataclasses.replace(blank_measurement(2, 4), position=Vec3(0.3, 0.0, 0.0), quaternion=LEVEL)
    told = dataclasses.replace(told, tip=tuple(tip))
    for push, slower in (((), True), ((1.0, 0.1, -1.0, 0.0, 0.0), False), ((0.0, 0.1, -1.0, 0.0, 0.0), True),
                         ((1.0, 0.1, 0.0, 1.0, 0.0), True)):  # fmt: skip
        after = paces.following(clock, 0.0, measurement, dataclasses.replace(told, push=push), idle)
        assert (after.now.jerk < 0.0) is slower


def test_the_law_is_told_the_pace_of_the_last_period_in_which_the_reference_was_published(scenario):
    paces = Paces(dataclasses.replace(scenario, pause=PathPause(error=0.05)))
    far = dataclasses.replace(blank_measurement(2, 4), position=Vec3(0.4, 0.0, 0.0))
    told, idle = hover((0.0, 0.0, 0.0), joints=(0.0, 0.0)).at(0.0), Command(rotor_speeds=(0.0,) * 4, efforts=(0.0,) * 2)
    clock, paced = paces.first(), []
    for k in range(10):
        paced.append(clock.now)
        assert paces.held_pace(clock, float(k)) == paced[k - k % 4]
        clock = paces.following(clock, float(k), far, told, idle)
    assert paced[9].rate < paced[8].rate < paced[4].rate


def test_a_slow_loop_keeps_the_rate_between_none_and_one(scenario):
    # at 5 Hz the rate's own loop would swing
    paces = Paces(dataclasses.replace(scenario, pause=PathPause(error=0.05, acceleration=50.0)))
    paces._rate = 5.0
    clock, told, rates = paces.first(), hover((0.0, 0.0, 0.0), joints=(0.0, 0.0)).at(0.0), []
    idle = Command(rotor_speeds=(0.0,) * 4, efforts=(0.0, 0.0))
    for k in range(60):
        away = Vec3(1.0 if k % 20 < 10 else 0.0, 0.0, 0.0)
        measurement = dataclasses.replace(blank_measurement(2, 4), position=away)
        following = paces.following(clock, float(k), measurement, told, idle)
        assert following.now.place >= clock.now.place
        clock = following
        rates.append(clock.now.rate)
    assert 0.0 == min(rates) < max(rates) == 1.0


def test_python_sessions_and_batches_fly_the_same_bits(scenario, log):
    short = run_in_python(dataclasses.replace(scenario, duration=0.9))
    assert short.time[-1] - short.path_time[-1] > 0.0
    arrays = log.arrays()
    assert [name for name, a in short.arrays().items() if not np.array_equal(a, arrays[name][: len(a)])] == []
    session = skyarm.Session(scenario)
    for _ in range(250):
        session.step()
    clock = session.now.clock
    row = episode_inputs(scenario).row_at(250, session.now)
    assert row.path_time == clock.now.place / 200.0 == log.path_time[250]
    held = session.snapshot()
    session.step()
    session.restore(held)
    assert same(session.run(), log) == []


@pytest.mark.thorough
def test_a_batch_is_a_loop_of_single_flights(scenario, log):
    masses = np.array([0.0, 0.1])
    found = Batch(scenario, [MASS], bit_exact=True, log_every=1, metrics=["reference_lag_max"], effort=0).fly(
        {MASS: masses}
    )
    for lane, mass in enumerate(masses):
        alone = skyarm.run(with_numbers(scenario, {MASS: float(mass)}))
        np.testing.assert_array_equal(found.log.state.position.x[lane], alone.position[:, 0])
        assert found.metrics["reference_lag_max"][lane] == (alone.time - alone.path_time).max()
    assert same(skyarm.replay(log), log) == []


@pytest.mark.thorough
def test_a_plan_and_a_pause_go_together():
    planned = flight({"tilt": 0.3, "reserve": 0.4}, 3.0)
    both = flight({"tilt": 0.3, "reserve": 0.4, "pause_error": 10.0}, 3.0)
    assert planned.path_time == both.path_time
    assert planned.path_time is not None
    a, b = skyarm.run(planned), skyarm.run(both)
    # bounds that are never met: the plan alone, but for what rounds otherwise
    np.testing.assert_allclose(b.path_time, a.path_time, atol=1e-9)
    np.testing.assert_allclose(b.position, a.position, atol=1e-6)
    tight = skyarm.run(flight({"tilt": 0.3, "reserve": 0.4, "pause_error": 0.03}, 3.0))
    assert (tight.path_time <= a.path_time + 1e-9).all()
    assert (a.path_time - tight.path_time).max() > 0.05


@pytest.mark.parametrize(
    ("error", "thrust", "rate"),
    [(0.0, 0.0, 1.0), (0.05, 0.8, 1.0), (0.075, 0.5, 0.5), (0.1, 0.5, 0.0), (0.3, 0.5, 0.0), (0.0, 0.9, 0.5),
     (0.0, 1.0, 0.0), (0.0, 1.2, 0.0), (0.0625, 0.95, 0.25)],
)  # fmt: skip
def test_the_rate_falls_from_one_at_a_bound_to_none(error, thrust, rate):
    assert PathPause(error=0.05, thrust=0.8).rate(error, thrust) == pytest.approx(rate)
    assert PathPause(error=0.05).rate(error, 5.0) == pytest.approx(min(max(2.0 - error / 0.05, 0.0), 1.0))
    assert PathPause(thrust=0.8).rate(9.0, thrust) == pytest.approx(min(max((1.0 - thrust) / 0.2, 0.0), 1.0))


@pytest.mark.parametrize("bounds", [{"thrust": 1.2}, {"thrust": 1.0}, {"thrust": 0.0}, {"error": 0.0}])
def test_bounds_that_would_stop_the_reference_for_good_are_refused(bounds):
    (name,) = bounds
    with pytest.raises(ValueError, match=rf"reference\.governor\.pause\.{name} = .*must be (above 0|below 1)"):
        PathPause(**bounds)


def test_without_bounds_there_is_no_clock(scenario):
    free = flight({"tilt": 0.6})
    assert free.pause is None
    assert first_loop_state(free).clock == ()
    # one that takes over in flight begins at the flight's time
    before = dataclasses.replace(first_loop_state(free), ticks=37.0)
    first = first_loop_state(scenario)
    clock = carry_over(first, before, (), clock_of_change(scenario, first, before, anew=False)).clock
    assert (clock.now.place, clock.now.rate, clock.held.place) == (37.0, 1.0, 37.0)
    with pytest.raises(skyarm.ScenarioError, match=r"pause_eror: is no option of a governor|pause_eror.*unknown"):
        flight({"pause_eror": 0.1})


def test_an_infinite_bound_says_never_in_a_file():
    limits = {"pause_error": math.inf, "pause_thrust": math.inf, "joint_speed": math.inf}
    assert options_from(limits) == GovernorOptions()
    with pytest.raises(ValueError, match=r"pause_acceleration = inf: must be a finite number"):
        options_from({"pause_acceleration": math.inf})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pause_error": 0.0}, "reference.governor.pause_error = 0.0: must be above 0"),
        ({"pause_error": math.nan}, "reference.governor.pause_error = nan: must be a number"),
        ({"pause_thrust": 1.0}, "reference.governor.pause_thrust = 1.0: must be below 1"),
        ({"pause_thrust": -0.1}, "reference.governor.pause_thrust = -0.1: must be above 0"),
        ({"pause_acceleration": 0.0}, "reference.governor.pause_acceleration = 0.0: must be above 0"),
        ({"pause_error": "far"}, "reference.governor.pause_error = 'far': must be a"),
    ],
)
def test_a_pause_that_cannot_be_gets_one_line(options, message):
    with pytest.raises(skyarm.ScenarioError) as caught:
        flight(options)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
