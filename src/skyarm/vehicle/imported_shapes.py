"""Shapes that touch, as files of other programs state them: read on request, or one
capsule around those of each link.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from skyarm.algebra import ZERO3, Mat3, Vec3
from skyarm.records import coerce
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.vehicle import description
from skyarm.vehicle.attach import Notes, RigidBodies, moved_into
from skyarm.vehicle.convex_hull import FLAT, convex_hull
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Collision, Frame

IMPORTS = ("none", "file", "capsules")
"""What becomes of the shapes of other programs' files: nothing, shapes as they are, or
one capsule around those of each link but the base."""


MOST_VERTICES = 32
"""Usual largest number of corners of the hull of a mesh: the time of a contact grows
with it."""

MOST_CORNERS = 256
"""Largest number of corners of a hull that a file may state, for the same reason."""

SHORTEST = 1e-6
"""Least length (m) of a capsule that is fitted, for a length must not be zero."""

CUBE = np.array([*product((-0.5, 0.5), repeat=3)])
"""Corners of a cube of edge 1 around the origin, shape (8, 3)."""


@immutable
class FileShape(Frame):
    """Shape of a link in another program's file, which is read only where it touches.

    Attributes:
        name: name of the link.
        read: reads the shape, in the axes of the link; None, with a note, for one that
            cannot be used.
    """

    read: Callable[[Notes], Collision | None]


def file_shape(
    seat: Frame, name: str, read: Callable[[Notes], Collision | None]
) -> FileShape:
    """Shape of a link with a given name and frame."""
    return moved_into(seat, FileShape(name=name, link=BASE, position=ZERO3, read=read))


def collision_of(
    name: str,
    shape: str,
    at: Frame,
    size: Sequence[float] | Array,
    notes: Notes,
    most: float = MOST_VERTICES,
) -> Collision:
    """Shape of a body, with a note on a hull that has not all corners of its points.

    Args:
        name: name of the shape.
        shape: a key of ``COLLISION_SIZES``.
        at: its pose.
        size: its lengths, or points in the hull, m.
        notes: takes the note.
        most: largest number of corners of the hull.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    corners: tuple[Vec3, ...] = ()
    if isinstance(size, np.ndarray):
        kept, _, left = convex_hull(size, most)
        # within the rounding at which a point counts as inside no corner is missing
        if left > FLAT * np.ptp(size, axis=0).max():
            inside = f"up to {1e3 * left:.2g} mm inside that of its points"
            notes.add(f"hull of {len(kept)} corners, {inside}", name, "shape")
        rows = size[kept].tolist()
        corners = tuple(coerce.vector("vertices", each) for each in rows)
    return Collision(
        name=name,
        link=at.link,
        rotation=at.rotation,
        position=at.position,
        shape=shape,
        size=() if corners else tuple(size),
        vertices=corners,
    )


def import_shapes(bodies: RigidBodies, how: str, notes: Notes) -> list[Collision]:
    """Shapes that touch, from the files of other programs.

    Args:
        bodies: bodies of the vehicle.
        how: one of ``IMPORTS``.
        notes: takes what is left out.

    Raises:
        ValueError: one line: a shape of the file that cannot be.
    """
    stated = [each for each in bodies.looks if isinstance(each, FileShape)]
    if how == "none":
        if stated:
            cure = "import_collisions = 'file' takes them"
            notes.add(f"{len(stated)} shapes of its file touch nothing; {cure}")
        return []
    if not stated:
        why = "takes none: no other file states a shape that touches"
        notes.add(f"import_collisions = {how!r} {why}")
    # a rotor stated on the root has no link of its own, and the root keeps its shapes
    of_rotors = {each.link for each in bodies.rotors} - {bodies.root}
    shapes = list[Collision]()
    for each in stated:
        if each.name in of_rotors:
            notes.add("shapes left out: its rotor's disc is there", each.name, "link")
        elif shape := each.read(notes):
            name = f"{each.name}.{len(shapes) + 1}"
            shapes.append(replace(moved_into(each, shape), name=name))
    if how == "file":
        return shapes
    fitted = [each for each in shapes if each.link == BASE]
    for i, link in enumerate(bodies.links):
        if balls := [_balls(each) for each in shapes if each.link == i]:
            fitted.append(capsule_around(np.concatenate(balls), link.name, i))
    return fitted


def _balls(shape: Collision) -> Array:
    """Balls whose hull holds a shape: rows of centre and radius (m), on its body.

    A cylinder is taken as the capsule around it.
    """
    # a sphere states a radius alone: the length of its middle line is then 0
    size = [*map(float, shape.size), 0.0]
    if shape.shape == "hull":
        points = np.array(shape.vertices, float)
    else:
        # of a box the eight corners; the corners of a cube without width are the two
        # ends of a middle line, each four times
        points = CUBE * (size[:3] if shape.shape == "box" else [0.0, 0.0, size[1]])
    R = np.array(shape.rotation.rows, float)
    centres = points @ R.T + np.array(shape.position, float)
    radius = 0.0 if shape.shape in ("box", "hull") else size[0]
    return np.column_stack([centres, np.full(len(points), radius)])


def capsule_around(balls: Array, name: str, link: int) -> Collision:
    """Capsule around balls, along the longest principal axis of their centres.

    Args:
        balls: centre and radius in each row, m.
        name: name of the capsule.
        link: body that carries it.
    """
    centres, radii = balls[:, :3], balls[:, 3]
    # bias: the unbiased covariance of one ball would be NaN
    turn = np.linalg.eigh(np.cov(centres.T, bias=True))[1]
    # eigenvectors may be left-handed; the longest axis is the last, as eigh sorts
    turn[:, 0] *= np.linalg.det(turn)
    x, y, z = (centres @ turn).T
    # the middle of their extent: near the smallest radius, without a search
    u, v = (0.5 * (min(each - radii) + max(each + radii)) for each in (x, y))
    off = np.hypot(x - u, y - v)
    radius = float(max(off + radii))
    # an end as near to the centre of a ball as their radii differ holds the ball
    room = np.sqrt(np.maximum((radius - radii) ** 2 - off**2, 0.0))
    top, bottom = float(max(z - room)), float(min(z + room))
    return Collision(
        name=name,
        link=link,
        shape="capsule",
        size=(radius, max(top - bottom, SHORTEST)),
        position=description.vector(turn @ [u, v, 0.5 * (top + bottom)]),
        rotation=description.rotation(Mat3.from_numbers(turn.tolist())),
    )
