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
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.select import data
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, add, divide, maximum, mul, sqrt, sub


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
