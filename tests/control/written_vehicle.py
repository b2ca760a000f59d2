"""Taylor series and rigid bodies of the law that is written again: NumPy and a vehicle
file, nothing of the library.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np

EYE = np.eye(3)
E_Z = np.array([0.0, 0.0, 1.0])


# Taylor series: the last axis has the coefficients f, f', f'' / 2, ...


PRODUCTS = np.array(
    [[[float(i + j == k) for k in range(5)] for j in range(5)] for i in range(5)]
)
"""1 where coefficients i and j of two factors belong to coefficient k of the
product."""


def mul(a: Any, b: Any) -> Any:
    """Product of two series."""
    n = min(a.shape[-1], b.shape[-1])
    return np.einsum(
        "...i,...j,ijk->...k", a[..., :n], b[..., :n], PRODUCTS[:n, :n, :n]
    )


def power(x: Any, p: float) -> Any:
    """x^p of a scalar series that is not 0."""
    c = [x[0] ** p]
    for k in range(1, len(x)):
        c.append(
            sum((i * p - (k - i)) * x[i] * c[k - i] for i in range(1, k + 1))
            / (k * x[0])
        )
    return np.array(c)


def one_plus(x: Any) -> Any:
    """1 and a scalar series."""
    return x + np.eye(len(x))[0]


def cos_sin(x: Any) -> tuple[Any, Any]:
    """Cosine and sine of a scalar series."""
    c, s = [np.cos(x[0])], [np.sin(x[0])]
    for k in range(1, len(x)):
        c.append(-sum(i * x[i] * s[k - i] for i in range(1, k + 1)) / k)
        s.append(sum(i * x[i] * c[k - i] for i in range(1, k + 1)) / k)
    return np.array(c), np.array(s)


FACTORIAL = np.array([1.0, 1.0, 2.0, 6.0, 24.0])


def series(*derivatives: Any) -> Any:
    """Series of a value and its derivatives."""
    return (
        np.stack([np.asarray(d, dtype=float) for d in derivatives], axis=-1)
        / FACTORIAL[: len(derivatives)]
    )


def derivatives(x: Any) -> list[Any]:
    """Value and derivatives of a series."""
    return [x[..., k] * FACTORIAL[k] for k in range(x.shape[-1])]


def dot(a: Any, b: Any) -> Any:
    """Scalar product of two vectors of series."""
    return mul(a, b).sum(axis=0)


def cross(a: Any, b: Any) -> Any:
    """Vector product of two vectors of series."""
    x, y, z = range(3)
    return np.stack(
        [mul(a[i], b[j]) - mul(a[j], b[i]) for i, j in ((y, z), (z, x), (x, y))]
    )


def matmul(A: Any, B: Any) -> Any:
    """Product of two matrices, or of a matrix and a vector, of series."""
    n = min(A.shape[-1], B.shape[-1])
    return np.einsum(
        "abi,b...j,ijk->a...k", A[..., :n], B[..., :n], PRODUCTS[:n, :n, :n]
    )


def vector(a: Any, b: Any) -> Any:
    """Vector product of two vectors of numbers."""
    (a1, a2, a3), (b1, b2, b3) = a, b
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])


def constant(x: Any, n: int) -> Any:
    """Series of n coefficients of a constant."""
    x = np.asarray(x, dtype=float)
    return np.concatenate([x[..., None], np.zeros((*x.shape, n - 1))], axis=-1)


def rotation_series(axis: Any, q: Any) -> Any:
    """Rotation by a series of angles about a unit axis: Rodrigues."""
    c, s = cos_sin(q)
    outer = axis[:, None] * axis
    R = (EYE - outer)[..., None] * c + skew(axis)[..., None] * s
    R[..., 0] += outer
    return R


def skew(v: Any) -> Any:
    """Matrix of the vector product with v."""
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def vee(A: Any) -> Any:
    """Axial vector of the skew part."""
    return 0.5 * np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]])


def half_turn(E: Any) -> Any:
    """What is added to vee(-E) near half a turn: along the axis, the eigenvector of E +
    E^T of the eigenvalue 2.
    """
    h, left = 0.2, 1.0 + np.trace(E)
    if left >= h * h:
        return np.zeros(3)
    axis = np.linalg.eigh(E + E.T)[1][:, 2]
    return (h - left / h) * axis * (1.0 if axis @ vee(-E) >= 0.0 else -1.0)


# attitudes


def turn(v: Any) -> Any:
    """Quaternion of a rotation vector."""
    angle = np.linalg.norm(v)
    return np.array(
        [np.cos(angle / 2), *(np.sinc(angle / 2 / np.pi) / 2 * np.asarray(v))]
    )


def times(a: Any, b: Any) -> Any:
    """Hamilton product."""
    w, v, u, z = a[0], a[1:], b[0], b[1:]
    return np.array([w * u - v @ z, *(w * z + u * v + vector(v, z))])


def matrix(q: Any) -> Any:
    """R = 1 + 2 w S(v) + 2 S(v)^2."""
    S = skew(q[1:])
    return EYE + 2 * q[0] * S + 2 * S @ S


def unit(v: Any) -> Any:
    return v / np.linalg.norm(v)


class Vehicle:
    """Rigid bodies and rotors of a vehicle file; everything in base axes about the base
    origin.
    """

    def __init__(self, file: dict[str, Any]) -> None:
        bodies = [file["base"], *file["links"]]
        self.bodies = [self._body(each) for each in bodies]
        names = ["base", *(each["name"] for each in file["links"])]
        self.n, self.parent = (
            len(names) - 1,
            [names.index(each["parent"]) - 1 for each in file["links"]],
        )
        joints = [each["joint"] for each in file["links"]]
        assert all(
            j.get("type", "revolute") == "revolute" and "lower" not in j for j in joints
        )
        self.axis = [np.array(j["axis"], dtype=float) for j in joints]
        self.place = [np.array(j["position"], dtype=float) for j in joints]
        self.damping = np.array([j.get("damping", 0.0) for j in joints])
        self.limit = np.array([j["effort_limit"] for j in joints])
        frame = next(
            each for each in file["frames"] if each["name"] == file["end_effector"]
        )
        self.tip_link, self.tip_place = (
            names.index(frame["link"]) - 1,
            np.array(frame["position"], dtype=float),
        )
        self.mass = sum(m for m, _, _ in self.bodies)
        rotors = [file["rotor_defaults"] | each for each in file["rotors"]]
        self.k, self.km, self.cd, self.cr, self.up, self.down, self.top = (
            np.array([r[name] for r in rotors])
            for name in (
                "thrust_coefficient",
                "moment_coefficient",
                "drag_coefficient",
                "rolling_moment_coefficient",
                "time_constant_up",
                "time_constant_down",
                "max_speed",
            )
        )
        self.hub = np.array([r["position"] for r in rotors], dtype=float)
        spin = np.array([1.0 if r["direction"] == "ccw" else -1.0 for r in rotors])
        # torque about x, y, z and thrust along z, per squared speed
        self.A = np.array(
            [
                self.hub[:, 1] * self.k,
                -self.hub[:, 0] * self.k,
                -spin * self.km * self.k,
                self.k,
            ]
        )
        self.inverse = self.A.T @ np.linalg.inv(self.A @ self.A.T)

    @staticmethod
    def _body(entry: dict[str, Any]) -> tuple[float, Any, Any]:
        """Mass, centre of mass, and inertia about the body's origin."""
        parts = entry.get("parts", [])
        parts = [entry, *parts] if "mass" in entry else parts
        mass, moment, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
        for part in parts:
            m, c = part["mass"], np.array(part.get("com", [0.0, 0.0, 0.0]), dtype=float)
            mass, moment = mass + m, moment + m * c
            inertia = (
                inertia
                + np.diag(part.get("inertia", [0.0] * 3))
                - m * skew(c) @ skew(c)
            )
        return mass, moment / mass, inertia

    def chain(self, i: int) -> list[int]:
        """Joints from the base to a link."""
        found: list[int] = []
        while i >= 0:
            found, i = [i, *found], self.parent[i]
        return found

    def poses(self, q: Any) -> tuple[list[Any], list[Any]]:
        """Rotations and origins of the links for series of joint angles."""
        n, R, p = q.shape[-1], list[Any](), list[Any]()
        for i in range(self.n):
            own = rotation_series(self.axis[i], q[i])
            if self.parent[i] < 0:
                R.append(own)
                p.append(constant(self.place[i], n))
            else:
                above = R[self.parent[i]]
                p.append(
                    p[self.parent[i]] + np.einsum("ijk,j->ik", above, self.place[i])
                )
                R.append(matmul(above, own))
        return R, p

    def com_tip(self, q: Any) -> tuple[Any, Any]:
        """Centre of mass and tip for series of joint angles."""
        R, p = self.poses(q)
        m, c, _ = self.bodies[0]
        total = constant(m * c, q.shape[-1])
        for (m, c, _), Ri, pi in zip(self.bodies[1:], R, p, strict=True):
            total = total + m * (pi + np.einsum("ijk,j->ik", Ri, c))
        tip = p[self.tip_link] + np.einsum(
            "ijk,j->ik", R[self.tip_link], self.tip_place
        )
        return total / self.mass, tip

    def still(self, q: Any) -> tuple[list[Any], list[Any], list[Any]]:
        """Rotations, origins and joint axes at joint angles."""
        R, p = self.poses(constant(q, 1))
        R, p = [each[..., 0] for each in R], [each[..., 0] for each in p]
        return R, p, [Ri @ a for Ri, a in zip(R, self.axis, strict=True)]

    def rnea(
        self, q: Any, w: Any, qd: Any, alpha: Any, a: Any, qdd: Any
    ) -> tuple[Any, Any, Any]:
        """Force and torque on the base, and joint torques; ``a`` is the proper
        acceleration of the base origin.
        """
        R, p, axes = self.still(q)
        rates, turns, pulls = [np.asarray(w)], [np.asarray(alpha)], [np.asarray(a)]
        for i in range(self.n):
            j = self.parent[i] + 1
            r = p[i] - (p[self.parent[i]] if j else 0.0)
            slide = axes[i] * qd[i]
            pulls.append(
                pulls[j] + vector(turns[j], r) + vector(rates[j], vector(rates[j], r))
            )
            turns.append(turns[j] + vector(rates[j], slide) + axes[i] * qdd[i])
            rates.append(rates[j] + slide)
        forces, torques = [], []
        for k, (m, c, inertia) in enumerate(self.bodies):
            Rk = R[k - 1] if k else EYE
            turned, com = Rk @ inertia @ Rk.T, Rk @ c
            forces.append(
                m
                * (
                    pulls[k]
                    + vector(turns[k], com)
                    + vector(rates[k], vector(rates[k], com))
                )
            )
            torques.append(
                turned @ turns[k]
                + vector(rates[k], turned @ rates[k])
                + m * vector(com, pulls[k])
            )
        efforts = np.zeros(self.n)
        for i in reversed(range(self.n)):
            j = self.parent[i] + 1
            efforts[i] = axes[i] @ torques[i + 1]
            r = p[i] - (p[self.parent[i]] if j else 0.0)
            forces[j] = forces[j] + forces[i + 1]
            torques[j] = torques[j] + torques[i + 1] + vector(r, forces[i + 1])
        return forces[0], torques[0], efforts

    def mass_matrix(self, q: Any) -> Any:
        """Mass matrix: translation and rotation of the base, joints, in base axes."""
        R, p, axes = self.still(q)
        M = np.zeros((6 + self.n, 6 + self.n))
        for k, (m, c, inertia) in enumerate(self.bodies):
            J, turns = np.zeros((3, 6 + self.n)), np.zeros((3, 6 + self.n))
            Rk, place = (R[k - 1], p[k - 1]) if k else (EYE, np.zeros(3))
            com = place + Rk @ c
            J[:, :3], J[:, 3:6], turns[:, 3:6] = EYE, -skew(com), EYE
            for i in self.chain(k - 1):
                J[:, 6 + i], turns[:, 6 + i] = vector(axes[i], com - p[i]), axes[i]
            central = Rk @ (inertia + m * skew(c) @ skew(c)) @ Rk.T
            M += m * J.T @ J + turns.T @ central @ turns
        return M

    def tip_jacobian(self, q: Any) -> Any:
        """Of the tip's position in base axes by the joints."""
        _, p, axes = self.still(q)
        tip = self.com_tip(constant(q, 1))[1][:, 0]
        J = np.zeros((3, self.n))
        for i in self.chain(self.tip_link):
            J[:, i] = vector(axes[i], tip - p[i])
        return J

    def com_jacobian(self, q: Any) -> Any:
        """Of the centre of mass in base axes by the joints."""
        R, p, axes = self.still(q)
        J = np.zeros((3, self.n))
        for k, (m, c, _) in enumerate(self.bodies[1:]):
            for i in self.chain(k):
                J[:, i] += m / self.mass * vector(axes[i], p[k] + R[k] @ c - p[i])
        return J

    def side(self, W: Any, v: Any, w: Any) -> tuple[Any, Any]:
        """Force and torque of the rotors that the allocation leaves out, at a motion in
        still air, base axes.
        """
        force, torque = np.zeros(3), np.zeros(3)
        for each, hub, cd, cr in zip(W, self.hub, self.cd, self.cr, strict=True):
            across = (v + vector(w, hub)) * [1.0, 1.0, 0.0]
            force = force - cd * each * across
            torque = torque - cr * each * across - vector(hub, cd * each * across)
        return force, torque

    def motors(self, W: Any, command: Any, time: float) -> Any:
        """Rotor speeds after a time of a held command."""
        u = np.minimum(command, self.top)
        return u + (W - u) * np.exp(-time / np.where(u > W, self.up, self.down))


def low(w: float, dt: float) -> float:
    return 1.0 - np.exp(-w * dt)


def pass_on(
    line: list[Any], value: Any, bandwidths: tuple[float, ...], dt: float
) -> None:
    """Low-passes in a row, one period later."""
    for k, bandwidth in enumerate(bandwidths):
        line[k] = line[k] + low(bandwidth, dt) * (value - line[k])
        value = line[k]


def is_jump(a: Any, b: Any, T: float) -> bool:
    (v0, a0), (v1, a1) = a, b
    return (
        abs(v1 - v0 - T * (a0 + a1) / 2)
        > T * (0.1 * abs(a1 - a0) + 0.02 * (abs(a1) + abs(a0))) + 1e-9
    )


def squares(rows: Any, wanted: Any, weights: Any) -> Any:
    """Weighted least squares."""
    A = sum(w * J.T @ J for J, w in zip(rows, weights, strict=True))
    return np.linalg.solve(
        A, sum(w * J.T @ b for J, b, w in zip(rows, wanted, weights, strict=True))
    )


def vehicle_of(path: Path) -> Vehicle:
    """Vehicle of a file."""
    return Vehicle(tomllib.loads(path.read_text("utf-8")))
