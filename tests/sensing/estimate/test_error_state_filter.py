"""The error-state filter: against a dense filter that shares no code, and what a flight
on it must show.
"""

from __future__ import annotations

import dataclasses
import itertools
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.dynamics.actuators import Command
from skyarm.plant.interface import Truth
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.sensing.estimate.error_state_filter import ErrorStateFilter
from skyarm.sensing.estimate.filter_constants import FilterMemory
from skyarm.sensing.estimate.filter_models import modelled_force
from skyarm.sensing.sensor_kinds import Encoders, Imu, Pose
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.simulate.loop import run_in_python
from skyarm.vehicle.vehicle_records import BodyDrag
from support.flights import GPS, estimated, with_satellites
from support.one_vehicle import acceleration
from support.vehicles import tumbling

PERIOD = 0.005


@cache
def recorded(periods: int = 120):
    """Readings as the sensors made them, and what the filter held after each period."""
    session = skyarm.Session(estimated(), machine_code=False)
    held = []
    for _ in range(periods):
        session.step()
        held.append(session.now)
    return held


def dense_filter(inertial, poses, start, delay):
    """A textbook filter on readings in the order in which they were taken, with dense
    matrices; errors in world axes.

    Returns belief and covariance at each instant, and the belief carried on by
    ``delay`` further readings.
    """
    gyro, gyro_walk, acc, acc_walk, sigma = 0.005, 1e-4, 0.02, 1e-3, 0.005
    p, v, R = np.array(start.position), np.zeros(3), rotation(start.quaternion)
    bg, ba = np.zeros(3), np.zeros(3)
    P = np.diag(
        [sigma**2] * 3 + [0.1**2] * 3 + [sigma**2] * 3 + [0.01**2] * 3 + [0.1**2] * 3
    )
    down = np.array([0.0, 0.0, -9.8])

    def carried(p, v, R, a, b):
        dt = b.time - a.time
        w = 0.5 * (np.array(a.rate) + np.array(b.rate)) - bg
        after = R * Rotation.from_rotvec(w * dt)
        f = 0.5 * (
            R.apply(np.array(a.specific_force) - ba)
            + after.apply(np.array(b.specific_force) - ba)
        )
        return p + v * dt + 0.5 * (f + down) * dt**2, v + (f + down) * dt, after, f

    found = []
    for k, (a, b) in enumerate(itertools.pairwise(inertial)):
        dt = b.time - a.time
        before = R.as_matrix()
        p, v, R, f = carried(p, v, R, a, b)
        F = np.eye(15)
        F[0:3, 3:6] = np.eye(3) * dt
        F[3:6, 12:15], F[6:9, 9:12] = -before * dt, -before * dt
        F[3:6, 6:9] = (
            -np.array([[0, -f[2], f[1]], [f[2], 0, -f[0]], [-f[1], f[0], 0]]) * dt
        )
        Q = np.repeat([0.0, acc**2, gyro**2, gyro_walk**2, acc_walk**2], 3) * dt
        P = F @ P @ F.T + np.diag(Q)
        for pose in poses:
            if abs(pose.time - b.time) < 1e-9:
                H = np.zeros((6, 15))
                H[0:3, 0:3], H[3:6, 6:9] = np.eye(3), np.eye(3)
                turn = (rotation(pose.quaternion) * R.inv()).as_quat()
                z = np.concatenate(
                    [np.array(pose.position) - p, 2.0 * np.sign(turn[3]) * turn[:3]]
                )
                S = H @ P @ H.T + sigma**2 * np.eye(6)
                K = P @ H.T @ np.linalg.inv(S)
                e = K @ z
                P = (np.eye(15) - K @ H) @ P
                p, v, R = p + e[0:3], v + e[3:6], Rotation.from_rotvec(e[6:9]) * R
                bg, ba = bg + e[9:12], ba + e[12:15]
        ahead = (p, v, R)
        for c, d in zip(
            inertial[k + 1 :], inertial[k + 2 : k + 2 + delay], strict=False
        ):
            ahead = carried(*ahead, c, d)[:3]
        found.append((b.time, (p, v, R, bg, ba), P, ahead))
    return found


