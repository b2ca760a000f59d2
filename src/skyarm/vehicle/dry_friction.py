"""Dry friction of files that state no rate at which it bends: smooth enough to be integrated.

URDF and MJCF give the size of dry friction, and nothing of the drive behind a light last link. Friction * tanh(rate /
coulomb_rate) is then so stiff at rest that no flight could afford its steps. A joint that would be refused for that is
given a ``coulomb_rate`` that is not, and a note; the armature of the drive is what is really missing.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Sequence
from typing import Any

from skyarm.vehicle.linkage import Joint, Link
from skyarm.vehicle.mobility import joint_mobility
from skyarm.vehicle.notes import Notes
from skyarm.vehicle.vehicle_records import Vehicle

MOST = 3000.0
"""1/s at the six configurations looked at here: at others friction may be three times as fast; plants refuse 1e4."""

WANTED = 2500.0
"""1/s, below which faster friction is brought."""

SOFTER = 1.5
"""Factor from one try to the next."""


NOTE = "dry friction too stiff to integrate, bent by a larger coulomb_rate; state the armature of its drive"


def with_smooth_friction(vehicle: Vehicle, names: Collection[str]) -> Vehicle:
    """Vehicle whose dry friction can be integrated.

    Args:
        vehicle: with concrete numbers.
        names: joints whose ``coulomb_rate`` nobody has stated.
    """
    if not any(link.joint.name in names and link.joint.coulomb for link in vehicle.links):
        return vehicle
    links, mobilities = list(vehicle.links), joint_mobility(vehicle)
    viscous = _fastest([float(link.joint.damping) for link in links], mobilities)[0]
    if _fastest(_slopes(links), mobilities)[0] <= MOST:
        return vehicle
    # what viscous damping does alone is the file's own number: if that is too stiff, both plants say so
    wanted = max(WANTED, 1.1 * viscous)
    while True:
        rate, shares = _fastest(_slopes(links), mobilities)
        dry = [
            _dry(link.joint) * share if link.joint.name in names else 0.0
            for link, share in zip(links, shares, strict=True)
        ]
        i = dry.index(max(dry))
        if rate <= wanted or dry[i] == 0.0:
            break
        softer = dataclasses.replace(links[i].joint, coulomb_rate=SOFTER * float(links[i].joint.coulomb_rate))
        links[i] = dataclasses.replace(links[i], joint=softer)
    notes = Notes()
    for old, new in zip(vehicle.links, links, strict=True):
        if new is not old:
            notes.add(NOTE, new.joint.name)
    return dataclasses.replace(vehicle, links=tuple(links), notes=(*vehicle.notes, *notes.lines()))


def _dry(joint: Joint) -> float:
    """Slope of a joint's dry friction at rest, N m s/rad or N s/m."""
    return float(joint.coulomb) / float(joint.coulomb_rate)


def _slopes(links: Sequence[Link]) -> list[float]:
    return [float(link.joint.damping) + _dry(link.joint) for link in links]


def _fastest(slopes: Sequence[float], mobilities: Sequence[Any]) -> tuple[float, list[float]]:
    """Largest decay rate of friction at rest, 1/s, and how much each joint moves in its mode, per slope."""
    import numpy as np

    root = np.sqrt(np.array(slopes))
    with np.errstate(all="ignore"):  # absurd numbers overflow; plants refuse them
        product = root[:, None] * np.array(mobilities) * root[None, :]
    if not np.all(np.isfinite(product)):
        return 0.0, [0.0] * len(slopes)
    rates, modes = np.linalg.eigh(product)
    worst = int(np.argmax(rates[:, -1]))
    return float(rates[worst, -1]), [
        float(m) ** 2 / max(s, 1e-300) for m, s in zip(modes[worst, :, -1], slopes, strict=True)
    ]
