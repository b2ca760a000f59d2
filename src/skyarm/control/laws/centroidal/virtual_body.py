"""A virtual body that a force moves or a torque turns: inertia, damping and stiffness along or about three axes.

The offset x of the reference that a law tracks, along each axis by itself, is the motion of

    M x'' + D x' + K x = f(t),

and f is measured only as g, late by a known time T: of first order g' = (f - g) / T, or two filters of T / 2. The
velocity is therefore taken as v = w + T g / M, with M w' = g - D v - K x: both equations together are the ones above
with g + T g' in place of g, which is f to second order of the lag, and nothing is differentiated. A body that damper or
spring stop sooner than within T has not gathered the impulse T f: for it the lead is M / D or sqrt(M / K), with which
the velocity that comes with the first measured force is no more than the body's own.

Trapezoidal rule, stable for any numbers that are not negative. An axis of inertia 0 stays where it is.
Source: Hogan 1985, "Impedance control"; Villani, De Schutter, "Force control", Springer Handbook of Robotics 2016, 9.2.

Rotation: the orientation against the reference is E = exp([theta]), and the rotation vector theta (rad, along fixed
axes) is its coordinate. With the kinetic energy theta'^T J theta' / 2, the elastic energy theta^T K theta / 2 and the
losses theta'^T D theta', J, D and K diagonal, Lagrange's equation is

    J theta'' + D theta' + K theta = A(theta)^T tau,        w = A(theta) theta',

A the left Jacobian of SO(3), so that the work of the torque is tau . w at any angle: the body is passive. About one
axis A does nothing, and the equation is J w' + D w + K theta = tau of textbooks; a constant torque about an axis of K
turns it by tau / K. Across the axis of an offset by the angle a the apparent inertia is J ((a / 2) / sin(a / 2))^2: 9 %
more at 1 rad.
Source: Caccavale, Natale, Siciliano, Villani 1999, "Six-DOF impedance control based on angle/axis representations",
IEEE Trans. Robotics and Automation 15(2), (13)-(15) for coordinates of orientation; Bullo, Murray 1995, Lemma 3 (A).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.algebra.scalars import Scalar, cos, divide, maximum, sin, sqrt, where
from skyarm.algebra.scalars.taylor import Taylor, choose
from skyarm.control.blocks.select import data
from skyarm.records.units import Unit


@dataclass(frozen=True, kw_only=True, slots=True)
class Compliance:
    """Inertia, damping and stiffness of a virtual body along three axes, or about them.

    Attributes:
        inertia, damping, stiffness: of each axis; a structural 0 of the inertia holds it.
        lead: lag of the measured force or torque. axes: unit vectors, world axes; empty for those of the world.
    """

    inertia: Annotated[tuple[Scalar, ...], Unit("kg or kg m^2", "of the virtual body; 0 holds an axis", low=0.0)]
    damping: Annotated[tuple[Scalar, ...], Unit("N s/m or N m s/rad", "along or about each axis", low=0.0)]
    stiffness: Annotated[tuple[Scalar, ...], Unit("N/m or N m/rad", "towards the reference", low=0.0)]
    lead: Annotated[Scalar, Unit("s", "lag of the measured force or torque", low=0.0)]
    axes: Annotated[tuple[Vec3, ...], Unit("", "unit vectors, world axes; none for those of the world")] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class VirtualBody:
    """Memory of the virtual body, along its axes.

    Attributes:
        offset: x, or the rotation vector theta. rate: w, the velocity without what the lead adds.
    """

    offset: Annotated[tuple[Scalar, ...], Unit("m or rad", "from the reference, along each axis")] = (0.0, 0.0, 0.0)
    rate: Annotated[tuple[Scalar, ...], Unit("m/s or rad/s", "along each axis, without the lead")] = (0.0, 0.0, 0.0)


def move(gains: Compliance, memory: VirtualBody, force: Vec3, dt: Any) -> tuple[VirtualBody, tuple[Vec3, ...]]:
    """One period of translation.

    Args:
        gains: constants.
        memory: one period earlier.
        force: N, world axes, that pushes it in this period.
        dt: s.

    Returns:
        The memory, and the offset with two derivatives (m, m/s, m/s^2, world axes).
    """
    along = [axis.dot(force) for axis in gains.axes] if gains.axes else list(force)
    axes = zip(gains.inertia, gains.damping, gains.stiffness, memory.offset, memory.rate, along, strict=True)
    rates, motions = zip(*(_axis_step(axis, gains.lead, dt) for axis in axes), strict=True)
    offset = tuple(along_world(gains.axes, each) for each in zip(*motions, strict=True))
    held = [
        data(x) if type(M) is int else row[0] for M, x, row in zip(gains.inertia, memory.offset, motions, strict=True)
    ]
    return VirtualBody(offset=tuple(held), rate=rates), offset


def _axis_step(axis: Sequence[Any], lead: Any, dt: Any) -> tuple[Any, tuple[Any, Any, Any]]:
    """Rate of one axis one period later; offset, velocity, acceleration then, structural zeros where it is held."""
    M, D, K, x, w, f = axis
    if type(M) is int:
        return data(w), (0, 0, 0)
    per = divide(1.0, M)
    d, k, half = D * per, K * per, 0.5 * dt
    slowed = maximum(maximum(lead * d, 1.0), sqrt(maximum(lead * lead * k, 1.0)))
    ahead = divide(lead, slowed) * per * f
    # w+ = w + h/2 (a + a+), x+ = x + h/2 (v + v+), v = w + ahead, a = f/M - d v - k x
    before = per * f - d * ahead - d * w - k * x
    # a+ with w+ = w + h/2 (a + a+) and x+ = x + h (v + h/4 (a + a+)) put in
    share = half * d + half * half * k
    then = divide(before - dt * k * (w + ahead) - share * before, 1.0 + share)
    rate = w + half * (before + then)
    velocity = rate + ahead
    return rate, (x + half * (w + ahead + velocity), velocity, then)


def along_world(axes: Sequence[Vec3], values: Sequence[Any]) -> Vec3:
    """A vector along the axes as one along those of the world."""
    if not axes:
        return Vec3(*values)
    first, second, third = (axis * value for axis, value in zip(axes, values, strict=True))
    total: Vec3 = first + second + third
    return total


SMALL = 1e-2
"""rad; below it the factors of A are taken from their series, whose next terms are below 1e-11 there."""


def rotate(gains: Compliance, memory: VirtualBody, torque: Vec3, dt: Any) -> tuple[VirtualBody, tuple[Vec3, ...]]:
    """One period of rotation: the rotation vector with two derivatives (rad, rad/s, rad/s^2, world axes)."""
    return move(gains, memory, generalised_torque(along_world(gains.axes, memory.offset), torque), dt)


def generalised_torque(theta: Vec3, torque: Vec3) -> Vec3:
    """A(theta)^T tau of a torque (N m) at a rotation vector (rad), world axes."""
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


def rotation_series(vector: tuple[Vec3, ...]) -> Mat3:
    """The rotation E of a rotation vector with two derivatives (rad and per s): every entry a series in time."""
    theta = Vec3(*(Taylor.of_derivatives(each) for each in zip(*vector, strict=True)))
    square = theta.dot(theta)
    small = square < SMALL * SMALL
    # the root never sees zero; next terms of the series of sin(a/2)/a and cos(a/2) are below 1e-16
    angle = sqrt(choose(small, Taylor.constant(1.0, len(square.c) - 1), square))
    factor = choose(small, 0.5 - square * (1.0 / 48.0) + square * square * (1.0 / 3840.0), sin(angle * 0.5) / angle)
    w = choose(small, 1.0 - square * 0.125 + square * square * (1.0 / 384.0), cos(angle * 0.5))
    return Quaternion(w, factor * theta.x, factor * theta.y, factor * theta.z).rotation()
