"""The motion of the tip as a reference, and the motion of the base that carries it there.

For a level base p_b = p_tip - R_z(yaw) p_e(q), exactly and with all derivatives, whatever the joints do: what the arm
does not do, the base does. That is the tip at which metrics and the laws in tip mode aim. A base that tilts carries the
tip off by about the arm's length times the tilt: the laws in tip mode make that good by the joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.dynamics.kinematics import joint_placement
from skyarm.records.field_rules import accept_fields
from skyarm.records.leaves import leaves, rebuild
from skyarm.records.units import Unit
from skyarm.reference.signals import Constant, Derivatives, Signal
from skyarm.scalars import cos, sin
from skyarm.scalars.taylor import Taylor
from skyarm.vehicle.linkage import BASE, Joint
from skyarm.vehicle.vehicle_records import Vehicle

ORDER = 4
"""Derivatives of a reference."""

STILL = Constant(0.0)

FiveVectors = tuple[Vec3, Vec3, Vec3, Vec3, Vec3]


@dataclass(frozen=True, kw_only=True, slots=True)
class Arm:
    """The joints between the base and the tip.

    Attributes:
        carriers: numbers of these joints among the vehicle's. joints: the joints, from the base on.
        tip: of the last link.
    """

    carriers: tuple[int, ...]
    joints: tuple[Joint, ...]
    tip: Annotated[Vec3, Unit("m", "axes of the last link")] = ZERO3

    def reached(self, joints: Sequence[Taylor]) -> Vec3:
        """Tip against the base origin, base axes, as series; ``joints`` are those of the whole vehicle."""
        point = _lifted(self.tip)
        for number, joint in reversed(list(zip(self.carriers, self.joints, strict=True))):
            point = joint_placement(_lifted(joint), joints[number]).apply(point)
        found: Vec3 = point
        return found


def arm_of(vehicle: Vehicle, frame: str = "") -> Arm:
    """The arm that carries a frame, the tip by default.

    Raises:
        ValueError: the vehicle has no tip, or one that a follower carries.
    """
    if not (frame or vehicle.end_effector):
        raise ValueError(f"vehicle {vehicle.name!r}: has no tip (end_effector)")
    held = vehicle.frame(frame or vehicle.end_effector)
    if held.link >= vehicle.n:
        raise ValueError(f"vehicle {vehicle.name!r}: frame {held.name!r} is carried by a follower, not by a joint")
    carriers: list[int] = []
    index = held.link
    while index != BASE:
        carriers.insert(0, index)
        index = vehicle.links[index].parent
    joints = tuple(vehicle.links[i].joint for i in carriers)
    return Arm(carriers=tuple(carriers), joints=joints, tip=held.position)


@dataclass(frozen=True, kw_only=True, slots=True)
class TipMotion:
    """The desired motion of the tip.

    Attributes:
        x, y, z: its position, world axes; of a tip that is relative to the base: against the base origin, axes of the
            base's heading.
        arm: what carries it.
        relative: true of a tip that is relative to the base, whose motion then is its own.
    """

    x: Annotated[Signal, Unit("m", "the tip, world axes or relative to the base")] = STILL
    y: Annotated[Signal, Unit("m")] = STILL
    z: Annotated[Signal, Unit("m")] = STILL
    arm: Arm
    relative: bool = False

    def __post_init__(self) -> None:
        accept_fields(self, "tip")

    def path(self, t: Any) -> FiveVectors:
        """Its signals and their derivatives at a time, s."""
        found: list[Derivatives] = [signal.derivatives(t) for signal in (self.x, self.y, self.z)]
        p, v, a, j, s = (Vec3(*c) for c in zip(*found, strict=True))
        return p, v, a, j, s

    def base(self, t: Any, yaw: Sequence[Any], joints: Sequence[Sequence[Any]]) -> FiveVectors:
        """Where a level base carries the tip from, with derivatives; for a tip in the world.

        Args:
            t: s.
            yaw: heading and its derivatives.
            joints: values, rates ... to the fourth derivative.
        """
        series = [Taylor.of_derivatives(each) for each in zip(*joints, strict=True)]
        arm = _derivatives(turned(yaw, self.arm.reached(series)))
        p, v, a, j, s = (tip - held for tip, held in zip(self.path(t), arm, strict=True))
        return p, v, a, j, s

    def in_world(self, t: Any, base: FiveVectors, yaw: Sequence[Any]) -> FiveVectors:
        """The tip's own reference in the world, with derivatives."""
        path = self.path(t)
        if not self.relative:
            return path
        arm = Vec3(*(Taylor.of_derivatives(each) for each in zip(*path, strict=True)))
        p, v, a, j, s = (b + held for b, held in zip(base, _derivatives(turned(yaw, arm)), strict=True))
        return p, v, a, j, s


def turned(yaw: Sequence[Any], v: Vec3) -> Vec3:
    """Return R_z(yaw) v for a heading with four derivatives and a vector of series."""
    heading = Taylor.of_derivatives([*yaw, *(0,) * (ORDER + 1 - len(yaw))])
    c, s = cos(heading), sin(heading)
    return Vec3(c * v.x - s * v.y, s * v.x + c * v.y, v.z)


def _derivatives(v: Vec3) -> FiveVectors:
    p, vel, a, j, s = (
        Vec3(*(c.derivative(k) if isinstance(c, Taylor) else (c if k == 0 else 0) for c in v)) for k in range(5)
    )
    return p, vel, a, j, s


def _lifted(record: Any) -> Any:
    """The record with every number a series: an engine's scalar on the left of a product knows of none."""
    return rebuild(record, iter([Taylor.constant(number, ORDER) for number in leaves(record)]))
