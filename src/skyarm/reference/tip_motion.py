"""Tip reference: desired motion and contact of the tip, and the base motion that
carries it.

For a level base p_b = p_tip - R_z(yaw) p_e(q), exactly and with all derivatives,
whatever the joints do: what the arm does not do, the base does. That is the tip at
which metrics and the laws in tip mode aim. A base that leans carries the tip off by
about the arm's length times the tilt: the laws in tip mode make that good by the
joints.

A desired contact is the force with which the tip presses, and the model of the surface.
The true surface stands in ``[world]`` and may lie elsewhere and turned. As long as
``force`` is above 0 a law that can press leads the tip against the normal until
something pushes back, and holds the force; across the normal the tip stays on its
reference.

A tip that grips (``grip`` above 0.5) is held by what it grips, a handle or a lever:
nothing is touched and nothing can be lost, and the force along the normal may have
either sign; 0 of it is what a handle asks for that goes its own way. With a ``pivot``
the normal is the direction from an axis through it to the tip: that of a door or a
valve.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from skyarm.algebra import ZERO3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import divide, logical_or, sqrt, where
from skyarm.algebra.scalars.taylor import Taylor, nth_derivative
from skyarm.dynamics.kinematics import chain, joint_placement, out_of_axis
from skyarm.records.arrays import Array
from skyarm.records.field_rules import checked
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.leaves import Record, leaves, rebuild
from skyarm.records.path_names import Names, field_paths
from skyarm.records.units import Unit, nonnegative
from skyarm.reference.motion_names import motion_names
from skyarm.reference.signals import Constant, Signal
from skyarm.vehicle import Joint, Vehicle

ORDER = 4
"""Highest derivative of a reference."""

STILL = Constant(0.0)
"""Signal that is zero at all times."""

Components = tuple[Scalar, Scalar, Scalar]
"""Components x, y and z of a vector of a table."""

FiveVectors = tuple[Vec3, ...]
"""Vector and its first four derivatives."""


@immutable
class Arm:
    """Chain of joints between the base and the tip.

    Attributes:
        carriers: indices of these joints among the vehicle's. joints: joints from the
            base on.
        tip: position of the tip on the last link.
    """

    carriers: tuple[int, ...]
    joints: tuple[Joint, ...]
    tip: Annotated[Vec3, Unit("m", "position of the tip, axes of the last link")] = (
        ZERO3
    )

    def tip_position(self, joints: Sequence[Taylor]) -> Vec3:
        """Tip position (m, base axes) as Taylor series of time, from joint positions as
        Taylor series.
        """
        point = _to_series(self.tip)
        # from the tip inwards each joint turns one point; outwards it would be frames
        for number, joint in reversed(
            list(zip(self.carriers, self.joints, strict=True))
        ):
            point = joint_placement(_to_series(joint), joints[number]).apply(point)
        return point


def arm_of(vehicle: Vehicle) -> Arm:
    """Chain of joints between a vehicle's base and its tip.

    Raises:
        ValueError: the vehicle has no tip, or one that a follower carries.
    """
    if not vehicle.end_effector:
        raise ValueError(f"vehicle {vehicle.name!r}: has no tip (end_effector)")
    frame = vehicle.frame()
    if frame.link >= vehicle.n:
        raise ValueError(
            f"vehicle {vehicle.name!r}: frame {frame.name!r} is carried by a follower,"
            " not by a joint"
        )
    carriers = chain(vehicle, frame.link)
    joints = tuple(vehicle.links[i].joint for i in carriers)
    return Arm(carriers=tuple(carriers), joints=joints, tip=frame.position)


@immutable
@checked("tip")
class TipMotion:
    """Desired tip motion: position in world axes, and the arm that carries the tip."""

    x: Annotated[Signal, Unit("m", "desired x of the tip, world axes")] = STILL
    y: Annotated[Signal, Unit("m", "desired y of the tip, world axes")] = STILL
    z: Annotated[Signal, Unit("m", "desired z of the tip, world axes")] = STILL
    arm: Arm

    def path_names(self) -> Names:
        """Names, in parameter paths, of the fields and of the tip motion's
        parameters.
        """
        return field_paths(self) | {"path": motion_names(self.x, self.y, self.z)}

    def path(self, t: Scalar) -> FiveVectors:
        """Tip position and its first four derivatives at time t (s), world axes."""
        return vector_derivatives((self.x, self.y, self.z), t)

    def base(
        self, t: Scalar, yaw: Sequence[Scalar], joints: Sequence[Sequence[Scalar]]
    ) -> FiveVectors:
        """Base position and four derivatives that keep the tip of a level vehicle on
        its desired path.

        Args:
            t: s.
            yaw: heading and its derivatives.
            joints: positions, rates ... to the fourth derivative.
        """
        series = [Taylor.of_derivatives(each) for each in zip(*joints, strict=True)]
        arm = self.arm.tip_position(series).about_z(Taylor.of_derivatives(yaw))
        return tuple(
            tip - Vec3(*(nth_derivative(c, order) for c in arm))
            for order, tip in enumerate(self.path(t))
        )


def vector_derivatives(signals: Sequence[Signal], t: Scalar) -> FiveVectors:
    """Position (m) and first four derivatives at time t (s), from the signals of x, y
    and z.
    """
    rows = [signal.derivatives(t) for signal in signals]
    return tuple(Vec3(*column) for column in zip(*rows, strict=True))


def _to_series(record: Record) -> Record:
    """Copy of a dataclass with every number as a constant Taylor series."""
    return rebuild(
        record, iter([Taylor.constant(number, ORDER) for number in leaves(record)])
    )


SPEED = 0.1
"""Default approach speed (m/s) of the tip; an arm of 0.1 kg then meets 5000 N/m with 2
N."""

FASTEST = 10.0
"""Highest approach speed (m/s) of the tip; chosen, far above what a contact bears."""

STRONGEST = 1e4
"""Largest desired contact force (N), far beyond that of multirotors."""

UPRIGHT = (0.0, 0.0, 1.0)
"""Default axis of a door: vertical."""


@immutable
@checked("reference.push")
class TipPush:
    """Desired tip contact: force signal, surface normal, approach speed, and the arc of
    a held handle.
    """

    force: Annotated[
        Signal,
        Unit(
            "N",
            "desired contact force of the tip on the surface; 0 requests no contact",
        ),
    ]
    normal: Annotated[
        Components,
        Unit("", "outward unit normal of the modelled surface, world axes"),
    ]
    speed: Annotated[Scalar, nonnegative("m/s", "approach speed of the tip")] = SPEED
    grip: Annotated[
        Signal | None, Unit("", "above 0.5 while the tip is held by what it grips")
    ] = field_if_any(default=None)
    pivot: Annotated[
        Components | None,
        Unit("m", "point on the axis about which the tip turns, world axes"),
    ] = field_if_any(default=None)
    axis: Annotated[
        Components,
        Unit("", "direction of the axis through the pivot, world axes"),
    ] = field_if_any(default=UPRIGHT)

    def at(self, t: Scalar) -> Scalars:
        """Desired contact at time t (s) as a tuple: force, approach speed, normal, and
        grip data.

        Force (N), speed (m/s) and unit normal; where the tip may grip, also that (0 to
        1), and where it goes about an axis, pivot (m) and unit vector of the axis.
        """
        press = (self.force.derivatives(t)[0], self.speed, *_unit(self.normal))
        if self.grip is None:
            return press
        grip = (*press, self.grip.derivatives(t)[0])
        return grip if self.pivot is None else (*grip, *self.pivot, *_unit(self.axis))

    def across(self, away: Array, t: Scalar, tip: Array) -> Array:
        """Tip position error (m), shape (..., 3), at times t (s), without the component
        along the contact normal.
        """
        counted = counted_error(Vec3(*away.T), self.at(t), Vec3(*tip.T))
        return np.stack(np.broadcast_arrays(*map(np.asarray, counted)), axis=-1).astype(
            float
        )


def counted_error(away: Vec3, push: Sequence[Scalar], tip: Vec3) -> Vec3:
    """Tip position error (m) without the component along the normal while the tip
    presses or grips.

    Along the normal a force is held there, not a place.

    Args:
        away: position of the tip from its reference, m, world axes.
        push: contact request of the reference; () where no contact is ever requested.
        tip: position of the tip, m, world axes.
    """
    if not push:
        return away
    # push: force, speed, normal (3); then grip; then pivot (3) and axis (3)
    force, _, *normal = push[:5]
    n, pressed = Vec3(*normal), force > 0.0
    if len(push) > 5:
        pressed = logical_or(pressed, push[5] > 0.5)
    # the normal of a handle turns with the tip
    if len(push) > 6:
        n = out_of_axis(tip, Vec3(*push[6:9]), Vec3(*push[9:]), push[5] > 0.5, n)
    return away - n * where(pressed, n.dot(away), 0.0)


def _unit(v: Components) -> Components:
    x, y, z = v
    length = divide(1.0, sqrt(x * x + y * y + z * z))
    return x * length, y * length, z * length
