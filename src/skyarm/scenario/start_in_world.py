"""A vehicle, and every object, may start in the air or at rest on a surface, not inside of one."""

from __future__ import annotations

import numpy as np

from skyarm.algebra import Vec3
from skyarm.compile import leaves
from skyarm.contact.carrier import NOBODY, CarriedFrame
from skyarm.contact.contact import Contact
from skyarm.contact.free_object import FreeObject
from skyarm.contact.surface import Surface
from skyarm.dynamics.point_motion import PointMotion
from skyarm.files import shown
from skyarm.plant.largest_step import MOST_STEPS
from skyarm.records.coerce import concrete
from skyarm.scenario.endings import BodyContact, RotorContact
from skyarm.scenario.scenario_record import Scenario, first_state

MOST = 2.0
"""Weights with which a surface may push a point at the start: what stands on one point takes one."""


def require_start_outside(scenario: Scenario) -> None:
    """Refuse a start from which the surfaces would throw the vehicle, or at which its rotors or joints are in one.

    Raises:
        ValueError: one line: the point, the surface, the depth.
    """
    for contact in scenario.worlds:
        state, vehicle = first_state(scenario), scenario.plant.vehicle
        if not concrete(*leaves((contact, state, scenario.plant.gravity, vehicle.mass))):
            return  # of a batch: each lane shows itself
        memory, motion = contact.start(1.0, ()), PointMotion(vehicle, state)
        weight = float(vehicle.mass) * float(scenario.plant.gravity)
        for (surface, point), touch in zip(contact.pairs, contact.touches(memory, motion), strict=True):
            if float(touch.normal) > MOST * max(weight, 1e-9):
                raise ValueError(
                    f"world: point {point.name!r} starts {float(touch.depth):.3g} m inside surface {surface.name!r}, "
                    f"which would push it with {float(touch.normal):.3g} N: must start outside, or at rest by "
                    "initial.standing = true"
                )
        _require_objects_outside(contact, motion, weight, float(scenario.plant.gravity))
        require_places_apart(contact, float(scenario.plant.gravity), MOST)
        for ending in (RotorContact(), BodyContact()):
            if not ending.fine(scenario, state, state.position, 0):
                cause = ending.cause(scenario, state, state.position)
                raise ValueError(f"world: {cause} at the start: must start outside")


def _require_objects_outside(contact: Contact, motion: PointMotion, weight: float, gravity: float) -> None:
    """The same of objects, in surfaces and in each other, and of the vehicle's points in objects."""
    weights = [float(getattr(each, "mass", 0.0)) * gravity for each in contact.carriers]
    for each in contact.meetings(contact.start(1.0, ()), motion)[len(contact.pairs) :]:
        touching = weight if each.by == NOBODY else weights[each.by]
        borne = max(touching, 1e-9 if each.of == NOBODY else weights[each.of])
        if float(each.touch.normal) > MOST * max(borne, 1e-9):
            what = (
                f"point {contact.points[each.index].name!r}"
                if each.by == NOBODY
                else repr(contact.carriers[each.by].name)
            )
            way = ", or at rest by standing = true" if 0 <= each.by < len(contact.objects) else ""
            raise ValueError(
                f"world: {what} starts {float(each.touch.depth):.3g} m inside {each.surface!r}, which would push "
                f"it with {float(each.touch.normal):.3g} N: must start outside{way}"
            )


SHARES = (-0.97, -0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9, 0.97)
"""Of half the length that may be in the other body, at which places are looked at along each axis."""

PAST = "; a box carries another only where corners of one lie within a face of the other"
"""Said where two boxes that stand have come into one place, as those of one size do: the corners are on edges."""

SHALLOW = 1e-3
"""m inside both bodies that is let pass, beside how deep weights press them."""


