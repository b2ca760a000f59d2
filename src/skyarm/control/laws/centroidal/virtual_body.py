"""Virtual body of an admittance: mass, damping and stiffness along three axes.

The offset x of the reference along each axis is the motion of

    M x'' + D x' + K x = f(t),

and f is measured only as g, late by a known time T: of first order g' = (f - g) / T, or two filters of T / 2. The
velocity is therefore v = w + T g / M, with M w' = g - D v - K x: the motion above with g + T g' in place of g, which is
f to second order of the lag, and nothing is differentiated. A body that damper or spring stop sooner than within T has
not gathered the impulse T f: for it the lead is M / D or sqrt(M / K).

Trapezoidal rule, stable for any numbers that are not negative. An axis of inertia 0 stays where it is.
Source: Hogan 1985, "Impedance control"; Villani, De Schutter, "Force control", Springer Handbook of Robotics 2016, 9.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import Scalar, divide, maximum, sqrt
from skyarm.control.blocks.select import data
from skyarm.records.units import Unit


@dataclass(frozen=True, kw_only=True, slots=True)
class Compliance:
    """Constants along the axes (unit vectors; empty for those of the world); a structural inertia 0 holds one."""

    inertia: Annotated[tuple[Scalar, ...], Unit("kg", "of the virtual body; 0 holds an axis", low=0.0)]
    damping: Annotated[tuple[Scalar, ...], Unit("N s/m", "along each axis", low=0.0)]
    stiffness: Annotated[tuple[Scalar, ...], Unit("N/m", "towards the reference", low=0.0)]
    lead: Annotated[Scalar, Unit("s", "lag of the measured force", low=0.0)]
    axes: Annotated[tuple[Vec3, ...], Unit("", "unit vectors, world axes; none for those of the world")] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class VirtualBody:
    """Memory of the virtual body, along its axes: x and w."""

    offset: Annotated[tuple[Scalar, ...], Unit("m", "from the reference, along each axis")] = (0.0, 0.0, 0.0)
    rate: Annotated[tuple[Scalar, ...], Unit("m/s", "along each axis, without the lead")] = (0.0, 0.0, 0.0)


def move(gains: Compliance, memory: VirtualBody, force: Vec3, dt: Any) -> tuple[VirtualBody, tuple[Vec3, ...]]:
    """Memory and offset with two derivatives (m, m/s, m/s^2, world axes) one period later, under a force in N."""
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
