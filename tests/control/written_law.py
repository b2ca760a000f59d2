"""The centroidal law in mode "tip", preset "adaptive", written again from docs/centroidal_law.md and the files alone.

NumPy and the files of vehicle and scenario, nothing of the library. Numbers are those that the page states in
parentheses; sections are the page's. For vehicles of turning joints without limits, and no option beside the preset.
"""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

EYE = np.eye(3)
E_Z = np.array([0.0, 0.0, 1.0])


# Taylor series: the last axis has the coefficients f, f', f'' / 2, ...


PRODUCTS = np.array([[[float(i + j == k) for k in range(5)] for j in range(5)] for i in range(5)])
"""1 where coefficients i and j of two factors belong to coefficient k of the product."""


def mul(a: Any, b: Any) -> Any:
    """Product of two series."""
    n = min(a.shape[-1], b.shape[-1])
    return np.einsum("...i,...j,ijk->...k", a[..., :n], b[..., :n], PRODUCTS[:n, :n, :n])


def power(x: Any, p: float) -> Any:
    """x^p of a scalar series that is not 0."""
    c = [x[0] ** p]
    for k in range(1, len(x)):
        c.append(sum((i * p - (k - i)) * x[i] * c[k - i] for i in range(1, k + 1)) / (k * x[0]))
    return np.array(c)


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
    return np.stack([np.asarray(d, dtype=float) for d in derivatives], axis=-1) / FACTORIAL[: len(derivatives)]


def derivatives(x: Any) -> list[Any]:
    """Value and derivatives of a series."""
    return [x[..., k] * FACTORIAL[k] for k in range(x.shape[-1])]


def dot(a: Any, b: Any) -> Any:
    """Scalar product of two vectors of series."""
    return mul(a, b).sum(axis=0)


def cross(a: Any, b: Any) -> Any:
    """Vector product of two vectors of series."""
    x, y, z = range(3)
    return np.stack([mul(a[i], b[j]) - mul(a[j], b[i]) for i, j in ((y, z), (z, x), (x, y))])


def matmul(A: Any, B: Any) -> Any:
    """Product of two matrices, or of a matrix and a vector, of series."""
    n = min(A.shape[-1], B.shape[-1])
    return np.einsum("abi,b...j,ijk->a...k", A[..., :n], B[..., :n], PRODUCTS[:n, :n, :n])


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


# attitudes


def turn(v: Any) -> Any:
    """Quaternion of a rotation vector."""
    angle = np.linalg.norm(v)
    return np.array([np.cos(angle / 2), *(np.sinc(angle / 2 / np.pi) / 2 * np.asarray(v))])


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
    """Rigid bodies and rotors of a vehicle file; everything in base axes about the base origin."""

    def __init__(self, file: dict[str, Any]) -> None:
        bodies = [file["base"], *file["links"]]
        self.bodies = [self._body(each) for each in bodies]
        names = ["base", *(each["name"] for each in file["links"])]
        self.n, self.parent = len(names) - 1, [names.index(each["parent"]) - 1 for each in file["links"]]
        joints = [each["joint"] for each in file["links"]]
        assert all(j.get("type", "revolute") == "revolute" and "lower" not in j for j in joints)
        self.axis = [np.array(j["axis"], dtype=float) for j in joints]
        self.place = [np.array(j["position"], dtype=float) for j in joints]
        self.damping = np.array([j.get("damping", 0.0) for j in joints])
        self.limit = np.array([j["effort_limit"] for j in joints])
        frame = next(each for each in file["frames"] if each["name"] == file["end_effector"])
        self.tip_link, self.tip_place = names.index(frame["link"]) - 1, np.array(frame["position"], dtype=float)
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
        self.A = np.array([self.hub[:, 1] * self.k, -self.hub[:, 0] * self.k, -spin * self.km * self.k, self.k])
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
            inertia = inertia + np.diag(part.get("inertia", [0.0] * 3)) - m * skew(c) @ skew(c)
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
                p.append(p[self.parent[i]] + np.einsum("ijk,j->ik", above, self.place[i]))
                R.append(matmul(above, own))
        return R, p

    def com_tip(self, q: Any) -> tuple[Any, Any]:
        """Centre of mass and tip for series of joint angles."""
        R, p = self.poses(q)
        m, c, _ = self.bodies[0]
        total = constant(m * c, q.shape[-1])
        for (m, c, _), Ri, pi in zip(self.bodies[1:], R, p, strict=True):
            total = total + m * (pi + np.einsum("ijk,j->ik", Ri, c))
        tip = p[self.tip_link] + np.einsum("ijk,j->ik", R[self.tip_link], self.tip_place)
        return total / self.mass, tip

    def still(self, q: Any) -> tuple[list[Any], list[Any], list[Any]]:
        """Rotations, origins and joint axes at joint angles."""
        R, p = self.poses(constant(q, 1))
        R, p = [each[..., 0] for each in R], [each[..., 0] for each in p]
        return R, p, [Ri @ a for Ri, a in zip(R, self.axis, strict=True)]

    def rnea(self, q: Any, w: Any, qd: Any, alpha: Any, a: Any, qdd: Any) -> tuple[Any, Any, Any]:
        """Force and torque on the base, and joint torques; ``a`` is the proper acceleration of the base origin."""
        R, p, axes = self.still(q)
        rates, turns, pulls = [np.asarray(w)], [np.asarray(alpha)], [np.asarray(a)]
        for i in range(self.n):
            j = self.parent[i] + 1
            r = p[i] - (p[self.parent[i]] if j else 0.0)
            slide = axes[i] * qd[i]
            pulls.append(pulls[j] + vector(turns[j], r) + vector(rates[j], vector(rates[j], r)))
            turns.append(turns[j] + vector(rates[j], slide) + axes[i] * qdd[i])
            rates.append(rates[j] + slide)
        forces, torques = [], []
        for k, (m, c, inertia) in enumerate(self.bodies):
            Rk = R[k - 1] if k else EYE
            I, c = Rk @ inertia @ Rk.T, Rk @ c
            forces.append(m * (pulls[k] + vector(turns[k], c) + vector(rates[k], vector(rates[k], c))))
            torques.append(I @ turns[k] + vector(rates[k], I @ rates[k]) + m * vector(c, pulls[k]))
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
        """Force and torque of the rotors that the allocation leaves out, at a motion in still air, base axes."""
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


