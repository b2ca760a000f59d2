"""Normal forces between a world's surfaces and a vehicle's points, as arrows over time, from what a log keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Vec3
from skyarm.contact import Contact, ContactPoint, Surface
from skyarm.drawing.carried_poses import CarriedPoses
from skyarm.drawing.world_shapes import NOBODY
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TouchArrow:
    """The force of one surface on one point at N instants.

    Attributes:
        surface, point: names of the pair.
        spot: (N, 3) where it acts, world axes, m. force: (N, 3) N on the vehicle, along the surface's normal.
    """

    surface: str
    point: str
    spot: Array
    force: Array


def touch_arrows(
    contact: Contact,
    vehicle: Vehicle,
    poses: Mapping[int, tuple[Array, Array]],
    times: Array,
    normal_force: Array,
    carried: CarriedPoses = NOBODY,
) -> tuple[TouchArrow, ...]:
    """Arrows of the pairs that touch at any of the instants.

    Args:
        contact: of the scenario, with concrete numbers.
        vehicle: the plant's.
        poses: body -> (R_WB (N, 3, 3), p_WB (N, 3)).
        times: (N,) s.
        normal_force: (N, pairs) N: every surface with every point, then what carriers carry with every point.
        carried: poses of the carriers.
    """
    found = []
    for (surface, carrier, point), force in zip(_pairs(contact), normal_force.T, strict=True):
        if not np.any(force > 0.0) or (carrier and carrier not in carried):
            continue
        at, body = point.place(vehicle)
        R, p = poses[body]
        middle = p + R @ np.array([float(c) for c in at])
        seen = middle
        if carrier:
            turn, origin = carried[carrier]
            seen = np.einsum("nij,ni->nj", turn, middle - origin)
        normal = _columns(surface.depth(Vec3(*seen.T), point.radius, times)[1], len(times))
        if carrier:
            normal = np.einsum("nij,nj->ni", turn, normal)
        spot = middle - float(point.radius) * normal
        found.append(TouchArrow(surface.name, point.name, spot, force[:, None] * normal))
    return tuple(found)


def _pairs(contact: Contact) -> list[tuple[Surface, str, ContactPoint]]:
    """(surface, name of its carrier or nothing, point) in the order in which a contact logs them."""
    own = [(surface, "", point) for surface, point in contact.pairs]
    return own + [
        (surface, carrier.name, point)
        for carrier in contact.carriers
        for surface in carrier.surfaces
        for point in contact.points
    ]


def _columns(v: Vec3, count: int) -> Array:
    """A vector of numbers and columns (N,) as (N, 3)."""
    return np.stack([np.broadcast_to(np.asarray(c, float), count) for c in v], axis=1)
