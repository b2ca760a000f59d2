"""The paper's equations of motion as public functions: against the 8 x 8 form,
Pinocchio and MuJoCo, and by laws.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.paper import (
    coriolis_matrix,
    forward_kinematics,
    gravity_vector,
    mass_matrix,
)
from support import euler_lagrange as el
from support.vehicles import TWINS, RandomState, random_vehicle, with_armature

PAPER = skyarm.load_vehicle("hummingbird_arm2")
RELATIVE = 1e-9
STEP = 1e-30  # a complex step has no cancellation: any tiny step is exact to rounding


def states(count: int, joints: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Random coordinates with a pitch of up to 75 degrees, and their rates."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-np.pi, np.pi, (count, 6 + joints))
    q[:, 4] = rng.uniform(-1.3, 1.3, count)
    return q, rng.uniform(-3.0, 3.0, q.shape)


Q, QD = states(20, 2, seed=481)


def close(ours: np.ndarray, theirs: np.ndarray, relative: float = RELATIVE) -> None:
    assert ours.shape == theirs.shape
    assert np.abs(ours - theirs).max() <= relative * np.abs(theirs).max()


def rotation(q: np.ndarray) -> np.ndarray:
    """R = Rz Ry Rx by hand; complex angles for its derivative."""
    (sx, sy, sz), (cx, cy, cz) = np.sin(q[3:6]), np.cos(q[3:6])
    yaw = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    pitch = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    roll = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    return yaw @ pitch @ roll


def body_rates(q: np.ndarray) -> np.ndarray:
    """Q of w_B = Q [phi', theta', psi'], from R alone: the columns of R^T dR by complex
    steps, or by its formula.
    """
    columns = []
    for k in range(3, 6):
        z = q.astype(complex)
        z[k] += 1j * STEP
        turn = rotation(q).T @ (rotation(z).imag / STEP)
        columns.append([turn[2, 1], turn[0, 2], turn[1, 0]])
    return np.array(columns).T


def velocity_map(q: np.ndarray) -> np.ndarray:
    T = np.eye(len(q))
    T[3:6, 3:6] = body_rates(q)
    return T


def turning(q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """dT/dt qd by a five-point difference: R's third derivative is not at hand by a
    complex step.
    """
    h = 1e-3
    at = [velocity_map(q + k * h * qd) for k in (-2, -1, 1, 2)]
    return (at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * h) @ qd


def at_state(q: np.ndarray, velocity: np.ndarray) -> RandomState:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation(q)).as_quat()
    return RandomState(q[:3], np.array([w, x, y, z]), q[6:], velocity)


@pytest.fixture(params=sorted(TWINS))
def twin_of(request):
    pytest.importorskip(request.param)
    return TWINS[request.param]


@pytest.fixture(params=range(4))
def vehicle(request):
    rng = np.random.default_rng([48, request.param])
    made = random_vehicle(rng, request.param + 1)
    return with_armature(made, rng) if request.param % 2 else made


def test_mass_coriolis_and_gravity_are_those_of_the_papers_8x8_form():
    for q, qd in zip(Q, QD, strict=True):
        close(mass_matrix(PAPER, q), el.mass_matrix(q))
        close(coriolis_matrix(PAPER, q, qd), el.coriolis_matrix(q, qd))
        close(gravity_vector(PAPER, q), el.gravity_vector(q))


def test_mass_matrix_of_any_tree_is_the_oracles_by_the_euler_rate_map(vehicle, twin_of):
    twin = twin_of(vehicle)
    for q in states(3, vehicle.n, seed=1)[0]:
        T = velocity_map(q)
        close(
            mass_matrix(vehicle, q),
            T.T @ twin.mass_matrix(at_state(q, np.zeros(len(q)))) @ T,
        )


def test_the_coriolis_matrix_of_any_tree_is_the_oracles_symmetric_velocity_products(
    vehicle, twin_of
):
    """C is linear in qd and C(a) b = C(b) a, so the products h(a) = C(a) a alone
    determine it: by polarisation.
    """
    twin = twin_of(vehicle)
    for q, qd in zip(*states(2, vehicle.n, seed=2), strict=True):

        def products(rate, q=q):
            T = velocity_map(q)
            return T.T @ twin.inverse_dynamics(
                at_state(q, T @ rate), turning(q, rate), 0.0
            )

        axes = np.eye(len(q))
        columns = [0.5 * (products(qd + e) - products(qd) - products(e)) for e in axes]
        close(coriolis_matrix(vehicle, q, qd), np.array(columns).T)


def test_gravity_vector_of_any_tree_is_the_oracles_force_at_rest(vehicle, twin_of):
    twin = twin_of(vehicle)
    for q in states(3, vehicle.n, seed=3)[0]:
        at, zero = at_state(q, np.zeros(len(q))), np.zeros(len(q))
        close(
            gravity_vector(vehicle, q, gravity=3.71),
            velocity_map(q).T @ twin.inverse_dynamics(at, zero, 3.71),
        )


def test_gravity_vector_is_the_gradient_of_the_potential_energy(vehicle):
    for q in states(2, vehicle.n, seed=4)[0]:

        def energy(at):
            place = at_state(at, np.zeros(len(at)))
            return float(skyarm.energy(vehicle, *place.all, gravity=9.81))

        h = 1e-3  # five points: h^4/30 of the fifth derivative is 3e-14 of the energy
        slope = [
            sum(
                c * energy(q + k * h * e)
                for k, c in ((-2, 1), (-1, -8), (1, 8), (2, -1))
            )
            / (12 * h)
            for e in np.eye(len(q))
        ]
        close(gravity_vector(vehicle, q), np.array(slope))


def test_gravity_is_the_mass_matrix_times_g_upwards(vehicle):
    for q in states(3, vehicle.n, seed=5)[0]:
        up = np.zeros(len(q))
        up[2] = 9.81
        close(gravity_vector(vehicle, q), mass_matrix(vehicle, q) @ up, 1e-13)


def test_mass_matrix_is_symmetric_and_positive_definite(vehicle):
    for q in states(5, vehicle.n, seed=6)[0]:
        M = mass_matrix(vehicle, q)
        assert np.array_equal(M, M.T)
        assert np.linalg.eigvalsh(M).min() > 0.0


def test_rate_of_the_mass_matrix_less_twice_c_is_skew(vehicle):
    for q, qd in zip(*states(3, vehicle.n, seed=7), strict=True):
        h = 3e-4
        M = [mass_matrix(vehicle, q + k * h * qd) for k in (-2, -1, 1, 2)]
        rate = (M[0] - 8 * M[1] + 8 * M[2] - M[3]) / (12 * h)
        N = rate - 2.0 * coriolis_matrix(vehicle, q, qd)
        # five points: h^4/30 of the fifth derivative at rates of 3 rad/s, and rounding
        # over h
        assert np.abs(N + N.T).max() < 1e-9 * np.abs(rate).max()


def test_a_batch_equals_a_loop():
    batch, rates = Q.reshape(4, 5, 8), QD.reshape(4, 5, 8)
    for function, arguments in (
        (mass_matrix, (batch,)),
        (coriolis_matrix, (batch, rates)),
        (gravity_vector, (batch,)),
    ):
        found = function(PAPER, *arguments)
        single = [
            function(PAPER, *(each[i, j] for each in arguments))
            for i in range(4)
            for j in range(5)
        ]
        close(found, np.array(single).reshape(found.shape), 1e-15)
    poses = forward_kinematics(PAPER, batch)
    for name, pose in poses.items():
        close(pose[1, 2], forward_kinematics(PAPER, batch[1, 2])[name], 1e-15)


def test_transforms_are_those_of_the_papers_points():
    """(5), (9), (10): the tip, with the elbow at L1 and a = th1, b = th1 + th2."""
    for q in Q[:5]:
        poses, L = forward_kinematics(PAPER, q), 0.15
        a, b = q[6], q[6] + q[7]
        elbow = -L * np.array([math.sin(a), 0.0, math.cos(a)])
        tip = elbow - L * np.array([math.sin(b), 0.0, math.cos(b)])
        for name, point, angle in (
            ("base", np.zeros(3), 0.0),
            ("link2", elbow, b),
            ("tip", tip, b),
        ):
            turn = np.array(
                [
                    [math.cos(angle), 0, math.sin(angle)],
                    [0, 1, 0],
                    [-math.sin(angle), 0, math.cos(angle)],
                ]
            )
            whole = np.eye(4)
            whole[:3, :3], whole[:3, 3] = (
                rotation(q) @ turn,
                q[:3] + rotation(q) @ point,
            )
            close(poses[name], whole, 1e-14)


def test_every_frame_of_any_tree_is_the_oracles(vehicle, twin_of):
    twin = twin_of(vehicle)
    for q in states(2, vehicle.n, seed=8)[0]:
        poses = forward_kinematics(vehicle, q)
        assert list(poses) == [
            "base",
            *(each.name for each in (*vehicle.links, *vehicle.frames)),
        ]
        for frame in vehicle.frames:
            position, turn, _ = twin.frame(at_state(q, np.zeros(len(q))), frame.name)
            whole = np.eye(4)
            whole[:3, :3], whole[:3, 3] = turn, position
            close(poses[frame.name], whole)


def test_a_frame_with_the_name_of_a_link_stands_under_a_name_of_its_own():
    frame = dataclasses.replace(PAPER.frame(), name="link1")
    twice = dataclasses.replace(PAPER, frames=(*PAPER.frames, frame))
    poses = forward_kinematics(twice, Q[0])
    assert list(poses) == ["base", "link1", "link2", "tip", "frame link1"]
    assert np.array_equal(poses["frame link1"], poses["tip"])


def test_coupled_joints_act_at_their_leader():
    """A gripper's second finger has no coordinate: M is that of the free fingers by the
    ratio of their rates.
    """
    vehicle = random_vehicle(np.random.default_rng(9), 3, branching=False)
    last = vehicle.links[2]
    tied = dataclasses.replace(
        vehicle,
        links=vehicle.links[:2],
        followers=(
            skyarm.vehicle.linkage.Follower(
                link=last, leader=1, ratio=-0.7, offset=0.2
            ),
        ),
    )
    q = states(1, 2, seed=10)[0][0]
    G = np.vstack([np.eye(8), [0.0] * 7 + [-0.7]])
    free = [*q, -0.7 * q[7] + 0.2]
    close(mass_matrix(tied, q), G.T @ mass_matrix(vehicle, free) @ G)
    close(
        forward_kinematics(tied, q)["link2"], forward_kinematics(vehicle, free)["link2"]
    )


def test_at_a_pitch_of_90_degrees_the_matrices_exist_and_m_has_no_inverse():
    q = np.array([0.0, 0.0, 1.0, 0.3, np.pi / 2, -0.4, 0.5, 0.2])
    M, C, G = (
        mass_matrix(PAPER, q),
        coriolis_matrix(PAPER, q, QD[0]),
        gravity_vector(PAPER, q),
    )
    assert all(np.isfinite(each).all() for each in (M, C, G))
    close(M, el.mass_matrix(q))
    values = np.linalg.eigvalsh(M)
    assert abs(values[0]) < 1e-15 < values[1]
    # the direction without inertia: roll against yaw, which turn about one axis
    still = np.array([0, 0, 0, 1.0, 0, 1.0, 0, 0])
    assert np.abs(M @ still).max() < 1e-15


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: mass_matrix("hummingbird_arm2", Q[0]),
            "vehicle = 'hummingbird_arm2': must be a Vehicle",
        ),
        (lambda: mass_matrix(PAPER, Q[0, :7]), r"q: shape \(7,\), allowed \(..., 8\)"),
        (
            lambda: coriolis_matrix(PAPER, Q[0], QD[:, :6]),
            r"qd: shape \(20, 6\), allowed \(..., 8\)",
        ),
        (
            lambda: coriolis_matrix(PAPER, Q[:3], QD[:4]),
            "leading axes .* do not broadcast",
        ),
        (lambda: gravity_vector(PAPER, [math.nan] * 8), "q = .*must be finite numbers"),
        (
            lambda: gravity_vector(PAPER, Q[0], gravity=math.inf),
            "gravity = inf: must be one finite number",
        ),
        (lambda: forward_kinematics(PAPER, 3.0), r"q: shape \(\), allowed \(..., 8\)"),
    ],
)
def test_a_wrong_argument_is_refused_by_its_name(call, words):
    with pytest.raises(ValueError, match=words):
        call()
