"""The tip's force, and interaction, admittance, load and accelerometer, as the page on
the centroidal law writes them.

NumPy, from its equations and numbers alone. A disturbance is (force in world axes,
torque in base axes, efforts).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from written_vehicle import EYE, Vehicle, low, skew, squares, vector

UP = np.array([0.0, 0.0, 1.0])


class Arm:
    """Lever and Jacobian of the tip, joint axes and the tip's axes at an attitude and
    joint angles.
    """

    def __init__(self, vehicle: Vehicle, R: Any, q: Any) -> None:
        rotations, _, axes = vehicle.still(q)
        self.R, self.J, self.turns = R, vehicle.tip_jacobian(q), np.array(axes).T
        self.lever = vehicle.com_tip(np.asarray(q)[:, None])[1][:, 0]
        self.tip = R @ rotations[vehicle.tip_link]

    def force(self, d: Any) -> Any:
        """Force at the tip, world axes."""
        efforts = len(d[2])
        rows = [EYE, skew(self.lever), self.J.T]
        weights = [1.0, 1.0 / 0.055**2, np.eye(efforts) / 0.0045**2]
        A = sum(
            J.T @ (w * J if np.isscalar(w) else w @ J)
            for J, w in zip(rows, weights, strict=True)
        )
        b = self.R.T @ d[0] + rows[1].T @ d[1] * weights[1] + self.J @ d[2] / 0.0045**2
        return self.R @ np.linalg.solve(A, b)

    def load(self, f: Any, base: Any = 0.0) -> Any:
        """What a force at the tip (world axes) loads, with more of it on the base
        alone.
        """
        own = self.R.T @ f
        return (
            np.array(f + base),
            vector(self.lever, own + self.R.T @ (base + np.zeros(3))),
            self.J.T @ own,
        )


def plus(a: Any, b: Any, share: float = 1.0) -> Any:
    return tuple(x + share * y for x, y in zip(a, b, strict=True))


def unit(v: Any) -> Any:
    return v / np.linalg.norm(v)


class Interaction:
    """`interaction = [touch, lost]`, without a sensor, geared joints or tolerances."""

    def __init__(self, joints: int, touch: float, lost: float, dt: float) -> None:
        self.touch, self.lost, self.dt = touch, lost, dt
        self.contact, self.whole, self.met, self.losing, self.free = (
            False,
            False,
            False,
            0.0,
            0.0,
        )
        self.gamma = self.o = self.i = self.s = self.ds = self.moving = 0.0
        self.last = 0.0
        self.lean, self.bias = np.zeros(3), (np.zeros(3), np.zeros(3), np.zeros(joints))

    def normal(self, told: Any) -> Any:
        return unit(told + self.lean)

    def step(
        self,
        push: Any,
        d: Any,
        u: Any,
        then: Arm,
        now: Arm,
        v: Any,
        most: float,
        course: float,
        gap: float,
    ) -> Any:
        """Disturbance that is compensated, shift of the reference with two derivatives,
        n, gamma and D.
        """
        f_d, speed, told = push
        dt, n, asked, slides = self.dt, self.normal(told), f_d > 0.0, course > 0.01
        into = -n @ v
        e, enters = (
            (max(into - 0.8 * min(speed, 0.1), 0.0) if self.gamma == 1.0 else 0.0),
            into + min(self.ds, 0.0) > 0.1,
        )
        f = then.force(plus(d, self.bias, -1.0))
        along, was = n @ f, self.contact
        through = enters and self.whole
        if was:
            count = max(
                (
                    dt / 0.04
                    if (along if asked else np.linalg.norm(f)) < self.lost
                    else 0.0
                ),
                dt / 0.015 if through else 0.0,
            )
            self.losing = self.losing + count if count else 0.0
            self.contact = self.losing < 1.0 - 1e-9
        else:
            self.losing = 0.0
            self.contact = (
                asked and along > self.touch and (not enters or self.free > 0.05)
            )
        pressed = asked and self.contact
        before, down = max(self.gamma, 1e-9), dt / (0.15 if self.contact else 0.02)
        self.gamma = min(max(self.gamma + (dt / 0.15 if pressed else -down), 0.0), 1.0)
        self.moving = (
            1.0
            if slides
            else min(
                max(self.moving + (dt / 2.0 if course > 0.001 else -dt / 0.15), 0.0),
                1.0,
            )
        )
        s = 0.0 if slides else min(max(10.0 * (most - 0.9), 0.0), 1.0)
        step = 4.0 * dt * (f_d * (1.0 - 10.0 * e) - along) if self.gamma == 1.0 else 0.0
        step *= 1.0 - s if step * (f_d + self.i) > 0.0 else 1.0
        bound = f_d / 2 + 0.3
        self.i = min(max(self.i + step, -max(bound, f_d)), bound) if pressed else 0.0
        o, across = (
            (self.gamma * (f_d + self.i) if asked else self.o * self.gamma / before),
            f - along * n,
        )
        self.o = o
        kappa = (1.0 - 0.2 * s) * min(
            1.0,
            (0.25 + 0.75 * self.moving) * max(o, along, 0.0) / np.linalg.norm(across),
        )
        engaged = self.contact or self.gamma > 0.0
        if engaged:
            more = (1.0 - self.gamma) * along * n if self.contact else np.zeros(3)
            u = plus(
                plus(u, now.load(o * n + kappa * across, more)), then.load(f), -1.0
            )
        # the reference
        if pressed:
            a = 3.5**2 * gap - 7.0 * (self.ds + max(e - 0.2 * min(speed, 0.1), 0.0))
        elif asked:
            c = min(speed, 0.1) if self.met else speed
            a = 8.0 * (-(c if self.s > self.last - 0.5 else 0.0) - self.ds)
        else:
            a = 3.5**2 * (self.gamma * (gap + self.s) - self.s) - 7.0 * self.ds
        a = min(max(a, -4.0), 4.0)
        self.s, self.ds = self.s + dt * (self.ds + 0.5 * dt * a), self.ds + dt * a
        self.last = (self.s if pressed else self.last) if asked else 0.0
        damping = 53.0 if through else 20.0
        self.met = asked and (self.met or self.contact)
        self.whole = asked and (self.whole or (self.contact and self.gamma == 1.0))
        # the bias, and the normal
        self.free = 0.0 if engaged or was else self.free + dt
        if asked:
            self.bias = (
                self.bias[0] + low(1.0, dt) * (d[0] - f - self.bias[0]),
                *self.bias[1:],
            )
        elif self.free > 0.5:
            self.bias = plus(self.bias, plus(d, self.bias, -1.0), low(0.5, dt))
        if not asked:
            self.lean = np.zeros(3)
        elif slides and self.gamma > 1.0 - 1e-9:
            self.lean = np.clip(
                self.lean - dt * (n @ v) * v / (v @ v + 0.02**2), -0.4, 0.4
            )
        return u, (self.s, self.ds, a), n, self.gamma, damping


class Admittance:
    """`admittance` along the world's axes, without a sensor."""

    def __init__(
        self, joints: int, M: Any, D: Any, K: Any, T: float, dt: float
    ) -> None:
        self.M, self.D, self.K, self.T, self.dt = M, D, K, T, dt
        self.x, self.w, self.time, self.quiet, self.counts = (
            np.zeros(3),
            np.zeros(3),
            0.0,
            0.0,
            False,
        )
        self.bias = (np.zeros(3), np.zeros(3), np.zeros(joints))

    def step(self, d: Any, at: Arm) -> Any:
        """Shift of the reference, with two derivatives."""
        dt, begun = self.dt, self.time >= 2.0
        f = at.force(plus(d, self.bias, -1.0))
        loud = begun and np.linalg.norm(f) > 0.3
        self.quiet = 0.0 if loud else self.quiet + dt
        self.counts = loud or (self.counts and self.quiet < 0.3)
        if self.counts:
            self.bias = (
                self.bias[0] + low(1.0, dt) * (d[0] - f - self.bias[0]),
                *self.bias[1:],
            )
        else:
            self.bias = plus(
                self.bias, plus(d, self.bias, -1.0), low(0.5 if begun else 3.0, dt)
            )
        self.time += 0.0 if begun else dt
        f = f if self.counts else np.zeros(3)
        lead = (
            self.T
            * f
            / (
                self.M
                * np.maximum(
                    1.0,
                    np.maximum(
                        self.T * self.D / self.M, self.T * np.sqrt(self.K / self.M)
                    ),
                )
            )
        )
        # x' = w + lead, M w' = f - D (w + lead) - K x, by the trapezoidal rule
        x, w = np.zeros(3), np.zeros(3)
        for k in range(3):
            A = np.array([[0.0, 1.0], [-self.K[k] / self.M[k], -self.D[k] / self.M[k]]])
            b = np.array([lead[k], (f[k] - self.D[k] * lead[k]) / self.M[k]])
            old = np.array([self.x[k], self.w[k]])
            x[k], w[k] = np.linalg.solve(
                np.eye(2) - dt / 2 * A, old + dt / 2 * (A @ old + 2.0 * b)
            )
        self.x, self.w = x, w
        v = w + lead
        return x, v, (f - self.D * v - self.K * x) / self.M


