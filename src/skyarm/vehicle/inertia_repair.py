"""Repair of slightly unphysical inertias, as rounding and other programs leave them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from skyarm.algebra import Sym3
from skyarm.records.coerce import TOLERANCE
from skyarm.vehicle.attach import RigidBodies
from skyarm.vehicle.check import NOISE, principal_moments
from skyarm.vehicle.linkage import Body

REPAIRABLE = 0.1
"""Largest violation of the inequality, as a fraction of the largest moment, that counts as rounding or as a density
error of a program."""


def excess(moments: Sequence[float]) -> float:
    """Violation of the triangle inequality of principal moments, relative to the largest; at most 0 for a real body."""
    a, b, c = sorted(moments)
    return (c - a - b) / c if c > 0.0 else 0.0


def nearest_inertia(inertia: Sym3) -> Sym3:
    """Nearest physically consistent inertia (kg m^2) about the same centre of mass in the same axes."""
    given = np.array([[float(each) for each in row] for row in inertia.full().rows])
    values, axes = np.linalg.eigh(0.5 * np.trace(given) * np.eye(3) - given)
    second = (axes * np.maximum(values, 0.0)) @ axes.T
    found = np.trace(second) * np.eye(3) - second
    # products that were zero stay structure
    size = 1e-15 * float(np.abs(given).max())
    entries = [float(found[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return Sym3.from_numbers(*(0.0 if abs(each) <= size else each for each in entries))


def with_real_inertias(bodies: RigidBodies) -> RigidBodies:
    """Bodies with each slightly unphysical inertia (by up to a tenth) replaced by the nearest physical one."""
    notes: list[str] = []
    base = _checked_body(f"link {bodies.root}", bodies.base, notes)
    links = tuple(replace(link, body=_checked_body(f"link {link.name}", link.body, notes)) for link in bodies.links)
    return replace(bodies, base=base, links=links, notes=(*bodies.notes, *notes)) if notes else bodies


def _checked_body(name: str, body: Body, notes: list[str]) -> Body:
    """Body with a repaired inertia where it violates physical consistency; the change is added to the notes."""
    if body.planar or not all(math.isfinite(float(entry)) for entry in body.inertia.entries):
        return body
    moments = principal_moments(body.inertia)
    beyond = moments[2] - moments[0] - moments[1]
    if beyond <= TOLERANCE * max(map(abs, moments)) or (beyond > NOISE and not 0.0 < excess(moments) <= REPAIRABLE):
        return body
    found = replace(body, inertia=nearest_inertia(body.inertia))
    now = ", ".join(f"{each:.6g}" for each in principal_moments(found.inertia))
    words = "rounding of its inertia left out" if beyond <= NOISE else "inertia repaired"
    notes.append(f"{name}: {words}: principal moments {', '.join(f'{each:.6g}' for each in moments)} -> {now} kg m^2")
    return found
