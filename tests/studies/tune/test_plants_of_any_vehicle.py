"""Wrong plants of any vehicle: the README's for the paper's, scaled for others; and the
flight through them.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import PERFECT_SENSORS
from skyarm.studies.compare.perturbed_plants import (
    RESERVE,
    Spread,
    arm_length,
    draw,
    spread_of,
    thrust_margin,
)
from skyarm.studies.flights import WorkRunner
from skyarm.studies.tune.candidate_flights import (
    CandidateFlights,
    CandidateResults,
    scores,
)
from skyarm.studies.tune.excitation import (
    BLOWN,
    DURATION,
    KINDS,
    STEP,
    STEPPED,
    draw_motions,
    draw_plants,
    motion,
    of_vehicle,
    tuning_flight,
    unseen_motion,
    with_lost,
)
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.world.contact import Contact, Surface

FORCE = "environment.forces.0.force_W"


def test_the_papers_vehicle_meets_the_readmes_plants():
    flight = tuning_flight(load_scenario("case3"))
    mine = draw_plants(flight, 16, seed=5)
    usual = draw(load_scenario("case3_wind"), Spread(), 16, seed=5)
    assert mine.eased == 1.0
    for path, values in usual.items():
        name = path.replace("environment.wind.force_W", FORCE)
        # the arm is 0.3 m long but for the last digits; the truth's joints have less
        # damping than the spread
        np.testing.assert_allclose(
            mine.values[name], values, rtol=0.02, atol=1e-9, err_msg=path
        )
    assert set(mine.values) == {
        path.replace("environment.wind.force_W", FORCE) for path in usual
    }


@pytest.mark.parametrize(
    "name", ["crazyflie_arm1", "hexarotor_arm6", "quadrotor_roll_arm2", "hummingbird"]
)
def test_any_vehicle_gets_plants_that_can_be_made_and_hover(name):
    flight = tuning_flight(of_vehicle(load_vehicle(name)))
    plants = draw_plants(flight, 12, seed=1)
    vehicle, weight = flight.plant.vehicle, float(flight.plant.vehicle.mass) * 9.81
    assert ("plant.payload.mass" in plants.values) == bool(vehicle.end_effector)
    for k in range(plants.count):
        with_numbers(
            flight, {path: float(values[k]) for path, values in plants.values.items()}
        )
    pulled = plants.spread.payload * 9.81 + plants.spread.wind
    assert weight + pulled <= RESERVE * 0.9 * thrust_margin(vehicle, 9.81) * weight * (
        1.0 + 1e-9
    )
    np.testing.assert_array_equal(
        draw_plants(flight, 4, seed=1).values[f"{FORCE}.x"],
        plants.values[f"{FORCE}.x"][:4],
    )


def test_load_and_wind_shrink_where_the_thrust_would_not_reach():
    vehicle = load_vehicle("hummingbird_arm2_rotors")
    weak = dataclasses.replace(
        vehicle,
        rotors=tuple(
            dataclasses.replace(r, max_speed=0.68 * float(r.max_speed))
            for r in vehicle.rotors
        ),
    )
    assert thrust_margin(weak, 9.81) == pytest.approx(
        0.68**2 * thrust_margin(vehicle, 9.81)
    )
    (whole, all_of_it), (eased, share) = (
        spread_of(vehicle, 9.81, 0.01),
        spread_of(weak, 9.81, 0.01),
    )
    assert all_of_it == 1.0
    assert 0.0 < share < 1.0
    assert (eased.payload, eased.wind) == pytest.approx(
        (share * whole.payload, share * whole.wind)
    )
    assert eased.mass == whole.mass
    assert arm_length(vehicle) == pytest.approx(0.3, rel=0.01)


@pytest.mark.parametrize("made", [motion, unseen_motion])
def test_the_flight_moves_everything_from_rest_within_the_joints_limits(made):
    vehicle = load_vehicle("octo_coaxial_two_arms")
    path = made(vehicle)
    for k, signal in enumerate((path.x, path.y, path.z, path.yaw, *path.joints)):
        _, rate, acceleration, *_ = signal.derivatives(0.0)
        assert (float(rate), float(acceleration)) == (0.0, 0.0)
        moved = [
            float(signal.derivatives(t)[0]) for t in np.linspace(0.0, STEPPED, 200)
        ]
        assert np.ptp(moved) > 0.01, k
        if k >= 4:
            joint = vehicle.links[k - 4].joint
            assert float(joint.lower) < min(moved) <= max(moved) < float(joint.upper)
    if made is unseen_motion:
        return
    jump = float(path.x.derivatives(STEPPED)[0]) - float(
        path.x.derivatives(STEPPED - 1e-9)[0]
    )
    assert jump == pytest.approx(STEP, abs=1e-6)


def test_a_scenario_keeps_its_loop_and_gets_noise_only_where_it_has_none():
    case = load_scenario("case3_wind")
    flight, own = tuning_flight(case), tuning_flight(case, own_motion=True)
    assert case.noise == PERFECT_SENSORS != flight.noise
    assert (flight.plant, flight.rates, flight.wind, flight.controller) == (
        case.plant,
        case.rates,
        case.wind,
        case.controller,
    )
    assert flight.duration == DURATION
    assert (own.reference, own.duration) == (case.reference, case.duration)
    aside = tuning_flight(case, unseen=True)
    assert aside.reference == unseen_motion(case.plant.vehicle) != flight.reference
    # once the gust of one second is over
    assert (aside.windows.steady.start, aside.windows.steady.stop) == (
        BLOWN + 2.0,
        aside.duration,
    )
    noisy = dataclasses.replace(
        case, noise=dataclasses.replace(case.noise, position=0.01)
    )
    assert tuning_flight(noisy).noise == noisy.noise
    walled = dataclasses.replace(case, world=Contact(surfaces=(Surface(name="wall"),)))
    assert tuning_flight(walled) == flight
    assert tuning_flight(walled, own_motion=True) == own
    gust = flight.forces[-1].gusts[0]
    weight = case.plant.vehicle.mass * case.plant.gravity
    assert gust.peak.norm() == pytest.approx(0.15 * weight, rel=0.01)
    assert gust.start == BLOWN


@pytest.mark.thorough
def test_joints_with_servos_are_charged_no_effort():
    flight = tuning_flight(
        of_vehicle(load_vehicle("quadrotor_roll_arm2"), "decoupled_pd")
    )
    flight = dataclasses.replace(flight, duration=1.0)
    flights = CandidateFlights(flight, (), draw_plants(flight, 2, seed=0), WorkRunner())
    flown = flights.fly("few", np.zeros((1, 0)))
    assert flown.effort.tolist() == [[0.0, 0.0]]
    assert (flown.jitter > 0.0).all()


def test_every_plant_flies_its_own_motion_and_the_kinds_take_turns():
    flight = tuning_flight(of_vehicle(load_vehicle("octo_coaxial_two_arms")))
    plants = draw_plants(flight, 12, seed=3, mixed=True)
    assert plants.kinds.tolist() == [k % len(KINDS) for k in range(12)]
    assert draw_plants(flight, 12, seed=3).kinds.tolist() == [0] * 12
    few = draw_plants(flight, 7, seed=3, mixed=True)
    moved = {path for path in plants.values if path.startswith("reference.")}
    joints = flight.plant.vehicle.n
    assert len(moved) == 3 * (4 + joints)
    for path in moved:
        np.testing.assert_array_equal(few.values[path], plants.values[path][:7])
    fastest = np.zeros(3)
    time = np.linspace(0.0, STEPPED, 200, endpoint=False)
    for k in range(12):
        path = with_numbers(
            flight, {each: float(plants.values[each][k]) for each in moved}
        ).reference
        x, y = (np.array(signal.derivatives(time)[:3]) for signal in (path.x, path.y))
        # what any of the shipped vehicles can fly
        assert np.abs([x[2], y[2]]).max() < 1.5
        if plants.kinds[k] == 0:
            away = np.hypot(x[0], y[0])[100:]
            # a circle once it is eased in
            np.testing.assert_allclose(away, away[0], rtol=1e-6)
        swung = [np.array(signal.derivatives(time)[:2]) for signal in path.joints]
        for link, (angle, _) in zip(flight.plant.vehicle.links, swung, strict=True):
            assert (
                float(link.joint.lower)
                < angle.min()
                <= angle.max()
                < float(link.joint.upper)
            )
        fastest[plants.kinds[k]] = max(
            fastest[plants.kinds[k]], *(np.abs(rate).max() for _, rate in swung)
        )
    # five joints share what two would swing: 0.25 rad each, 1.6 times it at most
    widest = max(
        plants.values[f"reference.joints.{i}.signals.1.signal.amplitude"].max()
        for i in range(joints)
    )
    assert 0.6 * 1.6 * 0.25 * 2 / 5 < widest <= 1.6 * 0.25 * 2 / 5 + 1e-9
    assert fastest[1] > 1.5 * fastest[[0, 2]].max()
    assert len(draw_motions(flight.plant.vehicle, 4, seed=3)[0]) == len(moved)


def test_an_error_of_several_kinds_is_the_mean_of_their_quantiles_not_the_largest():
    errors = np.concatenate([np.full(10, 1e-3), np.full(10, 0.1)])[None]
    errors[0, 3] = 5.0
    kinds = np.repeat([0, 1], 10)
    none = np.zeros((1, 20))
    flown = CandidateResults(
        error=errors,
        tip=errors,
        base=none,
        pull=none,
        jitter=none,
        effort=none,
        lost=none > 1.0,
        saturated=none,
        kinds=kinds,
    )
    # of ten, the greatest but one: sqrt(5 * 0.1) where the quantile takes the greatest
    assert scores(flown).error[0] == pytest.approx(np.sqrt(5.0 * 0.1))
    assert scores(dataclasses.replace(flown, kinds=0 * kinds)).error[
        0
    ] == pytest.approx(0.1)


def test_half_of_the_plants_are_those_that_candidates_lost_the_decisive_ones_first():
    flight = tuning_flight(of_vehicle(load_vehicle("crazyflie_arm1")))
    pool = draw_plants(flight, 24, seed=2, mixed=True)
    lost = np.zeros((3, 24), dtype=bool)
    lost[:, 10] = True  # by all: perhaps nothing flies it
    lost[:2, 12] = lost[:1, 20] = lost[2:, 23] = True
    lost[:, 3] = True  # is there anyway
    found = with_lost(pool, 6, lost)
    assert found.kinds.tolist() == pool.kinds[[0, 1, 2, 12, 20, 23]].tolist()
    for path, numbers in pool.values.items():
        np.testing.assert_array_equal(
            found.values[path], numbers[[0, 1, 2, 12, 20, 23]]
        )
    more = with_lost(pool, 8, lost).values["plant.payload.mass"]
    np.testing.assert_array_equal(
        more, pool.values["plant.payload.mass"][[0, 1, 2, 3, 10, 12, 20, 23]]
    )
    none = with_lost(pool, 6, lost & False)
    np.testing.assert_array_equal(
        none.values["plant.payload.mass"], pool.values["plant.payload.mass"][:6]
    )
