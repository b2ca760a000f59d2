"""The centroidal law in mode "tip" written again from
the equations beside its code and the files alone.

NumPy and the files of vehicle and scenario, nothing of the library. Numbers are those
that the page states in parentheses; sections are the page's. For vehicles of turning
joints without limits, and no option beside.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.polynomial.legendre import leggauss
from written_parts import FELT, NUMBERS, SEEN, SHARES, WrittenParts
from written_vehicle import (
    E_Z,
    Vehicle,
    constant,
    cos_sin,
    cross,
    derivatives,
    dot,
    half_turn,
    is_jump,
    low,
    matmul,
    matrix,
    mul,
    one_plus,
    power,
    rotation_series,
    series,
    squares,
    times,
    turn,
    unit,
    vector,
    vee,
)

BINOMIAL = np.array(
    [[math.comb(i, k) for i in range(6)] for k in range(6)], dtype=float
)


class WrittenLaw(WrittenParts):
    """The law's memory, and one step of it."""

    def __init__(
        self, vehicle: Vehicle, gravity: float, dt: float, T: float, delay: int
    ) -> None:
        self.par, self.v, self.g, self.dt, self.T, self.delay = (
            NUMBERS,
            vehicle,
            gravity,
            dt,
            T,
            delay,
        )
        v, n = vehicle, vehicle.n
        f, t, efforts = v.rnea(
            np.zeros(n),
            np.zeros(3),
            np.zeros(n),
            np.zeros(3),
            gravity * E_Z,
            np.zeros(n),
        )
        W = np.sqrt(v.inverse @ [*t, f[2]])
        self.stride = max(1, round(0.005 / dt))
        # 1. newest first
        rows = 1 + delay + 8 * self.stride
        self.speeds, self.means, self.efforts = (
            [W] * rows,
            [W * W] * rows,
            [efforts] * rows,
        )
        self.command = (W, efforts)
        self.started, self.age, self.sample = False, 0.0, None
        self.pose = (np.zeros(3), np.array([1.0, 0, 0, 0]), np.zeros(n))
        self.rates = (np.zeros(3), np.zeros(3), np.zeros(n))
        self.d = (np.zeros(3), np.zeros(3), np.zeros(n))
        self.fed = [(np.zeros(3), np.zeros(3), np.zeros(n))] * (1 + delay)
        self.left, self.modelled = np.zeros(n), np.zeros(n)
        self.W = W
        self.free = np.ones(1 + n)
        self.slow, self.bias, self.integrated, self.agreed = (
            np.zeros(3),
            np.zeros(3),
            np.zeros(3),
            1.0,
        )
        self.last, self.leap = None, 0.0
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
            low=np.zeros((2, 2)),
            A=np.full(2, 0.05),
            B=np.full(2, 0.05),
            obeyed=1.0,
        )
        self.noise = SimpleNamespace(o=np.zeros(3), c=np.zeros(3), V=0.0)
        self.shaking = SimpleNamespace(o=np.zeros(3), c=np.zeros(3), V=0.0)
        self.learned = SimpleNamespace(
            m=0.0,
            b=np.zeros(n),
            once=np.zeros((3, n)),
            twice=np.zeros((3, n)),
            tip=np.zeros(3),
            u=np.zeros(n),
            o=np.zeros(n),
        )
        M = v.mass_matrix(np.zeros(n))
        self.slack, self.stickiest = self.par.yaw_slack * M[5, 5], 50.0 * np.diag(M)[6:]
        # what damping of 5 I takes from the fastest motion of the arm, whose base gives
        # way: no more than its loop has
        fastest = np.linalg.eigvals(
            np.linalg.inv(M)[6:, 6:] @ np.diag(self.stickiest / 10)
        ).real.max()
        self.borne = self.stickiest / 10 * min(1.0, self.par.arm[1] / fastest)

    def step(self, x: Any, held: Any, ahead: Any) -> tuple[Any, Any]:
        """Rotor speeds and joint torques.

        Args:
            x: measurement, with position, quaternion, velocity, rate, joints,
                joint_rates.
            held: reference sample, a row (value, rate, acceleration) of x, y, z, yaw
                and each joint.
            ahead: samples to come: after T, 2 T, and the shares of the preview.
        """
        par, v, dt, T, g, m = self.par, self.v, self.dt, self.T, self.g, self.v.mass
        # 1. actuators
        weights, L = self._lags()
        W, u, e = self.speeds[0], *self.command
        self.speeds = [v.motors(W, u, dt), *self.speeds[:-1]]
        mean = sum(
            0.5 * w * v.motors(W, u, 0.5 * dt * (1 + x)) ** 2
            for x, w in zip(*leggauss(9), strict=True)
        )
        self.means = [mean, *self.means[:-1]]
        self.efforts = [e, *self.efforts[:-1]]
        a = L[0] / dt + self.delay
        w = np.clip(a - np.arange(len(self.speeds)), 0.0, 1.0)
        shares = np.array([1.0, *w[:-1]]) - w
        then = SimpleNamespace(
            squares=shares @ self.means,
            speeds=shares @ self.speeds,
            efforts=shares @ self.efforts,
        )
        since = SimpleNamespace(
            squares=w[:-1] @ self.means[:-1] / a, efforts=w[:-1] @ self.efforts[:-1] / a
        )
        # 2. reference
        changed = self.sample is None or np.any(held != self.sample)
        self.age, self.sample = (0.0 if changed else min(self.age + dt, T)), held.copy()
        late = self.age + L[0]
        signals = np.array(
            [
                self._signal(*rows, late)
                for rows in zip(held, ahead[0], ahead[1], strict=True)
            ]
        )
        lead = [0.0]
        for p in SHARES:
            lead.append(max(p * par.preview - late, lead[-1] + dt))
        lead = lead[1:]
        # 3. gains
        r = par.lag[0] / (
            par.lag[0] + max(L[0] * (1 - self._delay_share()) - 0.002, 0.0)
        )
        j = self.j = par.lag[1] / (par.lag[1] + max(L[1] - L[0] - 0.002, 0.0))
        bend = 9 * par.damping**2
        room = (
            max(1 - L[0] / 0.02, 0.0)
            * bend
            / (bend + (v.tip_jacobian(self.pose[2])[2] ** 2).sum())
        )
        braced = 1.0 + room * np.clip(9 * (self.d[0][2] / (m * g) - 0.05), 0.0, 2.2)
        quicker = 1.0 + room * np.clip(3 * (self.d[0][2] / (m * g) - 0.15), 0.0, 1.0)
        kp, kv = par.base[0] * r * r, par.base[1] * r
        KR = np.array([par.base[2], par.base[2], par.yaw[0]]) * r * r
        Kw = np.array([par.base[3], par.base[3], par.yaw[1]]) * r
        arm = par.arm[0] * j**2 * braced**1.5, par.arm[1] * j * braced
        tip = par.tip[0] * j**2 * braced**1.5, par.tip[1] * j * braced
        quiet = self._share(self.noise, par.velocity_noise)
        joints = min(
            par.observer[2] * j, par.observer[1] * r * max(1.0, 8 * self.lag.obeyed)
        )
        observer = par.observer[0] * r * quiet, par.observer[1] * r, joints * quicker
        calm, seen = self._share(self.shaking, FELT), self._share(self.noise, SEEN)
        heard = (
            par.accelerometer[0] * r * calm,
            np.clip(par.accelerometer[1] * (seen / calm) ** 2, 2.0, 60.0),
        )
        heard = *heard, 0.05 / seen**2
        # 4. observer
        told = self._observe(x, then, observer, heard)
        # 5. prediction
        R = matrix(self.pose[1])
        side = v.side(self.W, R.T @ self.rates[0], self.rates[1])
        unknown = [a + b for a, b in zip(self.d, self.fed[0], strict=True)]
        unknown = [unknown[0] + R @ side[0], unknown[1] + side[1], unknown[2]]
        now = self._predict(since, unknown, a * dt)
        R, omega = matrix(now.quaternion), now.rate
        # 6. force
        rate, led = self._trend()
        lateness = 1 / max(heard[0], 1.0)
        unknown[0] = unknown[0] + led * lateness
        self.slow = self.slow + low(par.shift_rate, dt) * (self.d[0] - self.slow)
        F = self.slow + self.fed[0][0] + rate * (lateness + 1 / par.shift_rate)
        # 7. shift and quasi-static attitude
        base, psi, q = (
            np.array([derivatives(s) for s in signals[:3]]).T,
            signals[3],
            signals[4:],
        )
        com, point = v.com_tip(q)
        drag = (v.cd * now.W).sum()
        moved = self._shift(base, psi, q, com, point, F, rate, drag, lead, ahead[2:])
        going = [base[0], *(b + y for b, y in zip(base[1:], moved, strict=True))]
        D = [R @ v.side(now.W, R.T @ p, np.zeros(3))[0] for p in going[1:4]]
        wanted = (
            (going[2] + g * E_Z) * m - F - D[0],
            going[3] * m - D[1] - rate,
            going[4] * m - D[2],
        )
        fq = self._bounded(series(*wanted))
        Rq, wq, aq = self._attitude(self._upright(fq, fq), psi)
        # 8. links
        goal = self._goal(base, psi, q, point)
        qt = self._turned(q, goal, Rq, wq, aq)
        com, turned = v.com_tip(qt)
        s = self._offset(goal.arm, turned, Rq, wq, aq)
        base = [
            base[0] + s[0],
            base[1] + s[1],
            base[2] + s[2],
            base[3] + moved[2],
            base[4] + moved[3],
        ]
        # 9. centre of mass
        h = self._arm_turn(derivatives(com))
        carried = [
            h[0],
            vector(wq, h[0]) + h[1],
            vector(aq, h[0])
            + vector(wq, vector(wq, h[0]))
            + 2 * vector(wq, h[1])
            + h[2],
            h[3],
            h[4],
        ]
        pc = [p + Rq @ c for p, c in zip(base, carried, strict=True)]
        own = series(now.joints, now.joint_rates, np.zeros(v.n))
        c, p = v.com_tip(own)
        c, p = derivatives(c), derivatives(p)
        position, velocity = (
            now.position + R @ c[0],
            now.velocity + R @ (vector(omega, c[0]) + c[1]),
        )
        f, ac = self._force(
            pc, position, velocity, R, omega, unknown[0], (D[1] + led, D[2]), kp, kv
        )
        Fz = f[:, 0] @ R[:, 2]
        # 10. attitude
        Rd, wd, ad = self._attitude(self._upright(f, fq), psi)
        E = R.T @ Rd
        eR = vee(-E) + half_turn(E)
        alpha = E @ ad - vector(omega, E @ wd) - KR * eR - Kw * (omega - E @ wd)
        # 11. joints
        qd, qdd = q[:, 1], 2 * q[:, 2]
        preferred = (
            qdd + arm[1] * (qd - now.joint_rates) + arm[0] * (q[:, 0] - now.joints)
        )
        e = series(now.position - base[0], now.velocity - base[1], ac - base[2])
        fourth = mul(dot(e, e), dot(e, e)) / par.reach**4
        follow = derivatives(mul(e, mul(fourth, power(one_plus(fourth), -1))[None]))
        xd = [a + b for a, b in zip(goal.tip, follow, strict=True)]
        xp, xv = (
            now.position + R @ p[0],
            now.velocity + R @ (vector(omega, p[0]) + p[1]),
        )
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
        off = 0.0
        for i, (turning, bias) in enumerate(
            self._turning(axes, now.joint_rates, omega, alpha)
        ):
            rows.append(self._columns(axes, i))
            off += (
                (axes[i] @ R.T @ self._off(R @ links[i], goal.links[i])) ** 2
                / v.n
                / 0.07**2
            )
            turn_d = (
                goal.accelerations[i]
                + tip[1] * goal.rates[i]
                + tip[0] * self._off(R @ links[i], goal.links[i])
            )
            right.append(R.T @ turn_d - tip[1] * turning - bias)
        rows.append(np.eye(v.n))
        right.append(preferred)
        weight = par.damping**2 * (1 + 2 * off / (2 + off))
        qdd = squares(rows, right, [1.0, *[weight] * v.n, par.posture**2])
        pole = max(arm[1] / 2, np.sqrt(arm[0]))
        near = (
            2 * q[:, 2]
            + 2 * pole * (q[:, 1] - now.joint_rates)
            + pole**2 * (q[:, 0] - now.joints)
        )
        qdd = np.clip(qdd, near - 2.2 * pole**2, near + 2.2 * pole**2)
        # 12. inverse dynamics and commands
        F0 = v.rnea(now.joints, omega, now.joint_rates, alpha, np.zeros(3), qdd)[0]
        proper = (Fz * E_Z + R.T @ unknown[0] - F0) / m
        _, torque, efforts = v.rnea(
            now.joints, omega, now.joint_rates, alpha, proper, qdd
        )
        torque, efforts = (
            torque - unknown[1],
            efforts
            - unknown[2]
            + (self.j * v.damping + self._modelled()) * now.joint_rates,
        )
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
        goals = np.sqrt(
            np.maximum(
                allocated
                + self.trim
                + change * dt / (1 - (1 - kappa) * np.exp(-dt / tau)),
                0,
            )
        )
        goals = np.minimum(goals, v.top)
        tau = np.where(goals > now.W, v.up, v.down)
        speeds = np.clip(
            goals + kappa * (goals - now.W) * (1 / (1 - np.exp(-dt / tau)) - 1),
            0.0,
            v.top,
        )
        reached = v.motors(now.W, speeds, dt)
        before, self.free = (
            self.free,
            np.array([inside, *(np.abs(efforts) < v.limit)], dtype=float),
        )
        if inside:
            self.trim = np.clip(
                self.trim + par.trim_rate * dt * (allocated - reached**2),
                -0.1 * v.top**2,
                0.1 * v.top**2,
            )
        # 13. lag, noise and adaptation
        self._learn_lag(x, told, before, weights)
        left = told.known * (x.velocity - self.rates[0])
        self._learn_noise(
            self.noise, told.missed - self.noise.o, left, par.velocity_noise
        )
        self._learn_noise(self.shaking, told.beside - self.shaking.o, told.beside, FELT)
        self._adapt(x, q[:, 1], qt, Rq, wq, aq, base[2] + g * E_Z, observer, before)
        self.command, self.started = (speeds, given), True
        return speeds, given

    # 2.

    def _signal(self, held: Any, one: Any, two: Any, s: float) -> Any:
        """Series of a reference signal at the age s of its sample."""
        T, (p, v0, a0), (v1, a1), (v2, a2) = self.T, held, one[1:], two[1:]
        mean = (v1 - v0) / T
        b2, b3 = (3 * mean - 2 * a0 - a1) / T, (a0 + a1 - 2 * mean) / T**2
        k = (
            0.0
            if is_jump((v1, a1), (v2, a2), T)
            else (a2 - a0 - 4 * b2 * T - 12 * b3 * T**2) / (12 * T**3)
        )
        c = [v0, a0, b2 + k * T**2, b3 - 2 * k * T, k]
        if is_jump((v0, a0), (v1, a1), T):
            c = [v0, a0, 0.0, 0.0, 0.0]
        c = np.array([p, *(each / (i + 1) for i, each in enumerate(c))])
        # coefficients about s: of the binomial expansion of (s + x)^i
        return np.array(
            [BINOMIAL[k, k:] * s ** np.arange(6 - k) @ c[k:] for k in range(5)]
        )

    # 4. and 5.

    def _accelerations(
        self, R: Any, w: Any, q: Any, qd: Any, squared: Any, efforts: Any, unknown: Any
    ) -> Any:
        """Accelerations of the model: base (world axes), base (base axes), joints."""
        v = self.v
        f, t, u = v.rnea(q, w, qd, np.zeros(3), np.zeros(3), np.zeros(v.n))
        *torque, thrust = v.A @ squared
        given = (
            np.clip(efforts, -v.limit, v.limit)
            - (self.j * v.damping + self._modelled()) * qd
            + unknown[2]
        )
        right = np.concatenate(
            [thrust * E_Z + R.T @ unknown[0] - f, torque + unknown[1] - t, given - u]
        )
        a = np.linalg.solve(v.mass_matrix(q), right)
        return R @ a[:3] - self.g * E_Z, a[3:6], a[6:]

    def _observe(self, x: Any, done: Any, bandwidths: Any, heard: Any) -> Any:
        """Pose filter and observer; what the lag estimate takes from them."""
        v, dt = self.v, self.dt
        new = self._new(x)
        share = {
            name: low(self.par.observer[3], dt) * new[name] if self.started else 1.0
            for name in ("position", "quaternion", "joints")
        }
        (p, quaternion, q), (velocity, w, qd) = self.pose, self.rates
        p, joints = p + velocity * dt, q + qd * dt
        carried = times(quaternion, turn(w * dt))
        measured = x.quaternion if x.quaternion @ carried >= 0 else -x.quaternion
        turned = unit(carried + share["quaternion"] * (measured - carried))
        self.pose = (
            p + share["position"] * (x.position - p),
            turned,
            joints + share["joints"] * (x.joints - joints),
        )
        R, amid = (
            matrix(unit(quaternion + turned)),
            ((q + self.pose[2]) / 2 if self.started else self.pose[2]),
        )
        side = v.side(done.speeds, R.T @ velocity, w)
        unknown = [a + b for a, b in zip(self.d, self.fed[self.delay], strict=True)]
        unknown = [unknown[0] + R @ side[0], unknown[1] + side[1], unknown[2]]
        self.modelled = qd
        linear, angular, bend = self._accelerations(
            R, w, amid, qd, done.squares, done.efforts, unknown
        )
        ahead = velocity + linear * dt, w + angular * dt, qd + bend * dt
        seen, flags = (
            (x.velocity, x.rate, x.joint_rates),
            (
                new["velocity"],
                new["rate"],
                new["joint_rates"],
            ),
        )
        errors = [flag * (a - b) for a, b, flag in zip(seen, ahead, flags, strict=True)]
        most = max(1.0, dt / 0.005) * np.array(
            [max(0.3, np.sqrt(27 * max(self.noise.V, 0))), 1.0]
        )
        leap = [
            ((a - b) / each) @ ((a - b) / each)
            for a, b, each in zip(seen, ahead, most, strict=False)
        ]
        slight = 1 / max(1, leap[0] * flags[0], leap[1] * flags[1])
        known = min(1.0, (1 + self.leap) * slight)
        errors[0] = errors[0] * known
        poles = [np.exp(-each * dt) for each in bandwidths]
        slow = [
            slight * (1 - b) ** 2 * e / dt for b, e in zip(poles, errors, strict=True)
        ]
        left = [b**2 * (1 - known + slight) for b in poles]
        translation = ahead[0] + (1 - left[0]) * errors[0], slow[0]
        translation, beside = self._hear(x, new, R, linear, done, heard, translation)
        still = amid, np.zeros(3), np.zeros(v.n), slow[1], R.T @ translation[1]
        _, torque, efforts = v.rnea(*still, slow[2])
        trust = translation[2]
        quick = (
            trust * slight * low(heard[0], dt) * (errors[2] - self.left) / dt
            + (1 - trust) * slow[2]
        )
        force = v.rnea(*still, quick)[0]
        told = SimpleNamespace(
            R=R,
            w=w,
            q=amid,
            qd=qd,
            unknown=unknown,
            corrections=np.array([*slow[1][:2], *slow[2]]),
        )
        told.missed, told.beside, told.known = errors[0], beside, known
        if self.started:
            self.rates = tuple(
                a + (1 - b) * e for a, b, e in zip(ahead, left, errors, strict=True)
            )
            self.rates = (translation[0], *self.rates[1:])
            self.left, self.leap, force = left[2] * errors[2], max(leap), R @ force
            # at a limit it may shrink, slowly, until it is least
            self.d = (
                self.d[0]
                + force
                * max(
                    self.free[0],
                    np.clip(-self.d[0] @ force / (force @ force + 1e-9), 0.0, 0.05),
                ),
                self.d[1] + torque * self.free[0],
                self.d[2] + efforts * np.maximum(self.free[1:], 0.2),
            )
            self.W = done.speeds
        else:
            self.rates, self.integrated = seen, x.velocity
        return told

    def _new(self, x: Any) -> dict[str, float]:
        """Of each reading, 1 if it is new: it differs from the last one, or its rate is
        zero.
        """
        rates = {
            "position": "velocity",
            "quaternion": "rate",
            "specific_force": "rate",
            "joints": "joint_rates",
        }
        last, self.last, new = self.last, x, {}
        for name in (
            "position",
            "quaternion",
            "velocity",
            "rate",
            "specific_force",
            "joints",
            "joint_rates",
        ):
            repeats = last is not None and np.all(
                getattr(x, name) == getattr(last, name)
            )
            new[name] = float(
                not repeats or np.all(getattr(x, rates.get(name, name)) == 0.0)
            )
        return new

    def _predict(self, since: Any, unknown: Any, h: float) -> Any:
        """State in h seconds."""
        (p, quaternion, q), (velocity, w, qd) = self.pose, self.rates
        R = matrix(times(quaternion, turn(w * h / 2)))
        linear, angular, bend = self._accelerations(
            R, w, q + qd * h / 2, qd, since.squares, since.efforts, unknown
        )
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
        return np.array(
            [f[0] + mul(along[0], share), f[1] + mul(along[1], share), raised]
        )

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
            above = (
                rates[v.parent[i]]
                if v.parent[i] >= 0
                else np.array([0 * psi[1:], 0 * psi[1:], np.arange(1, 5) * psi[1:]])
            )
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
        """Angular velocity of each link, and its acceleration at zero joint
        accelerations.
        """
        found: list[Any] = []
        for i in range(self.v.n):
            rate, bias = (
                found[self.v.parent[i]] if self.v.parent[i] >= 0 else (w, alpha)
            )
            slide = axes[i] * qd[i]
            found.append((rate + slide, bias + vector(rate, slide)))
        return found

    def _turned(self, q: Any, goal: Any, Rq: Any, wq: Any, aq: Any) -> Any:
        """Joint signals that orient the links on a tilted base."""
        v, par = self.v, self.par
        weights = [*[par.damping**2] * v.n, par.posture**2]
        links, _, axes = v.still(q[:, 0])

        def solve(right: list[Any], preferred: Any) -> Any:
            return squares(
                [*(self._columns(axes, i) for i in range(v.n)), np.eye(v.n)],
                [*right, preferred],
                weights,
            )

        errors = [
            Rq.T @ self._off(Rq @ R, desired)
            for R, desired in zip(links, goal.links, strict=True)
        ]
        value = q[:, 0] + solve(errors, np.zeros(v.n))
        axes = v.still(value)[2]
        rates = solve([Rq.T @ w - wq for w in goal.rates], q[:, 1])
        turning = self._turning(axes, rates, wq, aq)
        bends = [
            Rq.T @ a - bias
            for a, (_, bias) in zip(goal.accelerations, turning, strict=True)
        ]
        second = solve(bends, 2 * q[:, 2])
        return np.column_stack([value, rates, second / 2, q[:, 3:]])

    def _offset(self, arm: Any, turned: Any, Rq: Any, wq: Any, aq: Any) -> list[Any]:
        """Shift of the base that keeps the tip, with two derivatives."""
        r = derivatives(turned)
        return [
            arm[0] - Rq @ r[0],
            arm[1] - Rq @ (vector(wq, r[0]) + r[1]),
            arm[2]
            - Rq
            @ (
                vector(aq, r[0])
                + vector(wq, vector(wq, r[0]))
                + 2 * vector(wq, r[1])
                + r[2]
            ),
        ]

    # 9.

    def _force(
        self,
        pc: Any,
        p: Any,
        v: Any,
        R: Any,
        w: Any,
        d: Any,
        changes: Any,
        kp: float,
        kv: float,
    ) -> tuple[Any, Any]:
        """Desired force, with two derivatives, and the acceleration that the thrust
        gives.
        """
        m, g, par = self.v.mass, self.g, self.par
        b3, b3d = R[:, 2], R @ vector(w, E_Z)
        e0 = 2 * par.approach * (kv / kp) ** 2

        def feedback(e: list[Any], k: int) -> Any:
            """The k-th derivative of sigma, from the error's derivatives up to the one
            after.
            """
            error = series(*e[: k + 1])
            far = dot(error, error) / e0**2
            chi = power(one_plus(mul(far, far)), -1 / 8)
            x = kp * mul(error, chi[None]) + kv * series(*e[1 : k + 2])
            return derivatives(
                mul(x, power(one_plus(dot(x, x) / par.pull**2), -1 / 2)[None])
            )[k]

        e = [p - pc[0], v - pc[1]]
        f = m * (pc[2] + g * E_Z - feedback(e, 0)) - d
        e.append((b3 * (f @ b3) + d) / m - g * E_Z - pc[2])
        f1 = m * (pc[3] - feedback(e, 1)) - changes[0]
        thrust = b3 * (f1 @ b3 + f @ b3d) + b3d * (f @ b3)
        e.append((thrust + changes[0]) / m - pc[3])
        f2 = m * (pc[4] - feedback(e, 2)) - changes[1]
        found = self._bounded(series(f, f1, f2))
        return found, (b3 * (found[:, 0] @ b3) + d) / m - g * E_Z
