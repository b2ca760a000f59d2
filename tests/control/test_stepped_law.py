"""The ladder from the paper's computed torque: each step does what its name says."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from published_laws import (
    ARM,
    DT,
    MODEL,
    NOTHING,
    UP,
    gentle,
    measured,
    rotation,
    vec,
    wanted,
)
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from skyarm.control.catalogue import ACCELERATION, HUMMINGBIRD
from skyarm.control.laws.ladder import _force_series, _turn
from skyarm.control.model import Model
from skyarm.log.metrics.windows import Window, Windows
from skyarm.reference import Reference
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate.batch import Batch
from support.laws import make_law, pushes, scalars
from support.vehicles import PinocchioTwin


def commanded(law, state, reference, **options):
    controller = make_law(law, MODEL, **options)
    weak = dataclasses.replace(
        controller.par.gains,
        attitude=controller.par.gains.attitude * 0.05,
        rate=controller.par.gains.rate * 0.05,
    )
    par = dataclasses.replace(controller.par, gains=weak)
    command = controller.law(
        controller.memory, measured(state), reference, DT, par=par
    )[1]
    assert min(command.rotor_speeds) > 0.0
    return command


@pytest.mark.parametrize("seed", range(6))
def test_the_coupled_force_is_pinocchios_without_the_bases_angular_acceleration(seed):
    """Thrust along the present axis is that force's component; a tilted arm moves the
    direction, not the size of R.
    """
    state, reference = gentle(seed), wanted(seed)
    thrust = pushes(ARM, commanded("ct_ladder 2", state, reference))[1]
    controller = make_law("ct_ladder 2", MODEL)
    gains, m = controller.par.gains, float(ARM.mass)
    up = -(scalars(gains.position) * (state.position - scalars(reference.position))) / m
    up -= (
        scalars(gains.velocity) * (state.velocity[:3] - scalars(reference.velocity)) / m
    )
    up += scalars(reference.acceleration)
    joint = controller.par.joint_gains
    qdd = np.array(joint.stiffness) * (np.array(reference.joints) - state.joints)
    qdd += np.array(joint.damping) * (
        np.array(reference.joint_rates) - state.velocity[6:]
    )
    qdd += np.array(reference.joint_accelerations)
    at_rest = dataclasses.replace(
        state, velocity=np.concatenate([np.zeros(3), state.velocity[3:]])
    )
    force = PinocchioTwin(ARM).inverse_dynamics(
        at_rest, np.concatenate([up, np.zeros(3), qdd])
    )[:3]
    assert thrust == pytest.approx(force @ rotation(state).as_matrix()[:, 2], rel=1e-11)


@pytest.mark.parametrize("seed", range(6))
def test_a_consistent_law_gets_the_joint_accelerations_it_wants(seed):
    """Its command through Pinocchio's forward dynamics; the paper's law, which assumes
    another base, does not.
    """
    state, reference = gentle(seed), wanted(seed)
    joint = make_law("ct_ladder 2", MODEL).par.joint_gains
    qdd = np.array(joint.stiffness) * (np.array(reference.joints) - state.joints)
    qdd += np.array(joint.damping) * (
        np.array(reference.joint_rates) - state.velocity[6:]
    )
    qdd += np.array(reference.joint_accelerations)
    found = []
    for law in ("ct_ladder 2", "ct_ladder 1"):
        command = commanded(law, state, reference)
        torque, thrust = pushes(ARM, command)
        applied = np.concatenate(
            [
                rotation(state).as_matrix()[:, 2] * thrust,
                torque,
                scalars(command.efforts),
            ]
        )
        found.append(PinocchioTwin(ARM).forward_dynamics(state, applied)[6:])
    np.testing.assert_allclose(found[0], qdd, atol=1e-9 * (1.0 + np.abs(qdd).max()))
    assert np.abs(found[1] - qdd).max() > 1e-3


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_of_the_force_are_those_along_the_motion_that_the_thrust_makes(
    seed,
):
    """SciPy integrates p'' = (b3 (F . b3) + d) / m - g e_z at a constant body rate; F
    by central differences.

    Differences of 1e-3 s leave 1e-6 of the first and 1e-4 of the second derivative,
    integration 1e-12.
    """
    state, m = gentle(seed), float(ARM.mass)
    rng = np.random.default_rng(seed)
    series = rng.normal(size=(5, 3)) * [[0.02], [0.1], [0.5], [1.0], [2.0]]
    push, R0, w = rng.normal(size=3), rotation(state), state.velocity[3:6]
    par = make_law("ct_ladder 4", MODEL).par
    kp, kv = scalars(par.gains.position), scalars(par.gains.velocity)

    def goal(t, k):
        return sum(
            series[k + i] * t**i / np.prod(range(1, i + 1)) for i in range(5 - k)
        )

    def force(t, p, v):
        return (
            m * (goal(t, 2) + UP) - kp * (p - goal(t, 0)) - kv * (v - goal(t, 1)) - push
        )

    def slope(t, y):
        b3 = (R0 * Rotation.from_rotvec(w * t)).as_matrix()[:, 2]
        return np.concatenate(
            [y[3:], (b3 * (force(t, y[:3], y[3:]) @ b3) + push) / m - UP]
        )

    start, h = np.concatenate([state.position, state.velocity[:3]]), 1e-3
    ends = [
        solve_ivp(slope, (0.0, t), start, rtol=1e-12, atol=1e-14).y[:, -1]
        for t in (-h, h)
    ]
    before, now, after = (
        force(-h, *np.split(ends[0], 2)),
        force(0.0, *np.split(start, 2)),
        force(h, *np.split(ends[1], 2)),
    )
    reference = Reference(
        position=vec(series[0]),
        velocity=vec(series[1]),
        acceleration=vec(series[2]),
        jerk=vec(series[3]),
        snap=vec(series[4]),
    )
    unknown = dataclasses.replace(NOTHING, force=vec(push))
    found = _force_series(
        vec(now),
        measured(state),
        reference,
        measured(state).quaternion.rotation(),
        unknown,
        par,
    )
    first, second = ([float(c.derivative(k)) for c in found] for k in (1, 2))
    np.testing.assert_allclose(
        first, (after - before) / (2 * h), atol=2e-5 * (1 + np.abs(first).max())
    )
    np.testing.assert_allclose(
        second,
        (after - 2 * now + before) / h**2,
        atol=1e-3 * (1 + np.abs(second).max()),
    )


@pytest.mark.parametrize("law", ["ct_ladder 3", "ct_ladder 6"])
def test_friction_of_the_observers_model_is_given_back(law):
    """Viscous at the measured rate, dry at the reference's: 0.002 qd + 0.003
    tanh(qd_d / 0.1).
    """
    state, reference = gentle(1), wanted(1)
    state = dataclasses.replace(state, velocity=0.1 * state.velocity)
    found = []
    for friction in ((0.0, 0.0), (0.002, 0.003)):
        damping, coulomb = friction
        vehicle = ARM.with_joints(damping=damping, coulomb=coulomb, coulomb_rate=0.1)
        controller = make_law(law, Model(vehicle=vehicle, gravity=MODEL.gravity))
        command = controller.law(
            controller.memory, measured(state), reference, DT, par=controller.par
        )[1]
        found.append(np.array(command.efforts))
    qd, qd_d = state.velocity[6:], np.array(reference.joint_rates)
    np.testing.assert_allclose(
        found[1] - found[0], 0.002 * qd + 0.003 * np.tanh(qd_d / 0.1), rtol=1e-9
    )


@pytest.mark.parametrize(
    "force", [[1e-6, -1e-6, 0.0], [1e-4, 0.0, 1e-4], [1e-3, 2e-3, 0.01]]
)
def test_a_wanted_force_near_nothing_does_not_ask_for_endless_turning(force):
    """In free fall the direction of the wanted force is undefined: below the floor it
    has that of the floor.
    """
    state, reference = gentle(2), wanted(2)
    par = make_law("ct_ladder 4", MODEL).par
    R = measured(state).quaternion.rotation()
    found = scalars(_turn(vec(force), measured(state), reference, R, NOTHING, par))
    # rad/s^2: a rotor craft of this size reaches some hundred; without the floor
    # thousands and more
    assert np.abs(found).max() < 1e3


def mean_errors(case, controller):
    """Mean errors of base and joints against the continuous reference, from 10 s to 20
    s.
    """
    scenario = dataclasses.replace(
        load_scenario(case, duration=20.0), controller=controller
    )
    names = ("position_error_mean_continuous", "joint_error_mean_continuous")
    batch = Batch(
        scenario, (), metrics=names, windows=Windows(steady=Window(10.0, 20.0))
    )
    found = batch.fly({}, episodes=np.zeros(1, dtype=int))
    return [float(found.metrics[name][0]) for name in names]


@pytest.mark.thorough
def test_each_step_buys_something_with_the_papers_gains():
    """Case 3 in wind for the observer, without for the rest: every rung against the one
    below, perfect sensors.
    """
    model = load_scenario("case3").controller.par.model
    flown = {}
    for steps in (2, 3, 4, 5, 6):
        controller = make_law(
            f"ct_ladder {steps}", model, gains=HUMMINGBIRD, joint_gains=ACCELERATION
        )
        flown[steps] = [
            mean_errors(name, controller) for name in ("case3", "case3_wind")
        ]
    base, joint = (
        {steps: found[0][k] for steps, found in flown.items()} for k in (0, 1)
    )
    assert flown[2][1][0] > 0.5
    assert flown[3][1][0] < 0.02
    assert base[4] < 0.85 * base[3]
    assert joint[5] < 0.8 * joint[4]
    assert base[6] < 0.85 * base[5]
