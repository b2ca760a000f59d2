"""A GPS at 10 Hz with walking bias and dropouts, and an estimator that uses it."""

from dataclasses import dataclass, replace

import skyarm
from skyarm.scalars import where


@skyarm.register.sensor("gps")
@dataclass(frozen=True, kw_only=True)
class Gps(skyarm.Sensor):
    """Reads (1 if there is a fix, x, y, z); memory is bias and last fix."""

    frequency: float = 10.0  # Hz
    latency: float = 0.05  # s
    sigma: float = 0.02  # white noise, m
    walk: float = 0.002  # of the bias from reading to reading, m
    dropout: float = 0.1  # share of lost fixes
    uniforms = staticmethod(lambda vehicle: 7)
    start = staticmethod(lambda vehicle: ((0.0,) * 3, (0.0,) * 3))

    def measure(self, memory, t, state, specific_force, draws, dt):
        noise, lost = skyarm.normals(draws[:6]), draws[6] < self.dropout
        bias = [b + self.walk * n for b, n in zip(memory[0], noise[:3], strict=True)]
        fix = [p + b + self.sigma * n for p, b, n in zip(state.position, bias, noise[3:], strict=True)]
        kept = tuple(where(lost, old, new) for old, new in zip(memory[1], fix, strict=True))
        return (tuple(bias), kept), (where(lost, 0.0, 1.0), *kept)


@skyarm.register.estimator("gps_corrected", title="the full state's position, drawn towards the fixes")
@dataclass(frozen=True, kw_only=True)
class Corrected(skyarm.Estimator):
    gain: float = 0.01
    start = staticmethod(lambda vehicle: (0.0,) * 3)

    def step(self, memory, readings, command, dt):
        full, (fix, *place) = readings["state"], readings["gps"]
        off = tuple(m + self.gain * fix * (p - q - m) for m, p, q in zip(memory, place, full.position, strict=True))
        return off, replace(full, position=full.position + skyarm.Vec3(*off))
