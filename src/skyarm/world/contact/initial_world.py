"""Interpenetration of the initial world: vehicle and objects may start in the air or at rest on a surface."""

from __future__ import annotations

import numpy as np

from skyarm.algebra import Vec3
from skyarm.compile import leaves
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.records.coerce import concrete
from skyarm.records.files import shown
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.world.contact.carrier import NOBODY, CarriedFrame
from skyarm.world.contact.contact import Contact
from skyarm.world.contact.free_object import FreeObject
from skyarm.world.contact.surface import Surface

MOST = 2.0
"""Weights with which a surface may push a point at the start: what stands on one point takes one."""


def require_start_outside(contact: Contact, vehicle: Vehicle, gravity: float, state: State) -> None:
    """Refuse a start from which surfaces or objects would throw the vehicle or each other.

    Raises:
        ValueError: one line: the point, the surface, the depth.
    """
    motion, weight = PointMotion(vehicle, state), float(vehicle.mass) * gravity
    weights = [float(getattr(each, "mass", 0.0)) * gravity for each in contact.carriers]
    for each in contact.meetings(contact.start(1.0, ()), motion):
        touching = weight if each.by == NOBODY else weights[each.by]
        borne = max(touching, 1e-9 if each.of == NOBODY else weights[each.of])
        if float(each.touch.normal) > MOST * max(borne, 1e-9):
            ours, way = each.by == NOBODY, ""
            what = f"point {contact.points[each.index].name!r}" if ours else repr(contact.carriers[each.by].name)
            inside = f"surface {each.surface!r}" if ours and each.of == NOBODY else repr(each.surface)
            if ours and each.of == NOBODY:
                way = ", or at rest by initial.standing = true"
            elif 0 <= each.by < len(contact.objects):
                way = ", or at rest by standing = true"
            raise ValueError(
                f"world: {what} starts {float(each.touch.depth):.3g} m inside {inside}, which would push it with "
                f"{float(each.touch.normal):.3g} N: must start outside{way}"
            )
    require_places_apart(contact, gravity, MOST)


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
                    place = _common_place((a, frames[i]), (b, frames[j]), SHALLOW + pressed)
                    if place is not None:
                        boxes = all(isinstance(e, FreeObject) and e.standing and e.shape == "box" for e in (one, other))
                        raise ValueError(
                            f"world: {a.name!r} starts inside {b.name!r}, both are at {shown(place)} m: must start "
                            f"outside of each other{PAST if boxes else ''}"
                        )


def _common_place(a: tuple[Surface, CarriedFrame], b: tuple[Surface, CarriedFrame], deep: float) -> list[float] | None:
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


def require_steps_to_fly(contact: Contact, least: float) -> None:
    """Refuse a world whose contact requires integration steps below a least one (s), a share of the control period.

    Raises:
        ValueError: one line: the part that requires them, and the shortest step allowed.
    """
    if not concrete(*leaves(contact)):
        return  # of a batch: its lanes are looked at one by one
    allowed = f"must leave them {least:g} s or more, a thousandth of the control period"
    try:
        steps = [(what, float(step)) for what, step in contact.steps]
    except ArithmeticError:  # of numbers beyond measure
        raise ValueError(f"world: has no integration steps in contact: {allowed}") from None
    for what, step in steps:
        if not step >= least:
            raise ValueError(f"world: {what} asks for integration steps of {step:.2g} s in contact: {allowed}")
