"""Extrapolation of reference signals from their last samples to the present, with
derivatives up to the fourth.

With a preview, rate and acceleration of the held sample and of the next one, T later,
and the acceleration at 2 T fix a rate of fourth order, so that jerk and snap have
hardly a step at a sample. Without one they are extrapolated:

a sample brings value, rate and acceleration, as a trajectory message does; jerk and
snap come from the accelerations of the last three samples. Both are zero at a jump. At
the sample with a_0 and those before it, a_1 and a_2, a period T apart: jerk = (3 a_0 -
4 a_1 + a_2) / 2T, snap = (a_0 - 2 a_1 + a_2) / T^2 (backward differences of second
order).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

from skyarm.algebra import Scalar
from skyarm.algebra.scalars import (
    absolute,
    add,
    data,
    divide,
    logical_or,
    minimum,
    same,
    total,
    where,
)
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.reference.preview import Sample

JUMP, ROUGH = 0.1, 0.02
"""Tolerances of the jump test of a rate, as fractions of the difference and of the size
of two accelerations. A rate that misses their mean by more has jumped.

Chosen: at a constant jerk a rate meets the mean to the last bits, so that both are for
what bends within a period."""


def extrapolate(
    channels: Sequence[Channel],
    age: Scalar,
    held: Sequence[Sample],
    started: Scalar,
    dt: Scalar,
    period: Scalar,
    ahead: Sequence[Sequence[Sample]] = (),
    late: Scalar = 0,
) -> tuple[list[Taylor], tuple[Channel, ...], Scalar]:
    """Extrapolated reference signals, next states of the extrapolators, and age (s) of
    the last reference sample.

    Args:
        channels: states of the signals, one period earlier.
        age: age of the sample last seen, s.
        held: the samples now held.
        started: False at the first call.
        dt: control period, s.
        period: time between samples, s.
        ahead: samples of one and two periods later; empty without a preview.
        late: s, from the present to the instant of the signals.
    """
    # a sample that is repeated is equal to the bit, so that any difference is a new one
    changed = total(
        absolute(data(value) - old)
        for channel, sample in zip(channels, held, strict=True)
        for old, value in zip(
            (channel.value, channel.rate, channel.acceleration), sample, strict=True
        )
    )
    new = logical_or(started < 0.5, changed > 0.0)
    # an age is a sum of periods, which rounds
    due = age + dt > period * (1.0 - 1e-6)
    # a sample that does not come is not continued beyond the time of the next one
    age = where(new, 0.0, minimum(age + dt, period))
    if ahead:
        rows = zip(held, ahead[0], ahead[1], strict=True)
        return (
            [_interpolate(*row, add(age, late), period) for row in rows],
            tuple(map(_hold, channels, held)),
            age,
        )
    moved = tuple(
        _after(channel, sample, new, due, started, period)
        for channel, sample in zip(channels, held, strict=True)
    )
    series = [
        _series(channel, sample, add(age, late), period)
        for channel, sample in zip(moved, held, strict=True)
    ]
    return series, moved, age


def _hold(channel: Channel, sample: Sample) -> Channel:
    """Extrapolator state that stores the current sample of a reference signal whose
    next samples are known.
    """
    value, rate, acceleration = map(data, sample)
    return replace(channel, value=value, rate=rate, acceleration=acceleration)


def _after(
    channel: Channel,
    sample: Sample,
    new: Scalar,
    due: Scalar,
    started: Scalar,
    period: Scalar,
) -> Channel:
    """State of a reference signal's extrapolator, updated with the current sample.

    Where a sample is due and nothing has changed, the motion is over: its last jerk and
    snap do not continue.
    """
    value, rate, acceleration = map(data, sample)
    jumped = _is_jump(
        (channel.rate, channel.acceleration), (rate, acceleration), period
    )
    # jerk and snap take two samples before: more need not be counted
    count = where(
        logical_or(jumped, started < 0.5), 0.0, minimum(channel.count + 1.0, 2.0)
    )
    return Channel(
        value=value,
        rate=rate,
        acceleration=acceleration,
        before=where(new, channel.acceleration, channel.before),
        earlier=where(new, channel.before, channel.earlier),
        count=where(new, count, where(due, 0.0, channel.count)),
    )


def _is_jump(
    before: tuple[Scalar, Scalar], after: tuple[Scalar, Scalar], period: Scalar
) -> Any:
    """True if rates and accelerations of two successive samples do not fit one smooth
    motion.
    """
    (v0, a0), (v1, a1) = before, after
    missed = absolute(v1 - v0 - (0.5 * period) * (a1 + a0))
    # rates that differ by rounding alone are no jump either, hence 1e-9 below
    size = absolute(a1) + absolute(a0)
    return missed > (JUMP * period) * absolute(a1 - a0) + (ROUGH * period) * size + 1e-9


def _interpolate(
    held: Sample, following: Sample, later: Sample, age: Scalar, period: Scalar
) -> Taylor:
    """Fourth-order Taylor series of a reference signal, interpolated between its last
    sample and the next one.

    The rate is the cubic of both samples' rates and accelerations plus k t^2 (t - T)^2,
    whose slope at 2 T is 12 k T^3. Values of the samples do not enter the derivatives,
    which single precision would spoil.
    """
    # zeros known before compilation: a signal that never moves needs no program
    if all(same(c, 0) for sample in (held, following, later) for c in sample[1:]):
        return Taylor.constant(held[0], 4)
    p, v, a = map(data, held)
    (v1, a1), (v2, a2) = (tuple(map(data, sample[1:])) for sample in (following, later))
    inverse = divide(1.0, period)
    mean = (v1 - v) * inverse
    b2 = (3.0 * mean - 2.0 * a - a1) * inverse
    b3 = (a + a1 - 2.0 * mean) * (inverse * inverse)
    away = a2 - a - period * (4.0 * b2 + 12.0 * period * b3)
    k = where(
        _is_jump((v1, a1), (v2, a2), period),
        0.0,
        away * (inverse * inverse * inverse / 12.0),
    )
    steady = _is_jump((v, a), (v1, a1), period)
    b2 = where(steady, 0.0, b2 + k * (period * period))
    b3 = where(steady, 0.0, b3 - (2.0 * period) * k)
    b4 = where(steady, 0.0, k)
    t = age
    c5, c4, c3, c2 = b4 / 5.0, b3 / 4.0, b2 / 3.0, 0.5 * a
    return Taylor(
        [
            p + t * (v + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
            v + t * (a + t * (b2 + t * (b3 + t * b4))),
            c2 + t * (b2 + t * (1.5 * b3 + t * (2.0 * b4))),
            c3 + t * (b3 + t * (2.0 * b4)),
            c4 + t * b4,
        ]
    )


def _series(channel: Channel, sample: Sample, age: Scalar, period: Scalar) -> Taylor:
    """Fourth-order Taylor series of a reference signal, ``age`` seconds after its
    sample was published.
    """
    if all(same(c, 0) for c in sample[1:]):
        return Taylor.constant(sample[0], 4)
    p, v, a = map(data, sample)
    inverse = divide(1.0, period)
    first = (a - channel.before) * inverse
    second = (first - (channel.before - channel.earlier) * inverse) * inverse
    # differences count once there are samples for them, and lag by half a period
    snap = where(channel.count > 1.5, second, 0.0)
    jerk = where(channel.count > 0.5, first, 0.0) + (0.5 * period) * snap
    # Horner, so that every derivative is consistent with the one before it
    c4, c3, c2 = snap / 24.0, jerk / 6.0, 0.5 * a
    t = age
    return Taylor(
        [
            p + t * (v + t * (c2 + t * (c3 + t * c4))),
            v + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4))),
            c2 + t * (3.0 * c3 + t * (6.0 * c4)),
            c3 + t * (4.0 * c4),
            c4,
        ]
    )


@immutable
class Channel:
    """State of one signal's extrapolator: last sample, two earlier accelerations, and
    count of continuous samples.
    """

    value: Annotated[
        Scalar, Unit("", "last sample of a reference signal: x, y, z, yaw or joint")
    ] = 0.0
    rate: Annotated[
        Scalar,
        Unit("", "first derivative of the signal at the last sample, per second"),
    ] = 0.0
    acceleration: Annotated[
        Scalar,
        Unit(
            "", "second derivative of the signal at the last sample, per second squared"
        ),
    ] = 0.0
    before: Annotated[Scalar, Unit("", "second derivative one sample earlier")] = 0.0
    earlier: Annotated[Scalar, Unit("", "second derivative two samples earlier")] = 0.0
    count: Annotated[
        Scalar,
        Unit("", "number of consecutive samples of one smooth motion, at most 2"),
    ] = 0.0
