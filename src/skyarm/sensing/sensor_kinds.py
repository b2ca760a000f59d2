"""Sensor types: inertial unit, motion capture, satellite position, heading, encoders,
force, tactile switch.

Each reading is a record whose first field is the instant at which it was read. Default
numbers are those of a small flight controller's inertial unit (gyroscope 0.005
rad/s/sqrt(Hz), accelerometer 0.02 m/s^2/sqrt(Hz)) and of a motion-capture system at 5
mm and 5 mrad.

Force sensors measure the true force of all that acts beyond their frame from outside:
surfaces, springs, a load on a cord, the weight of a load that is held. The weight of
the hand itself is taken off, and so is what accelerating hand and load takes: a sensor
on a light hand. A free object that is held counts whole, its acceleration too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field, replace
from typing import Annotated, Any, ClassVar

from skyarm.algebra import ZERO3, Mat3, Quaternion, Scalar, Scalars, Vec3
from skyarm.algebra.quaternion import euler_angles, euler_rotation
from skyarm.algebra.scalars import (
    absolute,
    cos,
    data,
    divide,
    exp,
    floor,
    mul,
    sin,
    sub,
    where,
)
from skyarm.dynamics.state import JointPositions, JointRates, State
from skyarm.records.coerce import RecordError, absent, concrete
from skyarm.records.immutable import UNWRITTEN, immutable
from skyarm.records.leaves import Tree, leaves
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.sensing.channel import (
    Channel,
    ChannelMemory,
    ChannelSensor,
    Quantities,
    SampleRate,
)
from skyarm.sensing.sensor import (
    NO_PUSH,
    BasePosition,
    FrameForce,
    FrameTorque,
    Push,
    Sensor,
    at_origin,
)
from skyarm.vehicle import Vehicle
from skyarm.vehicle.check import FARTHEST
from skyarm.world.component import require_frame


@immutable
class Reading:
    """Base class of sensor readings, with the time at which a reading was taken."""

    time: Annotated[Scalar, Unit("s", "time at which the reading was taken")]


@immutable
class ImuReading(Reading):
    """Reading of an inertial unit: angular rate and specific force at its place, in its
    own axes.
    """

    rate: Annotated[Vec3, Unit("rad/s", "angular velocity, axes of the inertial unit")]
    specific_force: Annotated[
        Vec3,
        Unit("m/s^2", "specific force, axes of the inertial unit, +g upwards in hover"),
    ]


@immutable
class PoseReading(Reading):
    """Reading of motion capture: position of the base origin and attitude of the
    base.
    """

    position: BasePosition
    quaternion: Annotated[Quaternion, Unit("", "attitude w x y z, base to world")]


@immutable
class PositionReading(Reading):
    """Reading of satellite navigation: position of the base origin."""

    position: BasePosition


@immutable
class HeadingReading(Reading):
    """Reading of a heading sensor: yaw of the base's x axis about the vertical."""

    heading: Annotated[Scalar, Unit("rad", "yaw, from -pi to pi")]


@immutable
class EncoderReading(Reading):
    """Reading of the encoders: positions and rates of all joints."""

    joints: JointPositions
    joint_rates: JointRates


@immutable
class ForceReading(Reading):
    """Reading of a force-torque sensor: external wrench at a frame."""

    force: FrameForce
    torque: FrameTorque


@immutable
class SwitchReading(Reading):
    """Reading of a tactile switch at a frame: closed while a force acts."""

    closed: Annotated[Scalar, Unit("", "state of the switch: 1 closed, 0 open")]


def declared_reading(sensor: Sensor) -> type:
    """Type of a sensor's readings by ``record`` of its class; ``object`` where that is
    no type.
    """
    declared = getattr(sensor, "record", object)
    return declared if isinstance(declared, type) else object


def reads(sensor: Sensor, reading: type) -> bool:
    """True if a sensor declares, by ``record`` of its class, readings of a given
    type.
    """
    return issubclass(declared_reading(sensor), reading)


LOG_2 = 0.6931471805599453
TURN = 2.0 * math.pi
"""One turn, rad."""