def require_places_apart(contact: Contact, gravity: float, most: float) -> None:
    """Refuse a world in which an object starts inside another body.

    Args:
        contact: of floats.
        gravity: m/s^2.
        most: weights with which what touches may be pressed.

    Raises:
        ValueError: one line: both, and a place inside of both.
    """
    frames = [each.frame(each.start()) for each in contact.carriers]
    weights = [float(getattr(each, "mass", 0.0)) * abs(gravity) for each in contact.carriers]
    for i, one in enumerate(contact.carriers):
        for j, other in enumerate(contact.carriers[:i]):
            if not (one.spot_count or other.spot_count):
                continue  # mechanisms pass through each other
            for a in one.surfaces:
                for b in other.surfaces:
                    pressed = most * max(weights[i], weights[j]) / min(a.material.stiffness, b.material.stiffness)
                    place = _shared((a, frames[i]), (b, frames[j]), SHALLOW + pressed)
                    if place is not None:
                        boxes = all(isinstance(e, FreeObject) and e.standing and e.shape == "box" for e in (one, other))
                        raise ValueError(
                            f"world: {a.name!r} starts inside {b.name!r}, both are at {shown(place)} m: must start "
                            f"outside of each other{PAST if boxes else ''}"
                        )


def _shared(a: tuple[Surface, CarriedFrame], b: tuple[Surface, CarriedFrame], deep: float) -> list[float] | None:
    """The place (m, world axes) that is deepest inside of both, by more than ``deep`` (m); None without one."""
    (one, of_one), (other, of_other) = a, b
    away = [float(c) for c in _middle(*a) - _middle(*b)]
    if np.linalg.norm(away) > float(one.farthest) + float(other.farthest):
        return None
    for places in (_lattice(*a, b), _lattice(*b, a)):
        least = np.minimum(of_one.depth(one, places, 0)[0], of_other.depth(other, places, 0)[0])
        if least.max() > deep:
            return [round(float(np.broadcast_to(c, least.shape)[least.argmax()]), 4) for c in places]
    return None


def _middle(surface: Surface, frame: CarriedFrame) -> Vec3:
    """World axes, m."""
    return frame.position + frame.rotation.apply(surface.position)


def _lattice(surface: Surface, frame: CarriedFrame, other: tuple[Surface, CarriedFrame]) -> Vec3:
    """Places in the box about a shape, where another one may be, m, world axes: arrays of one length."""
    middle, reach = _middle(surface, frame), float(other[0].farthest)
    toward = surface.rotation.apply_T(frame.rotation.apply_T(_middle(*other) - middle))
    along = []
    for (low, high), at in zip(_ends(surface), toward, strict=True):
        first, last = max(low, float(at) - reach), min(high, float(at) + reach)
        along.append(0.5 * (first + last) + 0.5 * (last - first) * np.array(SHARES))
    found = [np.ravel(each) for each in np.meshgrid(*along)]
    return middle + frame.rotation.apply(surface.rotation.apply(Vec3(*found)))


def _ends(surface: Surface) -> list[tuple[float, float]]:
    """First and last coordinate along each of a shape's axes, m."""
    if surface.shape == "hole":
        outer, length = (float(each) for each in surface.size[3:])
        return [(-outer, outer), (-outer, outer), (-length, 0.0)]
    if surface.shape == "box":
        return [(-0.5 * float(each), 0.5 * float(each)) for each in surface.size]
    radius = float(surface.size[0])
    half = 0.5 * float(surface.size[1]) if surface.shape == "cylinder" else radius
    return [(-radius, radius), (-radius, radius), (-half, half)]


def require_steps_to_fly(contact: Contact, period: float) -> None:
    """Refuse a world whose contact requires more steps of a control period (s) than ``MOST_STEPS``.

    Raises:
        ValueError: one line: the part that requires them, and the shortest step allowed.
    """
    if not concrete(*leaves(contact)):
        return  # of a batch: its lanes are looked at one by one
    least = period / MOST_STEPS
    allowed = f"must leave them {least:g} s or more, a thousandth of the control period"
    try:
        steps = [(what, float(step)) for what, step in contact.steps]
    except ArithmeticError:  # of numbers beyond measure
        raise ValueError(f"world: has no integration steps in contact: {allowed}") from None
    for what, step in steps:
        if not step >= least:
            raise ValueError(f"world: {what} asks for integration steps of {step:.2g} s in contact: {allowed}")
