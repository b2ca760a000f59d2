"""The same recursions on every engine; derivatives against the mass matrix."""

from __future__ import annotations

import numpy as np
import pytest

from skyarm import dynamics
from skyarm.algebra import Force, Motion, Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.dynamics import array_front as arrays
from support.engines import ENGINES, evaluate, jax_doubles, slopes
from support.vehicles import random_state, random_vehicle

N = 2
VEHICLE = random_vehicle(np.random.default_rng(31), N)


def lanes(count):
    """Rows: joints, body rate, joint rates, force and torque (or accelerations) in body
    axes, joint efforts.
    """
    return np.random.default_rng(32).normal(size=(count, 3 * N + 9))


def split(x):
    return (
        x[:N],
        Vec3(*x[N : N + 3]),
        x[N + 3 : 2 * N + 3],
        x[2 * N + 3 : 2 * N + 9],
        x[2 * N + 9 :],
    )


def forward(*x):
    q, w, qd, f, tau = split(x)
    base, qdd = dynamics.forward_dynamics(
        VEHICLE, q, w, qd, Force(Vec3(*f[3:]), Vec3(*f[:3])), tau
    )
    return [*base.linear, *base.angular, *qdd]


def inverse(*x):
    q, w, qd, a, qdd = split(x)
    force, tau = dynamics.inverse_dynamics(
        VEHICLE, q, w, qd, Motion(Vec3(*a[3:]), Vec3(*a[:3])), qdd
    )
    return [*force.force, *force.torque, *tau]


def energy(*x):
    q, w, qd, rest, _ = split(x)
    state = State(
        position=Vec3(*rest[:3]),
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=Vec3(*rest[3:]),
        rate=w,
        joints=q,
        joint_rates=qd,
    )
    momentum = dynamics.momentum(VEHICLE, state)
    potential = dynamics.potential_energy(VEHICLE, state, 9.81)
    return [
        dynamics.kinetic_energy(VEHICLE, state),
        potential,
        *momentum.linear,
        *momentum.angular,
    ]


@pytest.mark.parametrize("engine", [engine for engine in ENGINES if engine != "floats"])
@pytest.mark.parametrize("function", [forward, inverse, energy])
def test_an_engine_gives_the_numbers_of_plain_floats(engine, function):
    points = lanes(3)
    wanted = evaluate("floats", function, points)
    found = evaluate(engine, function, points)
    # other sines and another order of sums; the condition of this M is below 1e4
    assert np.allclose(found, wanted, rtol=0.0, atol=1e-11 * np.abs(wanted).max())


def test_the_gradient_of_kinetic_energy_is_the_generalized_momentum_in_jax():
    jax = pytest.importorskip("jax")
    state = random_state(np.random.default_rng(33), N)
    with jax_doubles():

        def kinetic(v):
            record = State(
                position=Vec3(*state.position.tolist()),
                quaternion=Quaternion(*state.quaternion.tolist()),
                velocity=Vec3(*v[:3]),
                rate=Vec3(*v[3:6]),
                joints=tuple(state.joints.tolist()),
                joint_rates=tuple(v[6:]),
            )
            return dynamics.kinetic_energy(VEHICLE, record)

        gradient = np.asarray(jax.grad(kinetic)(jax.numpy.asarray(state.velocity)))
    M = arrays.mass_matrix(VEHICLE, *state.configuration)
    assert np.allclose(
        gradient, M @ state.velocity, rtol=0.0, atol=1e-12 * np.abs(gradient).max()
    )


def test_the_jacobian_of_inverse_dynamics_by_acceleration_is_the_mass_matrix():
    point = lanes(1)[0]
    jacobian = slopes(inverse, point)[:, 2 * N + 3 :]
    level = (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), point[:N])
    M = arrays.mass_matrix(VEHICLE, *level)
    # roundings, divided by steps that are refined till the others have settled
    assert np.allclose(jacobian, M, rtol=0.0, atol=1e-10 * np.abs(M).max())
