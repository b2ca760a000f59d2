"""Sensors of force at a frame of the vehicle: a force-torque sensor in the wrist, a switch in the fingertip.

What they feel is the truth of all that pushes beyond their frame from outside: surfaces, springs, what hangs on a cord,
the weight of a payload that is held. The weight of the hand itself is taken off, and so is what accelerating hand and
payload takes: a sensor on a light hand. A free object that a gripper holds is felt whole,
its acceleration too.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.files import shown
from skyarm.records.coerce import RecordError, concrete
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, exp, mul, sqrt, where
from skyarm.sensors.channel import Channel
from skyarm.sensors.channel_sensor import ChannelMemory, ChannelSensor, Quantities
from skyarm.sensors.sensor import NO_PUSH, Push
from skyarm.sensors.sensor_readings import ForceReading, SwitchReading
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class FramedSensor(ChannelSensor):
    """A sensor of what pushes at a frame, behind a first-order low pass.

    Attributes:
        frame: of the vehicle; empty for its tip. bandwidth: rad/s of the low pass; 0 for none.
    """

    frame: str = ""
    bandwidth: Annotated[Scalar, Unit("rad/s", "of a first-order low pass, 0: none", low=0.0)] = 0

    @property
    def feels(self) -> str:  # type: ignore[override]
        """The frame."""
        return self.frame

    def felt(self, push: Push) -> Quantities:
        """Name, errors and true components of each channel."""
        raise NotImplementedError(f"{type(self).__name__} must say what it feels")

    def require_vehicle(self, vehicle: Vehicle) -> None:
        """The frame must be there."""
        try:
            vehicle.frame(self.frame or None)
        except VehicleError as error:
            raise RecordError(f"frame = {shown(self.frame)}: {error}") from None
        ChannelSensor.require_vehicle(self, vehicle)

    def examples(self, vehicle: Vehicle) -> Quantities:
        """Of no push at all."""
        return self.felt(NO_PUSH)

    def first_own(self, vehicle: Vehicle) -> Any:
        """What the low pass holds."""
        return NO_PUSH

    def passed(self, memory: ChannelMemory, before: Push, push: Push, dt: float) -> Push:
        """What comes through the low pass; the first push as it is."""
        if type(self.bandwidth) in (int, float) and self.bandwidth == 0:
            return push
        share = where(memory.read < 0.5, 1.0, 1.0 - exp(-mul(self.bandwidth, dt)))
        force, torque = before.force, before.torque
        return Push(force=force + (push.force - force) * share, torque=torque + (push.torque - torque) * share)

    def feel(self, memory: ChannelMemory, t: Any, push: Push, draws: Sequence[Any], dt: float) -> tuple[Any, Any]:
        """One reading."""
        behind = self.passed(memory, memory.own, push, dt)
        return self.read(dataclasses.replace(memory, own=behind), t, self.felt(behind), (), draws, dt)


@dataclass(frozen=True, kw_only=True, slots=True)
class ForceTorque(FramedSensor):
    """A force-torque sensor: force (N) and torque (N m) at a frame, in its axes."""

    force: Channel = Channel()
    torque: Channel = Channel()

    def felt(self, push: Push) -> Quantities:
        """Force and torque."""
        return ("force", self.force, tuple(push.force)), ("torque", self.torque, tuple(push.torque))

    def reading(self, t: Any, values: Sequence[tuple[Any, ...]], state: Any, own: Any, first: Any, dt: float) -> Any:
        """Both as read."""
        return own, ForceReading(time=t, force=Vec3(*values[0]), torque=Vec3(*values[1]))


@dataclass(frozen=True, kw_only=True, slots=True)
class Switched:
    """What a switch keeps."""

    push: Push
    closed: Annotated[Scalar, Unit("", "1 closed, 0 open")]


@dataclass(frozen=True, kw_only=True, slots=True)
class TactileSwitch(FramedSensor):
    """A tactile switch: closed above a force, open below another.

    Attributes:
        on, off: N, of the force's size. force: errors of it.
    """

    on: Annotated[Scalar, Unit("N", "above which it closes", low=0.0)] = 0.5
    off: Annotated[Scalar, Unit("N", "below which it opens", low=0.0)] = 0.25
    force: Channel = Channel()

    def __post_init__(self) -> None:
        FramedSensor.__post_init__(self)
        if concrete(self.on) and concrete(self.off) and self.off > self.on:
            raise RecordError(f"off = {self.off}: must be at most on = {self.on} N")

    def felt(self, push: Push) -> Quantities:
        """The force's size."""
        f = push.force
        return (("force", self.force, (sqrt(f.dot(f)),)),)

    def first_own(self, vehicle: Vehicle) -> Any:
        """What the low pass holds, and whether the switch is closed."""
        return Switched(push=NO_PUSH, closed=0.0)

    def feel(self, memory: ChannelMemory, t: Any, push: Push, draws: Sequence[Any], dt: float) -> tuple[Any, Any]:
        """One reading: the low pass before the switch."""
        before = memory.own
        behind = self.passed(memory, before.push, push, dt)
        own = Switched(push=behind, closed=before.closed)
        return self.read(dataclasses.replace(memory, own=own), t, self.felt(behind), (), draws, dt)

    def reading(self, t: Any, values: Sequence[tuple[Any, ...]], state: Any, own: Any, first: Any, dt: float) -> Any:
        """Closed or open, with a hysteresis."""
        force = values[0][0]
        closed = where(force > self.on, 1.0, where(force < self.off, 0.0, own.closed))
        return dataclasses.replace(own, closed=closed), SwitchReading(time=t, closed=closed)
