"""Normal forces between a world's surfaces and a vehicle's points, as arrows over time, from what a log keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Vec3
from skyarm.contact import Contact
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
    contact: Contact, vehicle: Vehicle, poses: Mapping[int, tuple[Array, Array]], times: Array, normal_force: Array
) -> tuple[TouchArrow, ...]:
    """Arrows of the pairs that touch at any of the instants.

    Args:
        contact: of the scenario, with concrete numbers.
        vehicle: the plant's.
        poses: body -> (R_WB (N, 3, 3), p_WB (N, 3)).
        times: (N,) s.
        normal_force: (N, pairs) N, in the order of ``contact.pairs``.
    """
    found = []
    for (surface, point), force in zip(contact.pairs, normal_force.T, strict=True):
        if not np.any(force > 0.0):
            continue
        at, body = point.place(vehicle)
        R, p = poses[body]
        middle = p + R @ np.array([float(c) for c in at])
        normal = _columns(surface.depth(Vec3(*middle.T), point.radius, times)[1], len(times))
        spot = middle - float(point.radius) * normal
        found.append(TouchArrow(surface.name, point.name, spot, force[:, None] * normal))
    return tuple(found)


def _columns(v: Vec3, count: int) -> Array:
    """A vector of numbers and columns (N,) as (N, 3)."""
    return np.stack([np.broadcast_to(np.asarray(c, float), count) for c in v], axis=1)
