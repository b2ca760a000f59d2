"""Checks of the initial world: interpenetration, and the clearance between vehicle and
surfaces.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.vehicle import Vehicle
from skyarm.world.contact.carrier import NOBODY
from skyarm.world.contact.contact import Contact
from skyarm.world.contact.shape_pairs import places
from skyarm.world.contact.vehicle_bodies import touch_of_bodies

MOST = 2.0
"""Largest weight of a contact point in the initial equilibrium; a body on one point
needs one."""


def require_start_outside(
    contact: Contact, vehicle: Vehicle, gravity: float, state: State
) -> None:
    """Refuse an initial state in which a contact force exceeds twice the weight of the
    bodies in contact.

    Raises:
        ValueError: one line: the point, the surface, the depth.
    """
    motion = PointMotion(vehicle, state)
    weight = float(vehicle.mass) * gravity
    weights = [float(getattr(each, "mass", 0.0)) * gravity for each in contact.carriers]
    # neither period nor draws enter the first state of a contact
    for each in contact.meetings(contact.start(1.0, ()), motion):
        touching = weight if each.by == NOBODY else weights[each.by]
        # the heavier of the two: a light body may lie on a heavy one, and the reverse;
        # without weight any force is too large
        borne = max(touching, 1e-9 if each.of == NOBODY else weights[each.of])
        if float(each.touch.normal) > MOST * max(borne, 1e-9):
            what, inside, way = "", repr(each.surface), ""
            if each.by == NOBODY:
                what = f"point {contact.points[each.index].name!r}"
                if each.of == NOBODY:
                    inside = f"surface {inside}"
                    way = ", or at rest by initial.standing = true"
            else:
                what = repr(contact.carriers[each.by].name)
                if each.by < len(contact.objects):
                    way = ", or at rest by standing = true"
            raise ValueError(
                f"world: {what} starts {float(each.touch.depth):.3g} m inside {inside},"
                f" which would push it with {float(each.touch.normal):.3g} N: must"
                f" start outside{way}"
            )


def require_bodies_apart(contact: Contact, motion: PointMotion) -> None:
    """Refuse initial states in which shapes press with more than twice the weight of
    the heavier of two bodies.

    Raises:
        ValueError: one line: both bodies, the depth, the force.
    """
    vehicles = [motion.of(each.agent).vehicle for each in contact.vehicle_bodies]
    others: dict[str, Sequence[object]] = {
        "surface": contact.surfaces,
        "carrier": contact.carriers,
        "body": vehicles,
    }
    for pair, record in contact.body_records(contact.start(1.0, ()), motion):
        both = vehicles[pair.body], others[pair.other][pair.index]
        mass = max(float(getattr(each, "mass", 0.0)) for each in both)
        touch = touch_of_bodies(record)
        normal, depth = float(touch.normal), float(touch.depth)
        # 1e-9 N: without weight any force is too large
        if normal > MOST * max(mass * float(motion.gravity), 1e-9):
            raise ValueError(
                f"world: {pair.name} start {depth:.3g} m inside each other, which would"
                f" push them with {normal:.3g} N: must start apart, at rest by"
                " initial.standing = true, or be a pair of world.ignore"
            )


def initial_clearance(
    contact: Contact, vehicle: Vehicle, state: State
) -> tuple[float, str, str]:
    """Smallest distance (m) of the vehicle's points and shapes from a surface, negative
    inside.

    With it come words for the point or body, and the name of the surface. Infinite
    where nothing can touch.
    """
    # an empty name fits points of any agent
    contact = contact.on({"": vehicle})
    memory, motion = contact.start(1.0, ()), PointMotion(vehicle, state)
    found = [
        (
            -float(each.touch.depth),
            f"point {contact.points[each.index].name!r}",
            each.surface,
        )
        for each in contact.meetings(memory, motion)
        if each.by == NOBODY
    ]
    for pair, (a, b, *_) in contact.body_records(memory, motion):
        body = contact.vehicle_bodies[pair.body].name
        for one, other in product(a.parts, b.parts):
            both = one.in_world(a.frame), other.in_world(b.frame)
            depth = max(float(deep) for _, deep, _ in places(*both))
            found.append((-depth, f"body {body!r}", pair.name[len(body) + 1 :]))
    return min(found, default=(math.inf, "", ""))
