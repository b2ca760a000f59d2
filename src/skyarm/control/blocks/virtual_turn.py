"""A virtual body that gives way to a torque: inertia, damping and stiffness of one's choice, about three axes.

Its orientation against the reference is E = exp([theta]), and the rotation vector theta (rad, along fixed axes) is its
coordinate. With the kinetic energy theta'^T J theta' / 2, the elastic energy theta^T K theta / 2 and the losses
theta'^T D theta', J, D and K diagonal, Lagrange's equation is

    J theta'' + D theta' + K theta = A(theta)^T tau,        w = A(theta) theta',

A the left Jacobian of SO(3), so that the work of the torque is tau . w at any angle: the body is passive for any
numbers that are not negative, and an axis of inertia 0 stays where it is. About one axis A does nothing, and the
equation is J w' + D w + K theta = tau of textbooks; a constant torque about an axis of K turns it by tau / K. Across
the axis of an offset by the angle a the inertia that is felt is J ((a / 2) / sin(a / 2))^2: 9 % more at 1 rad.

The torque is heard late, and the equation is solved, as in :mod:`skyarm.control.blocks.virtual_tip`.
Source: Caccavale, Natale, Siciliano, Villani 1999, "Six-DOF impedance control based on angle/axis representations",
IEEE Trans. Robotics and Automation 15(2), (13)-(15) for coordinates of orientation; Bullo, Murray 1995, Lemma 3 (A).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.control.blocks.virtual_tip import Compliance, VirtualTip, along_world, moved_tip
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, cos, divide, sin, sqrt, where
from skyarm.scalars.taylor import Taylor, chosen

SMALL = 1e-2
"""rad; below it the factors of A are taken from their series, whose next terms are below 1e-11 there."""


@dataclass(frozen=True, kw_only=True, slots=True)
class RotationalCompliance:
    """How a virtual body gives way about three axes.

    Attributes:
        inertia, damping, stiffness: about each axis; a structural 0 of the inertia holds it.
        lead: by how long the torque is known late. axes: unit vectors, world axes; empty for those of the world.
    """

    inertia: Annotated[tuple[Scalar, ...], Unit("kg m^2", "of the virtual body about each axis; 0 holds it", low=0.0)]
    damping: Annotated[tuple[Scalar, ...], Unit("N m s/rad", "about each axis", low=0.0)]
    stiffness: Annotated[tuple[Scalar, ...], Unit("N m/rad", "about each axis, towards the reference", low=0.0)]
    lead: Annotated[Scalar, Unit("s", "by how long the torque is known late", low=0.0)]
    axes: Annotated[tuple[Vec3, ...], Unit("", "unit vectors, world axes; none for those of the world")] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class VirtualTurn:
    """Memory of the virtual body, along its axes.

    Attributes:
        angle: theta. rate: of theta, without what the lead adds.
    """

    angle: Annotated[tuple[Scalar, ...], Unit("rad", "rotation vector from the reference, along each axis")]
    rate: Annotated[tuple[Scalar, ...], Unit("rad/s", "of the rotation vector, without the torque's lead")]


NOT_TURNED = VirtualTurn(angle=(0.0, 0.0, 0.0), rate=(0.0, 0.0, 0.0))


def moved_turn(
    gains: RotationalCompliance, memory: VirtualTurn, torque: Vec3, dt: Any
) -> tuple[VirtualTurn, tuple[Vec3, ...]]:
    """One period of the virtual body.

    Args:
        gains: constants.
        memory: one period earlier.
        torque: N m, world axes, that turns it in this period.
        dt: s.

    Returns:
        The memory, and the rotation vector with two derivatives (rad, rad/s, rad/s^2, world axes).
    """
    along = Compliance(
        mass=gains.inertia, damping=gains.damping, stiffness=gains.stiffness, lead=gains.lead, axes=gains.axes
    )
    before = along_world(gains.axes, memory.angle)
    body, vector = moved_tip(along, VirtualTip(place=memory.angle, rate=memory.rate), pulled(before, torque), dt)
    return VirtualTurn(angle=body.place, rate=body.rate), vector


def pulled(theta: Vec3, torque: Vec3) -> Vec3:
    """A(theta)^T tau: what a torque (N m, world axes) does to the rotation vector (rad, world axes)."""
    square = theta.dot(theta)
    small = square < SMALL * SMALL
    angle = sqrt(where(small, 1.0, square))
    # (1 - cos a) / a^2 and (a - sin a) / a^3
    first = where(small, 0.5 - square / 24.0 + square * square / 720.0, divide(1.0 - cos(angle), angle * angle))
    second = where(
        small,
        1.0 / 6.0 - square / 120.0 + square * square / 5040.0,
        divide(angle - sin(angle), angle * angle * angle),
    )
    across = theta.cross(torque)
    found: Vec3 = torque - across * first + theta.cross(across) * second
    return found


def turned_by(vector: tuple[Vec3, ...]) -> Mat3:
    """The rotation E of a rotation vector with two derivatives (rad and per s): every entry a series in time."""
    theta = Vec3(*(Taylor.of_derivatives(each) for each in zip(*vector, strict=True)))
    square = theta.dot(theta)
    small = square < SMALL * SMALL
    # the root never sees zero; next terms of the series of sin(a/2)/a and cos(a/2) are below 1e-16
    angle = sqrt(chosen(small, Taylor.constant(1.0, len(square.c) - 1), square))
    factor = chosen(small, 0.5 - square * (1.0 / 48.0) + square * square * (1.0 / 3840.0), sin(angle * 0.5) / angle)
    w = chosen(small, 1.0 - square * 0.125 + square * square * (1.0 / 384.0), cos(angle * 0.5))
    return Quaternion(w, factor * theta.x, factor * theta.y, factor * theta.z).rotation()
