"""The virtual body that a torque turns: against SciPy, against work and energy, about one axis and at large angles."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from skyarm.algebra import Vec3
from skyarm.control.laws.centroidal.virtual_body import (
    SMALL,
    Compliance,
    VirtualBody,
    generalised_torque,
    rotate,
    rotation_series,
)

DT, REST = 0.005, VirtualBody()
J, D, K = (0.05, 0.02, 0.08), (0.1, 0.05, 0.0), (0.9, 0.4, 0.3)


def body(J=J, D=D, K=K, lead=0.0, **more):
    return Compliance(inertia=J, damping=D, stiffness=K, lead=lead, **more)


def turned(gains, torques, dt=DT, memory=REST):
    """Rotation vectors with two derivatives, (n, 3, 3)."""
    rows = []
    for torque in torques:
        memory, vector = rotate(gains, memory, Vec3(*torque), dt)
        rows.append([[*each] for each in vector])
    return np.array(rows, dtype=float)


def left_jacobian(theta):
    """The integral of exp(s [theta]) over s from 0 to 1, by the matrix exponential of twice the size."""
    x, y, z = theta
    big = np.zeros((6, 6))
    big[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    big[:3, 3:] = np.eye(3)
    return expm(big)[:3, 3:]


def energy(theta, rate):
    return 0.5 * np.dot(J, rate**2) + 0.5 * np.dot(K, theta**2)


def free_decay(theta, rate, t, D=D):
    """Lagrange's equation of that energy, its derivatives taken by differences: nothing of the source in it."""

    def force(state, h=1e-6):
        place, speed = state[:3], state[3:]
        pull = [(energy(place + h * axis, speed) - energy(place - h * axis, speed)) / (2.0 * h) for axis in np.eye(3)]
        return np.array([*speed, *((-np.array(pull) - np.array(D) * speed) / np.array(J))])

    return solve_ivp(lambda _, y: force(y), (0.0, t), [*theta, *rate], rtol=1e-9, atol=1e-10).y[:3, -1]


@pytest.mark.parametrize("angle", [0.0, 1e-6, 0.3 * SMALL, 0.99 * SMALL, 1.01 * SMALL, 0.4, 2.5, 5.0])
def test_a_torque_pulls_by_the_transpose_of_the_left_jacobian(angle):
    theta = angle * np.array([0.6, -0.48, 0.64])
    torque = np.array([0.3, 1.2, -0.7])
    found = [*generalised_torque(Vec3(*theta), Vec3(*torque))]
    assert found == pytest.approx(left_jacobian(theta).T @ torque, abs=1e-10)


def test_the_work_of_the_torque_is_that_of_its_rotation():
    """tau . w = (A^T tau) . theta', w by differences of SciPy's rotations."""
    theta, rate, torque, h = np.array([1.1, -0.4, 0.8]), np.array([0.3, 0.9, -0.5]), np.array([0.2, -0.1, 0.4]), 1e-6
    ahead, behind = (Rotation.from_rotvec(theta + s * h * rate) for s in (1, -1))
    w = (ahead * behind.inv()).as_rotvec() / (2.0 * h)
    assert np.dot([*generalised_torque(Vec3(*theta), Vec3(*torque))], rate) == pytest.approx(torque @ w, rel=1e-8)


@pytest.mark.parametrize("angle", [0.0, 0.5 * SMALL, 0.7, 2.8])
def test_the_rotation_is_scipys_with_its_derivatives(angle):
    start, rate, bend, h = (
        angle * np.array([0.6, 0.0, -0.8]),
        np.array([0.5, -0.2, 0.3]),
        np.array([0.1, 0.4, 0.2]),
        1e-4,
    )

    def at(t):
        return Rotation.from_rotvec(start + rate * t + 0.5 * bend * t * t).as_matrix()

    E = rotation_series((Vec3(*start), Vec3(*rate), Vec3(*bend)))
    value, first, second = (np.array([[c.derivative(k) for c in row] for row in E.rows]) for k in range(3))
    assert value == pytest.approx(at(0.0), abs=1e-12)
    assert first == pytest.approx((at(h) - at(-h)) / (2.0 * h), abs=1e-8)
    assert second == pytest.approx((at(h) - 2.0 * at(0.0) + at(-h)) / (h * h), abs=1e-6)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("torque", [0.3, -0.3])
