"""Frames, gains and parameters of ArduPilot, against torques by cross products and its
thrust curve written out.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.actuators.rotor import Rotor, push
from skyarm.links.autopilots.ardupilot_frames import (
    FRAMES,
    fitting_frame,
    rate_gains,
    thrust_curve,
    torque_of_signal,
    vehicle_parameters,
)
from skyarm.links.autopilots.effectiveness import inertias
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.vehicle.thrust_table import ThrustTable

FITTING = {
    "hummingbird_arm2_rotors": ("quadrotor +", 1, 0),
    "pelican_arm2": ("quadrotor +", 1, 0),
    "quadrotor_roll_arm2": ("quadrotor X with reversed spins", 1, 18),
    "crazyflie_arm1": ("quadrotor X with reversed spins", 1, 18),
    "hexarotor_arm6": ("hexarotor +", 2, 0),
    "hexarotor12_arm5": ("hexarotor +", 2, 0),
    "octo_coaxial_two_arms": ("coaxial octorotor X", 4, 1),
}


def full_thrust(rotor: Rotor) -> float:
    """Thrust at the highest speed, N: the table's effective squared speed where the
    rotor has a table.
    """
    return rotor.thrust_coefficient * float(push(rotor, rotor.max_speed))


def turned(vehicle: skyarm.Vehicle, degrees: float, spin: int = 1) -> skyarm.Vehicle:
    """Vehicle with its rotors turned about z, and with other spins for -1."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    rotors = tuple(
        dataclasses.replace(
            each,
            position=Vec3(
                c * each.position.x - s * each.position.y,
                s * each.position.x + c * each.position.y,
                each.position.z,
            ),
            direction=spin * each.direction,
        )
        for each in vehicle.rotors
    )
    return dataclasses.replace(vehicle, rotors=rotors)


@pytest.mark.parametrize(("name", "expected"), FITTING.items())
def test_vehicles_of_the_library_have_these_frames(name, expected):
    frame, places = fitting_frame(skyarm.load_vehicle(name))
    assert (frame.name, frame.number, frame.form) == expected
    assert sorted(places) == list(range(len(frame.motors)))


@pytest.mark.parametrize("name", FITTING)
def test_the_motor_of_a_rotor_is_at_its_place_and_turns_its_way(name):
    """Angle by the complex number of the place: clockwise from the front, so its
    conjugate.
    """
    vehicle = skyarm.load_vehicle(name)
    frame, places = fitting_frame(vehicle)
    for rotor, place in zip(vehicle.rotors, places, strict=True):
        angle, spin = frame.motors[place]
        there = complex(rotor.position.x, -rotor.position.y)
        assert there / abs(there) == pytest.approx(
            complex(math.cos(math.radians(angle)), math.sin(math.radians(angle))),
            abs=1e-2,
        )
        assert spin == rotor.direction


def test_the_numbers_of_the_motors_are_those_of_ardupilots_drawings():
    """Its page on connecting motors: right 1, left 2, front 3, back 4 of a +; front
    right 1 of an X.
    """
    angles = {frame.name: [angle for angle, _ in frame.motors] for frame in FRAMES}
    assert angles["quadrotor +"] == [90, -90, 0, 180]
    assert angles["quadrotor X"] == [45, -135, -45, 135]
    assert angles["hexarotor +"] == [0, 180, -120, 60, -60, 120]
    assert angles["hexarotor X"] == [90, -90, -30, 150, 30, -150]


def test_the_angles_are_about_the_middle_of_the_rotors():
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    away = [
        dataclasses.replace(each, position=each.position + Vec3(0.3, -0.2, 0.1))
        for each in vehicle.rotors
    ]
    assert fitting_frame(
        dataclasses.replace(vehicle, rotors=tuple(away))
    ) == fitting_frame(vehicle)


