"""Extrapolation of sampled and held reference signals to the present, with derivatives up to the fourth.

A sample brings value, rate and acceleration, as a trajectory message does; jerk and snap come from the accelerations of
the last three samples, and are zero after a jump. At the sample with a_0 and those before it, a_1 and a_2, a period T
apart: jerk = (3 a_0 - 4 a_1 + a_2) / 2T, snap = (a_0 - 2 a_1 + a_2) / T^2 (backward differences of second order).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from skyarm.algebra.scalars import Scalar, absolute, divide, logical_or, minimum, where
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.select import data
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.reference import Reference

JUMP, ROUGH = 0.1, 0.02
"""A rate that misses the mean of two accelerations by this share of their difference and of their size has jumped."""

Sample = tuple[Any, Any, Any]


def samples(reference: Reference) -> list[Sample]:
    """Value, rate and acceleration of the reference's x, y, z, yaw and each joint."""
    found = list(zip(reference.position, reference.velocity, reference.acceleration, strict=True))
    found.append((reference.yaw, reference.yaw_rate, reference.yaw_acceleration))
    joints = zip(reference.joints, reference.joint_rates, reference.joint_accelerations, strict=True)
    return [*found, *joints]


def extrapolate(
    channels: Sequence[Channel],
    age: Scalar,
    held: Sequence[Sample],
    started: Scalar,
    dt: Scalar,
    period: Scalar,
) -> tuple[list[Taylor], tuple[Channel, ...], Scalar]:
    """Reference signals extrapolated to the present, next extrapolator states, and age of the held sample.

    Args:
        channels: as remembered.
        age: of the sample last seen, s.
        held: the samples now held.
        started: False at the first call.
        dt: control period, s.
        period: between samples, s.
    """
    new: Any = started < 0.5
    for channel, sample in zip(channels, held, strict=True):
        for old, value in zip((channel.value, channel.rate, channel.acceleration), sample, strict=True):
            new = logical_or(new, absolute(data(value) - old) > 0.0)
    due = age + dt > period * (1.0 - 1e-6)
    age = where(new, 0.0, minimum(age + dt, period))
    moved = tuple(
        _after(channel, sample, new, due, started, period) for channel, sample in zip(channels, held, strict=True)
    )
    series = [_series(channel, sample, age, period) for channel, sample in zip(moved, held, strict=True)]
    return series, moved, age


def _after(channel: Channel, sample: Sample, new: Any, due: Any, started: Scalar, period: Scalar) -> Channel:
    """State of one signal's extrapolator after comparison with the reference sample now held.

    Where a sample is due and nothing has changed, the motion is over: its last jerk and snap do not continue.
    """
    value, rate, acceleration = (data(c) for c in sample)
    change = acceleration - channel.acceleration
    missed = absolute(rate - channel.rate - (0.5 * period) * (acceleration + channel.acceleration))
    size = absolute(acceleration) + absolute(channel.acceleration)
    jumped = missed > period * (JUMP * absolute(change) + ROUGH * size) + 1e-9
    count = where(logical_or(jumped, started < 0.5), 0.0, minimum(channel.count + 1.0, 2.0))
    return Channel(
        value=value,
        rate=rate,
        acceleration=acceleration,
        before=where(new, channel.acceleration, channel.before),
        earlier=where(new, channel.before, channel.earlier),
        count=where(new, count, where(due, 0.0, channel.count)),
    )


def _series(channel: Channel, sample: Sample, age: Scalar, period: Scalar) -> Taylor:
    """Fourth-order Taylor series of a reference signal, ``age`` seconds after its sample was published."""
    if all(type(c) is int and c == 0 for c in sample[1:]):
        return Taylor.constant(sample[0], 4)
    p, v, a = (data(c) for c in sample)
    inverse = divide(1.0, period)
    first = (a - channel.before) * inverse
    second = (first - (channel.before - channel.earlier) * inverse) * inverse
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
    """State of one signal's extrapolator: last sample, two earlier accelerations, and count of continuous samples."""

    value: Annotated[Scalar, Unit("", "last sample of a reference signal: x, y, z, yaw, joints")] = 0.0
    rate: Annotated[Scalar, Unit("", "per second")] = 0.0
    acceleration: Annotated[Scalar, Unit("", "per second squared")] = 0.0
    before: Annotated[Scalar, Unit("", "acceleration one sample earlier")] = 0.0
    earlier: Annotated[Scalar, Unit("", "acceleration two samples earlier")] = 0.0
    count: Annotated[Scalar, Unit("", "samples of one motion, at most 2")] = 0.0
