"""Every term of the sliding mode, and of what it adapts, against Pinocchio and NumPy
from memories made by hand.

INDI's remembered commands: which of them its filters and its motors see, against SciPy
and a lag by hand.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from published_laws import (
    ARM,
    DT,
    UP,
    asked,
    gentle,
    measured,
    rotation,
    soft,
    vec,
    wanted,
)
from scipy import signal

import skyarm
from skyarm.control.blocks.common import arm_alone
from skyarm.control.catalogue import make_controller
from skyarm.control.controller import with_applied_command
from skyarm.control.laws.published.indi import _filter_signals
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command
from support.laws import pushes, replaced, scalars
from support.vehicles import PinocchioTwin

pytest.importorskip("pinocchio")

SWITCHING, BOUNDARY = (0.4, 1.5, 2.5), (0.1, 0.6, 0.9)
ADAPTATION, LIMIT = (2.0, 20.0, 50.0), (0.5, 4.0, 6.0)
"""No two of a row alike, so that the constant of another group shows."""


def law_with_terms(vehicle=ARM, **gains):
    options = {
        "switching": SWITCHING,
        "boundary": BOUNDARY,
        "adaptation": ADAPTATION,
        "limit": LIMIT,
    }
    law = soft("kim2013", vehicle, **options)
    return (
        replaced(law, joint_gains=dataclasses.replace(law.par.joint_gains, **gains))
        if gains
        else law
    )


def adapted(law, seed, share=0.5):
    """A memory that has learned something in every coordinate, within its limits."""
    rng = np.random.default_rng(seed + 40)
    found = [
        share * limit * rng.uniform(-1.0, 1.0, size)
        for limit, size in zip(LIMIT, (3, 3, 2), strict=True)
    ]
    memory = dataclasses.replace(
        law.memory,
        position=vec(found[0]),
        attitude=vec(found[1]),
        joints=tuple(found[2].tolist()),
    )
    return memory, found


def errors(law, state, reference, delta):
    """Errors and their rates, stiffness and damping on acceleration of position,
    attitude and joints.
    """
    par, mass = law.par, float(ARM.mass)
    J = law.par.model.vehicle.base.inertia
    moments = np.array([float(J.xx), float(J.yy), float(J.zz)])
    e_p = state.position - scalars(reference.position)
    v = state.velocity[:3] - scalars(reference.velocity)
    position = (
        e_p,
        v,
        scalars(par.gains.position) / mass,
        scalars(par.gains.velocity) / mass,
    )
    up = linear(*position, 0) - delta[0] + scalars(reference.acceleration) + UP
    R = rotation(state).as_matrix()
    b3 = up / np.linalg.norm(up)
    b2 = np.cross(b3, [np.cos(reference.yaw), np.sin(reference.yaw), 0.0])
    b2 /= np.linalg.norm(b2)
    R_d = np.column_stack([np.cross(b2, b3), b2, b3])
    E = 0.5 * (R_d.T @ R - R.T @ R_d)
    e_R = np.array([E[2, 1], E[0, 2], E[1, 0]])
    e_w = state.velocity[3:6] - R.T @ R_d @ [0.0, 0.0, reference.yaw_rate]
    attitude = (
        e_R,
        e_w,
        scalars(par.gains.attitude) / moments,
        scalars(par.gains.rate) / moments,
    )
    e_q = state.joints - np.array(reference.joints)
    qd = state.velocity[6:] - np.array(reference.joint_rates)
    joints = (
        e_q,
        qd,
        scalars(par.joint_gains.stiffness),
        scalars(par.joint_gains.damping),
    )
    return (position, attitude, joints), up


def sliding(e, de, kp, kd):
    """s = de + Lambda e, with Lambda the smaller root of x^2 - kd x + kp, kd / 2 where
    the roots are not real.
    """
    roots = np.array(
        [np.sort(np.roots([1.0, -b, a]).real) for a, b in zip(kp, kd, strict=True)]
    )
    return de + roots[:, 0] * e, roots


def linear(e, de, kp, kd, group):
    """-Lambda de - K s - eta tanh(s / boundary)."""
    s, roots = sliding(e, de, kp, kd)
    return (
        -roots[:, 0] * de
        - roots[:, 1] * s
        - SWITCHING[group] * np.tanh(s / BOUNDARY[group])
    )


@pytest.mark.parametrize("damping", [(20.0, 26.0), (40.0, 33.0)])
@pytest.mark.parametrize("seed", range(8))
def test_wanted_accelerations_are_linear_part_switching_adaptation_and_reference(
    seed, damping
):
    """Joint roots that are real and that are not; all disturbance accelerations learned
    so far are taken off.
    """
    law, state, reference = law_with_terms(damping=damping), gentle(seed), wanted(seed)
    memory, delta = adapted(law, seed)
    torque, thrust, efforts = asked(
        dataclasses.replace(law, memory=memory), state, reference
    )
    (_, attitude, joints), up = errors(law, state, reference, delta)
    alpha = linear(*attitude, 1) - delta[1]
    qdd = linear(*joints, 2) - delta[2] + np.array(reference.joint_accelerations)
    at_rest = dataclasses.replace(
        state, velocity=np.concatenate([np.zeros(3), state.velocity[3:]])
    )
    force = PinocchioTwin(ARM).inverse_dynamics(
        at_rest, np.concatenate([up - UP, alpha, qdd])
    )
    # np.roots of a double root is good to 1e-7 at worst; joint accelerations of
    # hundreds of rad/s^2 on 1e-3 kg m^2
    np.testing.assert_allclose(torque, force[3:6], atol=1e-8)
    np.testing.assert_allclose(efforts, force[6:], atol=1e-8)
    assert thrust == pytest.approx(
        force[:3] @ rotation(state).as_matrix()[:, 2], rel=1e-9
    )


@pytest.mark.parametrize("share", [0.5, 1.0])
@pytest.mark.parametrize("seed", range(6))
def test_each_coordinate_adapts_by_its_own_s_up_to_its_own_limit(seed, share):
    law, state, reference = law_with_terms(), gentle(seed), wanted(seed)
    memory, delta = adapted(law, seed, share)
    if share == 1.0:
        # all at a limit: some are driven beyond it, others come back
        delta = [
            limit * np.sign(each) for limit, each in zip(LIMIT, delta, strict=True)
        ]
        memory = dataclasses.replace(
            memory,
            position=vec(delta[0]),
            attitude=vec(delta[1]),
            joints=tuple(delta[2].tolist()),
        )
    found, command = law.law(memory, measured(state), reference, DT, par=law.par)
    assert min(command.rotor_speeds) > 0.0
    groups, _ = errors(law, state, reference, delta)
    for i, name in enumerate(("position", "attitude", "joints")):
        s, _ = sliding(*groups[i])
        expected = np.clip(delta[i] + ADAPTATION[i] * s * DT, -LIMIT[i], LIMIT[i])
        np.testing.assert_allclose(
            scalars(getattr(found, name)), expected, rtol=1e-9, err_msg=name
        )
    assert found.sent == command


@pytest.mark.parametrize("stuck", [0, 1])
def test_a_joint_at_its_limit_of_effort_keeps_what_it_learned_while_all_else_adapts(
    stuck,
):
    limits = [np.inf, np.inf]
    limits[stuck] = 1e-6
    links = tuple(
        dataclasses.replace(
            link, joint=dataclasses.replace(link.joint, effort_limit=most)
        )
        for link, most in zip(ARM.links, limits, strict=True)
    )
    law, state, reference = (
        law_with_terms(dataclasses.replace(ARM, links=links)),
        gentle(3),
        wanted(3),
    )
    memory, _ = adapted(law, 3)
    found, command = law.law(memory, measured(state), reference, DT, par=law.par)
    assert abs(command.efforts[stuck]) == 1e-6
    assert found.joints[stuck] == memory.joints[stuck]
    assert found.joints[1 - stuck] != memory.joints[1 - stuck]
    assert all(a != b for a, b in zip(found.position, memory.position, strict=True))
    assert all(a != b for a, b in zip(found.attitude, memory.attitude, strict=True))


pytest.importorskip("pinocchio")

VEHICLE = skyarm.load_vehicle("hummingbird_arm2_rotors").with_joints(
    effort_limit=np.inf
)
"""Its motors are slower down than up, so that a lag taken the wrong way shows."""

PERIODS = 9


def law_of(delay, *, measured_speeds):
    model = Model(vehicle=VEHICLE, gravity=9.81)
    return make_controller(
        "indi", model, delay_periods=delay, measured_speeds=measured_speeds
    )


def readings(seed):
    """What the sensors say in each period, unlike from one to the next in every
    signal.
    """
    found = []
    for k in range(PERIODS):
        rng = np.random.default_rng(100 * seed + k)
        base = measured(gentle(100 * seed + k))
        found.append(
            dataclasses.replace(
                base,
                specific_force=vec(rng.normal(size=3) + UP),
                rotor_speeds=tuple(rng.uniform(400.0, 600.0, 4).tolist()),
            )
        )
    return found


def commands(seed):
    rng = np.random.default_rng(seed + 7)
    return [
        # some beyond 838 rad/s, which is all that the rotors reach
        Command(
            rotor_speeds=tuple(rng.uniform(300.0, 900.0, 4)),
            efforts=tuple(0.1 * rng.normal(size=2)),
        )
        for _ in range(PERIODS)
    ]


def stepped(law, seen, sent):
    """Memory before the last of the readings when every command was changed into the
    one that is listed.
    """
    memory = law.memory
    for reading, command in zip(seen[:-1], sent, strict=False):
        memory, _ = law.law(memory, reading, wanted(0), DT, par=law.par)
        memory = with_applied_command(memory, command)
    return memory


def acted(sent, first, delay):
    """The command of each period that a measurement so old shows: before the first one
    rotors and arm were held.
    """
    return [first] * (delay + 1) + sent[: PERIODS - delay - 1]


def lagged(first, targets):
    """Rotor speeds in each period: the first-order lag of each motor, up and down, by
    hand.
    """
    found = [np.array(first)]
    for target in targets[1:]:
        now = []
        for speed, goal, rotor in zip(found[-1], target, VEHICLE.rotors, strict=True):
            top = min(goal, float(rotor.max_speed))
            constant = float(
                rotor.time_constant_up if top > speed else rotor.time_constant_down
            )
            now.append(top + (speed - top) * np.exp(-DT / constant))
        found.append(np.array(now))
    return found


def held_by(reading):
    """Joint efforts that carry the arm on a base at rest, by Pinocchio."""
    w, x, y, z = (float(c) for c in reading.quaternion)
    still = dataclasses.replace(
        gentle(0),
        quaternion=np.array([w, x, y, z]),
        joints=scalars(reading.joints),
        velocity=np.zeros(8),
    )
    return PinocchioTwin(VEHICLE).inverse_dynamics(still, np.zeros(8))[6:]


def matrix(reading):
    w, x, y, z = (float(c) for c in reading.quaternion)
    return rotation(
        dataclasses.replace(gentle(0), quaternion=np.array([w, x, y, z]))
    ).as_matrix()


@pytest.mark.parametrize("measured_speeds", [True, False])
@pytest.mark.parametrize("delay", [0, 1, 3])
def test_every_signal_is_as_late_as_the_measurement_and_filtered_alike(
    delay, measured_speeds
):
    law, seen, sent = (
        law_of(delay, measured_speeds=measured_speeds),
        readings(delay),
        commands(delay),
    )
    memory, last = stepped(law, seen, sent), seen[-1]
    R = last.quaternion.rotation()
    after, _ = law.law(memory, last, wanted(0), DT, par=law.par)
    speeds = last.rotor_speeds if measured_speeds else after.speeds
    hold = arm_alone(law.par, R, last.joints, (0, 0))
    _, found = _filter_signals(memory, last, R, speeds, hold, DT, law.par, False)

    shown = acted(
        sent,
        Command(rotor_speeds=seen[0].rotor_speeds, efforts=tuple(held_by(seen[0]))),
        delay,
    )
    turning = [scalars(each.rotor_speeds) for each in seen]
    if not measured_speeds:
        turning = lagged(seen[0].rotor_speeds, [each.rotor_speeds for each in shown])
    np.testing.assert_allclose(scalars(speeds), turning[-1], rtol=1e-12)
    rows = []
    for reading, turned, command in zip(seen, turning, shown, strict=True):
        torque, thrust = pushes(
            VEHICLE, Command(rotor_speeds=tuple(turned.tolist()), efforts=())
        )
        rows.append(
            [
                *(matrix(reading) @ scalars(reading.specific_force)),
                *(matrix(reading)[:, 2] * thrust),
                *scalars(reading.rate),
                *torque,
                *scalars(reading.joint_rates),
                *command.efforts,
            ]
        )
    signals = np.array(rows)
    b, a = signal.butter(2, 15.0, fs=1.0 / DT)
    expected = [
        signal.lfilter(b, a, row, zi=signal.lfilter_zi(b, a) * row[0])[0][-1]
        for row in signals.T
    ]
    # two forms of one filter, signals of up to 10 N
    np.testing.assert_allclose(found, expected, atol=1e-9)
    np.testing.assert_allclose(
        scalars(memory.sent[-1].efforts), sent[PERIODS - 2].efforts
    )


@pytest.mark.parametrize("delay", [0, 2, 6])
def test_modelled_rotor_speeds_are_the_measured_ones_of_a_vehicle_as_it_is_believed(
    delay,
):
    """The same commands, whichever of both the law takes: with what is measured late,
    what is modelled is late too.
    """
    seen, turning = readings(20 + delay), []
    laws = [law_of(delay, measured_speeds=each) for each in (True, False)]
    memories, start = [law.memory for law in laws], [480.0, 470.0, 490.0, 475.0]
    truth = [np.array(start)]
    for k, reading in enumerate(seen):
        shown = dataclasses.replace(
            reading, rotor_speeds=tuple(truth[max(k - delay, 0)].tolist())
        )
        found = [
            law.law(memory, shown, wanted(k), DT, par=law.par)
            for law, memory in zip(laws, memories, strict=True)
        ]
        memories, (first, second) = (
            [memory for memory, _ in found],
            [command for _, command in found],
        )
        # one lag computed twice; commands of hundreds of rad/s
        np.testing.assert_allclose(
            second.rotor_speeds, first.rotor_speeds, rtol=1e-10, atol=1e-7
        )
        np.testing.assert_allclose(second.efforts, first.efforts, atol=1e-10)
        truth.append(lagged(truth[-1], [None, first.rotor_speeds])[-1])
        turning.append(first.rotor_speeds)
    assert np.ptp(turning, axis=0).min() > 50.0  # rad/s: the commands do move
