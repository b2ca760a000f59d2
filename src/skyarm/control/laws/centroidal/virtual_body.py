"""A virtual tip that gives way to a force: mass, damping and stiffness of one's choice, along three axes.

The offset x of the reference that a law tracks, along each axis by itself, is the motion of

    M x'' + D x' + K x = f(t),

and f is heard only as g, late by a known time T: of first order g' = (f - g) / T, or two filters of T / 2. The velocity
is therefore taken as v = w + T g / M, with M w' = g - D v - K x: both equations together are the ones above with
g + T g' in place of g, which is f to second order of the lag, and nothing is differentiated. A body that damper or
spring stop sooner than within T has not gathered the impulse T f: for it the lead is M / D or sqrt(M / K), with which
the velocity that comes with the first force heard is no more than the body's own.

Trapezoidal rule, stable for any numbers that are not negative. An axis of mass 0 stays where it is.
Source: Hogan 1985, "Impedance control"; Villani, De Schutter, "Force control", Springer Handbook of Robotics 2016, 9.2.

A virtual body that gives way to a torque: inertia, damping and stiffness of one's choice, about three axes.

Its orientation against the reference is E = exp([theta]), and the rotation vector theta (rad, along fixed axes) is its
coordinate. With the kinetic energy theta'^T J theta' / 2, the elastic energy theta^T K theta / 2 and the losses
theta'^T D theta', J, D and K diagonal, Lagrange's equation is

    J theta'' + D theta' + K theta = A(theta)^T tau,        w = A(theta) theta',

A the left Jacobian of SO(3), so that the work of the torque is tau . w at any angle: the body is passive for any
numbers that are not negative, and an axis of inertia 0 stays where it is. About one axis A does nothing, and the
equation is J w' + D w + K theta = tau of textbooks; a constant torque about an axis of K turns it by tau / K. Across
the axis of an offset by the angle a the inertia that is felt is J ((a / 2) / sin(a / 2))^2: 9 % more at 1 rad.

The torque is heard late, and the equation is solved, as in :mod:`skyarm.control.laws.centroidal.virtual_body`.
Source: Caccavale, Natale, Siciliano, Villani 1999, "Six-DOF impedance control based on angle/axis representations",
IEEE Trans. Robotics and Automation 15(2), (13)-(15) for coordinates of orientation; Bullo, Murray 1995, Lemma 3 (A).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.control.blocks.select import data
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, add, cos, divide, maximum, mul, sin, sqrt, sub, where
from skyarm.scalars.taylor import Taylor, chosen


@dataclass(frozen=True, kw_only=True, slots=True)
class Compliance:
    """How a virtual body gives way along three axes.

    Attributes:
        mass, damping, stiffness: of each axis; a structural 0 of the mass holds it.
        lead: by how long the force is known late. axes: unit vectors, world axes; empty for those of the world.
    """

    mass: Annotated[tuple[Scalar, ...], Unit("kg", "of the virtual tip along each axis; 0 holds it", low=0.0)]
    damping: Annotated[tuple[Scalar, ...], Unit("N s/m", "along each axis", low=0.0)]
    stiffness: Annotated[tuple[Scalar, ...], Unit("N/m", "along each axis, towards the reference", low=0.0)]
    lead: Annotated[Scalar, Unit("s", "by how long the force is known late", low=0.0)]
    axes: Annotated[tuple[Vec3, ...], Unit("", "unit vectors, world axes; none for those of the world")] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class VirtualTip:
    """Memory of the virtual tip, along its axes.

    Attributes:
        place: x. rate: w, the velocity without what the lead adds.
    """

    place: Annotated[tuple[Scalar, ...], Unit("m", "from the reference, along each axis")]
    rate: Annotated[tuple[Scalar, ...], Unit("m/s", "along each axis, without the force's lead")]


AT_REST = VirtualTip(place=(0.0, 0.0, 0.0), rate=(0.0, 0.0, 0.0))


def moved_tip(gains: Compliance, memory: VirtualTip, force: Vec3, dt: Any) -> tuple[VirtualTip, tuple[Vec3, ...]]:
    """One period of the virtual tip.

    Args:
        gains: constants.
        memory: one period earlier.
        force: N, world axes, that pushes it in this period.
        dt: s.

    Returns:
        The memory, and the offset with two derivatives (m, m/s, m/s^2, world axes).
    """
    along = [axis.dot(force) for axis in gains.axes] if gains.axes else list(force)
    places, rates, rows = [], [], []
    for M, D, K, x, w, f in zip(
        gains.mass, gains.damping, gains.stiffness, memory.place, memory.rate, along, strict=True
    ):
        if type(M) is int:  # held: structure
            places.append(data(x))
            rates.append(data(w))
            rows.append((0, 0, 0))
            continue
        after, rate, motion = _moved(M, D, K, x, w, f, gains.lead, dt)
        places.append(after)
        rates.append(rate)
        rows.append(motion)
    offset = tuple(along_world(gains.axes, [row[k] for row in rows]) for k in range(3))
    return VirtualTip(place=tuple(places), rate=tuple(rates)), offset


def _moved(M: Any, D: Any, K: Any, x: Any, w: Any, f: Any, lead: Any, dt: Any) -> tuple[Any, Any, tuple[Any, Any, Any]]:
    """Place and rate of one axis one period later; place, velocity and acceleration then."""
    per = divide(1.0, M)
    d, k, half = mul(D, per), mul(K, per), mul(0.5, dt)
    slowed = maximum(maximum(mul(lead, d), 1.0), sqrt(maximum(mul(mul(lead, lead), k), 1.0)))
    ahead = mul(mul(divide(lead, slowed), per), f)
    # w+ = w + h/2 (a + a+), x+ = x + h/2 (v + v+), v = w + ahead, a = f/M - d v - k x
    pushed = sub(mul(per, f), mul(d, ahead))
    before = sub(sub(pushed, mul(d, w)), mul(k, x))
    # a+ with w+ = w + h/2 (a + a+) and x+ = x + h (v + h/4 (a + a+)) put in
    share = add(mul(half, d), mul(mul(half, half), k))
    known = sub(before, mul(mul(dt, k), add(w, ahead)))
    then = divide(sub(known, mul(share, before)), add(1.0, share))
    rate = add(w, mul(half, add(before, then)))
    velocity = add(rate, ahead)
    place = add(x, mul(half, add(add(w, ahead), velocity)))
    return place, rate, (place, velocity, then)


def along_world(axes: Sequence[Vec3], values: Sequence[Any]) -> Vec3:
    """A vector along the axes as one along those of the world."""
    if not axes:
        return Vec3(*values)
    first, second, third = (axis * value for axis, value in zip(axes, values, strict=True))
    total: Vec3 = first + second + third
    return total


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
