"""The filter's matrices against numerical derivatives, dense algebra and the chi-square
distribution.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import Quaternion, Vec3
from skyarm.sensing.estimate.error_state import (
    Navigated,
    correct_state,
    diagonal,
    gate_of,
    innovations,
    level_attitude,
    navigate,
    of_specific_force,
    predict_covariance,
    scaled_covariance,
    transition,
    turn_between,
    update_by_scalar,
)
from skyarm.sensing.estimate.filter_constants import FilterNumbers
from skyarm.sensing.sensor_kinds import HeadingReading, ImuReading, PoseReading

RNG = np.random.default_rng(4)
BEGINNING = RNG.bit_generator.state
STEP = 0.005
GRAVITY = 9.8


@pytest.fixture(autouse=True)
def _drawn_anew() -> None:
    RNG.bit_generator.state = BEGINNING


def vector(size: float = 1.0) -> Vec3:
    return Vec3(*(size * RNG.standard_normal(3)).tolist())


def navigated() -> Navigated:
    return Navigated(
        position=vector(),
        velocity=vector(),
        quaternion=Quaternion.of_rotation_vector(vector(0.6)),
        gyro_bias=vector(0.02),
        accelerometer_bias=vector(0.2),
        push=vector(0.5),
    )


def imu() -> ImuReading:
    return ImuReading(
        time=0.0, rate=vector(0.5), specific_force=Vec3(0.0, 0.0, 9.8) + vector(0.5)
    )


def error_between(truth: Navigated, belief: Navigated) -> np.ndarray:
    """The eighteen components, the attitude's by the exact logarithm."""
    q = truth.quaternion * Quaternion(
        *(s * c for s, c in zip((1, -1, -1, -1), belief.quaternion, strict=True))
    )
    axis = np.array([q.x, q.y, q.z])
    size = np.linalg.norm(axis)
    turn = axis * (2.0 * np.arctan2(size, q.w) / size if size else 2.0)
    parts = [
        np.array(getattr(truth, name)) - np.array(getattr(belief, name))
        for name in Navigated.__slots__
    ]
    position, velocity, _, gyro, accelerometer, push = (
        p if len(p) == 3 else None for p in parts
    )
    return np.concatenate([position, velocity, turn, gyro, accelerometer, push])


def dense(rows, size):
    matrix = np.zeros((len(rows), size))
    for i, row in enumerate(rows):
        for j, c in row.items():
            matrix[i, j] = c
    return matrix


def full(P) -> np.ndarray:
    lower = np.array([[*row, *[0.0] * (len(P) - len(row))] for row in P])
    return lower + np.tril(lower, -1).T


def random_covariance(size: int):
    A = RNG.standard_normal((size, size))
    P = A @ A.T
    return tuple(tuple(P[i, : i + 1].tolist()) for i in range(size)), P


@pytest.mark.parametrize("modelled", [False, True])
def test_the_transition_is_the_derivative_of_the_navigation(modelled):
    """Central differences of the navigation itself; the rows are of first order in dt,
    hence 1 % of a step.
    """
    belief, before, after, force = (
        navigated(),
        imu(),
        imu(),
        vector(1.0) + Vec3(0.0, 0.0, 9.8),
    )
    size = 18 if modelled else 15

    def moved(error):
        return navigate(
            correct_state(belief, error),
            before,
            after,
            GRAVITY,
            STEP,
            force if modelled else None,
        )

    centre, force_W = moved([0.0] * size)
    F = dense(
        transition(belief.quaternion.rotation(), force_W, STEP, modelled=modelled), size
    )
    found = np.zeros((size, size))
    h = 1e-5
    for j in range(size):
        ahead, back = (
            [h * sign * (i == j) for i in range(size)] for sign in (1.0, -1.0)
        )
        found[:, j] = (
            error_between(moved(ahead)[0], centre)
            - error_between(moved(back)[0], centre)
        )[:size] / (2 * h)
    np.testing.assert_allclose(F, found, atol=0.05 * STEP)
    # what is structure is exact: identity, and nothing where nothing couples
    assert np.array_equal(np.diag(F), np.ones(size))


@pytest.mark.parametrize("modelled", [False, True])
def test_the_prediction_is_the_dense_product(modelled):
    size = 18 if modelled else 15
    P, matrix = random_covariance(size)
    rows = transition(
        navigated().quaternion.rotation(), vector(9.0), STEP, modelled=modelled
    )
    added = [0, 0, 0, *RNG.uniform(size=size - 3).tolist()]
    F = dense(rows, size)
    np.testing.assert_allclose(
        full(predict_covariance(P, rows, added)),
        F @ matrix @ F.T + np.diag(added),
        rtol=1e-12,
    )
    np.testing.assert_array_equal(full(scaled_covariance(P, 1.5)), 1.5 * matrix)


