"""Replays of logged commands against the simulations that they were logged in, and
against laws by hand.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.flight_data.flight_data import Channel
from skyarm.identify.windows import held_over
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth
from skyarm.plant.surroundings import Surroundings
from skyarm.simulate.replay import CommandReplay
from support.flights import GRAVITY, ONE, QUAD, STEP, flown, on_servo, rotations

FIELDS = (
    "position",
    "quaternion",
    "velocity",
    "rate",
    "joints",
    "joint_rates",
    "rotor_speeds",
)
ROTORS, JOINTS = 0.0033, 0.0047
"""s, dead times that are no whole number of steps."""

STIFF = dataclasses.replace(
    ONE,
    links=tuple(
        dataclasses.replace(
            each, joint=dataclasses.replace(each.joint, coulomb_rate=0.002)
        )
        for each in ONE.links
    ),
)
"""Friction for which the plant takes several steps."""


def drives_of(vehicle):
    return tuple(each.drive for each in vehicle.drives)


def set_commands(flights, k, rotors, joints):
    """Give all lanes the commands of a step."""
    inputs = flights.inputs
    for name, held, place in (("speeds", rotors, 0), ("setpoints", joints, 1)):
        if held is not None:
            inputs[f"{name}_before"][:] = held.before[k][:, None]
            inputs[f"{name}_after"][:] = held.after[k][:, None]
            inputs["late"][place] = held.late[k]


def standing(log):
    """Setpoint (1, 1) of the servo that held the pendulum below the base before the
    first command.
    """
    body, q = ONE.links[0].body, log.joints[:1]
    return (
        q
        + body.mass
        * GRAVITY
        * -body.com.z
        * np.sin(q)
        / on_servo().drives[0].drive.stiffness
    )


def held_of(log, name, delay):
    """Commands of a log over each of its periods; before the first one what held the
    vehicle at rest.
    """
    values, rest = (
        getattr(log, name),
        (log.rotor_speeds[:1] if name == "rotor_commands" else standing(log)),
    )
    time = np.concatenate([[log.time[0] - 1.0], log.time])
    return held_over(
        Channel(time=time, values=np.concatenate([rest, values]), source=name),
        log.time,
        delay,
    )


@pytest.mark.parametrize(
    ("vehicle", "first", "late", "off"),
    [
        (QUAD, 0, (ROTORS, JOINTS), 1e-6),
        (STIFF, 60, (2 * STEP, 3 * STEP), 1e-6),
        (STIFF, 60, (ROTORS, JOINTS), 1e-4),
        (on_servo(integral=8.0, speed_limit=1.2), 0, (ROTORS, JOINTS), 1e-6),
    ],
    ids=[
        "quadrotor",
        "joint on torques with stiff friction, whole steps late",
        "joint on torques with stiff friction",
        "joint on a servo with integral and speed limit",
    ],
)
def test_a_replayed_flight_returns_its_own_states(vehicle, first, late, off):
    """To what other steps around the instants of switching leave; a reversal of stiff
    friction in one costs more.

    A long step of the simulation costs as much where friction reverses within it: that
    flight has short ones.
    """
    log = flown(vehicle, 0.8, *late, longest=2e-5 if off > 1e-6 else None)
    flights = CommandReplay(
        lambda _: vehicle, {}, STEP, GRAVITY, drives_of=drives_of
    ).flights(1)
    for name in FIELDS:
        flights.state[name][:, 0] = log[name][first]
    if vehicle.drives:
        flights.memories[0] = standing(log)
        moved = np.abs(np.diff(log.efforts[:, 0])) / STEP
        assert np.mean(moved > vehicle.drives[0].drive.speed_limit) > 0.05, (
            "the limit acts"
        )
    rotors = held_of(log, "rotor_commands", late[0])
    joints = held_of(log, "efforts", late[1]) if vehicle.n else None
    within = late == (ROTORS, JOINTS)
    assert rotors.late[5:] == pytest.approx(0.0013 if within else 0.0)
    assert joints is None or joints.late[5:] == pytest.approx(0.0007 if within else 0.0)
    for k in range(first, len(log.time) - 1):
        set_commands(flights, k, rotors, joints)
        flights.step()
        for name in FIELDS:
            assert flights.state[name][:, 0] == pytest.approx(
                log[name][k + 1], abs=off
            ), (name, k)
    assert np.ptp(log.rate, axis=0).min() > 1.0
    assert not vehicle.n or np.abs(log.joint_rates).max() > 1.0


NUMBERS = {
    "thrust": float(QUAD.rotors[0].thrust_coefficient),
    "inertia": float(QUAD.base.inertia.yy),
}


def quad_with(numbers):
    """Quadrotor with another thrust and inertia, centre of mass in its origin, without
    drag of the rotors.
    """
    inertia = dataclasses.replace(
        QUAD.base.inertia, yy=numbers["inertia"], xy=0.0, xz=0.0, yz=0.0
    )
    base = with_fields(QUAD.base, inertia=inertia, com=Vec3(0.0, 0.0, 0.0))
    changes = {
        "thrust_coefficient": numbers["thrust"],
        "drag_coefficient": 0.0,
        "rolling_moment_coefficient": 0.0,
    }
    return QUAD.with_checked(
        rotors=tuple(with_fields(each, **changes) for each in QUAD.rotors), base=base
    )


def with_fields(record, **changes):
    """Copy of a record with scalars of machine code in some fields, which no check
    takes.
    """
    made = object.__new__(type(record))
    for each in dataclasses.fields(record):
        object.__setattr__(
            made, each.name, changes.get(each.name, getattr(record, each.name))
        )
    return made


def logged(numbers, before, after):
    """Velocity gained in a step, m/s, and a number of the lane."""
    return (*(after.velocity - before.velocity), numbers["inertia"])


@cache
def replay(finer=1):
    return CommandReplay(quad_with, NUMBERS, STEP, GRAVITY, sensed=logged, finer=finer)


def hover_speed():
    return math.sqrt(
        GRAVITY * float(QUAD.mass) / (len(QUAD.rotors) * NUMBERS["thrust"])
    )


def at_hover(lanes, threads=1, finer=1):
    """Lanes that hover."""
    flights = replay(finer).flights(lanes, threads)
    for rows in (
        flights.state["rotor_speeds"],
        flights.inputs["speeds_before"],
        flights.inputs["speeds_after"],
    ):
        rows[:] = hover_speed()
    return flights


def test_rotors_switch_within_a_step_and_lag_exactly():
    rotor, late, speed = QUAD.rotors[0], 0.0006, 300.0
    flights = at_hover(2)
    flights.state["rotor_speeds"][:] = speed
    flights.inputs["speeds_before"][:], flights.inputs["speeds_after"][:] = 500.0, 200.0
    flights.inputs["late"][0] = [late, 0.0]
    flights.step()
    up, down = float(rotor.time_constant_up), float(rotor.time_constant_down)
    middle = 500.0 + (speed - 500.0) * math.exp(-late / up)
    wanted = [
        200.0 + (first - 200.0) * math.exp(-(STEP - gone) / down)
        for first, gone in ((middle, late), (speed, 0))
    ]
    assert flights.state["rotor_speeds"] == pytest.approx(
        np.tile(wanted, (4, 1)), rel=1e-12
    )


def test_a_force_accelerates_and_a_torque_turns_as_by_newton_and_euler():
    """Lanes with a push along each axis of a base that is turned about the vertical;
    one with both at hover.
    """
    flights, quarter = at_hover(7), math.sqrt(0.5)
    flights.state["quaternion"][:] = np.array([quarter, 0.0, 0.0, quarter])[:, None]
    flights.inputs["force"][:, :3], flights.inputs["torque"][:, 3:6] = (
        0.3 * np.eye(3),
        0.01 * np.eye(3),
    )
    flights.step()
    mass, inertia = (
        float(QUAD.mass),
        np.array([getattr(QUAD.base.inertia, 2 * axis) for axis in "xyz"], dtype=float),
    )
    velocity, rate = flights.state["velocity"], flights.state["rate"]
    # base x is world y, and base y is against world x
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert velocity[:, :3] == pytest.approx(0.3 * STEP / mass * turned, abs=1e-12)
    assert rate[:, 3:6] == pytest.approx(
        np.diag(0.01 * STEP / inertia), rel=1e-6, abs=1e-12
    )
    # a force at the origin, which is the centre of mass, turns nothing; a torque lifts
    # nothing
    assert np.abs(rate[:, :3]).max() < 1e-12
    assert np.abs(velocity[:, 6]).max() < 1e-12
    assert flights.logged[:3] == pytest.approx(velocity)


def test_the_thrust_factor_scales_forces_and_torques_of_the_rotors():
    flights = at_hover(2)
    flights.inputs["thrust"][:] = [1.0, 1.1]
    # of one direction of rotation: yaw
    faster = np.array([1.02, 1.0, 1.02, 1.0]) * hover_speed()
    for rows in (
        flights.state["rotor_speeds"],
        flights.inputs["speeds_before"],
        flights.inputs["speeds_after"],
    ):
        rows[:] = faster[:, None]
    flights.step()
    lift = flights.state["velocity"][2] / STEP + GRAVITY
    assert lift[1] / lift[0] == pytest.approx(1.1, rel=1e-9)
    yaw = flights.state["rate"][2]
    assert abs(yaw[0]) > 1e-4
    assert yaw[1] / yaw[0] == pytest.approx(1.1, rel=1e-6)


def test_numbers_of_a_lane_are_its_own():
    flights = at_hover(3)
    flights.inputs["numbers"][0, 1] *= 1.2
    flights.inputs["numbers"][1, 2] *= 2.0
    flights.inputs["torque"][1] = 0.01
    flights.step()
    lift, pitch = (
        flights.state["velocity"][2] / STEP + GRAVITY,
        flights.state["rate"][1],
    )
    assert lift == pytest.approx(GRAVITY * np.array([1.0, 1.2, 1.0]), rel=1e-9)
    assert pitch == pytest.approx(pitch[0] * np.array([1.0, 1.0, 0.5]), rel=1e-6)
    assert flights.logged[3] == pytest.approx(
        NUMBERS["inertia"] * np.array([1.0, 1.0, 2.0])
    )


@pytest.mark.parametrize("threads", [1, 3])
def test_lanes_side_by_side_fly_as_each_alone(threads):
    """Of a number that fills no whole set of SIMD lanes."""
    lanes, steps = 11, 5

    def disturbed(count, columns):
        draw, flights = np.random.default_rng(2), at_hover(count, threads)
        for rows in (*flights.state.values(), *flights.inputs.values()):
            change = draw.normal(size=(len(rows), lanes))[:, columns]
            rows[:] = rows + 0.1 * change * np.maximum(np.abs(rows[:, :1]), 1e-3)
        for _ in range(steps):
            flights.step()
        flights.close()
        return flights

    together = disturbed(lanes, slice(None))
    assert np.ptp(together.state["rate"], axis=1).min() > 1e-4
    for lane in (0, 7, 10):
        single = disturbed(1, slice(lane, lane + 1))
        for name in FIELDS:
            assert single.state[name][:, 0] == pytest.approx(
                together.state[name][:, lane], rel=1e-12, abs=1e-13
            )
        assert single.logged[:, 0] == pytest.approx(
            together.logged[:, lane], rel=1e-9, abs=1e-12
        )


def test_velocity_gained_in_a_step_is_the_mean_of_the_plant_s_own_accelerometer():
    """What is logged beside the states, against the plant's reading at 20 instants of a
    step of a turning quadrotor.
    """
    count = 10
    flights = at_hover(1, finer=count)
    plant = RigidBodyPlant(
        Truth(vehicle=quad_with(NUMBERS), gravity=GRAVITY), Surroundings(), "rk4"
    )
    flights.state["rate"][:, 0] = [1.0, -2.0, 0.5]
    flights.state["velocity"][:, 0] = [1.0, 2.0, -0.5]
    flights.inputs["speeds_after"][:, 0] = [600.0, 300.0, 700.0, 500.0]
    flights.inputs["late"][0] = late = 0.0007
    state, readings = np.concatenate([flights.state[name][:, 0] for name in FIELDS]), []
    commands = [
        flights.inputs[f"speeds_{each}"][:, 0].copy() for each in ("before", "after")
    ]
    before = flights.state["quaternion"].T.copy()
    flights.step()
    for command, seconds in zip(commands, (late, STEP - late), strict=True):
        for _ in range(count):
            middle = plant.advance(state, command, (0.0,), 0.5 * seconds / count)
            readings.append(
                np.array(plant.specific_force(middle, command, (0.0,)))
                * seconds
                / count
            )
            state = plant.advance(state, command, (0.0,), seconds / count)
    (R,) = rotations(0.5 * (before + flights.state["quaternion"].T))
    gained = flights.logged[:3, 0] / STEP + np.array([0.0, 0.0, GRAVITY])
    assert R.T @ gained == pytest.approx(np.sum(readings, axis=0) / STEP, abs=2e-3)
    assert np.concatenate(
        [flights.state[name][:, 0] for name in FIELDS]
    ) == pytest.approx(state, rel=1e-12, abs=1e-13)
