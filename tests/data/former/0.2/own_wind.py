"""Turbulence of first order: skyarm run mine.toml --plugin own_wind.py, with kind = "gusty" in [[environment.air]]."""

from dataclasses import dataclass

import skyarm
from skyarm.scalars import exp, sqrt


@skyarm.register.air("gusty")
@dataclass(frozen=True, kw_only=True)
class Gusty(skyarm.Air):
    """Air whose three components wander as Ornstein-Uhlenbeck processes, exact at any period."""

    sigma: float  # standard deviation, m/s
    seconds: float = 1.0  # time constant, s
    uniforms = 4  # random numbers a period

    def start(self, period, draws):
        return tuple(skyarm.normals(draws)[:3])  # stationary from the first period on

    def advance(self, memory, t, dt, state, draws):
        a = exp(-dt / self.seconds)
        b = sqrt(1.0 - a * a)
        return tuple(a * m + b * n for m, n in zip(memory, skyarm.normals(draws)[:3], strict=True))

    def velocity(self, memory, t, position_W):
        return skyarm.Vec3(*memory) * self.sigma
