"""Bristles of what stands at the start: bent as far as friction holds the part of the weight across the surfaces."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from skyarm.algebra import E_Z, ZERO3, Vec3
from skyarm.algebra.scalars import Scalar, divide, maximum, minimum, sqrt
from skyarm.dynamics.point_motion import PointMotion
from skyarm.world.contact.carrier import NOBODY

if TYPE_CHECKING:
    from skyarm.world.contact.contact import Contact, ContactMemory

_NOTHING = 1e-12
"""N or m in a denominator."""


def with_standing_bristles(
    contact: Contact, memory: ContactMemory, motion: PointMotion, *, vehicle: bool
) -> ContactMemory:
    """Internal state of the contact model in which friction holds what stands, each body by itself.

    Args:
        contact: model.
        memory: at the start.
        motion: of the vehicle, with gravity.
        vehicle: whether it stands, too.
    """
    weights: dict[int, Scalar] = {
        i: each.mass * motion.gravity for i, each in enumerate(contact.objects) if each.standing
    }
    if vehicle:
        weights[NOBODY] = motion.vehicle.mass * motion.gravity
    if not weights:
        return memory
    meetings, bristles = contact.meetings(memory, motion), list(memory.bristles)
    materials = {each.name: each.material for _, each in contact.every_surface}
    for by, weight in weights.items():
        force, pressed = ZERO3, 0.0
        for each in meetings:
            if each.by == by:
                force, pressed = force + each.touch.axis * each.touch.normal, pressed + each.touch.normal
        across = E_Z * weight - force
        for i, each in enumerate(meetings):
            if each.by == by:
                material = materials[each.surface]
                held = across - each.touch.axis * across.dot(each.touch.axis)
                bent = held * -divide(material.bristle_length, maximum(material.friction * pressed, _NOTHING))
                size = sqrt(bent.dot(bent) + _NOTHING * _NOTHING)
                share = minimum(divide(material.bristle_length, size), 1.0)
                bristles[i] = Vec3(*(c * share for c in bent))
    return replace(memory, bristles=tuple(bristles))
