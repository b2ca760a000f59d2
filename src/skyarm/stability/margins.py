"""Eigenvalues and margins of a sampled loop: how much delay, how much gain and how much of both it bears."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.stability.closed_loop import Closed, OpenLoop, Radius, closed, gains, radius, spectral_radius
from skyarm.stability.disk_margins import CutLoops, LoopMargin, cut_loops

Array = npt.NDArray[np.float64]

__all__ = ["Margins", "delay_margin", "margins", "radius"]

EDGE = 1.0 + 1e-7
"""Spectral radius above which a loop counts as unstable: the differences are good to 1e-9."""

LONGEST = 0.1
"""s, largest extra delay that is looked at."""

WIDEST, STRIDE = 100.0, 1.25
"""Largest change of a gain that is looked at, and the factor between two looks."""

HALVINGS = 24
"""Of the interval that holds a gain margin: to 1e-8 of it."""

BESIDE = 1e-3
"""An edge that the frequency response shows is looked at by eigenvalues so far beyond it, relative."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Margins:
    """Of one linearised loop.

    Attributes:
        z: eigenvalues per control period, largest first. s: the same as rates, 1/s, log(z) / period.
        radius: largest |z|; the loop is stable below 1.
        delay: s of further dead time of the commands that the loop bears; inf beyond 0.1 s, 0 if it is unstable.
        rotor_gain, joint_gain: (lower, upper) factors on the effect of all rotor commands, of all torques, between
            which the loop is stable; 0 and inf beyond a hundredfold. The factor is common to the group.
        one_rotor, one_joint: the same of one actuator alone, the others as they are: the largest lower and the smallest
            upper factor of any of them.
        loops: disk margins of each channel alone: rotors, their common pushes, joint drives, what is measured.
        together: disk margins of each group of channels under factors of their own, of all commands and of all that is
            measured.
    """

    z: npt.NDArray[np.complex128]
    s: npt.NDArray[np.complex128]
    radius: float
    delay: float
    rotor_gain: tuple[float, float]
    joint_gain: tuple[float, float]
    one_rotor: tuple[float, float]
    one_joint: tuple[float, float]
    loops: tuple[LoopMargin, ...] = ()
    together: tuple[LoopMargin, ...] = ()


def margins(loop: OpenLoop, *, measured: bool = True) -> Margins:
    """Eigenvalues and margins of a loop.

    Args:
        loop: the linearised loop.
        measured: cut it at the measurement too; left out, that costs no time.
    """
    as_it_is = closed(loop)
    A = as_it_is.matrix(gains(loop))
    finite = bool(np.isfinite(A).all())
    z = np.linalg.eigvals(A).astype(complex) if finite else np.array([math.inf], dtype=complex)
    z = z[np.argsort(-np.abs(z), kind="stable")]
    with np.errstate(divide="ignore"):
        s = np.log(z) / loop.period
    size = float(np.abs(z).max(initial=0.0))
    stable = size <= EDGE
    cut = cut_loops(loop, as_it_is, z, measured=measured, stable=stable)
    rotors, joints = range(loop.rotors), range(loop.rotors, loop.u_m.shape[0])
    return Margins(
        z=z,
        s=s,
        radius=size,
        delay=delay_margin(loop),
        rotor_gain=_common(loop, as_it_is, cut, rotors),
        joint_gain=_common(loop, as_it_is, cut, joints),
        one_rotor=_of_any(loop, as_it_is, cut, rotors),
        one_joint=_of_any(loop, as_it_is, cut, joints),
        loops=cut.loops(LONGEST),
        together=cut.together(),
    )


def _common(loop: OpenLoop, as_it_is: Closed, cut: CutLoops, places: Sequence[int]) -> tuple[float, float]:
    """The interval of a factor common to some commands."""
    if not cut.stable:
        return 1.0, 1.0
    if not places:
        return 0.0, math.inf

    def radius_at(k: float) -> float:
        factors = np.ones(loop.u_m.shape[0])
        factors[list(places)] = k
        return spectral_radius(as_it_is.matrix(factors))

    edges = cut.gain_edges[tuple(places)]
    low = _side(radius_at, [k for k in edges[::-1] if k < 1.0], 1.0 / STRIDE, 0.0)
    return low, _side(radius_at, [k for k in edges if k > 1.0], STRIDE, math.inf)


def _side(radius_at: Radius, edges: Sequence[float], factor: float, beyond: float) -> float:
    """The nearest edge beyond which the loop is unstable; searched for by eigenvalues where none of them is one."""
    inside = [k for k in edges if 1.0 / WIDEST <= k <= WIDEST]
    for k in inside:
        further = k * (1.0 + math.copysign(BESIDE, factor - 1.0))
        if radius_at(further) > EDGE:
            return float(k)
    last = math.copysign(1.0, factor - 1.0)
    if not inside and radius_at(WIDEST**last / STRIDE**last) <= EDGE:
        return beyond
    return _edge(radius_at, factor, beyond)


def _of_any(loop: OpenLoop, as_it_is: Closed, cut: CutLoops, places: Sequence[int]) -> tuple[float, float]:
    """The narrowest interval of single commands; everything is borne where there is none."""
    if not cut.stable:
        return 1.0, 1.0
    low, high = 0.0, math.inf
    nearest = {place: cut.gain_edges[place,] for place in places}
    # the narrowest first: others are looked at only if they could be narrower still
    for place in sorted(places, key=lambda i: -max((k for k in nearest[i] if k < 1.0), default=0.0)):
        if max((k for k in nearest[place] if k < 1.0), default=0.0) > low:
            low = max(low, _common(loop, as_it_is, cut, [place])[0])
    for place in sorted(places, key=lambda i: min((k for k in nearest[i] if k > 1.0), default=math.inf)):
        if min((k for k in nearest[place] if k > 1.0), default=math.inf) < high:
            high = min(high, _common(loop, as_it_is, cut, [place])[1])
    return low, high


def delay_margin(loop: OpenLoop) -> float:
    """Extra dead time, s, at which the spectral radius passes 1, between two steps of ``lates`` on a line."""
    step = loop.period / len(loop.lates)
    before = radius(loop)
    if before > EDGE:
        return 0.0
    for k in range(1, math.floor(LONGEST / step + 0.5) + 1):
        after = radius(loop, extra_delay=k * step)
        if after > EDGE:
            # the last stable radius may be 1 itself, where an eigenvalue only touches the circle
            share = (1.0 - min(before, 1.0)) / (after - min(before, 1.0))
            return (k - 1 + share) * step
        before = after
    return math.inf


def _edge(radius_at: Radius, factor: float, beyond: float) -> float:
    """First gain from 1 on, in strides of ``factor``, at which the loop is unstable; ``beyond`` if there is none."""
    stable, gain = 1.0, factor
    while 1.0 / WIDEST <= gain <= WIDEST:
        if radius_at(gain) > EDGE:
            unstable = gain
            for _ in range(HALVINGS):
                middle = math.sqrt(stable * unstable)
                stable, unstable = (stable, middle) if radius_at(middle) > EDGE else (middle, unstable)
            return stable
        stable, gain = gain, gain * factor
    return beyond
