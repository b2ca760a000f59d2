"""Desired motion of base and joints: one sample, and the trajectory it is taken from."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.reference.compose import Shifted, Sum, Windowed
from skyarm.reference.signals import Constant, Signal, Sine
from skyarm.scalars import Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class Reference:
    """Desired motion at one instant (or, with arrays as scalars, at many).

    Attributes:
        position, velocity, acceleration, jerk, snap: of the base origin, world axes, m and s.
        yaw, yaw_rate, yaw_acceleration: heading, rad and s.
        joints, joint_rates, joint_accelerations, joint_jerks, joint_snaps: rad or m, and s.
    """

    position: Vec3 = ZERO3
    velocity: Vec3 = ZERO3
    acceleration: Vec3 = ZERO3
    jerk: Vec3 = ZERO3
    snap: Vec3 = ZERO3
    yaw: Scalar = 0
    yaw_rate: Scalar = 0
    yaw_acceleration: Scalar = 0
    joints: tuple[Scalar, ...] = ()
    joint_rates: tuple[Scalar, ...] = ()
    joint_accelerations: tuple[Scalar, ...] = ()
    joint_jerks: tuple[Scalar, ...] = ()
    joint_snaps: tuple[Scalar, ...] = ()

    def mapped(self, function: Callable[[Any], Any]) -> Reference:
        """Apply a function to every scalar, structural ones too."""
        values: dict[str, Any] = {}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, Vec3):
                values[field.name] = Vec3(*(function(c) for c in value))
            elif isinstance(value, tuple):
                values[field.name] = tuple(function(c) for c in value)
            else:
                values[field.name] = function(value)
        return Reference(**values)

    def dense(self) -> Reference:
        """Return the same sample as data: no integer is left, so that one traced program fits every reference."""
        return self.mapped(lambda value: float(value) if isinstance(value, (int, float)) else value)


ZERO = Constant(0.0)
"""The signal that stays at zero."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Trajectory:
    """Signals of the base position (m), the heading (rad) and the joints (rad or m)."""

    x: Signal = ZERO
    y: Signal = ZERO
    z: Signal = ZERO
    yaw: Signal = ZERO
    joints: tuple[Signal, ...] = ()

    def at(self, t: Any) -> Reference:
        """Sample at time t (s); right-hand limits at switch times."""
        p, v, a, j, s = (Vec3(*c) for c in zip(*(k.derivatives(t) for k in (self.x, self.y, self.z)), strict=True))
        yaw, yaw_rate, yaw_acceleration, _, _ = self.yaw.derivatives(t)
        q = tuple(zip(*(k.derivatives(t) for k in self.joints), strict=True)) or ((),) * 5
        return Reference(
            position=p,
            velocity=v,
            acceleration=a,
            jerk=j,
            snap=s,
            yaw=yaw,
            yaw_rate=yaw_rate,
            yaw_acceleration=yaw_acceleration,
            joints=q[0],
            joint_rates=q[1],
            joint_accelerations=q[2],
            joint_jerks=q[3],
            joint_snaps=q[4],
        )

    def switch_times(self) -> tuple[float, ...]:
        """List the times (s), in order, at which a signal or one of its derivatives may jump."""
        return Sum((self.x, self.y, self.z, self.yaw, *self.joints)).switch_times()

    def with_joints(self, *joints: Signal | float) -> Trajectory:
        """Return the same base motion with these joint signals (a number is held)."""
        return dataclasses.replace(self, joints=signals(joints))

    def shifted(self, delay: Any) -> Trajectory:
        """Return the same motion ``delay`` seconds later."""
        x, y, z, yaw, *joints = (Shifted(k, delay) for k in (self.x, self.y, self.z, self.yaw, *self.joints))
        return Trajectory(x=x, y=y, z=z, yaw=yaw, joints=tuple(joints))

    def __add__(self, other: Trajectory) -> Trajectory:
        """Both motions at once; one without joints leaves the other's as they are."""
        if self.joints and other.joints and len(self.joints) != len(other.joints):
            raise ValueError(f"trajectories of {len(self.joints)} and {len(other.joints)} joints do not add")
        if self.joints and other.joints:
            joints = tuple(a + b for a, b in zip(self.joints, other.joints, strict=True))
        else:
            joints = self.joints or other.joints
        return Trajectory(
            x=self.x + other.x, y=self.y + other.y, z=self.z + other.z, yaw=self.yaw + other.yaw, joints=joints
        )


def signals(values: Sequence[Signal | Any]) -> tuple[Signal, ...]:
    """Signals, numbers made constants."""
    return tuple(value if isinstance(value, Signal) else Constant(value) for value in values)


def hover(position: Sequence[Any], *, yaw: Any = 0.0, joints: Sequence[Signal | Any] = ()) -> Trajectory:
    """Stay at a point (m) with a heading (rad) while the joints follow their signals."""
    x, y, z, heading = signals((*position, yaw))
    return Trajectory(x=x, y=y, z=z, yaw=heading, joints=signals(joints))


def circle(
    *,
    radius: Any,
    frequency_hz: Any,
    center: Sequence[Any],
    start: Any = -math.inf,
    stop: Any = math.inf,
    yaw: Any = 0.0,
    joints: Sequence[Signal | Any] = (),
) -> Trajectory:
    """Horizontal circle, counter-clockwise seen from above, within [start, stop); the centre outside.

    It begins with a step: x = radius cos(2 pi f (t - start)), y = radius sin(...), as in the paper's Case 3. Without a
    ``start`` the angle counts from t = 0.

    Args:
        radius: m.
        frequency_hz: turns per second; negative turns clockwise.
        center: m, world.
        start: s.
        stop: s.
        yaw: rad.
        joints: signals or numbers.
    """
    origin = 0.0 if isinstance(start, float) and math.isinf(start) else start
    motion = [
        Windowed(Shifted(Sine(amplitude=radius, frequency_hz=frequency_hz, phase=phase), origin), start, stop)
        for phase in (math.pi / 2.0, 0.0)
    ]
    at_center = hover(center, yaw=yaw, joints=joints)
    return dataclasses.replace(at_center, x=at_center.x + motion[0], y=at_center.y + motion[1])
