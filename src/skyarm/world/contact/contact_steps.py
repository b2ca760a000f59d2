"""Longest stable integration steps of contacts with movable bodies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import reduce

from skyarm.algebra import Scalar
from skyarm.algebra.scalars import minimum
from skyarm.world.contact.carrier import AnyCarrier, both
from skyarm.world.contact.material import LIGHTEST
from skyarm.world.contact.surface import Surface


def steps_of_carriers(
    carriers: Sequence[AnyCarrier], surfaces: Sequence[Surface], *, points: bool
) -> Iterator[tuple[str, Scalar]]:
    """Longest stable integration step (s) of each kind of contact pair with a movable body.

    Args:
        carriers: movable bodies.
        surfaces: surfaces of the world.
        points: whether the vehicle has points that may touch them.
    """
    masses = [1.0 / each.mobility for each in carriers]
    for i, carrier in enumerate(carriers):
        others = [(masses[j], each.step_share) for j, each in enumerate(carriers) if j != i and each.spot_count]
        what, share = f"the mass of {carrier.name!r}", carrier.step_share
        for surface in carrier.surfaces:
            if points:
                yield what, share * surface.material.step_of(both(masses[i], LIGHTEST))
            for mass, other in others:
                yield what, min(share, other) * surface.material.step_of(both(masses[i], mass))
        if carrier.spot_count:
            for surface in surfaces:
                yield what, share * surface.material.step_of(masses[i])


def least_of(steps: Iterable[Scalar]) -> Scalar | None:
    """Smallest of some steps (s); None for an empty sequence."""
    every = list(steps)
    return reduce(minimum, every) if every else None
