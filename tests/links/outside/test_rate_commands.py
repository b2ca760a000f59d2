"""Rate set points give the law's torque and acceleration through the loop that they
invert.
"""

import dataclasses
import math

import numpy as np
import pytest

from skyarm.algebra import Force, Quaternion, Vec3
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.drive import friction
from skyarm.dynamics.actuators.rotor import rotor_forces
from skyarm.dynamics.array_front import forward_dynamics
from skyarm.links.autopilots.effectiveness import highest_thrust, turning_inertia
from skyarm.links.autopilots.px4_parameters import (
    rate_bandwidth,
    rate_gains,
    torque_of_signal,
)
from skyarm.links.outside.outside_law import LoopSettings
from skyarm.links.outside.rate_commands import (
    GuidedRateLoop,
    IdealRateLoop,
    PidRateLoop,
    angular_acceleration,
    rotor_wrench,
)
from skyarm.links.outside.rate_settings import NAMES, px4_rate_loop
from skyarm.reference import hover
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle.vehicle_files import load_vehicle

BANDWIDTH = (17.0, 13.0, 5.0)


def example(name, seed):
    """Vehicle's model, a random measurement, rotor speeds and efforts."""
    rng = np.random.default_rng(seed)
    model = Model(vehicle=load_vehicle(name), gravity=9.81)
    n, rotors = model.vehicle.n, len(model.vehicle.rotors)
    q = rng.normal(size=4)
    measured = Measurement(
        time=0.0,
        position=Vec3(*rng.normal(size=3).tolist()),
        quaternion=Quaternion(*(q / np.linalg.norm(q)).tolist()),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(*rng.normal(size=3).tolist()),
        specific_force=Vec3(0.0, 0.0, 9.81),
        joints=tuple(rng.normal(size=n).tolist()),
        joint_rates=tuple(rng.normal(size=n).tolist()),
        rotor_speeds=(0.0,) * rotors,
    )
    speeds = tuple(
        rng.uniform(0.3, 0.9, rotors)
        * [float(r.max_speed) for r in model.vehicle.rotors]
    )
    return (
        model,
        measured,
        tuple(map(float, speeds)),
        tuple(rng.uniform(-0.05, 0.05, n).tolist()),
    )


def plant_acceleration(model, measured, still, efforts):
    """Angular and joint accelerations of the plant's own equations of motion under a
    wrench of the rotors.
    """
    vehicle = model.vehicle
    rows = zip(vehicle.links, measured.joint_rates, efforts, strict=True)
    efforts = [effort - friction(link.joint, rate, rate) for link, rate, effort in rows]
    R = np.array(
        [[float(c) for c in row] for row in measured.quaternion.rotation().rows]
    )
    force = [
        *(R @ np.array([float(c) for c in still.force])),
        *(float(c) for c in still.torque),
        *efforts,
    ]
    moving = [*measured.velocity, *measured.rate, *measured.joint_rates]
    found = forward_dynamics(
        vehicle,
        [*measured.position],
        [*measured.quaternion],
        measured.joints,
        moving,
        force,
        gravity=model.gravity,
    )
    return found[3:6], found[6:]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_ideal_rate_loop_gives_the_acceleration_of_the_law(seed):
    model, measured, speeds, efforts = example("hummingbird_arm2", seed)
    loop = IdealRateLoop(bandwidth=BANDWIDTH)
    command = Command(rotor_speeds=speeds, efforts=efforts)
    zero = Vec3(0.0, 0.0, 0.0)
    reference = hover((0.0, 0.0, 1.0), joints=(0.0,) * model.vehicle.n).at(0.0)
    _, found = LoopSettings(
        period=0.005, rate_loop=loop, full_thrust=20.0, center=zero
    ).set_point(model, zero, measured, reference, command)
    given = np.array(BANDWIDTH) * (
        np.array([*found.rates]) - np.array([*measured.rate])
    )
    still = rotor_forces(
        model.vehicle.rotors, speeds, Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0)
    )
    expected, _ = plant_acceleration(model, measured, still, efforts)
    assert given == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_behind_an_attitude_loop_that_integrates_rates_the_acceleration_is_the_laws():
    """A body of one axis each under ArduPilot's loop: desired angle from the rates,
    rate set point from both.
    """
    gain, dt = np.array([4.5, 3.0, 6.0]), 1e-3
    loop = GuidedRateLoop(bandwidth=BANDWIDTH, gain=tuple(gain.tolist()))
    memory, angle, desired, rate = (
        loop.begin(Vec3(1.0, 2.0, 3.0)),
        np.zeros(3),
        np.zeros(3),
        np.zeros(3),
    )
    for k in range(400):
        wanted = np.array([3.0, -2.0, 1.0]) * np.cos(0.02 * k)
        memory, error = loop.rate_error(
            memory, Vec3(0.0, 0.0, 0.0), Vec3(*wanted.tolist()), dt
        )
        command = rate + np.array([*error])
        given = np.array(BANDWIDTH) * (command + gain * (desired - angle) - rate)
        assert given == pytest.approx(wanted, rel=1e-9, abs=1e-9)
        desired, angle, rate = (
            desired + command * dt,
            angle + rate * dt,
            rate + given * dt,
        )
    assert np.abs(desired - angle).min() > 5e-3


