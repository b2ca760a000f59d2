"""States in which a formula divides by zero or has two answers: commands stay finite
and sensible.
"""

import dataclasses
import math

import numpy as np
import pytest
from euler_form import hybrid_computed_torque_euler
from paper_oracle import ALLOCATION, KR
from rotors_node import message_quaternion
from scipy.spatial.transform import Rotation

from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.control.blocks.geometric import HALF_TURN, SMALL_SINE, desired_attitude
from skyarm.control.model import Model
from skyarm.records.leaves import leaves
from skyarm.vehicle import Body
from support import euler_lagrange as el
from support.laws import (
    ARM2,
    LAWS,
    MODEL,
    G,
    cases,
    changed,
    controller,
    hovering,
    pushes,
    raw_squares,
    step,
    unclipped,
    vec,
)

NAN = math.nan
FREE = Model(vehicle=ARM2.with_joints(effort_limit=math.inf), gravity=G)


def array(m):
    return np.array([tuple(row) for row in m.rows], dtype=float)


def mat(R):
    return Mat3(*(vec(row) for row in R))


def finite(command):
    return all(math.isfinite(value) for value in leaves(command))


@pytest.mark.parametrize("name", [name for name in LAWS if name != "decoupled_pd"])
def test_without_a_commanded_force_thrust_is_zero_and_the_thrust_axis_stays(name):
    """A reference in free fall: a_d = 0 has no direction, and the vehicle has no reason
    to tilt.
    """
    case = changed(hovering(euler=(0.3, -0.2, 0.0)), a_d=(0.0, 0.0, -G))
    command = step(controller(name), case.measurement(), case.reference())
    assert finite(command)
    flown = unclipped(controller(name))
    raw = raw_squares(step(flown, case.measurement(), case.reference()))
    # thrust is the sum: zero but for rounding of the single rotors' shares
    assert abs(raw.sum()) < 1e-9 * np.abs(raw).max()
    R_d = array(desired_attitude(Vec3(0.0, 0.0, 0.0), 0.0, mat(case.R)))
    np.testing.assert_allclose(R_d[:, 2], case.R[:, 2], atol=1e-15)
    np.testing.assert_allclose(R_d.T @ R_d, np.eye(3), atol=1e-14)


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-7])
def test_a_vanishing_force_of_any_direction_keeps_the_present_thrust_axis(size):
    R = Rotation.from_euler("ZYX", [0.4, 0.3, -0.2]).as_matrix()
    R_d = array(desired_attitude(Vec3(size, -size, size), 0.4, mat(R)))
    np.testing.assert_allclose(R_d[:, 2], R[:, 2], atol=1e-15)


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_force_is_followed_from_a_millionth_of_a_metre_per_second_squared_on(axis):
    R, force = Rotation.from_euler("ZYX", [0.4, 0.3, -0.2]).as_matrix(), -np.array(axis)
    below, above = (
        array(desired_attitude(vec(size * force), 0.7, mat(R)))
        for size in (0.999e-6, 1.001e-6)
    )
    np.testing.assert_allclose(below[:, 2], R[:, 2], atol=1e-15)
    np.testing.assert_allclose(above[:, 2], axis, atol=1e-15)


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.0])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("off", [0.0, 1e-9, 0.9 * SMALL_SINE])
def test_thrust_along_the_heading_and_against_it_keeps_left_to_the_left(yaw, sign, off):
    heading = np.array([math.cos(yaw), math.sin(yaw), 0.0])
    left = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
    thrust = sign * heading + off * np.array([0.0, 0.0, 1.0])
    R_d = array(desired_attitude(vec(-5.0 * thrust), yaw, Mat3.identity()))
    np.testing.assert_allclose(R_d[:, 1], left, atol=1e-15)
    np.testing.assert_allclose(R_d[:, 2], sign * heading, atol=2e-6)
    np.testing.assert_allclose(R_d.T @ R_d, np.eye(3), atol=2e-6)
    assert np.linalg.det(R_d) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_target_that_asks_for_thrust_along_the_heading_gives_a_finite_command(
    name, sign
):
    """Kp e_x pulls along +-x while the reference falls with g: the wanted force lies in
    the nose's direction.
    """
    case = changed(hovering(), p_d=(3.0 * sign, 0.0, 1.0 - 0.806 * G / 4.0))
    assert finite(step(controller(name), case.measurement(), case.reference()))


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_an_attitude_error_of_180_degrees_is_finite_and_turns_about_its_axis(
    name, axis
):
    half = {
        "x": (0.0, 1.0, 0.0, 0.0),
        "y": (0.0, 0.0, 1.0, 0.0),
        "z": (0.0, 0.0, 0.0, 1.0),
    }[axis]
    measured = dataclasses.replace(
        hovering().measurement(), quaternion=Quaternion(*half)
    )
    command = step(controller(name), measured, _reference())
    assert finite(command)
    if name in ("rotors_sim_position", "decoupled_pd"):
        raw = raw_squares(step(unclipped(controller(name)), measured, _reference()))
        # sin(180 deg) = 0 is no torque; kept from vanishing it is that of one degree,
        # in either sense
        torque = np.where([axis == each for each in "xyz"], KR * HALF_TURN, 0.0)
        np.testing.assert_allclose(
            np.abs(ALLOCATION[:3] @ raw), torque, rtol=1e-9, atol=1e-12
        )
        # thrust along body z, which points down on its back
        assert np.sign(raw.sum()) == (1.0 if axis == "z" else -1.0)