def test_scalars_one_after_the_other_are_the_joint_update():
    P, matrix = random_covariance(15)
    H, z, noise = (
        RNG.standard_normal((4, 15)),
        RNG.standard_normal(4),
        RNG.uniform(0.5, 2.0, 4),
    )
    after, error, surprise = P, [0] * 15, 0.0
    for row, value, variance in zip(H, z, noise, strict=True):
        after, error, part = update_by_scalar(
            after, error, dict(enumerate(row)), value, variance
        )
        surprise += part
    S = H @ matrix @ H.T + np.diag(noise)
    K = matrix @ H.T @ np.linalg.inv(S)
    np.testing.assert_allclose(error, K @ z, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(full(after), matrix - K @ S @ K.T, rtol=1e-8, atol=1e-9)
    assert surprise == pytest.approx(z @ np.linalg.inv(S) @ z, rel=1e-9)


@pytest.mark.parametrize("kind", ["pose", "heading", "force", "mounted"])
def test_each_innovation_falls_by_its_derivative(kind):
    """H is minus the derivative of the innovation by what the belief takes in."""
    belief, read, modelled = navigated(), imu(), vector(9.0)
    pose = PoseReading(time=0.0, position=vector(), quaternion=belief.quaternion)
    heading = HeadingReading(time=0.0, heading=0.3)

    def rows(at):
        if kind == "force":
            return of_specific_force(at, read.specific_force, modelled, 1.0)
        place = Vec3(0.2, -0.1, 0.3) if kind == "mounted" else Vec3(0, 0, 0)
        return innovations(
            at, heading if kind == "heading" else pose, 0.1, 0.2, 0.3, place
        )

    h = 1e-6
    H = dense([row.H for row in rows(belief)], 18)
    for j in range(18):
        ahead, back = (
            rows(correct_state(belief, [h * s * (i == j) for i in range(18)]))
            for s in (1.0, -1.0)
        )
        found = [
            -(a.value - b.value) / (2 * h) for a, b in zip(ahead, back, strict=True)
        ]
        np.testing.assert_allclose(H[:, j], found, atol=1e-7)
    of_pose = [0.01] * 3 + [0.04] * 3
    variances = {
        "pose": of_pose,
        "mounted": of_pose,
        "heading": [0.09],
        "force": [1.0] * 3,
    }[kind]
    np.testing.assert_allclose(
        [row.variance for row in rows(belief)], variances, rtol=1e-12
    )


def test_a_heading_beyond_half_a_turn_is_taken_the_short_way():
    south = replace(
        navigated(), quaternion=Quaternion.of_rotation_vector(Vec3(0.0, 0.0, 3.1))
    )
    (row,) = innovations(south, HeadingReading(time=0.0, heading=-3.1), 0.1, 0.1, 0.1)
    assert row.value == pytest.approx(2 * np.pi - 6.2, abs=1e-9)
    opposite = Quaternion(*(-c for c in south.quaternion))
    assert np.allclose(turn_between(south.quaternion, opposite), 0.0, atol=1e-12)
    small = Quaternion.of_rotation_vector(Vec3(0.01, -0.02, 0.03))
    np.testing.assert_allclose(
        turn_between(south.quaternion, small * opposite), (0.01, -0.02, 0.03), atol=1e-5
    )


def test_navigation_of_a_steady_turn_and_a_steady_push_is_the_closed_form():
    """Turning about the vertical at a steady rate with a steady world acceleration, for
    a second.
    """
    rate, acceleration = 0.7, np.array([0.4, -0.2, 0.3])

    def reading(t):
        c, s = np.cos(rate * t), np.sin(rate * t)
        R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        force = R.T @ np.add(acceleration, (0.0, 0.0, GRAVITY))
        return ImuReading(
            time=t, rate=Vec3(0.0, 0.0, rate), specific_force=Vec3(*force.tolist())
        )

    zero = Vec3(0.0, 0.0, 0.0)
    now = Navigated(
        position=zero,
        velocity=zero,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        gyro_bias=zero,
        accelerometer_bias=zero,
    )
    for k in range(200):
        now, _ = navigate(
            now, reading(k * STEP), reading((k + 1) * STEP), GRAVITY, STEP
        )
    np.testing.assert_allclose(tuple(now.velocity), acceleration, atol=1e-9)
    np.testing.assert_allclose(tuple(now.position), 0.5 * acceleration, atol=1e-9)
    np.testing.assert_allclose(
        tuple(now.quaternion), (np.cos(0.35), 0, 0, np.sin(0.35)), atol=1e-12
    )


def test_a_base_at_rest_is_levelled_by_its_accelerometer():
    q = Quaternion.of_rotation_vector(
        Vec3(0.0, 0.0, 0.8)
    ) * Quaternion.of_rotation_vector(Vec3(0.2, -0.3, 0.0))
    force = q.rotation().apply_T(Vec3(0.0, 0.0, 9.8))
    x = q.rotation().column(0)
    found = level_attitude(force, float(np.arctan2(x.y, x.x)))
    np.testing.assert_allclose(np.array(found), np.array(q), atol=1e-12)


@pytest.mark.parametrize("count", [1, 3, 6])
@pytest.mark.parametrize("deviations", [3.0, 4.5])
def test_the_gate_is_near_the_quantile_of_chi_square(count, deviations):
    stats = pytest.importorskip("scipy.stats")
    exact = stats.chi2.isf(stats.norm.sf(deviations), count)
    assert gate_of(deviations, count) == pytest.approx(
        exact, rel={1: 0.15, 3: 0.07, 6: 0.04}[count]
    )


def test_a_push_that_turns_with_the_base_walks_across_its_own_turning():
    filters, belief, reading = (
        FilterNumbers(force="modelled", push_walk=0.02, push_turn=0.2),
        navigated(),
        imu(),
    )
    found = filters.added_variances(belief, reading, STEP)
    x, y, z, w = (
        belief.quaternion.x,
        belief.quaternion.y,
        belief.quaternion.z,
        belief.quaternion.w,
    )
    rate = Rotation.from_quat([x, y, z, w]).apply([*(reading.rate - belief.gyro_bias)])
    turning = np.cross(rate, list(belief.push))
    np.testing.assert_allclose(
        found[-3:], (0.02**2 + 0.2 * turning**2) * STEP, rtol=1e-12
    )


def test_the_first_covariance_is_of_independent_components():
    assert np.array_equal(full(diagonal([1.0, 4.0, 0])), np.diag([1.0, 4.0, 0.0]))