@pytest.mark.parametrize(("gravity", "hover"), [(1.0, 0.125), (25.0, 0.6875)])
def test_the_hover_thrust_is_within_ardupilots_limits(gravity, hover):
    vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors")
    found = vehicle_parameters(vehicle, gravity)
    share = float(vehicle.mass) * gravity / sum(map(full_thrust, vehicle.rotors))
    assert not 0.125 <= share <= 0.6875
    assert found["MOT_THST_HOVER"] == hover
    assert (found["PSC_ACCZ_P"], found["PSC_ACCZ_I"]) == pytest.approx(
        (share, 2.0 * share)
    )


@pytest.mark.parametrize("bend", [0.4, 0.75])
def test_the_thrust_curve_of_a_table_is_its_bend(bend):
    """Thrusts (1 - e) u + e u^2 of the share u of the highest speed, finely."""
    vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors")
    u = np.linspace(0.0, 1.0, 81)
    most = float(vehicle.rotors[0].max_speed)
    table = ThrustTable(
        speed=tuple((most * u).tolist()),
        thrust=tuple(((1 - bend) * u + bend * u * u).tolist()),
    )
    rotors = tuple(dataclasses.replace(each, table=table) for each in vehicle.rotors)
    assert thrust_curve(dataclasses.replace(vehicle, rotors=rotors)) == pytest.approx(
        bend, abs=1e-4
    )