def rotation(q) -> Rotation:
    w, x, y, z = q
    return Rotation.from_quat([x, y, z, w])


def test_it_is_the_textbook_filter_on_readings_in_the_order_of_their_instants():
    """The delay is made good exactly: belief, biases and covariance of a filter that
    never had one.
    """
    held = recorded()
    inertial = [now.agent.estimate.inertial[-1] for now in held]
    poses = [now.agent.estimate.aiding[0][-1] for now in held]
    late = {pose.time: pose for pose in poses if pose.time > 0.0}
    assert len(late) == 29  # 50 Hz over 0.59 s
    delay = 2
    wanted = {
        round(t / PERIOD): rest
        for t, *rest in dense_filter(inertial, [*late.values()], poses[0], delay)
    }
    for k in (3, 6, 50, 119):
        memory = held[k].agent.estimate
        (p, v, R, bg, ba), P, ahead = wanted[round(memory.time / PERIOD)]
        belief = memory.belief
        np.testing.assert_allclose(np.array(belief.position), p, atol=1e-10)
        np.testing.assert_allclose(np.array(belief.velocity), v, atol=1e-10)
        assert (rotation(belief.quaternion) * R.inv()).magnitude() < 1e-10
        np.testing.assert_allclose(np.array(belief.gyro_bias), bg, atol=1e-11)
        np.testing.assert_allclose(np.array(belief.accelerometer_bias), ba, atol=1e-10)
        found = np.array(
            [[*row, *[0.0] * (15 - len(row))] for row in memory.covariance]
        )
        np.testing.assert_allclose(found, np.tril(P), atol=1e-12)
        np.testing.assert_allclose(memory.deviations, np.sqrt(np.diag(P)), rtol=1e-9)
    assert ahead is not None