def is_jump(a: Any, b: Any, T: float) -> bool:
    (v0, a0), (v1, a1) = a, b
    return abs(v1 - v0 - T * (a0 + a1) / 2) > T * (0.1 * abs(a1 - a0) + 0.02 * (abs(a1) + abs(a0))) + 1e-9


def squares(rows: Any, wanted: Any, weights: Any) -> Any:
    """Weighted least squares."""
    A = sum(w * J.T @ J for J, w in zip(rows, weights, strict=True))
    return np.linalg.solve(A, sum(w * J.T @ b for J, b, w in zip(rows, wanted, weights, strict=True)))


NUMBERS = SimpleNamespace(
    observer=(27.0, 31.0, 34.0, 60.0),
    base=(22.0, 8.5, 205.0, 22.5),
    yaw=(30.0, 9.0),
    arm=(900.0, 60.0),
    tip=(700.0, 53.0),
    reach=0.12,
    damping=0.03,
    posture=1e-4,
    shift_rate=3.0,
    shift_limit=0.4,
    pull=8.0,
    tilt=1.2,
    approach=2.0,
    low_thrust=0.8,
    arm_turn=20.0,
    yaw_slack=5.0,
    lag_inversion=0.1,
    trim_rate=3.0,
    preview=0.6,
    lag=(0.020, 0.012),
    velocity_noise=0.0018,
    adaptation=0.6,
    friction_adaptation=2.0,
    tip_mass_limit=0.2,
)
"""Of the preset "adaptive", as the page states them."""

BINOMIAL = np.array([[math.comb(i, k) for i in range(6)] for k in range(6)], dtype=float)

SHARES = (1 / 8, 1 / 4, 7 / 16, 11 / 16, 1.0)


