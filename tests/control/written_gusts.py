"""The preset "gusts", written again from docs/centroidal_law.md: what it has beyond "adaptive"."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from written_law import WrittenLaw
from written_parts import NUMBERS
from written_vehicle import E_Z, Vehicle, low

GUSTS = SimpleNamespace(accelerometer=(30.0, 5.0), gust_shift=0.7, gust_rate=1.0)
"""As the page states them."""

UNHEARD = 1e9
"""Noise of the velocity that no flight has: there is no part for it."""


class WrittenGusts(WrittenLaw):
    """The law with an accelerometer, weighed by the share of gusts."""

    def __init__(self, vehicle: Vehicle, gravity: float, dt: float, T: float, delay: int) -> None:
        super().__init__(vehicle, gravity, dt, T, delay)
        self.par = SimpleNamespace(**(vars(NUMBERS) | {"velocity_noise": UNHEARD}))
        self.bias, self.filtered, self.P, self.T2 = np.zeros(3), np.zeros(3), 0.0, 0.0
        self.steep, self.gust = 7.0 * vehicle.mass, 1.0
        # along the arm from its first joint to the tip
        self.length = sum(float(np.linalg.norm(place)) for place in self._steps())

    def _steps(self) -> list[Any]:
        _, places, _ = self.v.still(np.zeros(self.v.n))
        chain = self.v.chain(self.v.tip_link)
        tip = self.v.com_tip(np.zeros((self.v.n, 1)))[1][:, 0]
        return [b - a for a, b in zip([places[i] for i in chain], [*(places[i] for i in chain[1:]), tip], strict=True)]

    def _share(self) -> float:
        return max(0.0, 1.0 - 3.0 * self.T2 / (self.P + (0.3 * self.v.mass) ** 2))

    def _stiffness(self) -> float:
        return 1.0 + 0.5 * self._share()

    def _quicker(self, room: float) -> float:
        return float(1.0 + room * np.clip(3 * (self.d[0][2] / (self.v.mass * self.g) - 0.15), 0.0, 1.0))

    def _lateness(self, observer: Any) -> float:
        share, r = self.heard, observer[0] / self.par.observer[0]
        return float(share / (GUSTS.accelerometer[0] * r) + (1 - share) * 2 / observer[0])

    def _hear(self, x: Any, R: Any, linear: Any, done: Any, bandwidth: float, seen: Any) -> Any:
        dt, m, share = self.dt, self.v.mass, self._share()
        self.heard = share
        more = (self.v.A @ (done.speeds**2 - done.squares))[-1]
        r = x.specific_force - self.bias - R.T @ (linear + self.g * E_Z) - E_Z * more / m
        guess = self.rates[0] + dt * (linear + R @ r)
        e, beta = x.velocity - guess, np.exp(-GUSTS.accelerometer[1] * dt)
        if self.started:
            self.bias = self.bias - (1 - beta) ** 2 * R.T @ e / dt
        trust, force = share * self.free[1:].prod(), GUSTS.accelerometer[0] * bandwidth / self.par.observer[0]
        return (
            share * (guess + (1 - beta**2) * e) + (1 - share) * seen[0],
            trust * low(force, dt) * (R @ r) + (1 - trust) * seen[1],
            trust + (1 - trust) * seen[2],
        )

    def _gusts(self, earlier: Any, observer: Any) -> None:
        dt, s2 = self.dt, self.steep**2
        move = low(2 * GUSTS.accelerometer[0] * observer[0] / self.par.observer[0], dt) * (self.d[0] - self.filtered)
        self.filtered, rate = self.filtered + move, move / dt
        loads = np.concatenate([(self.d[1] - earlier[1])[:2], self.d[2] - earlier[2]]) / (dt * self.length)
        both, mean = 1 + (rate @ rate + loads @ loads) / s2, low(1.5, dt) * self.free[0]
        self.P += mean * (rate[:2] @ rate[:2] / both - self.P)
        self.T2 += mean * (loads @ loads / both + s2 * (1 - self.free[1:]).sum() - self.T2)
        share = self._share()
        self.gust = share * max(0.0, 1 - 3 * self.trend.weight)
        self.change = GUSTS.gust_rate * self.gust * rate / np.sqrt(1 + rate @ rate / s2)
        self.rough = 1 + 6 * share * self.P / s2

    def _pace(self) -> float:
        """The filter's, and the drift that it leaves."""
        m, ws = self.v.mass, self.par.shift_rate
        p = GUSTS.gust_shift * min(np.sqrt(self.g / self.length), 10.0)
        q = ((self.slow - self.d[0]) ** 2).sum() / (2 * m) ** 2
        pace = float((ws + (p - ws) * self.gust * q / (q + 1)) / self.rough)
        self.drift = self.gust * low(pace, self.dt) * (self.d[0] - self.slow) / self.dt
        return pace