class Load:
    """`load`: mass and centre of mass, and what a support carries."""

    def __init__(
        self,
        joints: int,
        most: float,
        bandwidth: float,
        g: float,
        dt: float,
        wrist: bool,
    ) -> None:
        self.most, self.bandwidth, self.g, self.dt, self.lacking = (
            most,
            bandwidth,
            g,
            dt,
            0.2 if wrist else 0.0,
        )
        self.m, self.c, self.bias = (
            0.0,
            np.zeros(3),
            (np.zeros(3), np.zeros(3), np.zeros(joints)),
        )

    def step(self, d: Any, holds: bool, at: Arm) -> Any:
        """What is taken out of the disturbance; after it the arm has the load."""
        weight, about = at.R.T @ (-self.g * UP), at.R.T[:, :2]
        columns = np.column_stack([vector(at.lever, weight), about])
        joints = np.column_stack([at.J.T @ weight, at.turns.T @ about])
        seen = plus(d, self.bias, -1.0)
        about_tip = vector(at.tip @ self.c, -self.g * self.lacking * self.m * UP)[:2]
        lacking = np.array([self.lacking * self.m, *about_tip])
        beyond = plus(
            seen, (-self.g * lacking[0] * UP, columns @ lacking, joints @ lacking), -1.0
        )
        rows = [np.array([[-self.g, 0.0, 0.0]]), columns, joints, np.eye(3)[1:]]
        wanted = [beyond[0][2:], beyond[1], beyond[2], np.zeros(2)]
        dm, *t = squares(rows, wanted, [1.0, 1 / 0.055**2, 1 / 0.0045**2, 1 / 0.03**2])
        m0, m = self.most / 5, self.m
        if not holds:
            self.m, self.c = 0.0, np.zeros(3)
            self.bias = plus(self.bias, seen, low(0.5, self.dt))
            return tuple(0.0 * each for each in d)
        chi = dm**2 / (dm**2 + (0.05 * (m + m0)) ** 2)
        self.m = min(
            max(m + low(1.5 * self.bandwidth, self.dt) * (0.1 + 0.9 * chi) * dm, 0.0),
            self.most,
        )
        off = (
            at.tip.T
            @ vector(UP, np.array([*t, 0.0]))
            * self.m
            / (self.g * (self.m**2 + m0**2))
        )
        self.c = np.clip(
            self.c - low(0.05 * self.bandwidth, self.dt) * (1 - chi) * off, -0.05, 0.05
        )
        return tuple(
            max(-(m + dm), 0.0) * each
            for each in (-self.g * UP, columns[:, 0], joints[:, 0])
        )

    def shares(self, at: Arm) -> Any:
        """Share of each joint's inertia that the model lacks."""
        m0, r = self.most / 5, 0.03
        return (
            self.m**2 / (self.m**2 + m0**2) * r**4 / ((at.J**2).sum(axis=0) ** 2 + r**4)
        )