def test_a_constant_torque_turns_it_by_torque_over_stiffness_in_its_direction(axis, torque):
    push = np.zeros(3)
    push[axis] = torque
    damped = body(D=(0.4, 0.2, 0.4))
    found = turned(damped, [push] * 4000)[-1]
    wanted = np.zeros(3)
    wanted[axis] = torque / K[axis]
    assert found[0] == pytest.approx(wanted, abs=1e-6)
    assert np.abs(found[1:]).max() < 1e-6


def test_free_decay_is_that_of_the_equation_of_its_energy():
    theta, rate = np.array([1.2, -0.7, 0.9]), np.array([0.5, 2.0, -1.0])
    memory = VirtualBody(offset=tuple(theta.tolist()), rate=tuple(rate.tolist()))
    found = turned(body(), [(0.0, 0.0, 0.0)] * 2000, dt=5e-4, memory=memory)
    for n in (200, 1000, 2000):
        assert found[n - 1, 0] == pytest.approx(free_decay(theta, rate, n * 5e-4), abs=2e-4)


def test_it_keeps_no_more_energy_than_the_torque_gave_by_its_work():
    """At angles up to 2 rad about an axis that wanders, w by differences of SciPy's rotations."""
    rng, dt = np.random.default_rng(4), 1e-3
    torques = 0.4 * np.cumsum(rng.normal(size=(3000, 3)), axis=0) * dt**0.5
    found = turned(body(D=(0.0, 0.0, 0.0)), torques, dt=dt)
    rotations = Rotation.from_rotvec(np.concatenate([np.zeros((1, 3)), found[:, 0]]))
    turns = (rotations[1:] * rotations[:-1].inv()).as_rotvec()
    work = (torques * turns).sum(axis=1).cumsum()
    kept = np.array([energy(theta, rate) for theta, rate in found[:, :2]])
    assert np.linalg.norm(found[:, 0], axis=1).max() > 1.5
    assert kept == pytest.approx(work, abs=0.01 * kept.max())  # of first order in dt


def test_an_axis_that_is_held_stays_and_axes_turn_with_the_normal():
    n, a, b = Vec3(-0.6, 0.8, 0.0), Vec3(0.8, 0.6, 0.0), Vec3(0.0, 0.0, 1.0)
    gains = body((0.05, 0, 0.02), (0.2, 0, 0.1), (0.4, 0, 0.3), axes=(n, a, b))
    torques = np.random.default_rng(0).normal(size=(200, 3))
    found = turned(gains, torques)
    along = found[:, 0] @ np.array([[*each] for each in (n, a, b)]).T
    assert np.abs(along[:, 1]).max() < 1e-15
    assert np.abs(along[:, [0, 2]]).max(axis=0).min() > 0.1


def test_a_batch_equals_a_loop():
    rng = np.random.default_rng(3)
    angles, rates, torques = rng.normal(size=(3, 3, 7))
    gains = body()
    memory, vector = rotate(gains, VirtualBody(offset=tuple(angles), rate=tuple(rates)), Vec3(*torques), DT)
    for i in range(7):
        one = VirtualBody(offset=tuple(angles[:, i].tolist()), rate=tuple(rates[:, i].tolist()))
        alone, own = rotate(gains, one, Vec3(*torques[:, i].tolist()), DT)
        assert [each[i] for each in (*memory.offset, *memory.rate)] == [*alone.offset, *alone.rate]
        assert [each[i] for v in vector for each in v] == [each for v in own for each in v]
