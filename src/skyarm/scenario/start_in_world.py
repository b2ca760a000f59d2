"""A vehicle, and every object, may start in the air or at rest on a surface, not inside of one."""

from __future__ import annotations

from skyarm.compile import leaves
from skyarm.contact.carrier import NOBODY
from skyarm.contact.contact import Contact
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.coerce import concrete
from skyarm.scenario.endings import BodyContact, RotorContact
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.scenario.shared_places import require_places_apart

MOST = 2.0
"""Weights with which a surface may push a point at the start: what stands on one point takes one."""


def require_start_outside(scenario: Scenario) -> None:
    """Refuse a start from which the surfaces would throw the vehicle, or at which its rotors or joints are in one.

    Raises:
        ValueError: one line: the point, the surface, the depth.
    """
    for contact in scenario.contacts:
        state, vehicle = first_state(scenario), scenario.world.vehicle
        if not concrete(*leaves((contact, state, scenario.world.gravity, vehicle.mass))):
            return  # of a batch: each lane shows itself
        memory, motion = contact.start(1.0, ()), PointMotion(vehicle, state)
        weight = float(vehicle.mass) * float(scenario.world.gravity)
        for (surface, point), touch in zip(contact.pairs, contact.touches(memory, motion), strict=True):
            if float(touch.normal) > MOST * max(weight, 1e-9):
                raise ValueError(
                    f"world: point {point.name!r} starts {float(touch.depth):.3g} m inside surface {surface.name!r}, "
                    f"which would push it with {float(touch.normal):.3g} N: must start outside, or at rest by "
                    "initial.standing = true"
                )
        _require_objects_outside(contact, motion, weight, float(scenario.world.gravity))
        require_places_apart(contact, float(scenario.world.gravity), MOST)
        for ending in (RotorContact(), BodyContact()):
            if not ending.fine(scenario, state, state.position, 0):
                cause = ending.cause(scenario, state, state.position)
                raise ValueError(f"world: {cause} at the start: must start outside")


def _require_objects_outside(contact: Contact, motion: PointMotion, weight: float, gravity: float) -> None:
    """The same of objects, in surfaces and in each other, and of the vehicle's points in objects."""
    weights = [float(getattr(each, "mass", 0.0)) * gravity for each in contact.carriers]
    for each in contact.meetings(contact.start(1.0, ()), motion):
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