def mount_rotation(rpy: Vec3) -> Mat3 | None:
    """Rotation from an inertial unit's axes to base axes by its angles (rad); None for
    exact zeros.
    """
    if at_origin(rpy):
        return None
    return euler_rotation(
        tuple(sin(data(each)) for each in rpy), tuple(cos(data(each)) for each in rpy)
    )


@immutable
class Imu(ChannelSensor):
    """Inertial unit: angular rate (rad/s) and specific force (m/s^2) at its place on
    the base, in its own axes.

    Attributes:
        position: place. rpy: angles of its axes, Rz(yaw) Ry(pitch) Rx(roll) to base
            axes. gyro, accelerometer: errors, in its axes.
    """

    record: ClassVar[type] = ImuReading

    position: Annotated[
        Vec3,
        Unit(
            "m",
            "place of the inertial unit from the base origin, base axes",
            usual=FARTHEST,
        ),
    ] = field(default=ZERO3, metadata={UNWRITTEN: ZERO3})
    rpy: Annotated[
        Vec3, Unit("rad", "roll, pitch and yaw of the inertial unit's axes in the base")
    ] = field(default=ZERO3, metadata={UNWRITTEN: ZERO3})
    gyro: Channel = Channel(density=0.005, walk=1e-4)
    accelerometer: Channel = Channel(density=0.02, walk=1e-3)

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Angular rate and specific force: name, error model and true components of
        each.
        """
        rate = state.rate
        R_BS = mount_rotation(self.rpy)
        # R_BS turns the unit's axes into base axes, so readings take its transpose
        if R_BS is not None:
            rate, specific_force = R_BS.apply_T(rate), R_BS.apply_T(specific_force)
        return self.channels(gyro=rate, accelerometer=map(data, specific_force))

    @property
    def mounted_at(self) -> Vec3:
        """Place of the inertial unit, m, base axes."""
        return self.position

    @property
    def turned_by(self) -> Vec3:
        """Roll, pitch and yaw of the inertial unit's axes in the base, rad."""
        return self.rpy


@immutable
class Pose(ChannelSensor):
    """Motion capture: position of the base origin (m) and attitude of the base.

    The attitude's errors are a rotation vector in base axes (rad), after the true
    attitude: it has no scale and no resolution.
    """

    record: ClassVar[type] = PoseReading

    frequency: SampleRate = 50.0
    position: Channel = Channel(sigma=0.005)
    attitude: Channel = Channel(sigma=0.005)

    def __post_init__(self) -> None:
        ChannelSensor.__post_init__(self)
        for name in ("scale", "resolution"):
            value = getattr(self.attitude, name)
            if not (concrete(value) and value == 0):
                raise RecordError(
                    f"attitude.{name} = {value}: must be left out, errors of an"
                    " attitude are rotations"
                )

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Position and attitude error: name, error model and true components of
        each.
        """
        # the channel adds errors to zero, and reading() composes them with the attitude
        return self.channels(position=state.position, attitude=(0.0, 0.0, 0.0))

    def reading(
        self,
        t: Scalar,
        values: Sequence[Scalars],
        state: State,
        own: Any,
        first: Scalar,
        dt: float,
    ) -> tuple[Tree, PoseReading]:
        """Make the pose reading: position, and the true attitude rotated by the
        attitude error.
        """
        position, turn = values
        # from the right: the error is a rotation in base axes
        attitude = state.quaternion * Quaternion.of_rotation_vector(Vec3(*turn))
        return own, PoseReading(time=t, position=Vec3(*position), quaternion=attitude)


@immutable
class Position(ChannelSensor):
    """Satellite navigation: position of the base origin, m."""

    record: ClassVar[type] = PositionReading

    frequency: SampleRate = 10.0
    position: Channel = Channel(sigma=0.02)

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Base position: name, error model and true components."""
        return self.channels(position=state.position)


