"""Eigenvalues, delay margin, gain margin and disk margin of a sampled loop."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from skyarm.records.arrays import Complex
from skyarm.records.immutable import immutable
from skyarm.studies.stability.closed_loop import (
    Closed,
    OpenLoop,
    close_loop,
    gains,
    radius,
    spectral_radius,
)
from skyarm.studies.stability.disk_margins import LoopMargin, cut_loops

__all__ = ["Margins", "delay_margin", "margins", "radius"]

EDGE = 1.0 + 1e-7
"""Spectral radius above which a loop counts as unstable; the differences are accurate
to 1e-9."""

LONGEST = 0.1
"""Largest additional delay (s) that is evaluated, chosen."""

WIDEST, STRIDE = 100.0, 1.25
"""Largest factor on a gain that is evaluated, and ratio between two evaluations."""

HALVINGS = 20
"""Number of bisections of a gain margin's interval, to 1e-6 of it."""


@immutable
class Margins:
    """Stability margins of one linearised loop.

    Attributes:
        z: eigenvalues per control period, largest first. s: the same as rates, 1/s,
            log(z) / period.
        radius: largest |z|; the loop is stable below 1.
        delay: delay margin, s: further dead time of the commands; inf beyond 0.1 s, 0
            if unstable.
        rotor_gain, joint_gain: (lower, upper) factors on the effect of all rotor
            commands, of all torques, between which the loop is stable; 0 and inf beyond
            a hundredfold. The factor is common to the group.
        loops: disk margins of single channels: rotors, body torques and thrust, joint
            drives, measurements.
        together: disk margins of each group of channels under factors of their own, of
            all commands and of all that is measured.
    """

    z: Complex
    s: Complex
    radius: float
    delay: float
    rotor_gain: tuple[float, float]
    joint_gain: tuple[float, float]
    loops: tuple[LoopMargin, ...] = ()
    together: tuple[LoopMargin, ...] = ()


def margins(loop: OpenLoop, *, measured: bool = True) -> Margins:
    """Compute eigenvalues and stability margins of a loop.

    Args:
        loop: the linearised loop.
        measured: cut it at the measurement too; left out, that costs no time.
    """
    as_it_is = close_loop(loop)
    A = as_it_is.matrix(gains(loop))
    finite = bool(np.isfinite(A).all())
    z = (
        np.linalg.eigvals(A).astype(complex)
        if finite
        else np.array([math.inf], dtype=complex)
    )
    z = z[np.argsort(-np.abs(z), kind="stable")]
    # an eigenvalue of zero, of a pure delay, has the rate -inf
    with np.errstate(divide="ignore"):
        s = np.log(z) / loop.period
    size = float(np.abs(z).max(initial=0.0))
    stable = size <= EDGE
    cut = cut_loops(loop, as_it_is, z, measured=measured, stable=stable)
    return Margins(
        z=z,
        s=s,
        radius=size,
        delay=delay_margin(loop),
        rotor_gain=_gain(as_it_is, stable, slice(loop.rotors)),
        joint_gain=_gain(as_it_is, stable, slice(loop.rotors, None)),
        loops=cut.loops(LONGEST),
        together=cut.together(),
    )


def _gain(as_it_is: Closed, stable: bool, group: slice) -> tuple[float, float]:
    """Gain margin of all rotors or all joints: interval of the common factor on their
    commands.
    """
    if not stable:
        return 1.0, 1.0
    factors = np.ones(len(as_it_is.sent))
    if not factors[group].size:
        return 0.0, math.inf

    def is_unstable(gain: float) -> bool:
        factors[group] = gain
        return spectral_radius(as_it_is.matrix(factors)) > EDGE

    low = gain_edge(is_unstable, 1.0 / STRIDE, 1.0 / WIDEST)
    high = gain_edge(is_unstable, STRIDE, WIDEST)
    # a search that reached its end found no edge, so there is no bound on that side
    return 0.0 if low == 1.0 / WIDEST else low, math.inf if high == WIDEST else high


def gain_edge(
    is_unstable: Callable[[float], bool], stride: float, limit: float
) -> float:
    """Gain factor at the stability boundary, searched from 1 in steps; ``limit`` if
    stable up to there.

    ``stride`` is the factor of a step: above 1 to search upward, below 1 downward.
    """
    nearer = min if limit > 1.0 else max
    good = 1.0
    gain = nearer(stride, limit)
    while not is_unstable(gain):
        if gain == limit:
            return limit
        good = gain
        gain = nearer(gain * stride, limit)
    for _ in range(HALVINGS):
        # factors are ratios: the interval is halved in logarithms
        middle = math.sqrt(good * gain)
        good, gain = (good, middle) if is_unstable(middle) else (middle, gain)
    return good


def delay_margin(loop: OpenLoop) -> float:
    """Delay margin, s: extra dead time at which the spectral radius reaches 1, linearly
    interpolated.
    """
    step = loop.period / len(loop.lates)
    before = radius(loop)
    if before > EDGE:
        return 0.0
    # to the nearest whole step, which rounding must not leave out
    for k in range(1, math.floor(LONGEST / step + 0.5) + 1):
        after = radius(loop, extra_delay=k * step)
        if after > EDGE:
            # the last stable radius may be 1 itself, where an eigenvalue only touches
            # the circle
            share = (1.0 - min(before, 1.0)) / (after - min(before, 1.0))
            return (k - 1 + share) * step
        before = after
    return math.inf
