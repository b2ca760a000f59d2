"""Picture of a contact: surfaces, movable bodies, contact points and contact forces.

A plane has no end: it is drawn as a square patch about the place of the flight, or as
the ground where it is level and at rest.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from skyarm.algebra import Scalar, Vec3
from skyarm.records.arrays import Array, doubles
from skyarm.vehicle import BASE, Vehicle
from skyarm.world.contact.carrier import NOBODY
from skyarm.world.contact.contact_point import ContactPoint
from skyarm.world.contact.contact_steps import ContactSteps
from skyarm.world.contact.grasp import Grasp
from skyarm.world.contact.surface import Surface, heights_of
from skyarm.world.contact.vehicle_bodies import surface_of
from skyarm.world.scene.scene import PATCH, Arrow, Instants, Line, Scene
from skyarm.world.scene.shapes import (
    OBJECT,
    SURFACE,
    Shape,
    Solid,
    floats,
    shape_between,
    solid_shape,
)
from skyarm.world.scene.vehicle_shapes import (
    Poses,
    longest_boom,
    matrices,
    rotations_of,
    vectors,
)

POINT = 0.03
"""Radius of the drawn mark of a contact point, as a fraction of the longest boom; a
ball has its own radius."""

MARK = 0.08
"""Radius of the drawn mark of a grasp, as a fraction of the vehicle's longest boom."""

PIECES = 8
"""Number of segments of a drawn cable."""

LEVEL = 1e-9
"""Largest horizontal component of the normal of a plane that counts as level."""


def contact_scene(contact: ContactSteps, seen: Instants) -> Scene:
    """Drawn shapes and force arrows of the contact model at some instants of a
    flight.
    """
    poses = carrier_poses(contact, seen.numbers, len(seen.times))
    ground = ground_of(contact.surfaces)
    solids = [
        _surface_solid(each, seen) for each in contact.surfaces if each is not ground
    ]
    placed = [
        (surface, *(AT_REST if of == NOBODY else poses[of]))
        for of, surface in contact.every_surface
    ]
    solids += [_carrier_solid(*each) for each in placed[len(contact.surfaces) :]]
    own = [
        each
        for each in contact.points
        if each.agent in ("", seen.name) or not seen.name
    ]
    frames = {each.name: poses[i] for i, each in enumerate(contact.carriers)}
    drawn = [
        _grasp_scene(each, i, *frames[each.body], seen)
        for i, each in enumerate(contact.grasps)
        if seen.has(each.agent)
    ]
    return Scene(
        solids=(*solids, *(solid for each in drawn for solid in each.solids)),
        lines=tuple(line for each in drawn for line in each.lines),
        arrows=(
            *_touch_arrows(contact.points, placed, seen),
            *_body_arrows(contact, poses, seen),
            *(arrow for each in drawn for arrow in each.arrows),
        ),
        attached=tuple(_point_shapes(own, seen.vehicle)),
        ground=None if ground is None else float(ground.position.z),
    )


def ground_of(surfaces: Iterable[Surface]) -> Surface | None:
    """Highest horizontal plane that does not move, drawn as the ground; None without
    such a plane.
    """
    level = [
        each
        for each in surfaces
        if each.shape == "plane"
        and not each.moves
        and float(each.rotation.rows[2][2]) >= 1.0 - LEVEL
    ]
    return max(level, key=lambda each: float(each.position.z), default=None)


def surface_shape(surface: Surface, patch: float = PATCH) -> Shape:
    """Drawn shape of a contact surface in its own axes; a plane becomes a square of
    half width ``patch`` (m).
    """
    name = f"world/{surface.name}"
    if surface.shape == "plane":
        return Shape(name, "surface", "patch", BASE, (patch, patch))
    if surface.shape == "heightfield":
        return _relief(surface, name)
    return replace(solid_shape(surface, name, "surface", BASE), mesh=surface.mesh)


AT_REST = np.eye(3)[None], np.zeros((1, 3))
"""Rotation (1, 3, 3) and position (1, 3) of the axes of what is fixed in the world."""

FINEST = 64
"""Largest number of drawn rows and columns of a heightfield."""


