"""What the error-state filter keeps from period to period, and what it says of itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.compile import leaves, rebuild
from skyarm.estimate.error_covariance import ATTITUDE, Covariance
from skyarm.estimate.inertial_navigation import Navigated
from skyarm.estimate.joint_filter import FilteredJoints
from skyarm.scalars import Scalar, logical_and, logical_or, sqrt, where
from skyarm.sensors.sensor_readings import HeadingReading, ImuReading, PoseReading, PositionReading

AIDS: dict[str, tuple[type, ...]] = {
    "pose": (PoseReading,),
    "position": (PositionReading,),
    "position_heading": (PositionReading, HeadingReading),
}
"""Readings that correct the inertial unit's, by the word of the filter's ``aiding``."""

_ORIGIN = Vec3(0.0, 0.0, 0.0)
_LEVEL = Quaternion(1.0, 0.0, 0.0, 0.0)

BLANK_INERTIAL = ImuReading(time=0.0, rate=_ORIGIN, specific_force=_ORIGIN)
BLANK_READINGS: dict[type, Any] = {
    PoseReading: PoseReading(time=0.0, position=_ORIGIN, quaternion=_LEVEL),
    PositionReading: PositionReading(time=0.0, position=_ORIGIN),
    HeadingReading: HeadingReading(time=0.0, heading=0.0),
}
BLANK_BELIEF = Navigated(
    position=_ORIGIN, velocity=_ORIGIN, quaternion=_LEVEL, gyro_bias=_ORIGIN, accelerometer_bias=_ORIGIN
)


@dataclass(frozen=True, kw_only=True, slots=True)
class FilterMemory:
    """Memory of the error-state filter.

    Attributes:
        started: 1 after the first readings.
        belief, covariance: at the instant of ``inertial[0]``, up to which readings have been taken in.
        inertial: readings of the inertial unit from then to the present, oldest first.
        aiding: for each kind of aiding reading what has arrived since then, oldest first.
        modelled: specific force of the believed vehicle over the period that ends with each of ``inertial``, m/s^2,
            base axes; nothing where the force is measured.
        joints: of the encoders. rotor_speeds: of the believed vehicle's motors, rad/s.
        taken, refused: how many readings passed the innovation test, and how many did not.
        surprise: normalised squared innovation of the last reading; for a matched filter its mean is the number of the
            reading's components.
    """

    started: Scalar
    belief: Navigated
    covariance: Covariance
    inertial: tuple[ImuReading, ...]
    aiding: tuple[tuple[Any, ...], ...]
    joints: FilteredJoints
    modelled: tuple[Vec3, ...]
    rotor_speeds: tuple[Scalar, ...]
    taken: Scalar
    refused: Scalar
    surprise: Scalar

    @property
    def deviations(self) -> tuple[Any, ...]:
        """Standard deviation of each component of the error."""
        return tuple(sqrt(self.covariance[i][i]) for i in range(len(self.covariance)))

    @property
    def yaw_deviation(self) -> Any:
        """Standard deviation of the heading, rad: it grows where no reading tells of the heading."""
        return sqrt(self.covariance[ATTITUDE + 2][ATTITUDE + 2])

    @property
    def time(self) -> Any:
        """Instant of ``belief`` and ``covariance``, s."""
        return self.inertial[0].time


def choose(condition: Any, new: Any, old: Any) -> Any:
    """``new`` where the condition holds, else ``old``, number by number of two records of one shape."""
    return rebuild(old, (where(condition, a, b) for a, b in zip(leaves(new), leaves(old), strict=True)))


def in_turn(queue: Sequence[Any], after: Any, until: Any) -> tuple[Any, Any]:
    """The reading of a queue that was taken after one instant and not after another; a condition, and the reading."""
    reading, found = queue[0], due_between(queue[0].time, after, until)
    for each in queue[1:]:
        due = due_between(each.time, after, until)
        found, reading = logical_or(found, due), choose(due, each, reading)
    return found, reading


def due_between(time: Any, after: Any, until: Any) -> Any:
    """Whether an instant lies after one and not after another, but for 10 us of rounding."""
    return logical_and(time > after + 1e-5, time < until + 1e-5)
