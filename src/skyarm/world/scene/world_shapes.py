"""Shapes of the world at every instant: surfaces, bodies that move, the vehicle's contact points and their forces.

Films, recordings, the studio, figures and files for viewers take them from here. A plane has no end: it is drawn as a
square patch about the place of the flight, or as the ground where it is level and at rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Vec3
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.world.scene.shapes import OBJECT, Shape, Solid, floats, shape_between
from skyarm.world.scene.vehicle_shapes import longest_boom, matrices, rotations_of, vectors

if TYPE_CHECKING:
    from skyarm.world.contact import Contact, ContactPoint, Surface

Array = npt.NDArray[np.float64]

CarriedPoses = Mapping[str, tuple[Array, Array]]
"""Name of a carrier -> (R_WC (N, 3, 3), p_WC (N, 3)), its axes to the world's."""

NOBODY: CarriedPoses = MappingProxyType({})

PATCH = 1.0
"""m: half the width of the patch that stands for a plane."""

POINT = 0.03
"""Radius of the mark of a point that touches, as a share of the longest boom; a ball has its own."""

LEVEL = 1e-9
"""Largest share of a level plane's normal that is not upwards."""

WAY = np.linspace(0.03, 3.0, 100)
"""m from a place towards the eye at which something may be in the way."""


def logged_poses(contacts: Sequence[Contact], logged: Callable[[str], Array]) -> CarriedPoses:
    """Poses of objects and mechanisms from the arrays of a log, by name; none of what it does not hold."""
    found: dict[str, tuple[Array, Array]] = {}
    objects = [each for contact in contacts for each in contact.objects]
    mechanisms = [each for contact in contacts for each in contact.mechanisms]
    position, quaternion = logged("object_position"), logged("object_quaternion")
    for i, thing in enumerate(objects if position.shape[1] == 3 * len(objects) else ()):
        found[thing.name] = rotations_of(quaternion[:, 4 * i : 4 * i + 4]), position[:, 3 * i : 3 * i + 3]
    for mechanism, q in zip(mechanisms, logged("mechanism_position").T, strict=False):
        frame = mechanism.frame_at(q)
        found[mechanism.name] = matrices(frame.rotation, len(q)), vectors(frame.position, len(q))
    return found


def held_poses(components: Sequence[Any], memories: Sequence[Any]) -> CarriedPoses:
    """Poses of all carriers at one instant, from the memory of their contact.

    Args:
        components: of the scenario.
        memories: one for each.
    """
    found = {}
    for contact, memory in zip(components, memories, strict=True):
        if hasattr(contact, "carriers"):
            for carrier, held in zip(contact.carriers, memory.carried, strict=True):
                frame = carrier.frame(held)
                found[carrier.name] = matrices(frame.rotation, 1), vectors(frame.position, 1)
    return found


def world_shapes(
    contacts: Sequence[Contact],
    times: Array,
    around: Sequence[float] = (0.0, 0.0, 0.0),
    patch: float = PATCH,
    carried: CarriedPoses = NOBODY,
) -> tuple[Solid, ...]:
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
    found = [_surface_solid(each, times, np.array(around, float), patch) for each in surfaces if each is not below]
    for carrier in (carrier for contact in contacts for carrier in contact.carriers):
        if carrier.name in carried:
            found += [_carrier_solid(each, *carried[carrier.name]) for each in carrier.surfaces]
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
    """A mark at every contact point, on a stalk from its body's origin; the tip has its own shape.

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
            place = floats(at)
            found.append(Shape(f"point/{point.name}", "point", "sphere", body, (radius or least,), place))
            if math.hypot(*place) > 2.0 * least:
                ends = (0.0, 0.0, 0.0), place
                found.append(shape_between(f"stalk/{point.name}", "boom", "capsule", body, 0.4 * least, *ends))
    return tuple(found)


def surface_shape(surface: Surface, patch: float = PATCH) -> Shape:
    """A surface as a shape about its own middle, in its own axes; ``patch`` is half the width of a plane's, m."""
    size = tuple(float(each) for each in surface.size)
    if surface.shape == "plane":
        return Shape(f"world/{surface.name}", "surface", "patch", BASE, (patch, patch))
    halves = tuple(0.5 * each for each in size) if surface.shape == "box" else size
    return Shape(f"world/{surface.name}", "surface", surface.shape, BASE, halves, mesh=surface.mesh)


def _surface_solid(surface: Surface, times: Array, around: Array, patch: float) -> Solid:
    """A surface at every instant; a patch keeps the point of its plane that was nearest at first."""
    rotation, place = matrices(surface.rotation, len(times)), vectors(surface.place(times)[0], len(times))
    if surface.shape == "plane" and len(times):
        normal, away = rotation[0, :, 2], around - place[0]
        place = place + (away - normal * (normal @ away))
    return Solid(surface_shape(surface, patch), place, rotation)


def _carrier_solid(surface: Surface, rotation: Array, position: Array) -> Solid:
    """A surface that a carrier carries, of its poses (N, 3, 3) and (N, 3)."""
    shape = replace(surface_shape(surface), role="object")
    place = np.array(floats(surface.position))
    return Solid(shape, position + rotation @ place, rotation @ matrices(surface.rotation, 1)[0], OBJECT)


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
    """Normal forces of the pairs that touch at any of the instants.

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
        middle = p + R @ np.array(floats(at))
        turn, origin = carried[carrier] if carrier else (np.eye(3)[None], np.zeros(3))
        seen = np.einsum("nij,ni->nj", np.broadcast_to(turn, R.shape), middle - origin)
        normal = vectors(surface.depth(Vec3(*seen.T), point.radius, times)[1], len(times))
        normal = np.einsum("nij,nj->ni", np.broadcast_to(turn, R.shape), normal)
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


def hidden_share(solids: Iterable[Solid], places: Array, towards: Array) -> float:
    """Share of the instants at which a place is hidden from an eye.

    Args:
        solids: at N instants.
        places: (N, 3) m, world axes.
        towards: (3,) unit vector from the place to the eye.
    """
    ways = places[:, None] + WAY[:, None] * towards
    behind = np.zeros(len(places), bool)
    for solid in solids:
        local = np.einsum("kwi,kij->kwj", ways - solid.position[:, None], solid.rotation)
        behind |= inside(solid, local).any(axis=1)
    return float(behind.mean())


def inside(solid: Solid, places: Array) -> npt.NDArray[np.bool_]:
    """Return True for places (..., 3) inside a solid, in its axes; of a patch, below it; a hole counts as filled."""
    kind, size, height = solid.shape.kind, np.array(solid.shape.size), places[..., 2]
    across = np.linalg.norm(places[..., :2], axis=-1)
    found: Any
    if kind == "patch":
        found = (np.abs(places[..., :2]) < size).all(axis=-1) & (height < 0.0)
    elif kind == "box":
        found = (np.abs(places) < size).all(axis=-1)
    elif kind == "hole":
        found = (across < size[3]) & (height < 0.0) & (height > -size[4])
    elif kind == "cylinder":
        found = (across < size[0]) & (np.abs(height) < 0.5 * size[1])
    else:
        found = np.linalg.norm(places, axis=-1) < size[0]
    return np.asarray(found)
