"""The same vehicle from first principles: world positions and body rates by complex
steps, nothing of skyarm in it.

The kinetic energy is summed mass by mass from the positions alone; no Jacobian, block
or partial is written down. Kept apart from the paper's algebra on purpose: two copies
of one formula prove nothing.
"""

import numpy as np

MASSES = (0.716, 0.04, 0.04, 0.01)
BASE_INERTIA = np.diag([7.0e-3, 7.0e-3, 1.2e-2])
LINK_INERTIA = 7.5e-5
L = 0.15
STEP = 1e-30  # a complex step has no cancellation: any tiny step is exact to rounding


def rotation(q):
    (sx, sy, sz), (cx, cy, cz) = np.sin(q[3:6]), np.cos(q[3:6])
    yaw = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    pitch = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    roll = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    return yaw @ pitch @ roll


def positions(q):
    """World positions of base, both link centres and the tip: a chain of turns about
    the body's y axis.
    """
    turn = np.array(
        [[np.cos(q[6]), 0, np.sin(q[6])], [0, 1, 0], [-np.sin(q[6]), 0, np.cos(q[6])]]
    )
    bend = np.array(
        [[np.cos(q[7]), 0, np.sin(q[7])], [0, 1, 0], [-np.sin(q[7]), 0, np.cos(q[7])]]
    )
    down = np.array([0.0, 0.0, -1.0])
    R = rotation(q)
    upper, lower = R @ turn, R @ turn @ bend
    elbow = q[:3] + upper @ down * L
    return [
        q[:3],
        q[:3] + upper @ down * L / 2,
        elbow + lower @ down * L / 2,
        elbow + lower @ down * L,
    ]


def _stepped(q, k):
    z = np.asarray(q, dtype=complex).copy()
    z[k] += 1j * STEP
    return z


def velocity_jacobians(q):
    """Position Jacobians (3x8) of the four masses and the body-rate Jacobian (3x8), by
    complex steps.
    """
    linear = np.zeros((4, 3, 8))
    angular = np.zeros((3, 8))
    R = rotation(np.asarray(q, dtype=float))
    for k in range(8):
        z = _stepped(q, k)
        linear[:, :, k] = np.imag(positions(z)) / STEP
        skew = R.T @ (rotation(z).imag / STEP)
        angular[:, k] = skew[2, 1], skew[0, 2], skew[1, 0]
    return linear, angular


def mass_matrix(q):
    linear, w = velocity_jacobians(q)
    M = w.T @ BASE_INERTIA @ w
    for m, J in zip(MASSES, linear, strict=True):
        M = M + m * J.T @ J
    for joints in ([1, 0], [1, 1]):
        about_y = w[1] + np.array([0, 0, 0, 0, 0, 0, *joints])
        M = M + LINK_INERTIA * np.outer(about_y, about_y)
    return M


def potential_energy(q, gravity):
    return gravity * sum(m * p[2] for m, p in zip(MASSES, positions(q), strict=True))


def gravity_vector(q, gravity):
    return np.array(
        [np.imag(potential_energy(_stepped(q, k), gravity)) / STEP for k in range(8)]
    )


def states(count, seed, pitch=1.3):
    """Random configurations away from the pitch singularity, and rates."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-np.pi, np.pi, (count, 8))
    q[:, 4] = rng.uniform(-pitch, pitch, count)
    return q, rng.uniform(-3.0, 3.0, (count, 8))