def _relief(surface: Surface, name: str) -> Shape:
    """Drawn triangles of a heightfield, without its sides."""
    heights = heights_of(surface.heights)
    down, across = (
        # unique: a field of fewer rows than FINEST has each of them once
        np.unique(np.linspace(0, count - 1, FINEST).round().astype(int))
        for count in heights.shape
    )
    x, y, height, _ = map(float, surface.size)
    rows, columns = (each / (each[-1]) - 0.5 for each in (down, across))
    grid = np.stack(
        [
            *np.meshgrid(x * columns, y * rows),
            height * heights[np.ix_(down, across)],
        ],
        axis=2,
    )
    number = np.arange(grid[..., 0].size).reshape(grid.shape[:2])
    a, b, c, d = (
        number[i:, j:][: len(down) - 1, : len(across) - 1].ravel()
        for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))
    )
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return Shape(
        name,
        "surface",
        "hull",
        BASE,
        tuple(grid.ravel().tolist()),
        faces=tuple((i, j, k) for i, j, k in faces.tolist()),
    )


def carrier_poses(
    contact: ContactSteps, numbers: Mapping[str, Array], count: int
) -> Poses:
    """Rotations (N, 3, 3) and positions (N, 3) of free objects and mechanisms at N
    instants, by index.

    Args:
        contact: contact model.
        numbers: logged arrays with N rows.
        count: N.
    """
    poses = Poses()
    for i in range(len(contact.objects)):
        quaternion = numbers["object_quaternion"][:, 4 * i : 4 * i + 4]
        poses[i] = (
            rotations_of(quaternion),
            numbers["object_position"][:, 3 * i : 3 * i + 3],
        )
    for i, mechanism in enumerate(contact.mechanisms):
        frame = mechanism.frame_at(numbers["mechanism_position"][:, i])
        poses[len(contact.objects) + i] = (
            matrices(frame.rotation, count),
            vectors(frame.position, count),
        )
    return poses


def _surface_solid(surface: Surface, seen: Instants) -> Solid:
    """Drawn solid of a surface of the world at N instants; a plane becomes a patch near
    the vehicle.
    """
    count = len(seen.times)
    rotation = matrices(surface.rotation, count)
    place = vectors(surface.place(seen.times)[0], count)
    if surface.shape == "plane" and count:
        normal = rotation[0, :, 2]
        away = seen.around - place[0]
        # a plane has no middle: the patch follows the flight along the plane
        place = place + (away - normal * (normal @ away))
    return Solid(
        surface_shape(surface, seen.patch),
        place,
        rotation,
        SURFACE,
        fixed=not surface.moves,
    )


def _carrier_solid(surface: Surface, rotation: Array, position: Array) -> Solid:
    """Drawn solid of a movable body's surface at N instants."""
    shape = replace(surface_shape(surface), role="object")
    place = np.array(floats(surface.position))
    return Solid(
        shape,
        position + rotation @ place,
        rotation @ matrices(surface.rotation, 1)[0],
        OBJECT,
    )


def _grasp_scene(
    grasp: Grasp, i: int, rotation: Array, position: Array, seen: Instants
) -> Scene:
    """Mark of the place of a grasp on its body, line of its cable, and arrow of its
    force on the vehicle.

    Args:
        grasp: grasp of the world.
        i: index of the grasp.
        rotation: (N, 3, 3) of the body.
        position: (N, 3) m of the body.
        seen: the instants, with the logged pulls of all grasps.
    """
    holder = seen.of(grasp.agent)
    label = f"grasp/{grasp.label}"
    at = holder.vehicle.frame(grasp.frame or None)
    end = holder.place(at.position, at.link)
    place = position + rotation @ np.array(floats(grasp.place))
    mark = Shape(label, "point", "sphere", BASE, (MARK * longest_boom(holder.vehicle),))
    force = -seen.numbers["grasp_pull"][:, 3 * i : 3 * i + 3]
    lines: tuple[Line, ...] = ()
    if grasp.kind == "cable":
        share = np.linspace(0.0, 1.0, PIECES + 1)[:, None]
        slack = float(grasp.length) ** 2 - ((end - place) ** 2).sum(axis=1)
        # a parabola of sag f over a span d has a length l with l^2 - d^2 = 16 f^2 / 3,
        # to second order
        sag = (
            np.sqrt(3.0 * np.maximum(slack, 0.0))[:, None, None]
            * share
            * (1.0 - share)
            * [0.0, 0.0, 1.0]
        )
        cable = end[:, None] + share * (place - end)[:, None] - sag
        lines = (
            Line(
                label,
                np.where(
                    seen.times[:, None, None] < float(grasp.release), cable, np.nan
                ),
            ),
        )
    return Scene(
        solids=(Solid(mark, place, np.broadcast_to(np.eye(3), rotation.shape)),),
        lines=lines,
        arrows=(Arrow(label, end, force),),
    )