def _reference():
    return hovering().reference()


@pytest.mark.parametrize("name", LAWS)
def test_a_negated_quaternion_gives_the_same_command_to_the_bit(name):
    for case in cases(10, seed=21):
        measured = case.measurement()
        q = measured.quaternion
        negated = dataclasses.replace(
            measured, quaternion=Quaternion(-q.w, -q.x, -q.y, -q.z)
        )
        flown = controller(name)
        assert step(flown, measured, case.reference()) == step(
            flown, negated, case.reference()
        )


@pytest.mark.parametrize("name", LAWS[2:])
@pytest.mark.parametrize("turns", [-2, 1, 3])
def test_joints_and_references_wound_past_a_turn_give_the_same_command(name, turns):
    for case in cases(5, seed=22):
        wound = changed(
            case, q=case.q + 2.0 * np.pi * turns, q_d=case.q_d + 2.0 * np.pi * turns
        )
        a, b = (
            step(controller(name, FREE), c.measurement(), c.reference())
            for c in (case, wound)
        )
        # sin and cos of an angle 20 times larger: 20 eps, times the gain of 350 on a
        # difference of angles
        np.testing.assert_allclose(b.efforts, a.efforts, atol=1e-12)
        np.testing.assert_allclose(b.rotor_speeds, a.rotor_speeds, atol=1e-9)


def test_a_joint_a_turn_past_its_reference_is_unwound():
    """Encoders count turns: the PD error is the plain difference, 2 pi, not zero."""
    case = changed(hovering(), q=(2.0 * np.pi, 0.0), q_d=(0.0, 0.0))
    efforts = step(
        controller("decoupled_pd", FREE), case.measurement(), case.reference()
    ).efforts
    np.testing.assert_allclose(efforts, (-2.0 * np.pi, 0.0), atol=1e-12)


def test_a_tip_without_mass_is_a_vehicle_like_any_other():
    """Both forms fly it, and its static torque is that of the links alone."""
    lower = ARM2.links[1]
    rod = Body(
        mass=0.04,
        com=lower.joint.position * 0.5,
        inertia=ARM2.links[0].body.inertia,
        planar=True,
    )
    bare = dataclasses.replace(
        ARM2, links=(ARM2.links[0], dataclasses.replace(lower, body=rod))
    )
    for tip in (bare, bare.with_payload(0.0)):
        model = Model(vehicle=tip.with_joints(effort_limit=math.inf), gravity=G)
        body = unclipped(controller("hybrid_computed_torque", model))
        euler = dataclasses.replace(body, law=hybrid_computed_torque_euler)
        for case in cases(5, seed=23):
            a, b = (
                step(flown, case.measurement(), case.reference())
                for flown in (body, euler)
            )
            np.testing.assert_allclose(
                raw_squares(a), raw_squares(b), atol=1e-9 * np.abs(raw_squares(a)).max()
            )
            np.testing.assert_allclose(
                a.efforts, b.efforts, atol=1e-9 * np.abs(a.efforts).max()
            )
        case = hovering(joints=(0.4, -0.9))
        light = dataclasses.replace(el.TABLE_1, me=0.0)
        static = el.gravity_vector(
            np.array([0, 0, 1, 0, 0, 0, 0.4, -0.9]), G, parameters=light
        )[6:]
        found = step(
            controller("hybrid_computed_torque", model),
            case.measurement(),
            case.reference(),
        )
        np.testing.assert_allclose(found.efforts, static, rtol=1e-12)


