"""How far a loop in hover is from swinging: growth, delay and gain margins, all by bisection of its spectral radius."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from skyarm.stability.closed_loop import closed_loop, radius
from skyarm.stability.loop_derivatives import OpenLoop
from skyarm.stability.margins import EDGE
from skyarm.tune.front import LoopMargins, Required

LONGEST, WIDEST = 0.05, 8.0
"""s and factor: margins beyond these are not looked for."""

BISECTIONS = 10

UNSTABLE = 10.0
"""Shortness of a loop that is just unstable; a stable one is never shorter."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Edges:
    """Of a loop: growth, 1/s (negative where it is stable), frequency (Hz) at which it swings, margins."""

    growth: float
    frequency: float
    margins: LoopMargins

    def shortness(self, required: Required) -> float:
        """How far it is from what is required, as a factor; an unstable loop by its growth, above any stable one."""
        if self.growth > 0.0:
            return UNSTABLE * (1.0 + self.growth)
        return min(self.margins.shortness(required), UNSTABLE)


def edges(loops: Sequence[OpenLoop]) -> Edges:
    """The worse of a loop's linearisations in every number."""
    each = [_edges(loop) for loop in loops]
    worst = max(each, key=lambda one: one.growth)
    lows = [[getattr(one.margins, name)[0] for one in each] for name in ("rotors", "joints")]
    highs = [[getattr(one.margins, name)[1] for one in each] for name in ("rotors", "joints")]
    shortest = min(each, key=lambda one: one.margins.delay)
    (rotor_low, joint_low), (rotor_high, joint_high) = map(max, lows), map(min, highs)
    return Edges(
        growth=worst.growth,
        frequency=worst.frequency if worst.growth > 0.0 else shortest.frequency,
        margins=LoopMargins(
            delay=shortest.margins.delay, rotors=(rotor_low, rotor_high), joints=(joint_low, joint_high)
        ),
    )


def _edges(loop: OpenLoop) -> Edges:
    z = _fastest(loop)
    growth = math.log(max(abs(z), 1e-12)) / loop.period
    if abs(z) > EDGE:
        margins = LoopMargins(delay=0.0, rotors=(1.0, 1.0), joints=(1.0, 1.0))
        return Edges(growth=growth, frequency=_frequency(z, loop.period), margins=margins)
    step = loop.period / len(loop.lates)
    delay = _first(lambda k: radius(loop, extra_delay=k * step), 0, round(LONGEST / step)) * step

    def gains(name: str) -> tuple[float, float]:
        low, high = (_factor(lambda k: radius(loop, **{name: k}), side) for side in (1.0 / WIDEST, WIDEST))
        return low, high

    at_edge = _fastest(loop, math.floor(delay / step + 1.0) * step) if math.isfinite(delay) else z
    return Edges(
        growth=growth,
        frequency=_frequency(at_edge, loop.period),
        margins=LoopMargins(delay=delay, rotors=gains("rotor_gain"), joints=gains("joint_gain")),
    )


def _fastest(loop: OpenLoop, delay: float = 0.0) -> complex:
    """The eigenvalue of largest magnitude."""
    A = closed_loop(loop, extra_delay=delay)
    if not np.isfinite(A).all():
        return complex(math.inf, 0.0)
    z = np.linalg.eigvals(A)
    return complex(z[np.abs(z).argmax()])


def _frequency(z: complex, period: float) -> float:
    return abs(math.atan2(z.imag, z.real)) / period / (2.0 * math.pi) if math.isfinite(abs(z)) else math.nan


def _first(radius_at: Callable[[int], float], low: int, high: int) -> float:
    """Largest whole number below the first at which a loop is unstable; inf where it is stable at the last."""
    if radius_at(high) <= EDGE:
        return math.inf
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if radius_at(middle) <= EDGE else (low, middle)
    return low


def _factor(radius_at: Callable[[float], float], widest: float) -> float:
    """Gain at which a stable loop becomes unstable towards ``widest``; 0 or inf where it does not."""
    if radius_at(widest) <= EDGE:
        return 0.0 if widest < 1.0 else math.inf
    stable, unstable = 1.0, widest
    for _ in range(BISECTIONS):
        middle = math.sqrt(stable * unstable)
        stable, unstable = (middle, unstable) if radius_at(middle) <= EDGE else (stable, middle)
    return stable


def with_dead_time(loop: OpenLoop, measurement: int, command: float, rotors: float, joints: float) -> OpenLoop:
    """The loop with other delays: the measurement's in control periods, the others in s."""
    return dataclasses.replace(
        loop, measurement_delay=measurement, command_delay=command, rotors_delay=rotors, joints_delay=joints
    )
