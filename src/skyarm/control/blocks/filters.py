"""Discrete-time low-pass filters of scalar signals."""

from __future__ import annotations

from typing import Annotated, TypeVar

from skyarm.algebra import Scalar, Vec3
from skyarm.algebra.scalars import divide, exp, tan
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit

PI = 3.141592653589793
ROOT_TWO = 1.4142135623730951

Signal = TypeVar("Signal", Scalar, Vec3)


def low_pass(old: Signal, new: Signal, bandwidth: Scalar, dt: Scalar) -> Signal:
    """First-order low-pass: y += (1 - exp(-w dt)) (u - y), exact for an input held over
    the period.
    """
    return old + (new - old) * low_pass_share(bandwidth, dt)


def low_pass_share(bandwidth: Scalar, dt: Scalar) -> Scalar:
    """Gain 1 - exp(-w dt) of a first-order low-pass per period, for a bandwidth w in
    rad/s and dt in s.
    """
    return 1.0 - exp(-(bandwidth * dt))


def double_pole(
    bandwidth: Scalar, dt: Scalar, over: Scalar = 1
) -> tuple[Scalar, Scalar]:
    """Gains (L1, L2) of a second-order observer with both poles at exp(-bandwidth dt) /
    over; rad/s and s.
    """
    b = divide(exp(-(bandwidth * dt)), over)
    return 1.0 - b * b, (1.0 - b) * (1.0 - b)


@immutable
class Butterworth:
    """Coefficients of a second-order Butterworth low-pass: y = b0 u + b1 u1 + b0 u2 -
    a1 y1 - a2 y2.
    """

    b0: Scalar
    b1: Scalar
    a1: Scalar
    a2: Scalar


@immutable
class Taps:
    """State of a Butterworth filter: the two delayed sums of its transposed direct
    form.
    """

    first: Annotated[
        Scalar, Unit("", "first sum of a filter, in its signal's unit")
    ] = 0.0
    second: Annotated[
        Scalar, Unit("", "second sum of a filter, in its signal's unit")
    ] = 0.0


def butterworth(cutoff: Scalar, dt: Scalar) -> Butterworth:
    """Butterworth coefficients for a cut-off frequency in Hz, below 1 / (2 dt);
    prewarped bilinear transform.

    Source: Oppenheim, Schafer, Discrete-Time Signal Processing, chapter 7; the filter
    of Smeur, Chu, de Croon 2016.
    """
    k = tan(PI * cutoff * dt)
    scale = divide(1.0, 1.0 + ROOT_TWO * k + k * k)
    b0 = k * k * scale
    return Butterworth(
        b0=b0,
        b1=2.0 * b0,
        a1=2.0 * (k * k - 1.0) * scale,
        a2=(1.0 - ROOT_TWO * k + k * k) * scale,
    )


def settle(value: Scalar, par: Butterworth) -> Taps:
    """Steady filter state for a constant input ``value``."""
    return Taps(first=value * (1.0 - par.b0), second=value * (par.b0 - par.a2))


def apply_butterworth(
    taps: Taps, value: Scalar, par: Butterworth
) -> tuple[Taps, Scalar]:
    """One Butterworth filter step: next filter state and output."""
    # transposed direct form II: two numbers of memory
    out = par.b0 * value + taps.first
    return (
        Taps(
            first=par.b1 * value - par.a1 * out + taps.second,
            second=par.b0 * value - par.a2 * out,
        ),
        out,
    )