def test_readings_arrive_as_many_periods_late_as_stated_and_none_is_used_twice():
    held = recorded()
    for k, now in enumerate(held):
        newest = now.agent.estimate.aiding[0][-1].time
        # read at 50 Hz, 10 ms on its way; until the first has come that one is seen
        assert newest == pytest.approx(max(0.0, (k - 2) // 4 * 4 * PERIOD), abs=1e-12)
    memory = held[-1].agent.estimate
    assert memory.taken + memory.refused == 29
    assert memory.time == pytest.approx(117 * PERIOD)


def test_an_inertial_unit_as_late_as_the_pose_leaves_every_pose_to_be_used():
    late = {
        "sensors__imu__latency": 0.005,
        "sensors__mocap__latency": 0.005,
        "estimator__delay_periods": 1,
    }
    memory = flown(estimated(**late), 0.5)
    assert memory.taken + memory.refused == 24


def test_the_law_is_told_the_belief_carried_to_the_present():
    """With a lag of two periods, and the present as near the truth as its deviations
    say.
    """
    session = skyarm.Session(estimated(), machine_code=False)
    for _ in range(60):
        session.step()
    told, truth, memory = session.measurement, session.state, session.now.agent.estimate
    assert told.time == pytest.approx(60 * PERIOD)
    off = np.abs(np.array(told.position) - np.array(truth.position))
    assert np.all(off < 5 * np.array(memory.deviations[:3]))
    assert np.all(off > 0.0)
    np.testing.assert_allclose(told.rotor_speeds, truth.rotor_speeds, atol=15.0)
    assert np.abs(np.subtract(told.joints, truth.joints)).max() < 3e-3


def test_joints_are_known_where_the_inertial_unit_is_slow_and_lost_for_a_while():
    """Readings at 100 Hz, none from 0.3 s to 0.35 s: the encoders come every period all
    the same.
    """
    imu = {
        "sensors__imu__frequency": 100.0,
        "sensors__imu__dropouts": {"intervals": [[0.3, 0.35]]},
    }
    session = skyarm.Session(estimated(**imu), machine_code=False)
    off = []
    for _ in range(90):
        told, truth = session.measurement, session.state
        joints, rates = (
            np.subtract(told.joints, truth.joints),
            np.subtract(told.joint_rates, truth.joint_rates),
        )
        off.append((np.abs(joints).max(), np.abs(rates).max()))
        session.step()
    # as without either: encoders in steps of 1.5 mrad are off by half of it, and what
    # that makes of rates
    worst = np.max(off, axis=0)
    assert worst[0] < 1e-3
    assert worst[1] < 0.35


def same(a: skyarm.Log, b: skyarm.Log) -> bool:
    return all(
        np.array_equal(x, y)
        for x, y in zip(a.arrays().values(), b.arrays().values(), strict=True)
    )


@pytest.mark.parametrize("force", ["measured", "modelled"])
def test_machine_code_flies_it_as_floats_do_to_the_last_bit(force):
    scenario = estimated(
        duration=0.3, estimator__force=force, sensors__mocap__dropouts={"share": 0.3}
    )
    assert same(skyarm.run(scenario), run_in_python(scenario))


def test_lanes_are_flights_of_their_own_and_every_number_is_a_path():
    """Numbers that are structure by default become data where a path names them."""
    paths = {
        "sensors.imu.gyro.density": [0.005, 0.02],
        "sensors.imu.accelerometer.scale": [0.0, 0.01],
        "sensors.mocap.dropouts.share": [0.0, 0.4],
        "sensors.encoders.bits": [12.0, 9.0],
        "estimator.gyro": [0.005, 0.02],
        "estimator.joint_bandwidth": [300.0, 0.0],
    }
    absent = estimated(duration=0.5)
    with pytest.raises(ValueError, match=r"dropouts\.share: is 0 in this scenario"):
        skyarm.Batch(absent, ["sensors.mocap.dropouts.share"])
    scenario = skyarm.with_numbers(
        absent, {path: column[0] for path, column in paths.items()}
    )
    batch = skyarm.Batch(scenario, list(paths), bit_exact=True, log_every=1)
    outcome = batch.fly(
        {path: np.array(column) for path, column in paths.items()}, seed=3
    )
    assert outcome.log is not None
    for lane in (0, 1):
        one = skyarm.with_numbers(
            scenario, {path: column[lane] for path, column in paths.items()}
        )
        log = skyarm.run(dataclasses.replace(one, episode=lane))
        assert np.array_equal(
            np.asarray(outcome.log.state.position.x)[lane], log.position[:, 0]
        )
        assert np.array_equal(
            np.asarray(outcome.log.state.joints[1])[lane], log.joints[:, 1]
        )


def flown(scenario: skyarm.Scenario, seconds: float) -> FilterMemory:
    session = skyarm.Session(scenario, machine_code=False)
    for _ in range(round(seconds / PERIOD)):
        session.step()
    return session.now.agent.estimate


def test_readings_that_do_not_come_are_not_used():
    """In the interval from 0.2 s to 0.4 s ten of 50 Hz are missing, and the uncertainty
    grows.
    """
    intervals = {"intervals": [[0.2, 0.4]]}
    whole, gap = (
        flown(estimated(), 0.405),
        flown(estimated(sensors__mocap__dropouts=intervals), 0.405),
    )
    assert whole.taken - gap.taken == 10
    assert gap.deviations[0] > 1.5 * whole.deviations[0]
    assert gap.aiding[0][-1].time == pytest.approx(0.18)


def test_an_impossible_reading_is_refused_and_one_that_stays_is_taken_in_the_end():
    """Motion capture jumps by 0.5 m at 0.3 s: refused at first, then the covariance has
    grown enough to take it.
    """
    jumped = {"at": 0.3, "sensors.mocap.position.bias": [0.5, 0.0, 0.0]}
    scenario = estimated(
        sensors__mocap__position={"sigma": 0.005, "bias": [0.0, 0.0, 0.0]}
    )
    session = skyarm.Session(scenario, machine_code=False)
    for _ in range(60):
        session.step()
    before = session.now.agent.estimate
    session.change(
        {"sensors.mocap.position.bias.0": jumped["sensors.mocap.position.bias"][0]}
    )
    for _ in range(20):
        session.step()
    soon = session.now.agent.estimate
    assert before.refused == 0
    assert soon.refused >= 3
    assert abs(soon.belief.position.x - before.belief.position.x) < 0.05
    for _ in range(100):
        session.step()
    late = session.now.agent.estimate
    assert abs(late.aiding[0][-1].position.x - late.belief.position.x) < 0.1
    assert late.taken > soon.taken


def test_without_a_heading_its_uncertainty_grows_and_the_filter_says_so():
    alone = with_satellites(
        "position", estimator__first_heading=0.02, estimator__gyro=0.1
    )
    aided = with_satellites("position_heading", estimator__gyro=0.1)
    early, late, held = flown(alone, 0.3), flown(alone, 0.9), flown(aided, 0.9)
    # a noise of 0.1 rad/s/sqrt(Hz) over 0.25 s and 0.85 s: 0.05 and 0.09 rad; motion
    # tells little of it
    assert 0.04 < early.yaw_deviation < 0.055
    assert 0.07 < late.yaw_deviation < 0.1
    assert held.yaw_deviation < 0.04


def test_both_plants_fly_on_it_alike():
    """Euler steps are the same on both; the same draws, so the same readings to
    rounding.
    """
    euler = {"plant__integrator": "euler", "duration": 0.3}
    ours, theirs = (
        skyarm.run(estimated(**euler, plant__kind=kind))
        for kind in ("rigid_body", "mujoco")
    )
    np.testing.assert_allclose(theirs.position, ours.position, atol=1e-8)


def test_the_push_that_the_model_lacks_is_found():
    """A steady 1 N on a vehicle of known mass, by the modelled force; the accelerometer
    alone cannot tell it.
    """
    wind = {"mode": "force_wind", "force": [1.0, 0.0, 0.0]}
    scenario = estimated(
        duration=3.0,
        environment__wind=wind,
        estimator__force="modelled",
        estimator__push_walk=0.1,
    )
    memory = flown(scenario, 2.5)
    mass = sum(
        b.mass
        for b in (
            scenario.plant.vehicle.base,
            *(link.body for link in scenario.plant.vehicle.links),
        )
    )
    assert memory.belief.push.x * mass == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"sensors__imu": None},
            r"estimator: needs one sensor of kind 'imu' .*there are 0 of kind 'imu'",
        ),
        ({"sensors__encoders": None}, r"needs one sensor of kind 'encoders'"),
        ({"sensors__gps": GPS | {"kind": "pose"}}, r"there are 2 of kind 'pose'"),
        (
            {"estimator__delay_periods": 1},
            (
                r"delay_periods: lags 0.005 s, must be at least sensors.mocap.latency ="
                r" 0.01"
            ),
        ),
        (
            {"sensors__imu__latency": 0.015},
            (
                r"sensors.imu.latency = 0.015 s: must be at most sensors.mocap.latency"
                r" = 0.01 s, or the filter never uses"
            ),
        ),
        (
            {"sensors__imu__frequency": 100.0, "sensors__mocap__frequency": 40.0},
            r"sensors.mocap.frequency = 40 Hz: must divide that of sensors.imu, 100 Hz",
        ),
        (
            {"estimator__aiding": "compass"},
            r"aiding = 'compass': must be one of pose, position, position_heading",
        ),
        (
            {"estimator__force": "both"},
            r"force = 'both': must be one of measured, modelled",
        ),
        ({"estimator__inflation": 0.5}, r"inflation = 0.5: must be at least 1"),
        ({"estimator__gyro": -1.0}, r"gyro = -1.0: must be at least 0"),
        ({"estimator__vehicle": "x"}, r"estimator.vehicle"),
    ],
)
def test_what_it_cannot_work_with_is_refused_in_one_line(changes, words):
    with pytest.raises(ScenarioError, match=words) as refused:
        estimated(**changes)
    assert "\n" not in str(refused.value)