def test_servos_move_the_joints_as_their_references_do():
    model, measured, speeds, efforts = example("hexarotor12_arm5", 4)
    assert model.vehicle.drives
    expected, joints = plant_acceleration(
        model, measured, rotor_wrench(model.vehicle, speeds), efforts
    )
    # references with the accelerations that these joint torques give
    reference = hover((0.0, 0.0, 1.0), joints=(0.0,) * model.vehicle.n).at(0.0)
    reference = dataclasses.replace(
        reference, joint_accelerations=tuple(joints.tolist())
    )
    found = angular_acceleration(
        model, measured, reference, rotor_wrench(model.vehicle, speeds), efforts
    )
    assert [*found] == pytest.approx(expected.tolist(), rel=1e-8, abs=1e-8)


def test_the_wrench_is_that_of_the_plants_rotors_in_still_air():
    vehicle = load_vehicle("tilted_hexarotor")
    speeds = [300.0, 320.0, 290.0, 310.0, 305.0, 280.0]
    expected = rotor_forces(
        vehicle.rotors, speeds, Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0)
    )
    found = rotor_wrench(vehicle, speeds)
    assert isinstance(found, Force)
    for a, b in ((found.force, expected.force), (found.torque, expected.torque)):
        assert [*map(float, a)] == pytest.approx([*map(float, b)], rel=1e-12, abs=1e-12)


def test_a_pid_rate_loop_applies_the_torque_of_the_law():
    """A PID loop in the test, with the gains of the record, gives at each instant what
    was asked for.
    """
    p, i, d, most = (
        (0.12, 0.1, 0.05),
        (0.2, 0.15, 0.02),
        (0.004, 0.003, 0.0),
        (0.5, 0.5, 0.1),
    )
    loop = PidRateLoop(proportional=p, integral=i, derivative=d, limit=most)
    dt, t = 0.004, 0.0
    integral = loop.begin(Vec3(0.05, -0.02, 0.0))
    own = np.array([0.05, -0.02, 0.0])
    for _ in range(2500):
        torque = np.array(
            [0.05 + 0.2 * np.sin(3 * t), -0.02 + 0.1 * np.cos(7 * t), 0.01]
        )
        turning = np.array([np.sin(5 * t), 2.0, -1.0])
        integral, error = loop.rate_error(integral, Vec3(*torque), Vec3(*turning), dt)
        e = np.array([*map(float, error)])
        applied = np.array(p) * e + own - np.array(d) * turning
        assert applied == pytest.approx(torque, abs=1e-12)
        own = np.clip(own + np.array(i) * e * dt, -np.array(most), most)
        t += dt
    # a constant torque has gone to the integral
    assert own[2] == pytest.approx(0.01, rel=0.05)


def test_the_integral_ends_at_its_limit():
    loop = PidRateLoop(
        proportional=(0.1,) * 3,
        integral=(1.0,) * 3,
        derivative=(0.0,) * 3,
        limit=(0.02,) * 3,
    )
    integral = loop.begin(Vec3(0.05, -0.05, 0.0))
    assert [*integral] == [0.02, -0.02, 0.0]
    for _ in range(100):
        integral, error = loop.rate_error(
            integral, Vec3(0.1, -0.1, 0.0), Vec3(0.0, 0.0, 0.0), 0.01
        )
    assert [*integral] == [0.02, -0.02, 0.0]
    assert [*error] == pytest.approx([0.8, -0.8, 0.0])