@immutable
class Heading(ChannelSensor):
    """Heading sensor, a compass or two satellite antennas: yaw of the base's x axis,
    rad.
    """

    record: ClassVar[type] = HeadingReading

    frequency: SampleRate = 10.0
    heading: Channel = Channel(sigma=0.02)

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Heading: name, error model and true value."""
        return self.channels(heading=(euler_angles(state.rotation)[2],))

    def reading(
        self, t: Scalar, values: Sequence[Scalars], *rest: Any
    ) -> tuple[Tree, Tree]:
        """Make the reading, which errors do not carry beyond half a turn."""
        heading = values[0][0]
        # readings end at pi and -pi: where() keeps pi, which the floor may turn to -pi
        turned = heading - TURN * floor(heading * (1.0 / TURN) + 0.5)
        wrapped = where(absolute(heading) > 0.5 * TURN, turned, heading)
        # a subclass of slots is made anew: super() without its class would look at the
        # first
        return ChannelSensor.reading(self, t, ((wrapped,),), *rest)


RATES = ("difference", "measured")


@immutable
class Encoders(ChannelSensor):
    """Encoders of all joints: positions (rad or m), and rates by finite difference or
    measured.

    Attributes:
        bits: bits of an absolute encoder; its step is span / 2^bits, in place of the
            joints' resolution. 0 for none.
        span: range that the bits divide, rad or m.
        joints: errors of the positions. rates: "difference" or "measured". rate: errors
            of measured rates.
    """

    record: ClassVar[type] = EncoderReading

    bits: Annotated[
        Scalar,
        nonnegative(
            "",
            "resolution of an absolute encoder in bits; 0: no rounding",
            # a double resolves no more than 2^-52 of its size
            high=52.0,
            effect="fewer bits make coarser positions and noisier rates",
        ),
    ] = 12
    span: Annotated[
        Scalar, positive("rad or m", "range of a joint that the bits divide")
    ] = TURN
    joints: Channel = Channel()
    rates: str = "difference"
    rate: Channel = Channel()

    def __post_init__(self) -> None:
        ChannelSensor.__post_init__(self)
        if self.rates not in RATES:
            raise RecordError(
                f"rates = {self.rates!r}: must be one of {', '.join(RATES)}"
            )
        if self.rates == "difference" and (
            leaves(self.rate) or self.rate.bias or self.rate.offset is not None
        ):
            raise RecordError(
                "rate: must be left out where rates = 'difference': the errors of"
                " positions make those of their differences"
            )
        if all(
            not (concrete(each) and each == 0)
            for each in (self.bits, self.joints.resolution)
        ):
            raise RecordError(
                f"bits = {self.bits}: must be 0 where joints.resolution is given"
            )

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Joint positions, and rates if they are measured: name, error model and true
        components of each.
        """
        if self.rates == "difference":
            return self.channels(joints=state.joints)
        return self.channels(joints=state.joints, rate=state.joint_rates)

    def first_own(self, vehicle: Vehicle) -> Tree:
        """Initial joint positions for the finite difference; () if rates are
        measured.
        """
        return vehicle.zeros if self.rates == "difference" else ()

    def reading(
        self,
        t: Scalar,
        values: Sequence[Scalars],
        state: State,
        own: Scalars,
        first: Scalar,
        dt: float,
    ) -> tuple[Tree, EncoderReading]:
        """Make the encoder reading: quantised positions, and rates by finite difference
        or measured.
        """
        joints = tuple(map(self._quantize, values[0]))
        if self.rates == "measured":
            return own, EncoderReading(
                time=t, joints=joints, joint_rates=tuple(values[1])
            )
        # the first reading has none before it to differ from
        rates = tuple(
            where(first, 0.0, sub(q, old) * (1.0 / dt))
            for q, old in zip(joints, own, strict=True)
        )
        return joints, EncoderReading(time=t, joints=joints, joint_rates=rates)

    def _quantize(self, q: Scalar) -> Scalar:
        if absent(self.bits):
            return q
        # by one formula, that a number of bits which varies gives the same steps; off
        # by a rounding error
        step = divide(self.span, exp(self.bits * LOG_2))
        return Channel(resolution=where(self.bits > 0.0, step, 0.0)).quantize(q)