def test_a_vehicle_of_servos_flies_by_the_measured_force_only():
    vehicle = skyarm.load_vehicle("hexarotor12_arm5")
    sensors = {"imu": Imu(), "mocap": Pose(), "encoders": Encoders()}
    ErrorStateFilter().require_sensors(sensors, 200.0, vehicle)
    with pytest.raises(
        ValueError,
        match=(
            r"estimator.force = 'modelled': must be 'measured' for 'hexarotor12_arm5'"
        ),
    ):
        ErrorStateFilter(force="modelled").require_sensors(sensors, 200.0, vehicle)


def test_drives_of_the_scenario_alone_are_refused_too_except_one_of_its_torque():
    """The belief has none, and the law may send setpoints."""
    servo = {"kind": "position_servo", "stiffness": 1.0, "inertia": 0.01}
    estimated(plant__drives={"joint1": servo})
    estimated(plant__drives={"joint1": {"kind": "torque"}}, estimator__force="modelled")
    with pytest.raises(
        ScenarioError,
        match=r"must be 'measured' for .*, whose joint 'joint1' has a drive \(Posit",
    ):
        estimated(plant__drives={"joint1": servo}, estimator__force="modelled")


def test_the_filter_may_be_named_by_its_kind_alone():
    scenario = estimated(estimator="ekf", sensors__mocap__latency=0.0)
    assert scenario.estimator.gate == 4.5
    assert scenario.estimator.gravity is None


