"""What a motion requires of rotors and joints: wrench, attitude with a heading,
efforts, and room for the arm.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.algebra import ZERO3, Vec3
from skyarm.dynamics.actuators.rotor import rotor_forces
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.identify.required_flight import arm_clearance, required_flight
from skyarm.scenario.scenario_record import first_state
from skyarm.studies.tune.excitation import of_vehicle

VEHICLE = skyarm.load_vehicle("hummingbird_arm2_rotors")
GRAVITY, PERIOD = 9.81, 0.01
TIMES = PERIOD * np.arange(601)
INSIDE = slice(50, -50)
"""Rows away from the ends, where windows and differences are cut off."""


def moving(**waves):
    """Motion at rest but for sines of some axes: name -> (middle, amplitude, rad/s)."""
    names = ("x", "y", "z", "yaw", "first", "second")
    motion = np.zeros((3, len(names), len(TIMES)))
    for name, (middle, size, rate) in waves.items():
        wave = size * np.sin(rate * TIMES)
        motion[:, names.index(name)] = (
            middle + wave,
            size * rate * np.cos(rate * TIMES),
            -(rate**2) * wave,
        )
    return motion


def wrench_of_pushes(rotors):
    """Force and torque at the base origin, base axes, of each rotor at 1 rad/s, (6,
    rotors), by the plant's rotors.
    """
    found = []
    for i in range(len(rotors)):
        force = rotor_forces(
            rotors, [float(k == i) for k in range(len(rotors))], ZERO3, ZERO3
        )
        found.append([float(each) for each in (*force.force, *force.torque)])
    return np.array(found).T


def test_the_wrench_of_a_hover_holds_the_vehicle():
    """Of the speeds at which a scenario begins, the thrust is the weight, and no torque
    turns the base.
    """
    vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors")
    state = first_state(of_vehicle(vehicle, "paper_ct"))
    wrench = wrench_of_pushes(vehicle.rotors) @ np.array(
        [float(w) ** 2 for w in state.rotor_speeds]
    )
    assert wrench[2] == pytest.approx(vehicle.mass * 9.81, rel=0.02)
    assert wrench[5] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("height", [0.0, 3.0])
def test_a_vehicle_that_turns_in_hover_looks_along_its_heading_and_stays_upright(
    height,
):
    """Its rate is that of the heading, about z alone; the torque that turns it is its
    moment of inertia's.
    """
    motion = moving(yaw=(0.4, 0.8, 1.5), z=(height, 0.0, 1.0))
    flight = required_flight(VEHICLE, motion, PERIOD)
    heading, rate, pulled = motion[:, 3]
    ahead, left = flight.turned[:, :, 0], flight.turned[:, :, 1]
    np.testing.assert_allclose(
        ahead,
        np.stack([np.cos(heading), np.sin(heading), 0.0 * heading], axis=1),
        atol=1e-9,
    )
    np.testing.assert_allclose(
        left,
        np.stack([-np.sin(heading), np.cos(heading), 0.0 * heading], axis=1),
        atol=1e-9,
    )
    np.testing.assert_allclose(
        flight.rate[INSIDE], np.outer(rate, [0.0, 0.0, 1.0])[INSIDE], atol=2e-4
    )
    wrench = np.einsum(
        "ir,knr->nki", wrench_of_pushes(VEHICLE.rotors)[2:], flight.shares
    )
    moment = float(VEHICLE.base.inertia.zz) + sum(
        float(each.body.inertia.zz) for each in VEHICLE.links
    )
    # of each component's shares the other components are none
    np.testing.assert_allclose(
        wrench[INSIDE, 3, 3], moment * pulled[INSIDE], atol=2e-3 * moment
    )
    assert np.abs(wrench[:, 3, :3]).max() < 1e-12
    np.testing.assert_allclose(
        wrench[INSIDE, 0, 0], GRAVITY * float(VEHICLE.mass), rtol=1e-6
    )


def test_to_the_left_a_vehicle_rolls_to_the_left():
    """By -atan(a / g) about x, whatever axis of the world its heading makes the left
    one.
    """
    for heading, axis in ((0.0, "y"), (0.5 * np.pi, "x")):
        flight = required_flight(
            VEHICLE, moving(yaw=(heading, 0.0, 1.0), **{axis: (0.0, 2.0, 1.0)}), PERIOD
        )
        left = -2.0 * np.sin(TIMES) * (1.0 if axis == "y" else -1.0)
        roll = np.arctan2(flight.turned[:, 2, 1], flight.turned[:, 2, 2])
        assert np.abs(roll + np.arctan2(left, GRAVITY))[INSIDE].max() < 0.005
        assert (
            np.abs(flight.rate[:, 0] - np.gradient(roll, PERIOD))[INSIDE].max() < 0.01
        )
        assert np.abs(flight.rate[INSIDE, 1:]).max() < 0.01


def test_a_climb_needs_its_acceleration_more_of_thrust():
    flight = required_flight(VEHICLE, moving(z=(3.0, 0.5, 2.0)), PERIOD)
    thrust = flight.speeds**2 @ [
        float(each.thrust_coefficient) for each in VEHICLE.rotors
    ]
    np.testing.assert_allclose(
        thrust, float(VEHICLE.mass) * (GRAVITY - 2.0 * np.sin(2.0 * TIMES)), rtol=1e-6
    )
    np.testing.assert_allclose(flight.position[:, 2], 3.0 + 0.5 * np.sin(2.0 * TIMES))
    np.testing.assert_allclose(flight.velocity[:, 2], np.cos(2.0 * TIMES))


ROD = 0.15
"""m, from the shoulder in the base's origin to the elbow, and from there to the tip."""