USED = {
    "rotors_sim_position": ("position", "quaternion", "velocity", "rate"),
    "decoupled_pd": (
        "position",
        "quaternion",
        "velocity",
        "rate",
        "joints",
        "joint_rates",
    ),
    "hybrid_computed_torque": (
        "position",
        "quaternion",
        "velocity",
        "rate",
        "joints",
        "joint_rates",
    ),
}


@pytest.mark.parametrize("name", LAWS)
def test_a_nan_in_any_measured_number_the_law_uses_gives_a_nan_command(name):
    flown, case = controller(name), cases(1, seed=24)[0]
    measured = case.measurement()
    for field in USED[name]:
        values = list(getattr(measured, field))
        for i in range(len(values)):
            broken = [NAN if j == i else value for j, value in enumerate(values)]
            kind = type(getattr(measured, field))
            record = tuple(broken) if kind is tuple else kind(*broken)
            command = step(
                flown,
                dataclasses.replace(measured, **{field: record}),
                case.reference(),
            )
            if field in ("joints", "joint_rates"):
                # the first joint's torque feels both angles in every law, a joint's own
                # rate its own torque
                assert math.isnan(command.efforts[i])
            else:
                assert all(map(math.isnan, command.rotor_speeds)), field


@pytest.mark.parametrize("name", LAWS)
def test_a_nan_in_the_reference_gives_a_nan_command(name):
    flown, case = controller(name), cases(1, seed=25)[0]
    reference = dataclasses.replace(case.reference(), position=Vec3(NAN, 0.0, 1.0))
    assert all(map(math.isnan, step(flown, case.measurement(), reference).rotor_speeds))
    reference = dataclasses.replace(case.reference(), yaw=NAN)
    assert all(map(math.isnan, step(flown, case.measurement(), reference).rotor_speeds))


def test_a_nan_in_a_message_quaternion_stays_nan():
    assert all(map(math.isnan, message_quaternion(NAN, 0.0, 0.0, 0.0)))
    assert all(map(math.isnan, message_quaternion(1.0, 0.0, NAN, 0.0)))


def test_the_body_form_is_finite_and_smooth_through_a_pitch_of_90_degrees():
    flown = controller("hybrid_computed_torque", FREE)
    commands = []
    for pitch in (90.0 - 1e-7, 90.0, 90.0 + 1e-7):
        half = math.radians(pitch) / 2.0
        measured = dataclasses.replace(
            hovering(joints=(0.2, 0.1)).measurement(),
            quaternion=Quaternion(math.cos(half), 0.0, math.sin(half), 0.0),
            rate=Vec3(0.1, 0.2, -0.3),
        )
        commands.append(
            leaves(step(flown, measured, hovering(joints=(0.2, 0.1)).reference()))
        )
    assert np.all(np.isfinite(commands))
    np.testing.assert_allclose(commands[0], commands[2], rtol=1e-5, atol=1e-5)


def test_thrust_of_a_vehicle_on_its_side_is_its_share_of_the_wanted_force():
    """At a pitch of 90 degrees gravity has no part along body z: RotorS's law gives no
    thrust while it turns up.
    """
    case = hovering(euler=(0.0, np.pi / 2, 0.0))
    torque, _ = pushes(
        MODEL.vehicle,
        step(controller("rotors_sim_position"), case.measurement(), case.reference()),
    )
    assert torque[1] < 0.0
    raw = raw_squares(
        step(
            unclipped(controller("rotors_sim_position")),
            case.measurement(),
            case.reference(),
        )
    )
    assert abs(raw.sum()) < 1e-9 * np.abs(raw).max()
