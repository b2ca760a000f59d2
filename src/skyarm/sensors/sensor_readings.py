"""Readings of sensors of channels: each a record whose first field is the instant at which it was read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from skyarm.algebra import Quaternion, Vec3
from skyarm.records.units import Unit
from skyarm.scalars import Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class ImuReading:
    """Angular rate and specific force of the base origin."""

    time: Annotated[Scalar, Unit("s", "when it was read")]
    rate: Annotated[Vec3, Unit("rad/s", "base axes")]
    specific_force: Annotated[Vec3, Unit("m/s^2", "base axes, +g along z in hover")]


@dataclass(frozen=True, kw_only=True, slots=True)
class PoseReading:
    """Position of the base origin and attitude of the base."""

    time: Annotated[Scalar, Unit("s", "when it was read")]
    position: Annotated[Vec3, Unit("m", "base origin, world axes")]
    quaternion: Annotated[Quaternion, Unit("", "w x y z, base to world")]


@dataclass(frozen=True, kw_only=True, slots=True)
class PositionReading:
    """Position of the base origin."""

    time: Annotated[Scalar, Unit("s", "when it was read")]
    position: Annotated[Vec3, Unit("m", "base origin, world axes")]


@dataclass(frozen=True, kw_only=True, slots=True)
class HeadingReading:
    """Yaw of the base's x axis about the vertical."""

    time: Annotated[Scalar, Unit("s", "when it was read")]
    heading: Annotated[Scalar, Unit("rad", "yaw, not wrapped")]


@dataclass(frozen=True, kw_only=True, slots=True)
class EncoderReading:
    """Positions and rates of all joints."""

    time: Annotated[Scalar, Unit("s", "when it was read")]
    joints: Annotated[tuple[Scalar, ...], Unit("rad or m", "see the joints above")]
    joint_rates: Annotated[tuple[Scalar, ...], Unit("rad/s or m/s")]


@dataclass(frozen=True, kw_only=True, slots=True)
class ForceReading:
    """What pushes at a frame."""

    time: Annotated[Scalar, Unit("s", "when it was read")]
    force: Annotated[Vec3, Unit("N", "axes of the frame")]
    torque: Annotated[Vec3, Unit("N m", "about its origin, axes of the frame")]


@dataclass(frozen=True, kw_only=True, slots=True)
class SwitchReading:
    """Whether anything pushes at a frame."""

    time: Annotated[Scalar, Unit("s", "when it was read")]
    closed: Annotated[Scalar, Unit("", "1 closed, 0 open")]