def _point_shapes(points: Iterable[ContactPoint], vehicle: Vehicle) -> Iterator[Shape]:
    """Drawn shapes of the contact points: balls, each on a rod from the origin of its
    body.
    """
    least = POINT * longest_boom(vehicle)
    for point in points:
        radius = float(point.radius)
        # the vehicle's own shapes mark its tip already
        if radius == 0.0 and point.frame and point.frame == vehicle.end_effector:
            continue
        at, body = point.place(vehicle)
        place = floats(at)
        yield Shape(
            f"point/{point.name}", "point", "sphere", body, (radius or least,), place
        )
        if math.hypot(*place) > 2.0 * least:
            # the rod is thinner than the ball, so that this stands out (chosen)
            ends = (0.0, 0.0, 0.0), place
            yield shape_between(
                f"stalk/{point.name}", "boom", "capsule", body, 0.4 * least, *ends
            )


def _touch_arrows(
    points: Sequence[ContactPoint],
    placed: Iterable[tuple[Surface, Array, Array]],
    seen: Instants,
) -> Iterator[Arrow]:
    """Arrows of the normal forces of each surface on each contact point of the
    vehicle.
    """
    for i, ((surface, *pose), point) in enumerate(product(placed, points)):
        if not seen.has(point.agent):
            continue
        force = seen.numbers["contact_force"][:, i]
        name = f"touch/{surface.name}/{point.name}"
        own = seen.of(point.agent)
        at, body = point.place(own.vehicle)
        middle = own.place(at, body)
        # without force the normal is not needed, and an arrow of length zero is drawn
        if not np.any(force > 0.0):
            yield Arrow(name, middle, np.zeros_like(middle))
            continue
        _, normal = _skin(surface, pose, middle, point.radius, seen.times)
        yield Arrow(
            name, middle - float(point.radius) * normal, force[:, None] * normal
        )


def _skin(
    surface: Surface,
    pose: Sequence[Array],
    at: Array,
    radius: Scalar,
    times: Array,
) -> tuple[Array, Array]:
    """Penetration (N,) of balls (m) into a surface and its outward normals (N, 3),
    world axes.

    Args:
        surface: in the axes of its body.
        pose: rotations (N or 1, 3, 3) and positions (N or 1, 3) of these axes.
        at: (N, 3) m, middles of the balls.
        radius: of the balls, m.
        times: (N,) s.
    """
    turn, origin = pose
    R = np.broadcast_to(turn, (len(at), 3, 3))
    local = np.einsum("nij,ni->nj", R, at - origin)
    depth, normal = surface.depth(Vec3(*local.T), radius, times)
    return doubles(depth), np.einsum("nij,nj->ni", R, vectors(normal, len(at)))


def _body_arrows(
    contact: ContactSteps, poses: Poses, seen: Instants
) -> Iterator[Arrow]:
    """Arrows of the normal forces on bodies of vehicles that have shapes.

    They stand at the mean places of touch, along the normal of the other body's nearest
    shape.
    """
    bodies = contact.vehicle_bodies
    for i, pair in enumerate(contact.body_pairs):
        body, name = bodies[pair.body], f"touch/{pair.name}"
        # no other vehicle's body: the one condition below then asks for this one alone
        other = bodies[pair.index] if pair.other == "body" else body
        if not (seen.has(body.agent) and seen.has(other.agent)):
            continue
        force = seen.numbers["collision_force"][:, i]
        place = seen.numbers["collision_place"][:, 3 * i : 3 * i + 3]
        pose: Sequence[Array] = AT_REST
        if pair.other == "surface":
            shapes = [contact.surfaces[pair.index]]
        elif pair.other == "carrier":
            shapes = [*contact.carriers[pair.index].surfaces]
            pose = poses[pair.index]
        else:
            own = seen.of(other.agent)
            shapes = [surface_of(own.vehicle.shapes[k]) for k in other.shapes]
            pose = own.poses[other.body]
        normal, deepest = np.zeros_like(place), np.full(len(place), -np.inf)
        # without force no normal is needed: an arrow of length zero
        for each in shapes if np.any(force > 0.0) else ():
            depth, way = _skin(each, pose, place, 0, seen.times)
            normal = np.where((depth > deepest)[:, None], way, normal)
            deepest = np.maximum(depth, deepest)
        yield Arrow(name, place, force[:, None] * normal)