def test_the_present_state_is_less_its_biases_and_carried_by_each_modelled_force():
    scenario = estimated(estimator__force="modelled", duration=0.5)
    session = skyarm.Session(scenario, machine_code=False)
    for _ in range(60):
        session.step()
    # the measurement of the period to come is that of its own memory: flown one period
    # further
    told = session.measurement
    session.step()
    memory = session.now.agent.estimate
    imu, belief = memory.inertial[-1], memory.belief
    np.testing.assert_allclose(
        tuple(told.rate), tuple(imu.rate - belief.gyro_bias), atol=1e-12
    )
    np.testing.assert_allclose(
        tuple(told.specific_force),
        tuple(imu.specific_force - belief.accelerometer_bias),
        atol=1e-12,
    )
    velocity, R = np.array(belief.velocity), rotation(belief.quaternion)
    for old, new, force in zip(
        memory.inertial, memory.inertial[1:], memory.modelled[1:], strict=False
    ):
        rate = 0.5 * np.array(old.rate + new.rate) - np.array(belief.gyro_bias)
        after = R * Rotation.from_rotvec(rate * PERIOD)
        mean = 0.5 * (R.apply(np.array(force)) + after.apply(np.array(force)))
        velocity, R = (
            velocity + (mean + np.array(belief.push) - [0.0, 0.0, 9.8]) * PERIOD,
            after,
        )
    np.testing.assert_allclose(tuple(told.velocity), velocity, atol=1e-9)


def test_a_push_that_turns_with_the_base_walks_by_how_fast_it_turns():
    scenario = estimated(estimator__force="modelled")
    memory = scenario.estimator.start(scenario.plant.vehicle)
    reading = dataclasses.replace(memory.inertial[0], rate=skyarm.Vec3(0.3, -1.0, 2.0))
    belief = dataclasses.replace(memory.belief, push=skyarm.Vec3(1.0, 2.0, -3.0))
    found = scenario.estimator.added_variances(belief, reading, PERIOD)
    rate = rotation(belief.quaternion).apply(np.array(reading.rate - belief.gyro_bias))
    turning = np.cross(rate, (1.0, 2.0, -3.0))
    np.testing.assert_allclose(
        found[15:], (0.02**2 + 0.2 * turning**2) * PERIOD, rtol=1e-9
    )
    np.testing.assert_allclose(found[:6], 0.0)
    np.testing.assert_allclose(found[6:9], 0.005**2 * PERIOD)


