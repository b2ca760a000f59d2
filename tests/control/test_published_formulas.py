"""The published laws' formulas against Pinocchio, SciPy and NumPy, on random
vehicles.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from published_laws import (
    ARM,
    DT,
    MODEL,
    SEEDS,
    UP,
    asked,
    gentle,
    geometric_alpha,
    joint_wish,
    measured,
    pd_specific_force,
    rotation,
    soft,
    vec,
    wanted,
)
from scipy.linalg import expm

from skyarm.control.blocks.center_of_mass import (
    arm_reaction,
    center_velocity,
    central_inertia,
    forces_under_thrust,
    locked_inertia,
)
from skyarm.control.catalogue import make_controller
from skyarm.control.controller import with_applied_command
from skyarm.control.laws.published.guo import center_reference
from skyarm.control.laws.published.kim import sliding_rates
from skyarm.control.laws.published.l1 import adaptation, predict_velocities
from skyarm.dynamics.actuators import Command
from skyarm.reference import Reference
from support.laws import pushes, scalars
from support.vehicles import PinocchioTwin, RandomState, random_state, random_vehicle

pytest.importorskip("pinocchio")


@pytest.mark.parametrize("seed", SEEDS)
def test_centre_velocity_and_locked_inertia_are_pinocchios(seed):
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng, joints=4)
    state = random_state(rng, 4)
    twin = PinocchioTwin(vehicle)
    R = rotation(state).as_matrix()
    locked = locked_inertia(vehicle, state.joints.tolist())
    center, J = central_inertia(locked)
    com = twin.center_of_mass(state)
    # products of a few rotations: rounding of 1e-15 times sizes of one
    np.testing.assert_allclose(state.position + R @ scalars(center), com, atol=1e-12)
    arm = dataclasses.replace(
        state, velocity=np.concatenate([np.zeros(6), state.velocity[6:]])
    )
    relative = center_velocity(
        vehicle, state.joints.tolist(), state.velocity[6:].tolist()
    )
    np.testing.assert_allclose(
        R @ scalars(relative) * float(vehicle.mass), twin.momentum(arm)[:3], atol=1e-12
    )
    spin = np.array([0.3, -1.2, 0.7])
    turning = dataclasses.replace(
        state, velocity=np.concatenate([np.zeros(3), spin, np.zeros(4)])
    )
    np.testing.assert_allclose(
        R @ scalars(J.apply(vec(spin))), twin.momentum(turning)[3:], atol=1e-12
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_the_arms_reaction_is_pinocchios_inverse_dynamics_of_an_unaccelerated_base(
    seed,
):
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng, joints=4)
    state = random_state(rng, 4)
    state = dataclasses.replace(
        state, velocity=np.concatenate([np.zeros(3), state.velocity[3:]])
    )
    qdd = rng.normal(size=4)
    force = PinocchioTwin(vehicle).inverse_dynamics(
        state, np.concatenate([np.zeros(6), qdd]), gravity=0.0
    )
    found = arm_reaction(
        vehicle,
        state.joints.tolist(),
        vec(state.velocity[3:6]),
        state.velocity[6:].tolist(),
        qdd.tolist(),
    )
    scale = np.abs(force).max()
    np.testing.assert_allclose(
        rotation(state).apply(scalars(found.force)), force[:3], atol=1e-12 * scale
    )
    np.testing.assert_allclose(scalars(found.torque), force[3:6], atol=1e-12 * scale)


@pytest.mark.parametrize("seed", SEEDS)
def test_under_a_given_thrust_pinocchio_gives_the_wanted_accelerations(seed):
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng, joints=4)
    state = random_state(rng, 4)
    thrust, alpha, qdd = (
        rng.normal(size=3) * 10.0,
        rng.normal(size=3),
        rng.normal(size=4),
    )
    force, efforts, proper = forces_under_thrust(
        vehicle,
        state.joints.tolist(),
        vec(state.velocity[3:6]),
        state.velocity[6:].tolist(),
        applied=vec(thrust),
        angular=vec(alpha),
        joint_accelerations=qdd.tolist(),
    )
    R = rotation(state).as_matrix()
    applied = np.concatenate([R @ thrust, scalars(force.torque), scalars(efforts)])
    found = PinocchioTwin(vehicle).forward_dynamics(state, applied)
    scale = 1.0 + np.abs(found).max()
    np.testing.assert_allclose(found[3:6], alpha, atol=1e-10 * scale)
    np.testing.assert_allclose(found[6:], qdd, atol=1e-10 * scale)
    np.testing.assert_allclose(
        R.T @ (found[:3] + UP), scalars(proper), atol=1e-10 * scale
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_the_simplified_mass_matrix_is_pinocchios_without_its_blocks_of_translation(
    seed,
):
    """M_rr, M_rq, M_qr, M_qq, velocity products and weight; thrust m a_z / cos tilt."""
    controller, state, reference = soft("bulut2019"), gentle(seed), wanted(seed)
    torque, thrust, efforts = asked(controller, state, reference)
    up, R = pd_specific_force(controller, state, reference), rotation(state)
    yaw, pitch, roll = R.as_euler("ZYX")
    c, s = np.cos(yaw), np.sin(yaw)
    goal = np.array(
        [(up[0] * s - up[1] * c) / 9.81, (up[0] * c + up[1] * s) / 9.81, reference.yaw]
    )
    goal[:2] = np.clip(goal[:2], -0.6, 0.6)
    error = np.array([roll, pitch, yaw]) - goal
    error[2] = (error[2] + np.pi) % (2 * np.pi) - np.pi

    def rate_matrix(angles):
        ph, th = angles[:2]
        return np.array(
            [
                [1, 0, -np.sin(th)],
                [0, np.cos(ph), np.sin(ph) * np.cos(th)],
                [0, -np.sin(ph), np.cos(ph) * np.cos(th)],
            ]
        )

    angles = np.array([roll, pitch, yaw])
    Q = rate_matrix(angles)
    rates = np.linalg.solve(Q, state.velocity[3:6])
    gains = controller.par.gains
    J = np.array([list(r) for r in ARM.base.inertia.full().rows], dtype=float)
    pull = np.array(tuple(gains.attitude)) * error + np.array(tuple(gains.rate)) * rates
    second = -np.linalg.solve(J, pull)
    h = 1e-6
    alpha = Q @ second + (
        rate_matrix(angles + h * rates) - rate_matrix(angles - h * rates)
    ) @ rates / (2 * h)
    qdd = joint_wish(controller, state, reference)
    at_rest = dataclasses.replace(
        state, velocity=np.concatenate([np.zeros(3), state.velocity[3:]])
    )
    force = PinocchioTwin(ARM).inverse_dynamics(
        at_rest, np.concatenate([np.zeros(3), alpha, qdd])
    )
    # the difference quotient of Q is good to 1e-9
    np.testing.assert_allclose(torque, force[3:6], atol=1e-8)
    np.testing.assert_allclose(efforts, force[6:], atol=1e-8)
    assert thrust == pytest.approx(
        float(ARM.mass) * up[2] / R.as_matrix()[2, 2], rel=1e-12
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_the_centres_reference_has_the_derivatives_of_its_position(seed):
    """Central differences of Pinocchio's centre of mass along a motion of base, yaw and
    joints: 1e-6 at h = 1e-3.
    """
    twin, rng = PinocchioTwin(ARM), np.random.default_rng(seed)
    p, v, a = (rng.normal(size=3) for _ in range(3))
    q, qd, qdd = (rng.normal(size=2) for _ in range(3))
    yaw = rng.normal(size=3)

    def center(t):
        psi = yaw[0] + yaw[1] * t + 0.5 * yaw[2] * t * t
        state = RandomState(
            position=p + v * t + 0.5 * a * t * t,
            quaternion=np.array([np.cos(psi / 2), 0, 0, np.sin(psi / 2)]),
            joints=q + qd * t + 0.5 * qdd * t * t,
            velocity=np.zeros(8),
        )
        return twin.center_of_mass(state)

    reference = Reference(
        position=vec(p),
        velocity=vec(v),
        acceleration=vec(a),
        yaw=float(yaw[0]),
        yaw_rate=float(yaw[1]),
        yaw_acceleration=float(yaw[2]),
        joints=tuple(q.tolist()),
        joint_rates=tuple(qd.tolist()),
        joint_accelerations=tuple(qdd.tolist()),
    )
    place, velocity, acceleration = (
        scalars(each) for each in center_reference(ARM, reference)
    )
    h = 1e-3
    np.testing.assert_allclose(place, center(0.0), atol=1e-12)
    np.testing.assert_allclose(velocity, (center(h) - center(-h)) / (2 * h), atol=5e-6)
    np.testing.assert_allclose(
        acceleration, (center(h) - 2 * center(0.0) + center(-h)) / h**2, atol=5e-6
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_the_locked_body_turns_about_its_centre_as_wanted(seed):
    """Euler's equation about Pinocchio's centre of mass: the torque there is J_C
    alpha + w x J_C w.
    """
    controller, state, reference = soft("guo2023"), gentle(seed), wanted(seed)
    torque, thrust, efforts = asked(controller, state, reference)
    twin, R = PinocchioTwin(ARM), rotation(state).as_matrix()
    m, gains = float(ARM.mass), controller.par.gains
    momentum = twin.momentum(state)
    position, velocity, acceleration = (
        scalars(each) for each in center_reference(ARM, reference)
    )
    com = twin.center_of_mass(state)
    up = acceleration + UP - np.array(tuple(gains.position)) * (com - position) / m
    up -= np.array(tuple(gains.velocity)) * (momentum[:3] / m - velocity) / m
    assert thrust == pytest.approx(m * up @ R[:, 2], rel=1e-11)
    alpha = geometric_alpha(controller, state, reference, up)
    J = (
        np.array(
            [
                twin.momentum(
                    dataclasses.replace(
                        state, velocity=np.concatenate([np.zeros(3), e, np.zeros(2)])
                    )
                )[3:]
                for e in np.eye(3)
            ]
        )
        @ R
    )
    w, c = state.velocity[3:6], R.T @ (com - state.position)
    expected = J @ alpha + np.cross(w, J @ w) + np.cross(c, [0.0, 0.0, thrust])
    np.testing.assert_allclose(torque, expected, atol=1e-11)
    still = dataclasses.replace(state, velocity=np.zeros(8))
    servo = twin.inverse_dynamics(
        still, np.concatenate([np.zeros(6), joint_wish(controller, state, reference)])
    )
    np.testing.assert_allclose(efforts, servo[6:], atol=1e-11)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_base_feed_forward_is_pinocchios_inverse_dynamics_of_the_reference(seed):
    controller, state, reference = soft("li2024"), gentle(seed), wanted(seed)
    torque, thrust, _ = asked(controller, state, reference)
    twin, R = PinocchioTwin(ARM), rotation(state).as_matrix()
    at_rest = dataclasses.replace(
        state, velocity=np.concatenate([np.zeros(3), state.velocity[3:]])
    )
    qdd = np.array(reference.joint_accelerations)
    specific = pd_specific_force(controller, state, reference)
    reaction = twin.inverse_dynamics(
        at_rest, np.concatenate([np.zeros(6), qdd]), gravity=0.0
    )[:3]
    up = specific + reaction / float(ARM.mass)
    alpha = geometric_alpha(controller, state, reference, up)
    whole = twin.inverse_dynamics(at_rest, np.concatenate([specific - UP, alpha, qdd]))
    np.testing.assert_allclose(torque, whole[3:6], atol=1e-11)
    assert thrust == pytest.approx(float(ARM.mass) * up @ R[:, 2], rel=1e-11)


@pytest.mark.parametrize(
    ("kp", "kd"), [(4.0, 5.0), (350.0, 12.0), (9.0, 6.0), (0.0, 2.0)]
)
def test_sliding_rates_have_the_linear_part_of_the_pd_law(kp, kd):
    slope, gain = sliding_rates(kp, kd)
    assert slope + gain == pytest.approx(kd)
    assert 0.0 <= slope <= gain
    if kd * kd >= 4.0 * kp:
        assert slope * gain == pytest.approx(kp)


@pytest.mark.parametrize("products", [(0, 0, 0), (0.003, -0.002, 0.0025)])
@pytest.mark.parametrize("seed", SEEDS)
def test_without_switching_and_adaptation_sliding_mode_is_the_pd_law_of_its_gains(
    seed, products
):
    """Where K and Lambda are real the law is the computed torque of that PD, whatever
    the products of inertia.
    """
    J = dataclasses.replace(
        ARM.base.inertia, **dict(zip(("xy", "xz", "yz"), products, strict=True))
    )
    vehicle = dataclasses.replace(ARM, base=dataclasses.replace(ARM.base, inertia=J))
    controller = soft(
        "kim2013", vehicle, switching=(0.0, 0.0, 0.0), adaptation=(0.0, 0.0, 0.0)
    )
    par = controller.par
    mass = float(ARM.mass)
    moments = (float(J.xx), float(J.yy), float(J.zz))
    # kd = 3 sqrt(kp): the rates are real
    velocity = vec(3.0 * np.sqrt(scalars(par.gains.position) * mass))
    rate = vec(3.0 * np.sqrt(scalars(par.gains.attitude) * moments))
    gains = dataclasses.replace(par.gains, velocity=velocity, rate=rate)
    joints = dataclasses.replace(par.joint_gains, damping=(40.0, 40.0))
    controller = dataclasses.replace(
        controller, par=dataclasses.replace(par, gains=gains, joint_gains=joints)
    )
    state, reference = gentle(seed), wanted(seed)
    torque, thrust, efforts = asked(controller, state, reference)
    up, R = pd_specific_force(controller, state, reference), rotation(state).as_matrix()
    alpha = geometric_alpha(controller, state, reference, up)
    qdd = joint_wish(controller, state, reference)
    at_rest = dataclasses.replace(
        state, velocity=np.concatenate([np.zeros(3), state.velocity[3:]])
    )
    force = PinocchioTwin(vehicle).inverse_dynamics(
        at_rest, np.concatenate([up - UP, alpha, qdd])
    )
    np.testing.assert_allclose(torque, force[3:6], atol=1e-10)
    np.testing.assert_allclose(efforts, force[6:], atol=1e-10)
    assert thrust == pytest.approx(force[:3] @ R[:, 2], rel=1e-10)


def test_adaptation_follows_s_within_its_limit_and_waits_while_an_actuator_saturates():
    controller = make_controller(
        "kim2013", MODEL, adaptation=(2.0, 0.0, 3.0), limit=(0.01, 1.0, 1.0)
    )
    state = dataclasses.replace(
        gentle(1), position=np.array([0.1, 0.0, 0.0]), velocity=np.zeros(8)
    )
    still = Reference(
        joints=tuple(state.joints.tolist()),
        joint_rates=(0.0, 0.0),
        joint_accelerations=(0.0, 0.0),
    ).dense()
    weak = soft("kim2013", adaptation=(2.0, 0.0, 3.0), limit=(0.01, 1.0, 1.0))
    memory = weak.law(weak.memory, measured(state), still, DT, par=weak.par)[0]
    kp, kd = (
        float(g.x) / float(ARM.mass)
        for g in (controller.par.gains.position, controller.par.gains.velocity)
    )
    assert memory.position.x == pytest.approx(2.0 * sliding_rates(kp, kd)[0] * 0.1 * DT)
    for _ in range(20):
        memory, command = weak.law(memory, measured(state), still, DT, par=weak.par)
    assert memory.position.x == 0.01
    far = dataclasses.replace(state, position=np.array([0.0, 0.0, 50.0]))
    held, command = weak.law(weak.memory, measured(far), still, DT, par=weak.par)
    assert min(command.rotor_speeds) == 0.0
    assert held.position == weak.memory.position


def test_sliding_mode_does_not_adapt_while_what_was_sent_is_not_what_it_wished():
    weak = soft("kim2013", adaptation=(2.0, 2.0, 3.0))
    state, reference = (
        dataclasses.replace(gentle(1), position=np.array([0.1, 0.0, 0.0])),
        wanted(1),
    )
    memory, command = weak.law(
        weak.memory, measured(state), reference, DT, par=weak.par
    )

    def next_after(rotor=0.0, joint=0.0):
        first, *others = command.rotor_speeds
        sent = Command(
            rotor_speeds=(first + rotor, *others),
            efforts=(command.efforts[0], command.efforts[1] + joint),
        )
        return weak.law(
            with_applied_command(memory, sent),
            measured(state),
            reference,
            DT,
            par=weak.par,
        )[0]

    free, rotor, joint = next_after(), next_after(rotor=1e-9), next_after(joint=-1e-9)
    for held in (rotor, joint):
        assert (held.position, held.attitude, held.joints) == (
            memory.position,
            memory.attitude,
            memory.joints,
        )
    assert free.position != memory.position
    assert free.attitude != memory.attitude
    assert free.joints != memory.joints
    assert memory.applied == free.applied == (1.0, 1.0, 1.0)


@pytest.mark.parametrize("rate", [1.0, 10.0, 60.0])
def test_piecewise_constant_adaptation_is_the_publications_matrix_formula(rate):
    """sigma = -Phi^-1 mu with Phi = A^-1 (exp(A T) - 1), mu = exp(A T) ztilde."""
    A = np.diag([-rate, -2.0 * rate, -3.0 * rate])
    error = np.array([0.3, -0.1, 0.02])
    Phi = np.linalg.solve(A, expm(A * DT) - np.eye(3))
    sigma = -np.linalg.solve(Phi, expm(A * DT) @ error)
    found = [
        adaptation(e, a, DT)
        for e, a in zip(error, (rate, 2.0 * rate, 3.0 * rate), strict=True)
    ]
    np.testing.assert_allclose(found, sigma, rtol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_predictor_steps_with_pinocchios_forward_dynamics_of_what_was_sent(seed):
    controller, state, reference = soft("l1_adaptive"), gentle(seed), wanted(seed)
    law, par, rng = controller.law, controller.par, np.random.default_rng(seed)
    memory, desired = law(controller.memory, measured(state), reference, DT, par=par)
    sent = Command(
        rotor_speeds=tuple(
            (scalars(desired.rotor_speeds) + 30.0 * rng.normal(size=4)).tolist()
        ),
        efforts=tuple((scalars(desired.efforts) + 0.02 * rng.normal(size=2)).tolist()),
    )
    later = dataclasses.replace(
        state, velocity=state.velocity + 0.01 * rng.normal(size=8)
    )
    after, _ = law(
        with_applied_command(memory, sent), measured(later), reference, DT, par=par
    )

    def acceleration(at, command):
        torque, thrust = pushes(ARM, command)
        applied = np.concatenate(
            [rotation(at).as_matrix()[:, 2] * thrust, torque, scalars(command.efforts)]
        )
        return PinocchioTwin(ARM).forward_dynamics(at, applied)

    off = state.velocity + DT * acceleration(state, sent) - later.velocity
    rates = np.repeat(scalars(par.predictor), [3, 3, 2])
    e = np.exp(-rates * DT)
    sigma = off * rates * e / (e - 1.0)
    np.testing.assert_allclose(scalars(after.error), off, atol=1e-10)
    # off over a period of 5 ms
    np.testing.assert_allclose(scalars(after.sigma), sigma, atol=1e-8)
    expected = (
        later.velocity
        + off
        + DT * (acceleration(later, after.sent) + sigma - rates * off)
    )
    found = predict_velocities(par, after, DT)
    np.testing.assert_allclose(found, expected, atol=1e-10)


def test_the_predictor_turns_no_rotor_faster_than_it_can():
    par, state = soft("l1_adaptive").par, gentle(3)
    memory, desired = soft("l1_adaptive").law(
        soft("l1_adaptive").memory, measured(state), wanted(3), DT, par=par
    )
    top = tuple(float(rotor.max_speed) for rotor in ARM.rotors)
    limited, beyond = (
        predict_velocities(
            par,
            dataclasses.replace(
                memory, sent=dataclasses.replace(desired, rotor_speeds=speeds)
            ),
            DT,
        )
        for speeds in (top, tuple(2.0 * speed for speed in top))
    )
    assert limited == beyond