class WrittenLaw:
    """The law's memory, and one step of it."""

    def __init__(self, vehicle: Vehicle, gravity: float, dt: float, T: float) -> None:
        self.par, self.v, self.g, self.dt, self.T = NUMBERS, vehicle, gravity, dt, T
        v, n = vehicle, vehicle.n
        f, t, efforts = v.rnea(np.zeros(n), np.zeros(3), np.zeros(n), np.zeros(3), gravity * E_Z, np.zeros(n))
        W = np.sqrt(v.inverse @ [*t, f[2]])
        self.stride = max(1, round(0.005 / dt))
        # 1. newest first
        rows = 1 + 8 * self.stride
        self.speeds, self.means, self.efforts = [W] * rows, [W * W] * rows, [efforts] * rows
        self.command = (W, efforts)
        self.started, self.age, self.sample = False, 0.0, None
        self.pose = (np.zeros(3), np.array([1.0, 0, 0, 0]), np.zeros(n))
        self.rates = (np.zeros(3), np.zeros(3), np.zeros(n))
        self.d = (np.zeros(3), np.zeros(3), np.zeros(n))
        self.adapted = (np.zeros(3), np.zeros(3), np.zeros(n))
        self.W = W
        self.free = np.ones(1 + n)
        self.slow = np.zeros(3)
        self.trim = np.zeros(len(W))
        self.size, self.mean = 0.0, np.zeros(3)
        self.y, self.sinks = np.zeros(3), np.zeros(3)
        self.secants, self.falls, self.first = np.ones(6), np.zeros(5), 0.0
        self.trend = SimpleNamespace(
            level=np.zeros(3),
            rate=np.zeros(3),
            forces=[np.zeros(3)] * 3,
            rates=[np.zeros(3)] * 3,
            A=0.0,
            B=(5.0 * v.mass) ** 2 / 4,
        )
        k = 2 + n
        self.lag = SimpleNamespace(
            count=0.0,
            rates=np.zeros(k),
            own=np.zeros(k),
            model=[np.zeros(k)] * 3,
            measured=[np.zeros(k)] * 3,
            past=[np.zeros(k)] * (8 * self.stride),
            M=np.zeros((2, 9)),
            s=np.zeros(2),
            A=0.5,
            B=0.5,
        )
        self.noise = SimpleNamespace(o=np.zeros(3), c=np.zeros(3), V=0.0)
        self.learned = SimpleNamespace(
            m=0.0,
            b=np.zeros(n),
            c=np.zeros(n),
            k=np.zeros(n),
            once=np.zeros((3, n)),
            twice=np.zeros((3, n)),
            u=np.zeros(n),
            o=np.zeros(n),
        )
        M = v.mass_matrix(np.zeros(n))
        self.slack, self.stickiest = self.par.yaw_slack * M[5, 5], 50.0 * np.diag(M)[6:]

    def step(self, x: Any, held: Any, ahead: Any) -> tuple[Any, Any]:
        """Rotor speeds and joint torques.

        Args:
            x: measurement, with position, quaternion, velocity, rate, joints, joint_rates.
            held: reference sample, a row (value, rate, acceleration) of x, y, z, yaw and each joint.
            ahead: samples to come: after T, 2 T, and the shares of the preview.
        """
        par, v, dt, T, g, m = self.par, self.v, self.dt, self.T, self.g, self.v.mass
        # 1. actuators
        weights, L = self._lags()
        W, u, e = self.speeds[0], *self.command
        half, end = v.motors(W, u, dt / 2), v.motors(W, u, dt)
        self.speeds = [end, *self.speeds[:-1]]
        self.means = [(W * W + 4 * half * half + end * end) / 6, *self.means[:-1]]
        self.efforts = [e, *self.efforts[:-1]]
        a = L[0] / dt
        w = np.clip(a - np.arange(len(self.speeds)), 0.0, 1.0)
        shares = np.array([1.0, *w[:-1]]) - w
        then = SimpleNamespace(squares=shares @ self.means, speeds=shares @ self.speeds, efforts=shares @ self.efforts)
        since = SimpleNamespace(
            squares=w[:-1] @ self.means[:-1] / a, efforts=w[:-1] @ self.efforts[:-1] / a
        )
        # 2. reference
        changed = self.sample is None or np.any(held != self.sample)
        self.age, self.sample = (0.0 if changed else min(self.age + dt, T)), held.copy()
        late = self.age + L[0]
        signals = np.array([self._signal(*rows, late) for rows in zip(held, ahead[0], ahead[1], strict=True)])
        lead = [max(p * par.preview - late, dt) for p in SHARES]
        # 3. gains
        share = np.clip((1.35 - self.lag.B / self.lag.A) / 0.2, 0.0, 1.0)
        r = par.lag[0] / (par.lag[0] + max(L[0] * (1 - share) - 0.002, 0.0))
        j = par.lag[1] / (par.lag[1] + max(L[1] - L[0] - 0.002, 0.0))
        kp, kv = par.base[0] * r * r, par.base[1] * r
        KR = np.array([par.base[2], par.base[2], par.yaw[0]]) * r * r
        Kw = np.array([par.base[3], par.base[3], par.yaw[1]]) * r
        arm = par.arm[0] * j * j, par.arm[1] * j
        tip = par.tip[0] * j * j, par.tip[1] * j
        N2 = par.velocity_noise**2
        quiet = (N2 / max(self.noise.V * dt, N2)) ** 0.25
        observer = par.observer[0] * r * quiet, par.observer[1] * r, par.observer[2] * j
        # 4. observer
        told = self._observe(x, then, observer)
        # 5. prediction
        R = matrix(self.pose[1])
        side = v.side(self.W, R.T @ self.rates[0], self.rates[1])
        unknown = [a + b for a, b in zip(self.d, self.adapted, strict=True)]
        unknown = [unknown[0] + R @ side[0], unknown[1] + side[1], unknown[2]]
        now = self._predict(since, unknown, a * dt)
        R, omega = matrix(now.quaternion), now.rate
        # 6. force
        rate = self._trend()
        unknown[0] = unknown[0] + rate * 2 / observer[0]
        self.slow = self.slow + low(par.shift_rate, dt) * (self.d[0] - self.slow)
        F = self.slow + self.adapted[0] + rate * (2 / observer[0] + 1 / par.shift_rate)
        # 7. shift and quasi-static attitude
        base, psi, q = np.array([derivatives(s) for s in signals[:3]]).T, signals[3], signals[4:]
        com, point = v.com_tip(q)
        drag = (v.cd * now.W).sum()
        moved = self._shift(base, psi[0], q, com, point, F, rate, drag, lead, ahead[2:])
        going = [base[0], *(b + y for b, y in zip(base[1:], moved, strict=True))]
        D = [R @ v.side(now.W, R.T @ p, np.zeros(3))[0] for p in going[1:4]]
        changes = D[1] + rate, D[2]
        wanted = (going[2] + g * E_Z) * m - F - D[0], going[3] * m - changes[0], going[4] * m - changes[1]
        fq = self._bounded(series(*wanted))
        Rq, wq, aq = self._attitude(self._upright(fq, fq), psi)
        # 8. links
        goal = self._goal(base, psi, q, point)
        qt = self._turned(q, goal, Rq, wq, aq)
        com, turned = v.com_tip(qt)
        s = self._limited_shift(goal.arm, turned, Rq, wq, aq)
        base = [base[0] + s[0], base[1] + s[1], base[2] + s[2], base[3] + moved[2], base[4] + moved[3]]
        # 9. centre of mass
        h = self._arm_turn(derivatives(com))
        carried = [
            h[0],
            vector(wq, h[0]) + h[1],
            vector(aq, h[0]) + vector(wq, vector(wq, h[0])) + 2 * vector(wq, h[1]) + h[2],
            h[3],
            h[4],
        ]
        pc = [p + Rq @ c for p, c in zip(base, carried, strict=True)]
        own = series(now.joints, now.joint_rates, np.zeros(v.n))
        c, p = v.com_tip(own)
        c, p = derivatives(c), derivatives(p)
        position, velocity = now.position + R @ c[0], now.velocity + R @ (vector(omega, c[0]) + c[1])
        f, ac = self._force(pc, position, velocity, R, omega, unknown[0], changes, kp, kv)
        Fz = f[:, 0] @ R[:, 2]
        # 10. attitude
        Rd, wd, ad = self._attitude(self._upright(f, fq), psi)
        E = R.T @ Rd
        eR = vee(-E)
        alpha = E @ ad - vector(omega, E @ wd) - KR * eR - Kw * (omega - E @ wd)
        # 11. joints
        qd, qdd = q[:, 1], 2 * q[:, 2]
        preferred = qdd + arm[1] * (qd - now.joint_rates) + arm[0] * (q[:, 0] - now.joints)
        e = series(now.position - base[0], now.velocity - base[1], ac - base[2])
        fourth = mul(dot(e, e), dot(e, e)) / par.reach**4
        follow = derivatives(mul(e, mul(fourth, power(fourth + [1.0, 0, 0], -1))[None]))
        xd = [a + b for a, b in zip(goal.tip, follow, strict=True)]
        xp, xv = now.position + R @ p[0], now.velocity + R @ (vector(omega, p[0]) + p[1])
        rho = [a - b for a, b in zip(p, c, strict=True)]
        b1 = R.T @ (xd[2] + tip[1] * (xd[1] - xv) + tip[0] * (xd[0] - xp) - ac)
        b1 = b1 - (
            vector(alpha, rho[0])
            + vector(omega, vector(omega, rho[0]))
            + 2 * vector(omega, rho[1])
            + rho[2]
        )
        rows, right = [v.tip_jacobian(now.joints) - v.com_jacobian(now.joints)], [b1]
        links, _, axes = v.still(now.joints)
        for i, (turning, bias) in enumerate(self._turning(axes, now.joint_rates, omega, alpha)):
            rows.append(self._columns(axes, i))
            turn_d = goal.accelerations[i] + tip[1] * goal.rates[i] + tip[0] * self._off(R @ links[i], goal.links[i])
            right.append(R.T @ turn_d - tip[1] * turning - bias)
        rows.append(np.eye(v.n))
        right.append(preferred)
        qdd = squares(rows, right, [1.0, *[par.damping**2] * v.n, par.posture**2])
        # 12. inverse dynamics and commands
        F0 = v.rnea(now.joints, omega, now.joint_rates, alpha, np.zeros(3), qdd)[0]
        proper = (Fz * E_Z + R.T @ unknown[0] - F0) / m
        _, torque, efforts = v.rnea(now.joints, omega, now.joint_rates, alpha, proper, qdd)
        torque, efforts = torque - unknown[1], efforts - unknown[2] + v.damping * now.joint_rates
        given = np.clip(efforts, -v.limit, v.limit)
        M = v.mass_matrix(now.joints)
        lost = np.linalg.solve(M[6:, 6:] - M[6:, :3] @ M[:3, 6:] / m, efforts - given)
        torque = torque - (M[3:6, 6:] - M[3:6, :3] @ M[:3, 6:] / m) @ lost
        allocated, raw = self._allocate(torque, Fz)
        inside = bool(Fz > 0 and np.all(raw > 0) and np.all(raw < v.top**2))
        planned = m * (Rq.T @ pc[3] - vector(wq, Rq.T @ (pc[2] + g * E_Z)))
        kappa = par.lag_inversion
        change = v.inverse[:, 3] * planned[2]
        tau = np.where(change > 0, v.up, v.down)
        goals = np.sqrt(np.maximum(allocated + self.trim + change * dt / (1 - (1 - kappa) * np.exp(-dt / tau)), 0))
        goals = np.minimum(goals, v.top)
        tau = np.where(goals > now.W, v.up, v.down)
        speeds = np.clip(goals + kappa * (goals - now.W) * (1 / (1 - np.exp(-dt / tau)) - 1), 0.0, v.top)
        reached = v.motors(now.W, speeds, dt)
        before, self.free = self.free, np.array([inside, *(np.abs(efforts) < v.limit)], dtype=float)
        if inside:
            self.trim = np.clip(
                self.trim + par.trim_rate * dt * (allocated - reached**2), -0.1 * v.top**2, 0.1 * v.top**2
            )
        # 13. lag, noise and adaptation
        self._learn_lag(x, told, before, weights)
        self._learn_noise(x.velocity - self.rates[0], observer[0])
        self._adapt(qt, Rq, wq, aq, base[2] + g * E_Z, observer, before)
        self.command, self.started = (speeds, given), True
        return speeds, given

    # 1. to 3.

    def _weights(self) -> list[Any]:
        """Weights of the lags of base and joints."""
        found = []
        for M in self.lag.M:
            paid = M + 0.005 * np.arange(9)
            found.append((1 + 12.5 * (paid - paid.min()) / (paid.min() + 0.005)) ** -8)
        return found

    def _lags(self) -> tuple[list[Any], list[float]]:
        weights = self._weights()
        return weights, [w @ np.arange(9) * self.stride * self.dt / w.sum() for w in weights]

    def _signal(self, held: Any, one: Any, two: Any, s: float) -> Any:
        """Series of a reference signal at the age s of its sample."""
        T, (p, v0, a0), (v1, a1), (v2, a2) = self.T, held, one[1:], two[1:]
        mean = (v1 - v0) / T
        b2, b3 = (3 * mean - 2 * a0 - a1) / T, (a0 + a1 - 2 * mean) / T**2
        k = 0.0 if is_jump((v1, a1), (v2, a2), T) else (a2 - a0 - 4 * b2 * T - 12 * b3 * T**2) / (12 * T**3)
        c = [v0, a0, b2 + k * T**2, b3 - 2 * k * T, k]
        if is_jump((v0, a0), (v1, a1), T):
            c = [v0, a0, 0.0, 0.0, 0.0]
        c = np.array([p, *(each / (i + 1) for i, each in enumerate(c))])
        # coefficients about s: of the binomial expansion of (s + x)^i
        return np.array([BINOMIAL[k, k:] * s ** np.arange(6 - k) @ c[k:] for k in range(5)])

    # 4. and 5.

    def _accelerations(self, R: Any, w: Any, q: Any, qd: Any, squared: Any, efforts: Any, unknown: Any) -> Any:
        """Accelerations of the model: base (world axes), base (base axes), joints."""
        v = self.v
        f, t, u = v.rnea(q, w, qd, np.zeros(3), np.zeros(3), np.zeros(v.n))
        *torque, thrust = v.A @ squared
        given = np.clip(efforts, -v.limit, v.limit) - v.damping * qd + unknown[2]
        right = np.concatenate([thrust * E_Z + R.T @ unknown[0] - f, torque + unknown[1] - t, given - u])
        a = np.linalg.solve(v.mass_matrix(q), right)
        return R @ a[:3] - self.g * E_Z, a[3:6], a[6:]

    def _observe(self, x: Any, done: Any, bandwidths: Any) -> Any:
        """Pose filter and observer; what the lag estimate takes from them."""
        v, dt = self.v, self.dt
        share = low(self.par.observer[3], dt) if self.started else 1.0
        (p, quaternion, q), (velocity, w, qd) = self.pose, self.rates
        p, joints = p + velocity * dt, q + qd * dt
        carried = times(quaternion, turn(w * dt))
        measured = x.quaternion if x.quaternion @ carried >= 0 else -x.quaternion
        new = unit(carried + share * (measured - carried))
        self.pose = p + share * (x.position - p), new, joints + share * (x.joints - joints)
        R, amid = matrix(unit(quaternion + new)), (q + self.pose[2]) / 2
        side = v.side(done.speeds, R.T @ velocity, w)
        unknown = [a + b for a, b in zip(self.d, self.adapted, strict=True)]
        unknown = [unknown[0] + R @ side[0], unknown[1] + side[1], unknown[2]]
        linear, angular, bend = self._accelerations(R, w, amid, qd, done.squares, done.efforts, unknown)
        ahead = velocity + linear * dt, w + angular * dt, qd + bend * dt
        seen = x.velocity, x.rate, x.joint_rates
        errors = [a - b for a, b in zip(seen, ahead, strict=True)]
        poles = [np.exp(-each * dt) for each in bandwidths]
        slow = [(1 - b) ** 2 * e / dt for b, e in zip(poles, errors, strict=True)]
        force, torque, efforts = v.rnea(amid, np.zeros(3), np.zeros(v.n), slow[1], R.T @ slow[0], slow[2])
        told = SimpleNamespace(R=R, w=w, q=amid, qd=qd, unknown=unknown, corrections=np.array([*slow[1][:2], *slow[2]]))
        if self.started:
            self.rates = tuple(a + (1 - b * b) * e for a, b, e in zip(ahead, poles, errors, strict=True))
            self.d = (
                self.d[0] + R @ force * self.free[0],
                self.d[1] + torque * self.free[0],
                self.d[2] + efforts * self.free[1:],
            )
            self.W = done.speeds
        else:
            self.rates = seen
        return told

    def _predict(self, since: Any, unknown: Any, h: float) -> Any:
        """State in h seconds."""
        (p, quaternion, q), (velocity, w, qd) = self.pose, self.rates
        R = matrix(times(quaternion, turn(w * h / 2)))
        linear, angular, bend = self._accelerations(R, w, q + qd * h / 2, qd, since.squares, since.efforts, unknown)
        v1, w1, qd1 = velocity + linear * h, w + angular * h, qd + bend * h
        return SimpleNamespace(
            position=p + (velocity + v1) * h / 2,
            quaternion=times(quaternion, turn((w + w1) * h / 2)),
            joints=q + (qd + qd1) * h / 2,
            velocity=v1,
            rate=w1,
            joint_rates=qd1,
            W=self.speeds[0],
        )

    # 6.

    def _trend(self) -> Any:
        """Rate of the observed force."""
        t, dt, d, m = self.trend, self.dt, self.d[0], self.v.mass
        b = np.exp(-10.0 * dt)
        e = d - t.level - t.rate * dt
        t.level = t.level + t.rate * dt + (1 - b * b) * e
        t.rate = t.rate + (1 - b) ** 2 * e / dt
        for line, value in ((t.forces, d), (t.rates, t.rate)):
            for k in range(3):
                line[k] = value = line[k] + low(3 / 0.25, dt) * (value - line[k])

        def nu(x: Any) -> float:
            return 1 / (1 + (np.linalg.norm(x) / (5 * m)) ** 4)

        c = (d - t.forces[2]) / 0.25
        t.A += low(0.7, dt) * (nu(c) * t.rates[2] @ c - t.A)
        t.B += low(0.7, dt) * (nu(c) * t.rates[2] @ t.rates[2] - t.B)
        return t.rate * nu(t.rate) * np.clip(2 * t.A / (t.B + (0.1 * m) ** 2) - 1, 0.0, 1.0)

    # 7.

    def _bounded(self, f: Any) -> Any:
        """Force with bounded vertical part and tilt."""
        floor = 0.15 * self.v.mass * self.g + 0.001
        z = f[2] if f[2, 0] > floor else constant(floor, 3)
        side = mul(f[0], f[0]) + mul(f[1], f[1])
        if side[0] > (self.par.tilt * z[0]) ** 2:
            share = mul(z, power(side, -0.5)) * self.par.tilt
            return np.array([mul(f[0], share), mul(f[1], share), z])
        return np.array([f[0], f[1], z])

    def _upright(self, f: Any, along: Any) -> Any:
        """Force whose small vertical part is raised."""
        c, weight = self.par.low_thrust, self.v.mass * self.g
        width = 0.875 * c
        t, z = (constant(c, 3) - f[2] / weight) / width, f[2]
        if t[0] <= 0:
            return f
        if t[0] >= 1:
            t, z = constant(1.0, 3), constant((c - width) * weight, 3)
        cube = mul(t, mul(t, t))
        raised = z + width * weight * (cube - mul(cube, t) / 2)
        share = mul(raised - f[2], power(along[2], -1))
        return np.array([f[0] + mul(along[0], share), f[1] + mul(along[1], share), raised])

    def _attitude(self, f: Any, psi: Any) -> tuple[Any, Any, Any]:
        """Attitude of a force and the heading, with rate and acceleration."""
        c, s = cos_sin(psi[:3])
        b3 = mul(f, power(dot(f, f), -0.5)[None])
        b2 = cross(b3, np.array([c, s, np.zeros(3)]))
        b2 = mul(b2, power(dot(b2, b2), -0.5)[None])
        R = np.stack([cross(b2, b3), b2, b3], axis=1)
        R, first, second = derivatives(R)
        return R, vee(R.T @ first), vee(R.T @ second)

    # 8.

    def _goal(self, base: Any, psi: Any, q: Any, tip: Any) -> Any:
        """Tip and links of a level base."""
        v, Z = self.v, rotation_series(E_Z, psi)
        poses, _ = v.poses(q)
        links = [matmul(Z, R) for R in poses]
        rates: list[Any] = []
        for i in range(v.n):
            axis = np.einsum("ijk,j->ik", links[i], v.axis[i])
            slope = np.arange(1, 5) * q[i, 1:]
            above = rates[v.parent[i]] if v.parent[i] >= 0 else np.array([0 * psi[1:], 0 * psi[1:], np.arange(1, 5) * psi[1:]])
            rates.append(above + mul(axis, slope[None]))
        arm = derivatives(matmul(Z, tip))[:3]
        return SimpleNamespace(
            arm=arm,
            tip=[p + a for p, a in zip(base, arm, strict=False)],
            links=[R[..., 0] for R in links],
            rates=[w[:, 0] for w in rates],
            accelerations=[w[:, 1] for w in rates],
        )

    @staticmethod
    def _off(R: Any, desired: Any) -> Any:
        """Rotation from an attitude to the desired one, in world axes."""
        return 0.5 * sum(vector(R[:, k], desired[:, k]) for k in range(3))

    def _columns(self, axes: Any, i: int) -> Any:
        """Jacobian of a link's angular velocity by the joints."""
        A = np.zeros((3, self.v.n))
        for k in self.v.chain(i):
            A[:, k] = axes[k]
        return A

    def _turning(self, axes: Any, qd: Any, w: Any, alpha: Any) -> list[Any]:
        """Angular velocity of each link, and its acceleration at zero joint accelerations."""
        found: list[Any] = []
        for i in range(self.v.n):
            rate, bias = found[self.v.parent[i]] if self.v.parent[i] >= 0 else (w, alpha)
            slide = axes[i] * qd[i]
            found.append((rate + slide, bias + vector(rate, slide)))
        return found

    def _turned(self, q: Any, goal: Any, Rq: Any, wq: Any, aq: Any) -> Any:
        """Joint signals that orient the links on a tilted base."""
        v, par = self.v, self.par
        weights = [*[par.damping**2] * v.n, par.posture**2]
        links, _, axes = v.still(q[:, 0])

        def solve(right: list[Any], preferred: Any) -> Any:
            return squares([*(self._columns(axes, i) for i in range(v.n)), np.eye(v.n)], [*right, preferred], weights)

        errors = [Rq.T @ self._off(Rq @ R, desired) for R, desired in zip(links, goal.links, strict=True)]
        value = q[:, 0] + solve(errors, np.zeros(v.n))
        axes = v.still(value)[2]
        rates = solve([Rq.T @ w - wq for w in goal.rates], q[:, 1])
        turning = self._turning(axes, rates, wq, aq)
        bends = [Rq.T @ a - bias for a, (_, bias) in zip(goal.accelerations, turning, strict=True)]
        second = solve(bends, 2 * q[:, 2])
        return np.column_stack([value, rates, second / 2, q[:, 3:]])

    def _limited_shift(self, arm: Any, turned: Any, Rq: Any, wq: Any, aq: Any) -> list[Any]:
        """Shift of the base that keeps the tip, with two derivatives."""
        r = derivatives(turned)
        n = series(
            arm[0] - Rq @ r[0],
            arm[1] - Rq @ (vector(wq, r[0]) + r[1]),
            arm[2]
            - Rq @ (vector(aq, r[0]) + vector(wq, vector(wq, r[0])) + 2 * vector(wq, r[1]) + r[2]),
        )
        square = dot(n, n) / self.par.shift_limit**2
        fourth = mul(square, square)
        return derivatives(mul(n, power(mul(fourth, fourth) + [1.0, 0, 0], -1 / 8)[None]))

    # 9.

    def _arm_turn(self, h: list[Any]) -> list[Any]:
        dt, size = self.dt, np.hypot(*h[4][:2]) / self.g
        self.size += (10.0 if size > self.size else 0.5) * dt * (size - self.size)
        self.mean = self.mean + (h[0] - self.mean) * dt
        mean = [self.mean]
        for each in h[:-1]:
            mean.append(each - mean[-1])
        left = (1 - self.par.arm_turn / max(self.size, self.par.arm_turn)) * np.array([1.0, 1.0, 0.0])
        return [a - (a - b) * left for a, b in zip(h, mean, strict=True)]

    def _force(
        self, pc: Any, p: Any, v: Any, R: Any, w: Any, d: Any, changes: Any, kp: float, kv: float
    ) -> tuple[Any, Any]:
        """Desired force, with two derivatives, and the acceleration that the thrust gives."""
        m, g, par = self.v.mass, self.g, self.par
        b3, b3d = R[:, 2], R @ vector(w, E_Z)
        e0 = 2 * par.approach * (kv / kp) ** 2

        def feedback(e: list[Any], k: int) -> Any:
            """The k-th derivative of sigma, from the error's derivatives up to the one after."""
            error = series(*e[: k + 1])
            far = dot(error, error) / e0**2
            chi = power(mul(far, far) + [1.0, *[0.0] * k], -1 / 8)
            x = kp * mul(error, chi[None]) + kv * series(*e[1 : k + 2])
            sigma = mul(x, power(dot(x, x) / par.pull**2 + [1.0, *[0.0] * k], -1 / 2)[None])
            return derivatives(sigma)[k]

        e = [p - pc[0], v - pc[1]]
        f = m * (pc[2] + g * E_Z - feedback(e, 0)) - d
        e.append((b3 * (f @ b3) + d) / m - g * E_Z - pc[2])
        f1 = m * (pc[3] - feedback(e, 1)) - changes[0]
        thrust = b3 * (f1 @ b3 + f @ b3d) + b3d * (f @ b3)
        e.append((thrust + changes[0]) / m - pc[3])
        f2 = m * (pc[4] - feedback(e, 2)) - changes[1]
        found = self._bounded(series(f, f1, f2))
        return found, (b3 * (found[:, 0] @ b3) + d) / m - g * E_Z

    # the shift of the base

    def _levers(self, q: Any, psi: float) -> tuple[Any, Any, Any]:
        """Directions (world axes), and what joints leave of a lever along them: share and rest."""
        v = self.v
        links, places, axes = v.still(q)
        flat = [np.outer(a[:2], a[:2]) for a in axes]
        chain = v.chain(v.tip_link)
        G = sum((flat[i] for i in chain), np.zeros((2, 2)))
        u = np.linalg.eigh(G)[1][:, 1]

        def left(joints: list[int]) -> Any:
            part = sum((flat[i] for i in joints), np.zeros((2, 2)))
            along = u @ part @ u
            return np.array([0.02 / (np.trace(part) - along + 0.02), 0.02 / (along + 0.02)])

        heights = [v.bodies[0][1][2], *((places[k] + links[k] @ c)[2] for k, (_, c, _) in enumerate(v.bodies[1:]))]
        rest = np.zeros(2)
        for i in range(v.n):
            carried = [k >= 0 and i in v.chain(k) for k in range(-1, v.n)]
            rows = zip(v.bodies, heights, carried, strict=True)
            terms = [(m / v.mass * (z - places[i][2]), c) for (m, _, _), z, c in rows]
            height = sum(t for t, c in terms if not c) if i in chain else -sum(t for t, c in terms if c)
            rest = rest + (left(v.chain(i)[:-1]) - left(v.chain(i))) * height
        c, s = np.cos(psi), np.sin(psi)
        first = np.array([[c, -s], [s, c]]) @ u
        return np.array([first, [-first[1], first[0]]]), left(chain), rest

    def _height(self, q: Any) -> float:
        com, tip = self.v.com_tip(constant(q, 1))
        return com[2, 0] - tip[2, 0]

    def _shift(
        self, base: Any, psi: float, q: Any, com: Any, tip: Any, F: Any, rate: Any, drag: float, lead: Any, ahead: Any
    ) -> list[Any]:
        """First to fourth derivative of the shift; the memory goes on."""
        m, g, dt = self.v.mass, self.g, self.dt
        axes, left, rest = self._levers(q[:, 0], psi)
        lever = com[2] - tip[2]
        times_ = np.array([0.0, *lead])
        h = np.diff(times_)
        one, two, four = (self._height(ahead[k][4:, 0]) for k in (0, 1, 3))
        levers = np.array([lever[0], one, two, (two + four) / 2, four, four])
        sizes = np.maximum(abs(levers), 0.02)
        velocity = [base[1], *(row[:3, 1] for row in ahead)]
        acceleration = [base[2], *(row[:3, 2] for row in ahead)]
        factor = (np.outer(levers, left) + rest) / sizes[:, None]
        f = np.array(
            [
                phi * (axes @ (F[:2] / m + rate[:2] / m * t - drag / m * v[:2] - a[:2]))
                for phi, t, v, a in zip(factor, times_, velocity, acceleration, strict=True)
            ]
        )
        # numbers of the last period go on to now
        late = lead[0] - self.first + dt
        k, e = self.secants.copy(), self.falls.copy()
        k[1:5] += (self.secants[2:6] - self.secants[1:5]) * late / h[1:5]
        e[0:4] += (self.falls[1:5] - self.falls[0:4]) * late / h[1:5]
        z = np.array([a[2] for a in acceleration])
        n = np.maximum([*(g - F[2] / m + (z[:-1] + z[1:]) / 2 + e), g - F[2] / m + z[-1]], 0.15 * g)
        n = n * [*((k[:-1] + k[1:]) / 2), k[-1]]
        b = np.sqrt(n[5] / sizes[5])
        v = -f[5] / b - (f[5] - f[4]) / (b * b * h[4])
        sweep = []
        for i in range(4, -1, -1):
            pace = 2 * n[i] / (sizes[i] + sizes[i + 1])
            x = pace * h[i] ** 2
            C, S = 1 + x / 2 + x**2 / 24 + x**3 / 720, h[i] * (1 + x / 6 + x**2 / 120 + x**3 / 5040)
            mean, change = (f[i] + f[i + 1]) / 2, f[i + 1] - f[i]
            p = h[i] ** 2 * ((1 / 2 + x / 24 + x**2 / 720) * mean - (1 / 12 + x / 80) * change)
            down = C + b * S
            v, b = (v - b * p - S * mean + h[i] * x * change / 24) / down, (pace * S + b * C) / down
            sweep.insert(0, (b, v, C, S, p))

        def secant(y: Any, size: float) -> float:
            return (1 - min(y @ y / size**2, 0.75)) ** -0.5

        y = now = axes @ self.y[:2]
        # forwards from the shift of now
        secants, falling, rates = [], [], []
        end = (np.sqrt(n[5] / sizes[5]), -f[5] / np.sqrt(n[5] / sizes[5]) - (f[5] - f[4]) / (n[5] / sizes[5] * h[4]))
        for i in range(6):
            bi, vi = sweep[i][:2] if i < 5 else end
            dy = vi - bi * y
            secants.append(secant(y, sizes[i]))
            rates.append(-levers[i] / sizes[i] ** 2 * secants[-1] * (y @ dy))
            if i < 5:
                y = sweep[i][2] * y + sweep[i][3] * dy + sweep[i][4]
        falling = np.diff(rates) / h
        # the shift of now, with derivatives
        (b, v), size0 = sweep[0][:2], sizes[0]
        size = lever[:3] * np.sign(lever[0]) if abs(lever[0]) > 0.02 else constant(0.02, 3)
        up = [
            base[2][2] + g - F[2] / m + self.sinks[0],
            base[3][2] - rate[2] / m + self.sinks[1],
            base[4][2] + self.sinks[2],
        ]
        N = series(*up) if up[0] > 0.15 * g else constant(0.15 * g, 3)
        per = power(size, -1)
        forcing = series(
            axes @ (F[:2] / m - drag / m * base[1][:2] - base[2][:2]),
            axes @ (rate[:2] / m - drag / m * base[2][:2] - base[3][:2]),
            axes @ (-drag / m * base[3][:2] - base[4][:2]),
        )
        phi = mul(np.outer(left, lever[:3]) + rest[:, None] * [1.0, 0, 0], per[None])
        F0, F1, F2 = derivatives(mul(phi, forcing))
        dy = v - b * now
        ddy = N[0] / size0 * secant(now, size0) * now + F0
        lean = mul(series(now, dy, ddy), per[None])
        square = dot(lean, lean)
        square = square if square[0] < 0.75 else constant(0.75, 3)
        k0, k1, k2 = derivatives(mul(mul(N, per), power(constant(1.0, 3) - square, -0.5)))
        third = k1 * now + k0 * dy + F1
        fourth = k2 * now + 2 * k1 * dy + k0 * ddy + F2
        Y = series(now, dy, ddy, third, fourth)
        low_by = -lever[0] / size0**2 * secant(now, size0)
        heights = [low_by * each for each in derivatives(dot(Y, Y) / 2)[1:]]
        moved = [np.array([*(axes.T @ each), z]) for each, z in zip((dy, ddy, third, fourth), heights, strict=True)]
        step = moved[0] * dt + moved[1] * dt * dt / 2
        self.y = self.y + step * [1.0, 1.0, 0.0]
        self.sinks = np.array(heights[1:])
        self.secants, self.falls, self.first = np.array(secants), falling, lead[0]
        return moved

    # 12.

    def _allocate(self, torque: Any, thrust: float) -> tuple[Any, Any]:
        """Squared rotor speeds within their limits, and those without limits."""
        P, top = self.v.inverse, self.v.top**2
        raw = P @ [*torque, thrust]
        tilt, p, t = P[:, :2] @ torque[:2], P[:, 3], P[:, 2]
        d = tilt / p
        spread = d[:, None] - d[None, :]
        shares = np.where(spread > 0, (top / p)[:, None] / np.where(spread > 0, spread, 1.0), 1.0)
        tilt = tilt * min(1.0, shares.min())
        # bounds of the yaw torque: low + slope f <= u <= high + slope f
        ends = np.array([-tilt / t, (top - tilt) / t])
        lows = [min(0.0, torque[2] - self.slack), *ends.min(axis=0)]
        highs = [max(0.0, torque[2] + self.slack), *ends.max(axis=0)]
        slopes = [0.0, *(-p / t)]
        least, most = -1e100, 1e100
        for low_, a in zip(lows, slopes, strict=True):
            for high, b in zip(highs, slopes, strict=True):
                if a > b:
                    most = min(most, (high - low_) / (a - b))
                elif a < b:
                    least = max(least, (high - low_) / (a - b))
        f, u = min(max(thrust, least), most), torque[2]
        for low_, high, a in zip(lows, highs, slopes, strict=True):
            u = min(max(u, low_ + a * f), high + a * f)
        return np.clip(tilt + p * f + t * u, 0.0, top), raw

    # 13.

    def _learn_lag(self, x: Any, told: Any, free: Any, weights: Any) -> None:
        """The bank of lags, one period later."""
        a, dt, v, running = self.lag, self.dt, self.v, self.started
        rates = np.array([*x.rate[:2], *x.joint_rates])
        if not running:
            a.rates = rates
            return
        _, angular, bend = self._accelerations(
            told.R, told.w, told.q, told.qd, self.means[0], self.efforts[0], told.unknown
        )
        model, seen = np.array([*angular[:2], *bend]) - a.own, (rates - a.rates) / dt
        bands = []
        for line, value in ((a.model, model), (a.measured, seen)):
            for k, edge in enumerate((60.0, 60.0, 20.0)):
                line[k] = value = line[k] + low(edge, dt) * (value - line[k])
            bands.append(line[1] - line[2])
        band, z = bands
        past = np.array([band, *a.past[self.stride - 1 :: self.stride]])
        eta = max(0.5 * dt, 1 / (a.count + 20))
        scale = a.s[0]
        for k, part in enumerate((slice(0, 2), slice(2, None))):
            E = ((z[part] - past[:, part]) ** 2).sum(axis=1)
            M = a.M[k] + eta * (E / (E + 4 * a.s[k] + 0.01) - a.M[k])
            cost = 0.005 * np.arange(9)
            a.M[k] = np.minimum(M, (M + cost).min() + 0.04 - cost)
            a.s[k] += dt * (min(E.mean(), 4 * (a.s[k] + 0.01)) - a.s[k])
        expected = weights[0] @ past[:, :2] / weights[0].sum()
        size = z[:2] @ z[:2] + 4 * scale + 0.01
        a.A += 0.15 * dt * (expected @ z[:2] / size - a.A)
        a.B += 0.15 * dt * (expected @ expected / size - a.B)
        a.own = a.own + told.corrections * [free[0], free[0], *free[1:]]
        a.rates, a.past, a.count = rates, [band, *a.past[:-1]], a.count + 1

    def _learn_noise(self, o: Any, bandwidth: float) -> None:
        """Variance of the measured velocity's noise."""
        a, dt = self.noise, self.dt
        c = o / max(np.exp(-bandwidth * dt) ** 2, 1e-3) - a.o
        most = 20 * (max(a.V, 0.0) + self.par.velocity_noise**2 / dt)
        a.V += 2.0 * dt * (np.clip(-(c @ a.c) / 3, -most, most) - a.V)
        a.o, a.c = o, c

    def _adapt(self, qt: Any, Rq: Any, wq: Any, aq: Any, proper: Any, observer: Any, free: Any) -> None:
        """Mass at the tip and damping of the joints, and what they need in the next period."""
        par, v, dt, a = self.par, self.v, self.dt, self.learned
        q, qd = qt[:, 0], qt[:, 1]
        r = derivatives(v.com_tip(qt[:, :3])[1])
        push = -(
            Rq.T @ proper
            + vector(aq, r[0])
            + vector(wq, vector(wq, r[0]))
            + 2 * vector(wq, r[1])
            + r[2]
        )
        Y = v.tip_jacobian(q).T @ push
        share = low(observer[2], dt)
        a.once = a.once + share * (np.array([Y, q, qd]) - a.once)
        a.twice = a.twice + share * (a.once - a.twice)
        slow = low(2.0, dt)
        a.u, a.o = a.u + slow * (qd**2 - a.u), a.o + slow * ((self.rates[2] - qd) ** 2 - a.o)
        weight = free[1:] * np.maximum(0.0, 1 - 2 * a.o / (a.u + 0.1))
        load, place, rate = a.twice
        d = self.d[2]
        a.m += par.adaptation * dt * (weight * load * d).sum() / (0.001 + (load**2).sum())
        a.m = np.clip(a.m, -par.tip_mass_limit, par.tip_mass_limit)
        e = weight * (d - a.c - a.k * place)
        a.b = a.b - par.friction_adaptation * dt * e * rate / (0.1 + rate**2)
        a.b = np.clip(a.b, -v.damping, self.stickiest)
        a.c, a.k = a.c + dt * e, a.k + dt * e * place / (0.01 + place**2)
        self.adapted = Rq @ push * a.m, vector(r[0], push) * a.m, Y * a.m - a.b * qd


def vehicle_of(path: Path) -> Vehicle:
    """Vehicle of a file."""
    return Vehicle(tomllib.loads(path.read_text("utf-8")))
