"""Contact on a plant with a contact solver of its own.

The formulas of :mod:`skyarm.world.contact.contact_point` do not apply there. The plant moves the bodies of the world
and
writes after every control period into the memory the forces on each of the vehicle's points; logs and sensors of force
read them there. Grippers and the inner efforts of mechanisms stay ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from skyarm.algebra.scalars import data
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.leaves import field_names
from skyarm.world.contact.contact import UNTOUCHED, Contact, ContactMemory, Felt, Meeting


@dataclass(frozen=True, kw_only=True, slots=True)
class PlantContact(Contact):
    """The same world, on a plant with contacts of its own."""

    def start(self, period: float, draws: Sequence[Any]) -> ContactMemory:
        """Initial memory of every body, without bristles and touches."""
        return replace(Contact.start(self, period, draws), bristles=(), felt=(UNTOUCHED,) * self.logged_pairs)

    def meetings(self, memory: Any, motion: PointMotion) -> list[Meeting]:
        """None of ours: the plant finds them."""
        return []

    def on_points(self, memory: Any, motion: PointMotion) -> Sequence[Felt]:
        """Contacts as the plant found them."""
        found: Sequence[Felt] = memory.felt
        return found

    def without_touches(self, memory: ContactMemory) -> ContactMemory:
        """The memory as if nothing touched: everything but the plant's own contacts acts."""
        return replace(memory, felt=tuple(UNTOUCHED for _ in memory.felt))

    def efforts(self, memory: Any, slope: ContactMemory, motion: PointMotion) -> list[Any]:
        """Generalized forces of grasps on the bodies of the world, one carrier after the other."""
        pulls = self.on_carriers(memory, motion, ())
        rows = zip(self.carriers, memory.carried, slope.carried, pulls, strict=True)
        return [data(c) for carrier, held, rate, pull in rows for c in carrier.effort(held, rate, *pull)]


def plant_contact(contact: Contact) -> PlantContact:
    """The same world for a plant that finds contacts by itself."""
    return PlantContact(**{name: getattr(contact, name) for name in field_names(Contact) or ()})
