"""Inertial unit, motion capture, satellite position, heading and joint encoders, each a sensor of channels.

Default numbers are those of a small flight controller's inertial unit (gyroscope 0.005 rad/s/sqrt(Hz), accelerometer
0.02 m/s^2/sqrt(Hz)) and of a motion-capture system at 5 mm and 5 mrad.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.euler import euler_angles
from skyarm.dynamics.state import State
from skyarm.records.coerce import RecordError, concrete
from skyarm.records.leaves import leaves
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, data, divide, exp, sub, where
from skyarm.sensors.channel import Channel, absent
from skyarm.sensors.channel_sensor import ChannelSensor, Quantities
from skyarm.sensors.sensor_readings import (
    EncoderReading,
    HeadingReading,
    ImuReading,
    PoseReading,
    PositionReading,
)
from skyarm.vehicle.vehicle_records import Vehicle

LOG_2 = 0.6931471805599453
TURN = 6.283185307179586
"""rad, one turn."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Imu(ChannelSensor):
    """An inertial unit at the base origin: angular rate (rad/s) and specific force (m/s^2), base axes."""

    gyro: Channel = Channel(density=0.005, walk=1e-4)
    accelerometer: Channel = Channel(density=0.02, walk=1e-3)

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Angular rate and specific force."""
        force = tuple(data(c) for c in specific_force)
        return ("gyro", self.gyro, tuple(state.rate)), ("accelerometer", self.accelerometer, force)

    def reading(self, t: Any, values: Sequence[tuple[Any, ...]], state: State, own: Any, first: Any, dt: float) -> Any:
        """Both, at one instant."""
        rate, force = values
        return own, ImuReading(time=t, rate=Vec3(*rate), specific_force=Vec3(*force))


@dataclass(frozen=True, kw_only=True, slots=True)
class Pose(ChannelSensor):
    """Motion capture: position of the base origin (m) and attitude of the base.

    The attitude's errors are a rotation vector in base axes (rad), after the true attitude: it has no scale and no
    resolution.
    """

    frequency: Annotated[float, Unit("Hz", "readings a second, 0: one each control period", low=0.0)] = 50.0
    position: Channel = Channel(sigma=0.005)
    attitude: Channel = Channel(sigma=0.005)

    def __post_init__(self) -> None:
        ChannelSensor.__post_init__(self)
        for name in ("scale", "resolution"):
            value = getattr(self.attitude, name)
            if not (concrete(value) and value == 0):
                raise RecordError(f"attitude.{name} = {value}: must be left out, errors of an attitude are rotations")

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Position, and the rotation that is no error."""
        return ("position", self.position, tuple(state.position)), ("attitude", self.attitude, (0.0, 0.0, 0.0))

    def reading(self, t: Any, values: Sequence[tuple[Any, ...]], state: State, own: Any, first: Any, dt: float) -> Any:
        """Position, and attitude turned by its errors."""
        position, turn = values
        attitude = state.quaternion * Quaternion.of_rotation_vector(Vec3(*turn))
        return own, PoseReading(time=t, position=Vec3(*position), quaternion=attitude)


@dataclass(frozen=True, kw_only=True, slots=True)
class Position(ChannelSensor):
    """Satellite navigation: position of the base origin, m."""

    frequency: Annotated[float, Unit("Hz", "readings a second, 0: one each control period", low=0.0)] = 10.0
    position: Channel = Channel(sigma=0.02)

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Position."""
        return (("position", self.position, tuple(state.position)),)

    def reading(self, t: Any, values: Sequence[tuple[Any, ...]], state: State, own: Any, first: Any, dt: float) -> Any:
        """Position."""
        return own, PositionReading(time=t, position=Vec3(*values[0]))


@dataclass(frozen=True, kw_only=True, slots=True)
class Heading(ChannelSensor):
    """A compass, or two satellite antennas: heading (yaw of the base's x axis), rad."""

    frequency: Annotated[float, Unit("Hz", "readings a second, 0: one each control period", low=0.0)] = 10.0
    heading: Channel = Channel(sigma=0.02)

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Yaw."""
        return (("heading", self.heading, (euler_angles(state.quaternion.rotation())[2],)),)

    def reading(self, t: Any, values: Sequence[tuple[Any, ...]], state: State, own: Any, first: Any, dt: float) -> Any:
        """Yaw, not wrapped."""
        return own, HeadingReading(time=t, heading=values[0][0])


RATES = ("difference", "measured")


@dataclass(frozen=True, kw_only=True, slots=True)
class Encoders(ChannelSensor):
    """Encoders of all joints: positions (rad or m), and rates by difference of two readings or measured.

    Attributes:
        bits: of an absolute encoder; its step is span / 2^bits, in place of the joints' resolution. 0 for none.
        span: rad or m, that the bits divide.
        joints: errors of the positions. rates: "difference" or "measured". rate: errors of measured rates.
    """

    bits: Annotated[Scalar, Unit("", "of an absolute encoder, 0: none", low=0.0, high=52.0)] = 12
    span: Annotated[Scalar, Unit("rad or m", "that the bits divide", low=0.0, strict=True)] = TURN
    joints: Channel = Channel()
    rates: str = "difference"
    rate: Channel = Channel()

    def __post_init__(self) -> None:
        ChannelSensor.__post_init__(self)
        if self.rates not in RATES:
            raise RecordError(f"rates = {self.rates!r}: must be one of {', '.join(RATES)}")
        if self.rates == "difference" and (leaves(self.rate) or self.rate.bias or self.rate.offset is not None):
            raise RecordError(
                "rate: must be left out where rates = 'difference': the errors of positions make those of their "
                "differences"
            )
        if not absent(self.bits) and not absent(self.joints.resolution):
            raise RecordError(f"bits = {self.bits}: must be 0 where joints.resolution is given")

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Positions, and rates where they are measured."""
        positions = ("joints", self.joints, tuple(state.joints))
        if self.rates == "difference":
            return (positions,)
        return positions, ("rate", self.rate, tuple(state.joint_rates))

    def first_own(self, vehicle: Vehicle) -> Any:
        """The last positions, for their difference."""
        return (0.0,) * vehicle.n if self.rates == "difference" else ()

    def reading(self, t: Any, values: Sequence[tuple[Any, ...]], state: State, own: Any, first: Any, dt: float) -> Any:
        """Positions in whole steps, and rates; the first difference is 0."""
        joints = tuple(self._stepped(q) for q in values[0])
        if self.rates == "measured":
            return own, EncoderReading(time=t, joints=joints, joint_rates=tuple(values[1]))
        rates = tuple(where(first, 0.0, sub(q, old) * (1.0 / dt)) for q, old in zip(joints, own, strict=True))
        return joints, EncoderReading(time=t, joints=joints, joint_rates=rates)

    def _stepped(self, q: Any) -> Any:
        if absent(self.bits):
            return q
        # by one formula, that a number of bits which varies gives the same steps; off by a rounding error
        return Channel(resolution=divide(self.span, exp(self.bits * LOG_2))).rounded(q)