@immutable
class FramedSensor(ChannelSensor):
    """Base class of sensors of the external wrench at a vehicle frame, with a
    first-order low-pass filter.

    Attributes:
        frame: frame of the vehicle; empty for its tip. bandwidth: rad/s, of the low
            pass; 0 for none.
    """

    frame: str = ""
    bandwidth: Annotated[
        Scalar,
        nonnegative(
            "rad/s",
            "bandwidth of the sensor's first-order low pass; 0: none",
            effect="lower values smooth the reading and add lag",
        ),
    ] = 0

    @property
    def feels(self) -> str:  # type: ignore[override]
        """Name of the vehicle frame at which the sensor measures the external
        wrench.
        """
        return self.frame

    def reading_of(self, push: Push) -> Quantities:
        """Name, error model and true components of each quantity, for an external
        wrench.
        """
        raise NotImplementedError(f"{type(self).__name__} must define reading_of()")

    def require_vehicle(self, vehicle: Vehicle) -> None:
        """Refuse a vehicle that lacks the sensor's frame."""
        require_frame(vehicle, self.frame)
        ChannelSensor.require_vehicle(self, vehicle)

    def examples(self, vehicle: Vehicle) -> Quantities:
        """Name, error model and components of each measured quantity at zero external
        wrench.
        """
        return self.reading_of(NO_PUSH)

    def first_own(self, vehicle: Vehicle) -> tuple[Push, Tree]:
        """Initial internal state: output of the low-pass filter, and any further state
        of the sensor type.
        """
        return NO_PUSH, ()

    def feel(
        self,
        memory: ChannelMemory,
        t: Scalar,
        push: Push,
        draws: Sequence[Scalar],
        dt: float,
    ) -> tuple[ChannelMemory, Tree]:
        """Take one reading of the low-pass filtered wrench; return the next internal
        state and the reading.
        """
        before, more = memory.own
        if not (concrete(self.bandwidth) and self.bandwidth == 0):
            # the first reading starts the filter at the wrench, so that it shows no
            # transient; the exponential is exact for a wrench that is constant over the
            # period
            share = where(memory.read < 0.5, 1.0, 1.0 - exp(-mul(self.bandwidth, dt)))
            force, torque = before.force, before.torque
            push = Push(
                force=force + (push.force - force) * share,
                torque=torque + (push.torque - torque) * share,
            )
        own = replace(memory, own=(push, more))
        return self.read(own, t, self.reading_of(push), (), draws, dt)


@immutable
class ForceTorque(FramedSensor):
    """Force-torque sensor: force (N) and torque (N m) at a vehicle frame, in the
    frame's axes.
    """

    record: ClassVar[type] = ForceReading
    senses: ClassVar[str] = "wrench"

    force: Channel = Channel()
    torque: Channel = Channel()

    def reading_of(self, push: Push) -> Quantities:
        """Force and torque: name, error model and true components of each."""
        return self.channels(force=push.force, torque=push.torque)


@immutable
class TactileSwitch(FramedSensor):
    """Tactile switch with hysteresis: closes above one force, opens below another.

    Attributes:
        on, off: thresholds of the force's size, N. force: errors of it.
    """

    senses: ClassVar[str] = "switch"

    on: Annotated[Scalar, nonnegative("N", "force above which the switch closes")] = 0.5
    off: Annotated[Scalar, nonnegative("N", "force below which the switch opens")] = (
        0.25
    )
    force: Channel = Channel()

    def __post_init__(self) -> None:
        FramedSensor.__post_init__(self)
        if concrete(self.on) and concrete(self.off) and self.off > self.on:
            raise RecordError(f"off = {self.off}: must be at most on = {self.on} N")

    def reading_of(self, push: Push) -> Quantities:
        """Magnitude of the contact force: name, error model and true value, N."""
        return self.channels(force=(push.force.norm(),))

    def first_own(self, vehicle: Vehicle) -> tuple[Push, Tree]:
        """Initial output of the low-pass filter, and 0.0 for the open switch."""
        return NO_PUSH, 0.0

    def reading(
        self,
        t: Scalar,
        values: Sequence[Scalars],
        state: State | tuple[()],
        own: tuple[Push, Scalar],
        first: Scalar,
        dt: float,
    ) -> tuple[Tree, SwitchReading]:
        """Make the reading of the switch, 1 closed or 0 open, with hysteresis."""
        push, before = own
        force = values[0][0]
        closed = where(force > self.on, 1.0, where(force < self.off, 0.0, before))
        return (push, closed), SwitchReading(time=t, closed=closed)
