"""Desired motion of a body that several tips hold: its pose over time, and the paths of
places on it.

The table ``[reference.object]`` of a scenario file; every phase goes from rest to rest,
smooth to the fourth derivative::

    [reference.object]
    kind = "phases"
    phases = [
        { kind = "hold", duration = 3.0 },               # s
        { kind = "lift", height = 0.5, duration = 3.0 }, # m
        { kind = "carry", by = [2.0, 0.0, 0.0], duration = 4.0 },  # m, world axes
        { kind = "turn", angle = 1.5708, duration = 4.0 },  # rad, about world z
        { kind = "tilt", pitch = 0.35, duration = 2.0 },  # rad, to this pitch and roll
        # level, and down to the height at which it began
        { kind = "place", duration = 3.0 },
    ]
    # left out: none; added
    path = { kind = "circle", radius = 1.0, frequency_hz = 0.1, start = 6, stop = 16 }

A body that hangs on cables from the start has its first phase of kind "lift" at 0 s.

A wrong table raises ValueError with one line: field, value, what is allowed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from skyarm.algebra import Mat3, Scalar, Vec3
from skyarm.algebra.quaternion import euler_rotation, euler_row
from skyarm.algebra.scalars import cos, sin
from skyarm.algebra.scalars.taylor import Taylor, nth_derivative
from skyarm.records.field_rules import checked
from skyarm.records.files import Fields, filled_list
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, nonnegative
from skyarm.reference.reference_tables import motion_from
from skyarm.reference.signals import Constant, Derivatives, Ramp, Signal, Sum
from skyarm.reference.task_records import Setting
from skyarm.reference.tip_motion import vector_derivatives

PHASES = ("hold", "lift", "carry", "turn", "tilt", "place")

POSE = ("x", "y", "z", "roll", "pitch", "yaw")


@immutable
class BodyMotion:
    """Motion of a body at an instant, world axes.

    Attributes:
        position, velocity, acceleration: of its middle, m. R: its axes to world axes.
        rate, turning: angular velocity and acceleration, rad/s and rad/s^2.
    """

    position: Vec3
    velocity: Vec3
    acceleration: Vec3
    R: Mat3
    rate: Vec3
    turning: Vec3

    def at_pace(self, pace: Scalar, change: Scalar) -> BodyMotion:
        """The same place in a motion whose time runs at a pace, which changes at a rate
        (1/s).
        """
        return BodyMotion(
            position=self.position,
            velocity=self.velocity * pace,
            acceleration=self.acceleration * (pace * pace) + self.velocity * change,
            R=self.R,
            rate=self.rate * pace,
            turning=self.turning * (pace * pace) + self.rate * change,
        )

    def of_place(self, place: Vec3) -> tuple[Vec3, Vec3, Vec3]:
        """Position, velocity and acceleration of a place on the body (m, its axes from
        its middle).
        """
        arm = self.R.apply(place)
        turned = self.rate.cross(arm)
        bent = self.turning.cross(arm) + self.rate.cross(turned)
        return self.position + arm, self.velocity + turned, self.acceleration + bent


@immutable
@checked("motion")
class PoseTrajectory:
    """Desired pose of a body over time, and when it leaves its support and stands on
    one again.
    """

    x: Annotated[Signal, Unit("m", "desired x of the middle of the body, world axes")]
    y: Annotated[Signal, Unit("m", "desired y of the middle of the body, world axes")]
    z: Annotated[Signal, Unit("m", "desired z of the middle of the body, world axes")]
    roll: Annotated[Signal, Unit("rad", "desired roll of the body (ZYX)")]
    pitch: Annotated[Signal, Unit("rad", "desired pitch of the body (ZYX)")]
    yaw: Annotated[Signal, Unit("rad", "desired yaw of the body (ZYX)")]
    lift: Annotated[
        Scalar, nonnegative("s", "time at which the body leaves its support")
    ]
    stop: Annotated[
        Scalar, nonnegative("s", "time at which the body stands on a support again")
    ]

    def at(self, t: Scalar) -> BodyMotion:
        """Desired motion of the body at time t (s)."""
        position, velocity, acceleration, *_ = vector_derivatives(
            (self.x, self.y, self.z), t
        )
        angles = [
            Taylor.of_derivatives(each.derivatives(t))
            for each in (self.roll, self.pitch, self.yaw)
        ]
        sines, cosines = tuple(map(sin, angles)), tuple(map(cos, angles))
        R = euler_rotation(sines, cosines)
        roll, pitch, yaw = (each.derivative_series() for each in angles)
        # the angular velocity is each angle's rate about its own axis, of ZYX angles
        turn = [
            R.r0.x * roll - sines[2] * pitch,
            R.r1.x * roll + cosines[2] * pitch,
            R.r2.x * roll + yaw,
        ]
        return BodyMotion(
            position=position,
            velocity=velocity,
            acceleration=acceleration,
            R=Mat3(*(Vec3(*(nth_derivative(c, 0) for c in row)) for row in R.rows)),
            rate=Vec3(*(nth_derivative(c, 0) for c in turn)),
            turning=Vec3(*(nth_derivative(c, 1) for c in turn)),
        )

    def path_of(self, place: Sequence[Signal]) -> tuple[Signal, Signal, Signal]:
        """World coordinates of a place on the body (m, its axes from its middle) over
        time.
        """
        turns = {name: getattr(self, name) for name in POSE[3:]}
        x, y, z = (
            CarriedPlace(
                middle=getattr(self, axis), place=tuple(place), axis=i, **turns
            )
            for i, axis in enumerate("xyz")
        )
        return x, y, z


@immutable
class CarriedPlace(Signal):
    """One world coordinate of a place on a body that moves and turns.

    Attributes:
        axis: 0, 1 or 2 for x, y or z.
    """

    middle: Annotated[Signal, Unit("m", "this coordinate of the middle of the body")]
    roll: Annotated[Signal, Unit("rad", "roll of the body (ZYX)")]
    pitch: Annotated[Signal, Unit("rad", "pitch of the body (ZYX)")]
    yaw: Annotated[Signal, Unit("rad", "yaw of the body (ZYX)")]
    place: Annotated[
        tuple[Signal, ...], Unit("m", "place on the body, its axes from its middle")
    ]
    axis: int

    def derivatives(self, t: Scalar) -> Derivatives:
        """Value and derivatives one to four at time t (s)."""
        *angles, middle, x, y, z = (
            Taylor.of_derivatives(each.derivatives(t))
            for each in (self.roll, self.pitch, self.yaw, self.middle, *self.place)
        )
        row = euler_row(tuple(map(sin, angles)), tuple(map(cos, angles)), self.axis)
        along = sum((each * p for each, p in zip(row, (x, y, z), strict=True)), middle)
        return tuple(map(along.derivative, range(5)))


def motion_of_object(fields: Fields, start: Vec3) -> PoseTrajectory:
    """Desired motion of a body from the table ``[reference.object]``.

    Args:
        fields: the table.
        start: position of the middle of the body at the beginning (m, world axes),
            where the table states none.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    fields.choice("kind", ("phases",), "phases")
    x, y, z = fields.vector("position", tuple(map(float, start)))
    pose = dict(zip(POSE, (x, y, z, 0.0, 0.0, 0.0), strict=True))
    time = 0.0
    moves: dict[str, list[Signal]] = {
        name: [Constant(value)] for name, value in pose.items()
    }
    if "path" in fields.table:
        path = motion_from(fields.take("path"), fields.at("path"), Setting())
        moves |= {name: [*moves[name], getattr(path, name)] for name in "xyz"}
    at = fields.at("phases")
    # -1 and 0 stand for a body that never leaves its support or never stands again
    lift, stop = -1.0, 0.0
    for i, entry in enumerate(
        filled_list(fields.take("phases"), at, "a list of phases")
    ):
        phase = Fields(entry, f"{at}[{i}]")
        kind = phase.choice("kind", PHASES)
        duration = phase.number("duration", low=0.0, strict=True)
        if stop and kind != "hold":
            raise ValueError(
                f"{at}[{i}].kind = {kind!r}: must be 'hold', after a phase of kind"
                " 'place'"
            )
        if kind == "place" and lift < 0.0:
            raise ValueError(
                f"{at}[{i}].kind = 'place': must come after a phase of kind 'lift'"
            )
        goal = dict(pose)
        if kind == "lift":
            goal["z"] += phase.number("height", low=0.0, strict=True)
            lift = time if lift < 0.0 else lift
        elif kind == "carry":
            by = phase.vector("by")
            goal |= {
                name: pose[name] + step for name, step in zip("xyz", by, strict=True)
            }
        elif kind == "turn":
            goal["yaw"] += phase.number("angle")
        elif kind == "tilt":
            goal |= {name: phase.number(name, pose[name]) for name in ("roll", "pitch")}
        elif kind == "place":
            goal |= {"z": z, "roll": 0.0, "pitch": 0.0}
        phase.done()
        for name, value in goal.items():
            if value != pose[name]:
                height = value - pose[name]
                moves[name].append(
                    Ramp(start=time, duration=duration, height=height, shape="nonic")
                )
        pose, time = goal, time + duration
        stop = time if kind == "place" else stop
    fields.done()
    if lift < 0.0:
        raise ValueError(
            f"{at}: must have a phase of kind 'lift' after one of kind 'hold', in which"
            " the tips take hold"
        )
    signals = {
        name: Sum(tuple(each)) if len(each) > 1 else each[0]
        for name, each in moves.items()
    }
    # without a place it stays aloft: later than any flight
    return PoseTrajectory(**signals, lift=lift, stop=stop or time + 1e6)