class Accelerometer:
    """Bias, velocity integrated from the accelerometer, and how far it is used."""

    def __init__(self, force: float, velocity: float, agreement: float) -> None:
        self.force, self.velocity, self.agreement = force, velocity, agreement
        self.b, self.v, self.used = np.zeros(3), np.zeros(3), 1.0

    def step(
        self,
        y: Any,
        seen: Any,
        new: Any,
        v: Any,
        change: Any,
        free: float,
        R: Any,
        a: Any,
        thrust: Any,
        g: float,
        dt: float,
    ) -> Any:
        """Velocity, acceleration by which the force of 4. changes, how much of that is
        felt, what is beyond the model.

        ``v`` and ``change`` are those of the measured velocity alone, ``new`` the flags
        of velocity and specific force.
        """
        r = R @ (y - self.b - thrust) - a - g * UP
        present = float(np.any(y != 0.0))
        there = new[1] * present
        ahead = self.v + dt * (a + there * r)
        e, beta = (seen - ahead) * new[0], np.exp(-self.velocity * dt)
        ratio = self.agreement / np.sqrt(e @ e + 1e-9)
        # of a wrong accelerometer's error a part is left, twice what is accepted at
        # most for each period
        self.v = ahead + e - beta**2 * min(1.0, 2.0 * ratio) * e
        trust = min(ratio, 1.0)
        self.used = min(trust**4, self.used + dt)
        self.b = np.clip(
            self.b - there * trust * (1 - beta) ** 2 / dt * (R.T @ e), -5.0, 5.0
        )
        use = present * self.used
        share = there * self.used * free
        bounded = r * min(1.0, 10.0 / np.sqrt(r @ r + 1e-9))
        return (
            use * self.v + (1 - use) * v,
            share * low(self.force, dt) * bounded + (1 - share) * change,
            share,
            r,
        )
