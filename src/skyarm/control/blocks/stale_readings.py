"""Readings of a measurement that repeat those of one period earlier: a sensor that
stands still, or one that is slower.

A reading of something that moves has other digits each time, by its noise if by nothing
else. One that repeats all its numbers while its rate is not zero says nothing of the
period: a filter predicts over it and corrects by the next new one. A vehicle at rest
repeats its readings rightly; its rates are zero, or so small that their sensor rounds
them off. One that stands still under a coarse gyro with a bias seems to move: after
``LONGEST`` a repeated reading is believed.

Numbers are compared by a weighted sum of each quantity: one to remember instead of all.
Two sums are equal by chance only where quantities are coarse, and then one reading is
left out.
Source: Bar-Shalom, Li, Kirubarajan 2001, 3.2 (prediction alone where no measurement
arrives).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from skyarm.algebra import Scalar
from skyarm.algebra.scalars import data, maximum, mul, total, where
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.sensing.measurement import Measurement

GOLDEN = 0.6180339887498949
"""Ratio of the weights of a quantity's numbers: no two that move against each other
have a sum that stands still."""


RATES = {
    "position": "velocity",
    "quaternion": "rate",
    "velocity": "velocity",
    "rate": "rate",
    "specific_force": "rate",
    "joints": "joint_rates",
    "joint_rates": "joint_rates",
}
"""Quantities of a measurement, each with the one that tells whether it may repeat: its
rate, or for a rate itself. A specific force repeats only where a body does not turn: in
the equilibrium about which a loop is linearised."""

MOTION = ("position", "quaternion", "velocity", "rate")
"""Quantities whose repetition is limited in time."""

RESTING = 1e-18
"""Square of a weighted sum of rates ((m/s)^2, (rad/s)^2) up to which they rest: the
rounding of a state of equilibrium, far below what any sensor resolves."""

LONGEST = 2.0
"""Longest time (s) for which repeated readings are predicted over: a prediction without
its sensor drifts off."""


@immutable
class Fresh:
    """Flags of a measurement's quantities: 1 for a new reading, 0 for one that its
    sensor repeats.
    """

    position: Scalar
    quaternion: Scalar
    velocity: Scalar
    rate: Scalar
    specific_force: Scalar
    joints: Scalar
    joint_rates: Scalar


@immutable
class ReadingSums:
    """Weighted sums of the last measurement's numbers, one for each quantity."""

    position: Annotated[Scalar, Unit("m", "weighted sum of the measured position")] = (
        0.0
    )
    quaternion: Annotated[Scalar, Unit("", "weighted sum of the measured attitude")] = (
        0.0
    )
    velocity: Annotated[
        Scalar, Unit("m/s", "weighted sum of the measured velocity")
    ] = 0.0
    rate: Annotated[
        Scalar, Unit("rad/s", "weighted sum of the measured angular velocity")
    ] = 0.0
    specific_force: Annotated[
        Scalar, Unit("m/s^2", "weighted sum of the measured specific force")
    ] = 0.0
    joints: Annotated[
        Scalar, Unit("rad or m", "weighted sum of the measured joint positions")
    ] = 0.0
    joint_rates: Annotated[
        Scalar, Unit("rad/s or m/s", "weighted sum of the measured joint rates")
    ] = 0.0
    missed: Annotated[
        Scalar, Unit("", "number of periods since the joint rates were new")
    ] = 0.0
    stale: Annotated[
        Scalar, Unit("s", "time since the motion of base and joints was all new")
    ] = 0.0

    @staticmethod
    def of(measurement: Measurement) -> ReadingSums:
        """Weighted sums of a measurement."""
        return ReadingSums(**{name: _sum(getattr(measurement, name)) for name in RATES})

    def fresh(self, now: ReadingSums, dt: Scalar) -> tuple[Fresh, ReadingSums]:
        """Flags of the quantities that are new in the measurement whose sums are
        ``now``, and these with their age.

        ``dt`` is the time from one measurement to the next, s.
        """
        rows = [(name, getattr(now, rate)) for name, rate in RATES.items()]
        flags = {
            name: _is_new(getattr(self, name), getattr(now, name), rate)
            for name, rate in rows
        }
        # one repeated quantity is enough for the age to grow
        share: Scalar = 1.0
        for name in MOTION:
            share = mul(share, flags[name])
        age = where(share > 0.5, 0.0, self.stale + dt)
        believed = where(age > LONGEST, 1.0, 0.0)
        fresh = Fresh(**{name: maximum(flag, believed) for name, flag in flags.items()})
        missed = where(fresh.joint_rates > 0.5, 0.0, self.missed + 1.0)
        return fresh, replace(now, stale=data(age), missed=data(missed))


def _sum(numbers: Sequence[Scalar]) -> Scalar:
    return data(
        # an int 1 costs no product in a program
        total(mul(GOLDEN**i if i else 1, each) for i, each in enumerate(numbers))
    )


def _is_new(last: Scalar, now: Scalar, rate: Scalar) -> Scalar:
    """1 if a sum differs from the last one, or if its rates rest, else 0."""
    change = now - last
    return where(change * change > 0.0, 1.0, where(rate * rate > RESTING, 0.0, 1.0))