@pytest.mark.parametrize("frame", FRAMES, ids=lambda frame: frame.name)
def test_a_frame_is_balanced(frame):
    """No twist by thrust, and none by roll and pitch: sums of unit vectors and of spins
    vanish.
    """
    arms = np.array(
        [
            [math.cos(math.radians(angle)), math.sin(math.radians(angle))]
            for angle, _ in frame.motors
        ]
    )
    spins = np.array([spin for _, spin in frame.motors])
    assert len(set(frame.motors)) == len(frame.motors)
    np.testing.assert_allclose(arms.sum(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(spins @ arms, 0.0, atol=1e-12)
    assert spins.sum() == 0


@pytest.mark.parametrize(
    ("degrees", "spin", "name"),
    [
        (0.0, 1, "quadrotor +"),
        (12.0, 1, "quadrotor +"),
        (-45.0, 1, "quadrotor X with reversed spins"),
        (-45.0, -1, "quadrotor X"),
        (45.0, 1, "quadrotor X"),
        (45.0, -1, "quadrotor X with reversed spins"),
        (90.0, 1, "quadrotor + with reversed spins"),
        (0.0, -1, "quadrotor + with reversed spins"),
    ],
)
def test_turning_the_rotors_or_their_spins_gives_another_frame(degrees, spin, name):
    vehicle = turned(skyarm.load_vehicle("hummingbird_arm2_rotors"), degrees, spin)
    found = fitting_frame(vehicle)[0].name
    assert found == name


@pytest.mark.parametrize(
    "vehicle",
    [
        skyarm.load_vehicle("tilted_hexarotor"),
        turned(skyarm.load_vehicle("hummingbird_arm2_rotors"), 22.0),
        turned(skyarm.load_vehicle("hexarotor_arm6"), 15.0),
    ],
    ids=["tilted", "between + and X", "hexarotor between + and X"],
)
def test_another_layout_is_refused_in_one_line_that_names_the_frames(vehicle):
    with pytest.raises(ScenarioError) as caught:
        fitting_frame(vehicle)
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith("plant.vehicle: rotors at ")
    assert all(frame.name in text for frame in FRAMES)


@pytest.mark.parametrize("name", FITTING)
def test_a_full_command_makes_this_torque(name):
    """Cross products of place and thrust, and reaction torques, of motors driven by
    ArduPilot's shares in its axes.
    """
    vehicle = skyarm.load_vehicle(name)
    frame, places = fitting_frame(vehicle)
    theta = np.radians([frame.motors[place][0] for place in places])
    factors = np.array(
        [
            np.cos(theta + math.pi / 2),
            np.cos(theta),
            [frame.motors[place][1] for place in places],
        ]
    )
    factors *= 0.5 / np.abs(factors).max(axis=1, keepdims=True)
    flip = np.array([1.0, -1.0, -1.0])
    for axis, torque in enumerate(torque_of_signal(vehicle)):
        found = np.zeros(3)
        for rotor, share in zip(vehicle.rotors, factors[axis], strict=True):
            thrust = share * full_thrust(rotor)
            lift = np.array([0.0, 0.0, thrust])
            found += (
                np.cross([float(c) for c in rotor.position], lift)
                - rotor.direction * rotor.moment_coefficient * lift
            )
        expected = np.zeros(3)
        expected[axis] = torque
        np.testing.assert_allclose(flip * found, expected, atol=1e-3 * torque)
        assert torque > 0.0


@pytest.mark.parametrize("name", FITTING)
def test_the_gains_turn_a_rate_error_into_bandwidth_times_it(name):
    vehicle = skyarm.load_vehicle(name)
    gains, torque = rate_gains(vehicle), torque_of_signal(vehicle)
    # with limp and with locked joints
    inertia = np.sqrt(np.prod(inertias(vehicle), axis=0))
    slowest = max(rotor.time_constant_up for rotor in vehicle.rotors)
    rows = zip(("RLL", "PIT", "YAW"), inertia, torque, (18, 18, 6), strict=True)
    for axis, J, full, most in rows:
        assert gains[f"ATC_RAT_{axis}_P"] * full / J == pytest.approx(
            min(most, 0.33 / slowest), rel=0.01
        )  # tilted joint axes couple
    assert gains["ATC_RAT_RLL_I"] == pytest.approx(gains["ATC_RAT_RLL_P"])
    assert gains["ATC_RAT_RLL_D"] / gains["ATC_RAT_RLL_P"] == pytest.approx(
        0.0036 / 0.135, rel=1e-2
    )
    assert gains["ATC_RAT_YAW_I"] / gains["ATC_RAT_YAW_P"] == pytest.approx(
        0.018 / 0.18
    )


@pytest.mark.parametrize(
    ("name", "error"), [("hexarotor_arm6", 1e-9), ("quadrotor_roll_arm2", 0.03)]
)
def test_its_thrust_curve_with_the_parameters_is_the_rotors(name, error):
    """Its curve solved for the signal: (e - 1 + sqrt((1 - e)^2 + 4 e thrust)) / 2 e,
    between SPIN_MIN and SPIN_MAX.
    """
    vehicle = skyarm.load_vehicle(name)
    found, rotor = vehicle_parameters(vehicle, 9.81), vehicle.rotors[0]
    e, low, high = found["MOT_THST_EXPO"], found["MOT_SPIN_MIN"], found["MOT_SPIN_MAX"]
    for thrust in (0.0, 0.1, 0.37, 1.0):
        curve = ((e - 1.0) + math.sqrt((1.0 - e) ** 2 + 4.0 * e * thrust)) / (2.0 * e)
        speed = (low + (high - low) * curve) * rotor.max_speed
        made = rotor.thrust_coefficient * float(push(rotor, speed)) / full_thrust(rotor)
        assert made == pytest.approx(thrust, abs=error)
    assert found["MOT_SPIN_ARM"] <= low


def test_the_hover_thrust_carries_the_weight():
    vehicle = skyarm.load_vehicle("quadrotor_roll_arm2")
    found = vehicle_parameters(vehicle, 9.81)
    full = sum(full_thrust(rotor) for rotor in vehicle.rotors)
    assert found["MOT_THST_HOVER"] * full == pytest.approx(vehicle.mass * 9.81)
    assert (
        found["PSC_ACCZ_I"]
        == 2.0 * found["PSC_ACCZ_P"]
        == pytest.approx(2.0 * found["MOT_THST_HOVER"])
    )


def test_a_vehicle_that_cannot_hover_is_refused():
    with pytest.raises(
        ScenarioError, match="must lift more than 1 times the weight for ArduPilot"
    ):
        vehicle_parameters(skyarm.load_vehicle("hummingbird_arm2_rotors"), 60.0)