def test_a_rotor_that_turns_backwards_pushes_the_other_way_in_the_modelled_force():
    vehicle = estimated().plant.vehicle
    rotors = tuple(
        dataclasses.replace(rotor, reversible=True) for rotor in vehicle.rotors
    )
    vehicle = dataclasses.replace(vehicle, rotors=rotors)
    still = (skyarm.Vec3(0.0, 0.0, 0.0),) * 2

    def vertical(*speeds):
        return modelled_force(
            vehicle,
            *still,
            (0.0, 0.0),
            (0.0, 0.0),
            [(w,) * 4 for w in speeds],
            (0.0, 0.0),
        ).z

    forwards = vertical(400.0, 400.0)
    assert forwards > 1.0
    assert vertical(-400.0, -400.0) == pytest.approx(-forwards)
    # of w |w| the mean of both ends: from -300 to 400 rad/s (400^2 - 300^2) / 2
    assert vertical(-300.0, 400.0) == pytest.approx(
        forwards * (400.0**2 - 300.0**2) / 2.0 / 400.0**2
    )


def test_the_modelled_force_is_the_plants_own_where_the_model_is_the_plant():
    """Through the plant's loads and its accelerations, with joint efforts, rates and
    hub drag; its wind is still.
    """
    scenario = estimated()
    world = scenario.plant
    state = dataclasses.replace(
        tumbling(world.vehicle), rotor_speeds=(480.0, 500.0, 470.0, 510.0)
    )
    efforts = (0.11, -0.07)
    around = first_surroundings(scenario, first_loop_state(scenario))
    wanted, _ = acceleration(world, state, Command(efforts=efforts), around)
    velocity = state.quaternion.rotation().apply_T(state.velocity)
    speeds = (state.rotor_speeds, state.rotor_speeds)
    found = modelled_force(
        world.vehicle,
        velocity,
        state.rate,
        state.joints,
        state.joint_rates,
        speeds,
        efforts,
    )
    np.testing.assert_allclose(tuple(found), tuple(wanted.linear), rtol=1e-9, atol=1e-9)


def test_the_modelled_force_has_the_drag_of_the_airframe():
    """As the plant has it; it slows the vehicle."""
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    still, flown = (0.0,) * 6, (400.0,) * 6
    state = dataclasses.replace(
        tumbling(vehicle), joints=still, joint_rates=still, rotor_speeds=flown
    )
    world = Truth(vehicle=vehicle, gravity=9.8)
    wanted, _ = acceleration(world, state, Command(efforts=still))
    velocity = state.quaternion.rotation().apply_T(state.velocity)
    found = modelled_force(
        vehicle, velocity, state.rate, still, still, (flown, flown), still
    )
    bare = dataclasses.replace(vehicle, drag=BodyDrag())
    without = modelled_force(
        bare, velocity, state.rate, still, still, (flown, flown), still
    )
    np.testing.assert_allclose(tuple(found), tuple(wanted.linear), rtol=1e-9, atol=1e-9)
    assert (found - without).dot(velocity) < 0.0


def test_the_modelled_force_has_the_stops_of_the_joints():
    vehicle = skyarm.load_vehicle("pelican_arm2")
    joint = vehicle.links[0].joint
    joints, still = (joint.upper + 0.005, 0.0), (0.0, 0.0)
    state = dataclasses.replace(
        tumbling(vehicle), joints=joints, joint_rates=still, rotor_speeds=(400.0,) * 4
    )
    world = Truth(vehicle=vehicle, gravity=9.8)
    wanted, _ = acceleration(world, state, Command(efforts=still))
    velocity = state.quaternion.rotation().apply_T(state.velocity)
    speeds = (state.rotor_speeds, state.rotor_speeds)
    found = modelled_force(vehicle, velocity, state.rate, joints, still, speeds, still)
    np.testing.assert_allclose(tuple(found), tuple(wanted.linear), rtol=1e-9, atol=1e-9)


def test_poses_between_two_inertial_readings_are_refused():
    """The filter corrects at readings of the inertial unit: those between would correct
    the state of another instant.
    """
    every = {"sensors__mocap__frequency": 0.0}
    taken = flown(estimated(**every), 0.5)
    assert taken.taken + taken.refused == 97.0
    with pytest.raises(skyarm.ScenarioError, match="must divide that of"):
        estimated(**every, sensors__imu__frequency=100.0)
