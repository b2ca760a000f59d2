"""Mechanisms of the world: bodies with one degree of freedom that carry surfaces, as doors, valves, drawers, buttons.

With the coordinate q (rad of a hinge, m of a slide) and the inertia m (kg m^2 or kg)

    m d2q/dt2 = applied + weight - k (q - rest) - c dq/dt - friction - detent(q) + stops,

where applied is what touches the mechanism, along or about its axis. Dry friction is a bristle, as that of contacts: it
holds a mechanism at rest up to its full value. A detent is a hump of force over a way w that it is left over,

    detent(q) = 16 F u^2 (1 - u)^2,  u = (q - place) / w between 0 and 1,

at most F, against growing q: a latch that holds until it is overcome and draws the door shut again, or the click of a
button. It is the slope of a potential and neither takes nor gives energy. A stop pushes back as a surface does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from skyarm.algebra import Vec3
from skyarm.contact.material import BRISTLE_STEP, LONGEST, Material, euler_step_of
from skyarm.records.coerce import concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, clip, divide, maximum, minimum, sqrt

if TYPE_CHECKING:
    from skyarm.contact.mechanism import Mechanism

BRISTLES = {True: 2e-3, False: 2e-4}
"""rad of a hinge, m of a slide, over which dry friction builds up where nothing is said."""

STOP_RATE, STOP_LEAST = 200.0, 5000.0
"""rad/s of a mechanism on a stop of which nothing is said, and N/m that such a stop of a slide has at least: a door
enters it by 5 mrad at 1 rad/s, a button of 20 g gives way by 0.2 mm under 1 N; neither asks for shorter steps than
contact does anyway."""

STEEPEST = 16.0 / 3.0**1.5
"""Largest slope of a detent, in F / w: that of 16 u^2 (1 - u)^2, at u = (1 - 3^-0.5) / 2."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Detent:
    """A detent is a hump of force that is overcome: a latch, or a click.

    Attributes:
        place: coordinate at which it begins. width: way to its end; it is highest in the middle.
    """

    force: Annotated[Scalar, Unit("N m or N", "largest, against growing coordinates", low=0.0)]
    width: Annotated[Scalar, Unit("rad or m", "from its beginning to its end", low=0.0, strict=True)]
    place: Annotated[Scalar, Unit("rad or m", "where it begins")] = 0.0

    def __post_init__(self) -> None:
        accept_fields(self, "detent")

    def at(self, coordinate: Any) -> Any:
        """What it asks for, N m or N."""
        u = clip((coordinate - self.place) * (1.0 / self.width), 0.0, 1.0)
        hump = u * (1.0 - u)
        return (16.0 * self.force) * (hump * hump)


@dataclass(frozen=True, kw_only=True, slots=True)
class MechanismMotion:
    """Motion of a mechanism: rad and rad/s, or m and m/s; and the bend of its friction's bristle, where it has one."""

    coordinate: Any
    rate: Any
    bristle: tuple[Any, ...]


def inner_effort(of: Mechanism, memory: MechanismMotion) -> tuple[Any, tuple[Any, ...]]:
    """What spring, damping, detent, stops and friction push with (N m or N), and the rate of friction's bristle."""
    q, rate = memory.coordinate, memory.rate
    effort = -of.stiffness * (q - of.rest) - of.damping * rate
    if of.detent is not None:
        effort = effort - of.detent.at(q)
    if _at_stop(of.lower):
        effort = effort + stop_of(of).normal_force(of.lower - q, -rate, stop_of(of).step_of(of.moved))
    if _at_stop(of.upper):
        effort = effort - stop_of(of).normal_force(q - of.upper, rate, stop_of(of).step_of(of.moved))
    if not memory.bristle:
        return effort, ()
    length, (z,) = bristle_of(of), memory.bristle
    # one axis of a contact's bristle
    fastest = length / longest_step(of)
    bending = Material(bristle_length=length).bristle_rate(Vec3(z, 0, 0), Vec3(rate, 0, 0), 1.0, fastest).x
    held = of.friction / length
    # half of critical damping: vibration of the bristle dies away
    wanted = held * z + sqrt(held * of.moved) * bending
    return effort - clip(wanted, -of.friction, of.friction), (bending,)


def longest_step(of: Mechanism, *, euler: bool = False) -> Any:
    """Longest integration step (s) that a mechanism's springs, friction and stops bear; of semi-implicit Euler's too.

    That method of an oscillator of frequency w and decay d = c / m is stable while (w h)^2 + 2 d h < 4.
    """
    stiffness, damping = of.stiffness, of.damping
    if type(of.friction) is not int:
        held = of.friction / bristle_of(of)
        stiffness, damping = stiffness + held, damping + sqrt(held * of.moved)
    if of.detent is not None:
        stiffness = stiffness + STEEPEST * of.detent.force / of.detent.width
    fastest = maximum(sqrt(stiffness / of.moved), of.damping / of.moved)
    step = minimum(divide(BRISTLE_STEP, fastest), LONGEST)
    if euler:
        step = minimum(step, euler_step_of(stiffness / of.moved, damping / of.moved))
    return minimum(step, stop_of(of).step_of(of.moved)) if _at_stop(of.lower) or _at_stop(of.upper) else step


def stop_of(of: Mechanism) -> Material:
    """A stop as what a surface is to a point: rad and N m in place of m and N where it turns."""
    stiffness = of.stop_stiffness
    if type(stiffness) is int:
        stiffness = STOP_RATE * STOP_RATE * of.moved
        stiffness = stiffness if of.turns else maximum(stiffness, STOP_LEAST)
    return Material(stiffness=stiffness, dissipation=of.stop_damping, friction=0.0)


def bristle_of(of: Mechanism) -> Any:
    """Slip at which dry friction is whole, rad or m."""
    return BRISTLES[of.turns] if type(of.bristle) is int else of.bristle


def _at_stop(limit: Any) -> bool:
    """Whether there is a stop, by structure."""
    return not (concrete(limit) and math.isinf(limit))
