"""Repair of slightly unphysical inertias, as rounding and other programs leave them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from skyarm.records.coerce import TOLERANCE
from skyarm.vehicle.attach import RigidBodies
from skyarm.vehicle.check import NOISE, nearest_inertia, principal_moments
from skyarm.vehicle.linkage import Body

REPAIRABLE = 0.1
"""Largest violation of the inequality, as a fraction of the largest moment, that counts
as rounding or as a density error of a program."""


def excess(moments: Sequence[float]) -> float:
    """Violation of the triangle inequality of principal moments, relative to the
    largest; at most 0 for a real body.
    """
    a, b, c = sorted(moments)
    # a body without inertia violates nothing
    return (c - a - b) / c if c > 0.0 else 0.0


def with_real_inertias(bodies: RigidBodies, *, every: bool = False) -> RigidBodies:
    """Bodies with each slightly unphysical inertia (by up to a tenth), or every one,
    replaced by the nearest one.
    """
    most = math.inf if every else REPAIRABLE
    notes: list[str] = []
    base = _checked_body(f"link {bodies.root}", bodies.base, most, notes)
    links = tuple(
        replace(link, body=_checked_body(f"link {link.name}", link.body, most, notes))
        for link in bodies.links
    )
    return replace(bodies, base=base, links=links, notes=(*bodies.notes, *notes))


def _checked_body(name: str, body: Body, most: float, notes: list[str]) -> Body:
    """Body whose inertia, if no more than ``most`` beyond physical consistency, is
    repaired; notes tell the change.
    """
    # infinite entries are refused later, with the field's name
    if body.planar or not all(
        math.isfinite(float(entry)) for entry in body.inertia.entries
    ):
        return body
    moments = principal_moments(body.inertia)
    beyond = moments[2] - moments[0] - moments[1]
    # rounding is cleaned without asking; beyond it only what looks like a density error
    if beyond <= TOLERANCE * max(map(abs, moments)) or (
        beyond > NOISE and not 0.0 < excess(moments) <= most
    ):
        return body
    found = replace(body, inertia=nearest_inertia(body.inertia))
    now = ", ".join(f"{each:.6g}" for each in principal_moments(found.inertia))
    words = (
        "rounding of its inertia left out" if beyond <= NOISE else "inertia repaired"
    )
    notes.append(
        f"{name}: {words}: principal moments"
        f" {', '.join(f'{each:.6g}' for each in moments)} -> {now} kg m^2"
    )
    return found
