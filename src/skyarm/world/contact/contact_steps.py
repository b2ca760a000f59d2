"""Longest stable integration steps of contacts with movable bodies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import reduce
from typing import TYPE_CHECKING, Any

from skyarm.algebra.scalars import minimum
from skyarm.world.contact.carrier import both
from skyarm.world.contact.material import LIGHTEST

if TYPE_CHECKING:
    from skyarm.world.contact.contact import Contact


def steps_of_carriers(contact: Contact) -> Iterator[tuple[str, Any]]:
    """Longest stable integration step (s) of each kind of contact pair with a movable body."""
    masses = [1.0 / each.mobility for each in contact.carriers]
    for i, carrier in enumerate(contact.carriers):
        others = [(masses[j], each.step_share) for j, each in enumerate(contact.carriers) if j != i and each.spot_count]
        what, share = f"the mass of {carrier.name!r}", carrier.step_share
        for surface in carrier.surfaces:
            if contact.points:
                yield what, share * surface.material.step_of(both(masses[i], LIGHTEST))
            for mass, other in others:
                yield what, min(share, other) * surface.material.step_of(both(masses[i], mass))
        if carrier.spot_count:
            for surface in contact.surfaces:
                yield what, share * surface.material.step_of(masses[i])


def least_of(steps: Iterable[Any]) -> Any:
    """Smallest of some steps (s); None for an empty sequence."""
    found = list(steps)
    return reduce(minimum, found) if found else None
