"""What a world looks like: its surfaces as shapes with a pose at every instant, and the vehicle's points that touch.

Whoever draws a world (films, recordings, the studio, figures, files for viewers) takes it from here. A plane has no
end: it is drawn as a square patch about the place of what happens, or as the ground where it is level and at rest.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Mat3, Vec3
from skyarm.contact import Contact, Surface
from skyarm.drawing.carried_poses import CarriedPoses
from skyarm.drawing.shapes import Shape, Vector, between
from skyarm.drawing.vehicle_shapes import longest_boom
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]

PATCH = 1.0
"""m: half the width of the patch that stands for a plane."""

POINT = 0.03
"""Radius of the mark of a point that touches, as a share of the longest boom; a ball has its own."""

ORIGIN: Vector = (0.0, 0.0, 0.0)

NOBODY: CarriedPoses = MappingProxyType({})

LEVEL = 1e-9
"""Largest share of a level plane's normal that is not upwards."""


@dataclass(frozen=True, slots=True)
class WorldShape:
    """A solid of the world at N instants.

    Attributes:
        shape: kind and size.
        position: (N, 3) of its middle in the world, m. rotation: (N, 3, 3), its axes to the world's.
    """

    shape: Shape
    position: Array
    rotation: Array

    @property
    def moves(self) -> bool:
        """Whether it is elsewhere at any later instant."""
        return bool(np.ptp(self.position, axis=0).any() or np.ptp(self.rotation, axis=0).any())


def world_shapes(
    contacts: Sequence[Contact],
    times: Array,
    around: Sequence[float] = (0.0, 0.0, 0.0),
    patch: float = PATCH,
    carried: CarriedPoses = NOBODY,
) -> tuple[WorldShape, ...]:
    """Every surface of a world but its ground, and what its carriers carry.

    Args:
        contacts: of the scenario, with concrete numbers.
        times: (N,) s.
        around: (3,) m, place of what happens: a plane's patch is about the point of the plane that is nearest to it.
        patch: half the width of a patch, m.
        carried: poses of carriers at the same instants; one that is not among them is not drawn.
    """
    surfaces = [surface for contact in contacts for surface in contact.surfaces]
    below = ground_of(surfaces)
    found = [_placed(each, times, np.array(around, float), patch) for each in surfaces if each is not below]
    for carrier in (carrier for contact in contacts for carrier in contact.carriers):
        if carrier.name in carried:
            found += [_carried(each, *carried[carrier.name]) for each in carrier.surfaces]
    return tuple(found)


def ground_of(surfaces: Iterable[Surface]) -> Surface | None:
    """The highest plane that is level and at rest, which a picture draws as its ground; None without one."""
    level = [
        each
        for each in surfaces
        if each.shape == "plane" and not each.moves and float(each.rotation.rows[2][2]) >= 1.0 - LEVEL
    ]
    return max(level, key=lambda each: float(each.position.z), default=None)


def ground_height(contacts: Iterable[Contact]) -> float:
    """Height of the ground, m; 0 of a world without one."""
    found = ground_of(surface for contact in contacts for surface in contact.surfaces)
    return 0.0 if found is None else float(found.position.z)


def point_shapes(contacts: Iterable[Contact], vehicle: Vehicle) -> tuple[Shape, ...]:
    """A mark at every point of a vehicle that may touch, on a stalk from its body's origin; the tip has its own shape.

    Args:
        contacts: of the scenario.
        vehicle: with concrete numbers, as the contacts were made for.
    """
    found, least = [], POINT * longest_boom(vehicle)
    for contact in contacts:
        for point in contact.points:
            radius = float(point.radius)
            if radius == 0.0 and point.frame and point.frame == vehicle.end_effector:
                continue
            at, body = point.place(vehicle)
            place = _floats(at)
            found.append(Shape(f"point/{point.name}", "point", "sphere", body, (radius or least,), place))
            if math.hypot(*place) > 2.0 * least:
                stalk = between(f"stalk/{point.name}", "boom", "capsule", body, 0.4 * least, ORIGIN, place)
                found.append(stalk)
    return tuple(found)


def surface_shape(surface: Surface, patch: float = PATCH) -> Shape:
    """A surface as a shape about its own middle, in its own axes; ``patch`` is half the width of a plane's, m."""
    size = tuple(float(each) for each in surface.size)
    if surface.shape == "plane":
        return Shape(f"world/{surface.name}", "surface", "patch", BASE, (patch, patch))
    halves = tuple(0.5 * each for each in size) if surface.shape == "box" else size
    return Shape(f"world/{surface.name}", "surface", surface.shape, BASE, halves, mesh=surface.mesh)


def _placed(surface: Surface, times: Array, around: Array, patch: float) -> WorldShape:
    """A surface at every instant; a patch keeps the point of its plane that was nearest at first."""
    count = len(times)
    rotation = matrix_of(surface.rotation)
    place = np.stack([np.broadcast_to(np.asarray(c, float), count) for c in surface.place(times)[0]], axis=1)
    if surface.shape == "plane" and count:
        normal, away = rotation[:, 2], around - place[0]
        place = place + (away - normal * (normal @ away))
    return WorldShape(surface_shape(surface, patch), place, np.broadcast_to(rotation, (count, 3, 3)))


def _carried(surface: Surface, rotation: Array, position: Array) -> WorldShape:
    """A surface that a carrier carries, of its poses (N, 3, 3) and (N, 3)."""
    shape = replace(surface_shape(surface), role="object")
    place = np.array(_floats(surface.position))
    return WorldShape(shape, position + rotation @ place, rotation @ matrix_of(surface.rotation))


def matrix_of(R: Mat3) -> Array:
    """A matrix of concrete numbers as an array (3, 3)."""
    return np.array([[float(entry) for entry in row] for row in R.rows])


def _floats(v: Vec3) -> tuple[float, float, float]:
    return (float(v.x), float(v.y), float(v.z))