def test_an_arm_that_is_held_aside_is_held_against_its_weight():
    """Each joint by the lever arms of the masses behind it: rods that hang from their
    joints, turned from straight down about y; against the torque of gravity, which
    pulls them back.
    """
    flight = required_flight(
        VEHICLE, moving(first=(0.7, 0.0, 1.0), second=(0.4, 0.0, 1.0)), PERIOD
    )
    (inner, to_inner), (outer, to_outer) = (
        (each.body.mass, -each.body.com.z) for each in VEHICLE.links
    )
    elbow = GRAVITY * outer * to_outer * np.sin(1.1)
    shoulder = GRAVITY * (inner * to_inner + outer * ROD) * np.sin(0.7) + elbow
    np.testing.assert_allclose(
        flight.efforts, np.tile([shoulder, elbow], (len(TIMES), 1)), rtol=1e-6
    )
    # the rotors hold what the shoulder takes from the base: their torques' sum is that
    # of all weights
    torque = np.einsum("r,kr->k", wrench_of_pushes(VEHICLE.rotors)[4], flight.speeds**2)
    base = GRAVITY * VEHICLE.base.mass * VEHICLE.base.com.x
    np.testing.assert_allclose(torque, base + shoulder, rtol=1e-6)


def test_joints_that_move_need_what_their_friction_takes_on_top():
    """Viscous, and Coulomb's with the sign of the rate: of a sine of the second joint
    none of the first one.
    """
    motion = moving(second=(0.3, 0.4, 1.5))
    joint = VEHICLE.links[1].joint
    rough = dataclasses.replace(
        joint, damping=0.02 + joint.damping, coulomb=0.01, coulomb_rate=0.05
    )
    links = (VEHICLE.links[0], dataclasses.replace(VEHICLE.links[1], joint=rough))
    plain = required_flight(VEHICLE, motion, PERIOD)
    more = (
        required_flight(
            dataclasses.replace(VEHICLE, links=links), motion, PERIOD
        ).efforts
        - plain.efforts
    )
    rate = 0.6 * np.cos(1.5 * TIMES)
    np.testing.assert_allclose(
        more[:, 1], 0.02 * rate + 0.01 * np.tanh(rate / 0.05), atol=1e-9
    )
    np.testing.assert_allclose(more[:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(plain.joints[:, 1], 0.3 + 0.4 * np.sin(1.5 * TIMES))
    np.testing.assert_allclose(
        plain.joint_rates, np.outer(rate, [0.0, 1.0]), atol=1e-12
    )


def test_a_vehicle_without_an_arm_has_neither_efforts_nor_a_distance():
    vehicle = skyarm.load_vehicle("hummingbird")
    flight = required_flight(vehicle, moving()[:, :4], PERIOD)
    assert flight.efforts.shape == flight.joints.shape == (len(TIMES), 0)
    distance, height = arm_clearance(vehicle, flight.joints)
    assert np.isinf(distance).all()
    assert not height.any()


def with_hubs(*hubs):
    """The vehicle with a rotor at each of some places, m."""
    rotor = VEHICLE.rotors[0]
    rotors = tuple(
        dataclasses.replace(
            rotor, name=f"r{i}", position=Vec3(*each), direction=1 - 2 * (i % 2)
        )
        for i, each in enumerate(hubs)
    )
    return dataclasses.replace(VEHICLE, rotors=rotors)


def test_a_rotor_reaches_half_way_to_the_next_one_that_is_not_above_it():
    """An arm of two rods of 0.15 m straight ahead or to the back, in the plane of hubs
    0.4 m from the axes.
    """
    corners = [(0.4, 0.4, 0.0), (0.4, -0.4, 0.0), (-0.4, 0.4, 0.0), (-0.4, -0.4, 0.0)]
    tip = np.hypot(0.4 - 2.0 * ROD, 0.4) - 0.4
    ahead = np.array([[-0.5 * np.pi, 0.0], [0.5 * np.pi, 0.0]])
    assert arm_clearance(with_hubs(*corners), ahead)[0] == pytest.approx(
        [tip, tip], abs=1e-9
    )
    # of rotors in pairs the lower ones are as near, and their discs as wide
    pairs = corners + [(x, y, -0.1) for x, y, _ in corners]
    assert arm_clearance(with_hubs(*pairs), ahead)[0] == pytest.approx(
        [tip, tip], abs=1e-9
    )
    # discs 0.1 m above the arm
    above = [(x, y, 0.1) for x, y, _ in corners]
    assert arm_clearance(with_hubs(*above), ahead)[0] == pytest.approx(
        np.hypot([tip, tip], 0.1), abs=1e-9
    )
    # two hubs 0.36 m from each other, of which the front one is wide enough to be over
    # the tip
    front = [(0.36, 0.0, 0.1), (0.0, 0.0, 0.1)]
    assert arm_clearance(with_hubs(*front), ahead[:1])[0] == pytest.approx(
        [0.1], abs=1e-9
    )


def test_sensors_of_an_arm_read_its_motion_and_the_efforts_come_before_it():
    """Channels that the other flight has, at its rates, until the end; a command by the
    usual dead time of 5 ms.
    """
    flight = required_flight(VEHICLE, moving(second=(0.3, 0.4, 1.5)), PERIOD)
    time = np.arange(0.0, 2.0, 0.02)
    like = FlightData(
        name="like",
        file="like",
        channels={
            name: Channel(time=time, values=np.zeros((time.size, count)), source="")
            for name, count in (
                ("position", 3),
                ("velocity", 3),
                ("joint_positions", 2),
                ("joint_efforts", 2),
            )
        },
    )
    found = flight.flight_data(VEHICLE, like)
    assert set(found) == set(like)
    at = found["joint_positions"].time
    np.testing.assert_allclose(at, 0.02 * np.arange(300), atol=1e-12)
    np.testing.assert_allclose(
        found["joint_positions"].values[:, 1], 0.3 + 0.4 * np.sin(1.5 * at), atol=1e-4
    )
    later = np.stack(
        [np.interp(at + 0.005, TIMES, each) for each in flight.efforts.T], axis=1
    )
    np.testing.assert_allclose(found["joint_efforts"].values, later, atol=1e-9)