def test_thrust_is_a_share_of_the_highest():
    model, measured, _, efforts = example("hummingbird_arm2", 1)
    vehicle = model.vehicle
    full = sum(highest_thrust(vehicle))
    speeds = tuple(0.5 * float(rotor.max_speed) for rotor in vehicle.rotors)
    zero = Vec3(0.0, 0.0, 0.0)
    reference = hover((0.0, 0.0, 1.0), joints=(0.0,) * vehicle.n).at(0.0)
    loop = IdealRateLoop(bandwidth=BANDWIDTH)
    command = Command(rotor_speeds=speeds, efforts=efforts)
    _, found = LoopSettings(
        period=0.005, rate_loop=loop, full_thrust=full, center=zero
    ).set_point(model, zero, measured, reference, command)
    assert found.thrust == pytest.approx(0.25)
    _, found = LoopSettings(
        period=0.005, rate_loop=loop, full_thrust=0.1 * full, center=zero
    ).set_point(model, zero, measured, reference, command)
    assert found.thrust == 1.0


def test_torques_are_about_the_point_that_the_autopilot_allocates_about():
    """The torque about the centre of mass: a vertical force through it has none."""
    model, measured, speeds, efforts = example("hummingbird_arm2", 2)
    loop = PidRateLoop(
        proportional=(1.0,) * 3,
        integral=(0.0,) * 3,
        derivative=(0.0,) * 3,
        limit=(0.0,) * 3,
    )
    reference = hover((0.0, 0.0, 1.0), joints=(0.0,) * model.vehicle.n).at(0.0)
    command = Command(rotor_speeds=speeds, efforts=efforts)
    zero, center = Vec3(0.0, 0.0, 0.0), Vec3(0.03, -0.02, 0.1)
    torques = []
    for point in (zero, center):
        _, found = LoopSettings(
            period=0.005, rate_loop=loop, full_thrust=20.0, center=point
        ).set_point(model, zero, measured, reference, command)
        torques.append(np.array([*found.rates]) - np.array([*measured.rate]))
    force = np.array([float(c) for c in rotor_wrench(model.vehicle, speeds).force])
    assert torques[0] - torques[1] == pytest.approx(
        np.cross([*center], force), abs=1e-12
    )


def test_px4s_loop_follows_from_its_parameters():
    vehicle = load_vehicle("hummingbird_arm2_rotors")
    torque = torque_of_signal(vehicle)
    set_by_us = px4_rate_loop(vehicle, {})
    assert set_by_us.proportional[0] == pytest.approx(
        rate_bandwidth(vehicle) * turning_inertia(vehicle)[0], rel=1e-9
    )
    assert set_by_us.limit == pytest.approx([0.3 * each for each in torque])
    read = px4_rate_loop(vehicle, dict.fromkeys(NAMES, 2.0) | {"MC_PITCHRATE_I": 0.5})
    assert read.proportional == pytest.approx([4.0 * each for each in torque])
    assert read.integral[1] == pytest.approx(torque[1])
    assert read.derivative == pytest.approx([4.0 * each for each in torque])
    assert {name for name in rate_gains(vehicle) if "RATE_MAX" not in name} <= set(
        NAMES
    )


def test_a_loop_without_a_proportional_gain_is_refused():
    with pytest.raises(ValueError, match=r"rate_loop.proportional\[1\] = 0.0"):
        PidRateLoop(
            proportional=(1.0, 0.0, 1.0),
            integral=(0.0,) * 3,
            derivative=(0.0,) * 3,
            limit=(0.0,) * 3,
        )
    with pytest.raises(ValueError, match=r"rate_loop.bandwidth\[0\] = -1.0"):
        IdealRateLoop(bandwidth=(-1.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("name", "value"),
    [("MC_ROLLRATE_P", 0.0), ("MC_YAWRATE_K", math.nan), ("MC_PR_INT_LIM", -1.0)],
)
def test_a_gain_of_px4_that_has_no_inverse_is_named(name, value):
    with pytest.raises(
        ValueError, match=f"PX4's {name} = {value}: must be a finite gain"
    ):
        px4_rate_loop(load_vehicle("hummingbird"), {name: value})
