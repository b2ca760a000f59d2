"""The nearest inertia that a real body can have, for moments that break the triangle inequality by a little.

A body's second moments S = integral of r r^T dm about its centre of mass are positive semi-definite, and its inertia is
I = tr(S) 1 - S. An inertia whose S = tr(I)/2 1 - I has negative eigenvalues belongs to no body. The S with these
eigenvalues set to zero is the nearest one in the Frobenius norm; mass and centre of mass stay.
Source: Wensing, Kim, Slotine 2018, "Linear matrix inequalities for physically consistent inertial parameter
identification", eq. 10 and 12.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from skyarm.algebra import Sym3
from skyarm.records.coerce import TOLERANCE

if TYPE_CHECKING:
    from skyarm.vehicle.bodies import RigidBodies
    from skyarm.vehicle.linkage import Body

NOISE = 1e-15
"""kg m^2: a negative moment of at most this size is rounding; a milligram at 30 micrometres has as much."""

REPAIRABLE = 0.1
"""Of the largest moment: what lies farther beyond the inequality is no slip of rounding or of a program's density."""


def excess(moments: Sequence[float]) -> float:
    """By what share of the largest principal moment the largest exceeds the sum of the others; at most 0 in a body."""
    a, b, c = sorted(moments)
    return (c - a - b) / c if c > 0.0 else 0.0


def repair_hint(moments: Sequence[float]) -> str:
    """What a refusal adds where ``repair = true`` would help; empty where it would not."""
    beyond = excess(moments)
    if not 0.0 < beyond <= REPAIRABLE:
        return ""
    return f"; {100.0 * beyond:.2g} % beyond it: 'repair = true' in a vehicle file takes the nearest that a body has"


def nearest_inertia(inertia: Sym3) -> Sym3:
    """The nearest inertia of a real body, kg m^2, about the same centre of mass in the same axes."""
    import numpy as np

    given = np.array([[float(each) for each in row] for row in inertia.full().rows])
    values, axes = np.linalg.eigh(0.5 * np.trace(given) * np.eye(3) - given)
    second = (axes * np.maximum(values, 0.0)) @ axes.T
    found = np.trace(second) * np.eye(3) - second
    # products that were zero stay structure
    size = 1e-15 * float(np.abs(given).max())
    entries = [float(found[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return Sym3.described(*(0.0 if abs(each) <= size else each for each in entries))


def with_real_inertias(bodies: RigidBodies, repair: bool) -> RigidBodies:
    """Bodies whose inertias that are off by rounding, or with ``repair`` by a tenth, are the nearest real ones."""
    notes: list[str] = []
    base = _settled(f"link {bodies.root}", bodies.base, repair, notes)
    links = tuple(replace(link, body=_settled(f"link {link.name}", link.body, repair, notes)) for link in bodies.links)
    return replace(bodies, base=base, links=links, notes=(*bodies.notes, *notes)) if notes else bodies


def _settled(name: str, body: Body, repair: bool, notes: list[str]) -> Body:
    """A body and, in the notes, what was changed of it."""
    import numpy as np

    if body.planar:
        return body
    rows = np.array([[float(each) for each in row] for row in body.inertia.full().rows])
    if not np.all(np.isfinite(rows)):
        return body
    moments = np.linalg.eigvalsh(rows).tolist()
    beyond = moments[2] - moments[0] - moments[1]
    if beyond <= TOLERANCE * max(abs(each) for each in moments):
        return body
    if beyond > NOISE and not (repair and 0.0 < excess(moments) <= REPAIRABLE):
        return body
    found = replace(body, inertia=nearest_inertia(body.inertia))
    if beyond <= NOISE:
        notes.append(f"{name}: inertia of {max(map(abs, moments)):.1e} kg m^2 is rounding, and taken without it")
        return found
    now = np.linalg.eigvalsh(np.array([[float(each) for each in row] for row in found.inertia.full().rows]))
    told = " -> ".join(", ".join(f"{each:.6g}" for each in of) for of in (moments, now.tolist()))
    notes.append(f"{name}: inertia repaired, {100.0 * excess(moments):.2g} % beyond: principal moments {told} kg m^2")
    return found
