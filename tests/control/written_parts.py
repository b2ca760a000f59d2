"""Parts of the law that is written again: lag, noises, accelerometer, force trend,
shift of the base, adaptation.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
from written_vehicle import (
    E_Z,
    Vehicle,
    constant,
    derivatives,
    dot,
    low,
    matmul,
    matrix,
    mul,
    pass_on,
    power,
    rotation_series,
    series,
    vector,
)

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
    accelerometer=(40.0, 8.0),
    force_trend=20.0,
    velocity_noise=0.0018,
    adaptation=2.0,
    friction_adaptation=2.0,
    tip_mass_limit=0.2,
)
"""As the page states them."""

SEEN, FELT = 0.01 * math.sqrt(0.005), 0.05 * math.sqrt(0.005)
"""Noises of velocity and accelerometer that the bandwidths of the latter are for: of
the bench, at 200 Hz."""

SHARES = (1 / 8, 1 / 4, 7 / 16, 11 / 16, 1.0)
"""Of the preview."""

PRICES = np.minimum(0.0075 * np.arange(9), 0.05)
"""Of the lags of the bank."""


class WrittenParts:
    """Memories of the parts, and one step of each."""

    par: Any
    v: Vehicle
    dt: float
    g: float
    delay: int
    d: Any
    rates: Any
    slack: float
    bias: Any
    free: Any
    started: bool

    # lag

    def _weights(self) -> list[Any]:
        """Weights of the lags of base and joints."""
        found = []
        for M in self.lag.M:
            paid = M + PRICES
            found.append((1 + 12.5 * (paid - paid.min()) / (paid.min() + 0.0075)) ** -8)
        return found

    def _delay_share(self) -> float:
        return float(np.clip((1.35 - (self.lag.B / self.lag.A).min()) / 0.2, 0.0, 1.0))

    def _lags(self) -> tuple[list[Any], list[float]]:
        weights = self._weights()
        return weights, [
            w @ np.arange(9) * self.stride * self.dt / w.sum() for w in weights
        ]

    # force trend

    def _trend(self) -> Any:
        """Rate of the observed force over the delay of the shift, and over those of
        observer and attitude.
        """
        t, dt, d, m = self.trend, self.dt, self.d[0], self.v.mass
        b = np.exp(-self.par.force_trend * dt)
        e = d - t.level - t.rate * dt
        t.level = t.level + t.rate * dt + (1 - b * b) * e
        t.rate = t.rate + (1 - b) ** 2 * e / dt
        for line, new in ((t.forces, d), (t.rates, t.rate)):
            pass_on(line, new, (12.0,) * 3, dt)

        def nu(x: Any) -> float:
            return 1 / (1 + (np.linalg.norm(x) / (5 * m)) ** 4)

        c = (d - t.forces[2]) / 0.25
        t.A += low(0.7, dt) * (nu(c) * t.rates[2] @ c - t.A)
        t.B += low(0.7, dt) * (nu(c) * t.rates[2] @ t.rates[2] - t.B)
        k = t.A / (t.B + (0.1 * m) ** 2)
        t.weight = nu(t.rate) * np.clip(2 * k - 1, 0.0, 1.0)
        return t.rate * t.weight, t.rate * (nu(t.rate) * np.clip(k, 0.0, 1.0))

    # arm_turn

    def _arm_turn(self, h: list[Any]) -> list[Any]:
        dt, size = self.dt, np.hypot(*h[4][:2]) / self.g
        self.size += (10.0 if size > self.size else 0.5) * dt * (size - self.size)
        self.mean = self.mean + (h[0] - self.mean) * dt
        mean = [self.mean]
        for each in h[:-1]:
            mean.append(each - mean[-1])
        left = (1 - self.par.arm_turn / max(self.size, self.par.arm_turn)) * np.array(
            [1.0, 1.0, 0.0]
        )
        return [a - (a - b) * left for a, b in zip(h, mean, strict=True)]

    # the shift of the base

    def _left(self, q: Any) -> Any:
        """Matrix, on heading 0, of what joints leave of a horizontal vector that the
        base would tilt for.
        """
        v = self.v
        axes = v.still(q)[2]
        G = sum(
            (np.outer(axes[i][:2], axes[i][:2]) for i in v.chain(v.tip_link)),
            np.zeros((2, 2)),
        )
        (least, most), U = np.linalg.eigh(G)
        # a turn about an axis moves the centre of mass across it
        return U @ np.diag([0.02 / (most + 0.02), 0.02 / (least + 0.02)]) @ U.T

    def _height(self, q: Any) -> float:
        com, tip = self.v.com_tip(constant(q, 1))
        return com[2, 0] - tip[2, 0]

    def _shift(
        self,
        base: Any,
        psi: Any,
        q: Any,
        com: Any,
        tip: Any,
        F: Any,
        rate: Any,
        drag: float,
        lead: Any,
        ahead: Any,
    ) -> list[Any]:
        """First to fourth derivative of the shift; the memory goes on."""
        m, g, dt = self.v.mass, self.g, self.dt
        left = self._left(q[:, 0])

        def on(heading: float, x: Any) -> Any:
            c, s = np.cos(heading), np.sin(heading)
            Z = np.array([[c, -s], [s, c]])
            return Z @ left @ Z.T @ x

        lever = com[2] - tip[2]
        times_ = np.array([0.0, *lead])
        h = np.diff(times_)
        one, two, four = (self._height(ahead[k][4:, 0]) for k in (0, 1, 3))
        levers = np.array([lever[0], one, two, (two + four) / 2, four, four])
        sizes = np.maximum(abs(levers), 0.02)
        velocity = [base[1], *(row[:3, 1] for row in ahead)]
        acceleration = [base[2], *(row[:3, 2] for row in ahead)]
        headings = [psi[0], *(row[3, 0] for row in ahead)]
        factor = levers / sizes
        f = np.array(
            [
                phi
                * on(heading, F[:2] / m + rate[:2] / m * t - drag / m * v[:2] - a[:2])
                for phi, heading, t, v, a in zip(
                    factor, headings, times_, velocity, acceleration, strict=True
                )
            ]
        )
        # numbers of the last period go on to now
        late = lead[0] - self.first + dt
        k, e = self.secants.copy(), self.falls.copy()
        k[1:5] += (self.secants[2:6] - self.secants[1:5]) * late / h[1:5]
        e[0:4] += (self.falls[1:5] - self.falls[0:4]) * late / h[1:5]
        z = np.array([a[2] for a in acceleration])
        n = np.maximum(
            [*(g - F[2] / m + (z[:-1] + z[1:]) / 2 + e), g - F[2] / m + z[-1]], 0.15 * g
        )
        n = n * [*((k[:-1] + k[1:]) / 2), k[-1]]
        b = np.sqrt(n[5] / sizes[5])
        v = -f[5] / b - (f[5] - f[4]) / (b * b * h[4])
        sweep = []
        for i in range(4, -1, -1):
            pace = 2 * n[i] / (sizes[i] + sizes[i + 1])
            x = pace * h[i] ** 2
            C, S = (
                1 + x / 2 + x**2 / 24 + x**3 / 720,
                h[i] * (1 + x / 6 + x**2 / 120 + x**3 / 5040),
            )
            mean, change = (f[i] + f[i + 1]) / 2, f[i + 1] - f[i]
            p = h[i] ** 2 * (
                (1 / 2 + x / 24 + x**2 / 720) * mean - (1 / 12 + x / 80) * change
            )
            down = C + b * S
            v, b = (
                (v - b * p - S * mean + h[i] * x * change / 24) / down,
                (pace * S + b * C) / down,
            )
            sweep.insert(0, (b, v, C, S, p))

        def secant(y: Any, size: float) -> float:
            return (1 - min(y @ y / size**2, 0.75)) ** -0.5

        y = now = self.y[:2]
        # forwards from the shift of now
        secants, falling, rates = [], [], []
        end = (
            np.sqrt(n[5] / sizes[5]),
            -f[5] / np.sqrt(n[5] / sizes[5]) - (f[5] - f[4]) / (n[5] / sizes[5] * h[4]),
        )
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
        size = (
            lever[:3] * np.sign(lever[0]) if abs(lever[0]) > 0.02 else constant(0.02, 3)
        )
        up = [
            base[2][2] + g - F[2] / m + self.sinks[0],
            base[3][2] - rate[2] / m + self.sinks[1],
            base[4][2] + self.sinks[2],
        ]
        N = series(*up) if up[0] > 0.15 * g else constant(0.15 * g, 3)
        per = power(size, -1)
        forcing = series(
            F[:2] / m - drag / m * base[1][:2] - base[2][:2],
            rate[:2] / m - drag / m * base[2][:2] - base[3][:2],
            -drag / m * base[3][:2] - base[4][:2],
        )
        Z = rotation_series(E_Z, psi[:3])[:2, :2]
        forcing = matmul(Z, left @ matmul(np.swapaxes(Z, 0, 1), forcing))
        F0, F1, F2 = derivatives(mul(mul(lever[:3], per)[None], forcing))
        dy = v - b * now
        ddy = N[0] / size0 * secant(now, size0) * now + F0
        lean = mul(series(now, dy, ddy), per[None])
        square = dot(lean, lean)
        square = square if square[0] < 0.75 else constant(0.75, 3)
        k0, k1, k2 = derivatives(
            mul(mul(N, per), power(constant(1.0, 3) - square, -0.5))
        )
        third = k1 * now + k0 * dy + F1
        fourth = k2 * now + 2 * k1 * dy + k0 * ddy + F2
        Y = series(now, dy, ddy, third, fourth)
        low_by = -lever[0] / size0**2 * secant(now, size0)
        heights = [low_by * each for each in derivatives(dot(Y, Y) / 2)[1:]]
        moved = [
            np.array([*each, z])
            for each, z in zip((dy, ddy, third, fourth), heights, strict=True)
        ]
        step = moved[0] * dt + moved[1] * dt * dt / 2
        self.y = self.y + step * [1.0, 1.0, 0.0]
        self.sinks = np.array(heights[1:])
        self.secants, self.falls, self.first = np.array(secants), falling, lead[0]
        return moved

    # the accelerometer

    def _hear(
        self, x: Any, new: Any, R: Any, linear: Any, done: Any, heard: Any, seen: Any
    ) -> Any:
        """Velocity, change of the force's acceleration and how much of it is felt; what
        is beyond the model.
        """
        dt = self.dt
        more = (self.v.A @ (done.speeds**2 - done.squares))[-1]
        beside = R @ (
            x.specific_force
            - self.bias
            - R.T @ (linear + self.g * E_Z)
            - E_Z * more / self.v.mass
        )
        there = float(np.any(x.specific_force))
        fresh = new["specific_force"] * there
        guess = self.integrated + dt * (linear + fresh * beside)
        e, beta = new["velocity"] * (x.velocity - guess), np.exp(-heard[1] * dt)
        ratio = heard[2] / np.sqrt(e @ e + 1e-9)
        integrated = guess + e - beta**2 * min(1.0, 2 * ratio) * e
        agreed = min(min(1.0, ratio) ** 4, self.agreed + dt)
        used = there * agreed
        trust = self.free.prod() * fresh * agreed
        taken = beside * min(1.0, 10.0 / np.sqrt(beside @ beside + 1e-9))
        change = trust * low(heard[0], dt) * taken + (1 - trust) * seen[1]
        if self.started:
            self.bias = (
                self.bias - fresh * min(1.0, ratio) * (1 - beta) ** 2 * R.T @ e / dt
            )
            self.bias = np.clip(self.bias, -5.0, 5.0)
            self.integrated, self.agreed = integrated, agreed
        return (used * integrated + (1 - used) * seen[0], change, trust), beside

    # 12.

    def _allocate(self, torque: Any, thrust: float) -> tuple[Any, Any]:
        """Squared rotor speeds within their limits, and those without limits."""
        P, top = self.v.inverse, self.v.top**2
        raw = P @ [*torque, thrust]
        tilt, p, t = P[:, :2] @ torque[:2], P[:, 3], P[:, 2]
        d = tilt / p
        spread = d[:, None] - d[None, :]
        shares = np.where(
            spread > 0, (top / p)[:, None] / np.where(spread > 0, spread, 1.0), 1.0
        )
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

    # lag, noise, adaptation

    def _learn_lag(self, x: Any, told: Any, free: Any, weights: Any) -> None:
        """The bank of lags, one period later."""
        a, dt, running = self.lag, self.dt, self.started
        rates = np.array([*x.rate[:2], *x.joint_rates])
        if not running:
            a.rates = rates
            return
        _, angular, bend = self._accelerations(
            told.R,
            told.w,
            told.q,
            told.qd,
            self.means[self.delay],
            self.efforts[self.delay],
            told.unknown,
        )
        model, seen = np.array([*angular[:2], *bend]) - a.own, (rates - a.rates) / dt
        bands = []
        for line, new in ((a.model, model), (a.measured, seen)):
            pass_on(line, new, (60.0, 60.0, 20.0), dt)
            bands.append(line[1] - line[2])
        band, z = bands
        past = np.array([band, *a.past[self.stride - 1 :: self.stride]])
        paces = (0.35 + 1.15 * self._delay_share(), 0.5)
        scale = a.s[0]
        for k, part in enumerate((slice(0, 2), slice(2, None))):
            eta = max(paces[k] * dt, 1 / (a.count + 20))
            E = ((z[part] - past[:, part]) ** 2).sum(axis=1)
            M = a.M[k] + eta * (E / (E + 4 * a.s[k] + 0.01) - a.M[k])
            a.M[k] = np.minimum(M, (M + PRICES).min() + 0.05 - PRICES)
            a.s[k] += dt * (min(E.mean(), 4 * (a.s[k] + 0.01)) - a.s[k])
        expected = weights[0] @ past[:, :2] / weights[0].sum()
        e, y = np.array([expected, z[:2]]) - a.low
        a.low = a.low + low(20.0, dt) * np.array([e, y])
        size = y**2 + e**2 + 4 * scale + 0.01
        a.A += 0.3 * dt * free[0] * (e * y / size - a.A)
        a.B += 0.3 * dt * free[0] * (e**2 / size - a.B)
        asked, answered = band[2:] @ band[2:], z[2:] @ z[2:]
        a.obeyed += (
            2.0 * dt * (min(answered, asked) - a.obeyed * asked) / (asked + 0.01)
        )
        a.own = a.own + told.corrections * [
            free[0],
            free[0],
            *np.maximum(free[1:], 0.2),
        ]
        a.rates, a.past, a.count = rates, [band, *a.past[:-1]], a.count + 1

    def _share(self, noise: Any, density: float) -> float:
        return float((density**2 / max(noise.V * self.dt, density**2)) ** 0.25)

    def _learn_noise(self, a: Any, c: Any, left: Any, density: float) -> None:
        """Variance of a sensor's white noise, from its changes beyond the model."""
        most = 20 * (max(a.V, 0.0) + density**2 / self.dt)
        a.V += 2.0 * self.dt * (np.clip(-(c @ a.c) / 3, -most, most) - a.V)
        a.o, a.c = left, c

    def _modelled(self) -> Any:
        """Of the learned damping what the model's joints have."""
        return np.minimum(self.learned.b, self.borne)

    def _adapt(
        self,
        x: Any,
        wanted: Any,
        qt: Any,
        Rq: Any,
        wq: Any,
        aq: Any,
        proper: Any,
        observer: Any,
        free: Any,
    ) -> None:
        """Mass at the tip and damping of the joints, and what they need in the next
        period.
        """
        par, v, dt, a = self.par, self.v, self.dt, self.learned
        R, J = matrix(x.quaternion), v.tip_jacobian(x.joints)
        tip = x.velocity + R @ (
            vector(x.rate, v.com_tip(x.joints[:, None])[1][:, 0]) + J @ x.joint_rates
        )
        felt = (tip - a.tip) / dt * self.started + self.g * E_Z
        given = self.fed[self.delay][2] - self._modelled() * self.modelled
        a.tip, share, slow = tip, low(observer[2], dt), low(2.0, dt)
        a.once = a.once + share * (
            np.array([-J.T @ R.T @ felt, x.joint_rates, given]) - a.once
        )
        a.twice = a.twice + share * (a.once - a.twice)
        a.u, a.o = (
            a.u + slow * (wanted**2 - a.u),
            a.o + slow * ((x.joint_rates - wanted) ** 2 - a.o),
        )
        Y, rate, given = a.twice
        e, old = (
            free[1:] * (self.d[2] + given - a.m * Y + a.b * rate),
            (
                a.m,
                a.b,
                self._modelled(),
            ),
        )
        a.m += par.adaptation * dt * (Y * e).sum() / (0.001 + (Y**2).sum())
        a.m = np.clip(a.m, -par.tip_mass_limit, par.tip_mass_limit)
        weight = a.u / (a.u + 0.001) * (1 + 2 * a.o / (a.u + 0.1)) ** -2.0
        a.b = a.b - par.friction_adaptation * dt * weight * e * rate / (0.1 + rate**2)
        a.b = np.clip(a.b, -v.damping, self.stickiest)
        # along the plan
        q, r = qt[:, 0], derivatives(v.com_tip(qt[:, :3])[1])
        push = -(
            Rq.T @ proper
            + vector(aq, r[0])
            + vector(wq, vector(wq, r[0]))
            + 2 * vector(wq, r[1])
            + r[2]
        )
        unit = [Rq @ push, vector(r[0], push), v.tip_jacobian(q).T @ push]

        def along(m: float, rest: Any) -> list[Any]:
            return [unit[0] * m, unit[1] * m, unit[2] * m - rest * qt[:, 1]]

        rest, inside = a.b - self._modelled(), self._modelled()
        change = along(a.m - old[0], rest - (old[1] - old[2]))
        over = [*change[:2], change[2] - (inside - old[2]) * self.rates[2]]
        self.d = [seen - taken for seen, taken in zip(self.d, over, strict=True)]
        fed = along(a.m, rest)
        before = [
            [each + more for each, more in zip(row, change, strict=True)]
            for row in self.fed[: self.delay]
        ]
        self.fed = [fed, *before]
