"""Shapes of a vehicle and the poses of its bodies at one or many instants."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import chain

import numpy as np

from skyarm.algebra import ZERO3, Mat3, Quaternion, Scalar, Scalars, Vec3, axis_rotation
from skyarm.algebra.frames import unit_rows
from skyarm.algebra.scalars import divide, maximum, minimum, where
from skyarm.compile import trace
from skyarm.compile.tracing.array_evaluation import evaluate
from skyarm.compile.tracing.program import Program
from skyarm.dynamics.kinematics import link_poses
from skyarm.records.arrays import Array, doubles
from skyarm.records.coerce import concrete
from skyarm.records.immutable import positional
from skyarm.vehicle import BASE, Vehicle
from skyarm.vehicle.description import Vector, quaternion_products, turn_onto
from skyarm.vehicle.vehicle_records import Look
from skyarm.world.scene.shapes import (
    Shape,
    floats,
    in_place,
    own_mesh,
    shape_between,
    solid_shape,
)

LEAST_REACH = 0.1
"""Assumed size (m) of a drawn vehicle without rotors."""

PAYLOAD_DENSITY = 2000.0
"""Density (kg/m^3) of the ball that is drawn for a payload, between those of water and
aluminium."""

HULL = 0.35, 0.15
"""Half axes of the drawn hull across and along the vehicle's z axis, as shares of its
longest boom."""

_ORIGIN: Vector = (0.0, 0.0, 0.0)


def vehicle_shapes(vehicle: Vehicle, *, meshes: bool = True) -> tuple[Shape, ...]:
    """Shapes that draw a vehicle: meshes of its links if available, else what touches,
    else rods, discs and balls.

    Args:
        vehicle: vehicle with concrete numbers.
        meshes: whether links are drawn as the meshes that their file names, where these
            are there, or as shapes that touch.
    """
    # sizes are shares of it, chosen by eye
    reach = longest_boom(vehicle)
    looks = enumerate(vehicle.looks if meshes else ())
    drawn = [
        (look, shape) for i, look in looks if own_mesh(shape := _mesh_shape(i, look))
    ]
    # what a fixed joint merged into a body, as the mount of an arm, is a frame of it:
    # it covers a part alone
    merged = {frame.name for frame in vehicle.frames}
    covered = {look.link for look, _ in drawn if look.name not in merged}
    touching = [
        each for each in vehicle.collisions if meshes and each.link not in covered
    ]
    covered |= {each.link for each in touching}
    hull = Shape(
        "hull",
        "hull",
        "ellipsoid",
        BASE,
        (HULL[0] * reach, HULL[0] * reach, HULL[1] * reach),
    )
    shapes = [] if BASE in covered else [hull]
    shapes += _rotor_shapes(vehicle, reach)
    shapes += _rods(vehicle, BASE, "base", 0.04 * reach)
    shapes += [shape for _, shape in drawn]
    shapes += [
        in_place(
            solid_shape(each, f"touch/{each.name}", _role(each.link), each.link), each
        )
        for each in (*touching, *vehicle.shields)
    ]
    for i, link in enumerate(vehicle.moving):
        if i not in covered:
            shapes += _rods(vehicle, i, f"link/{link.name}", 0.04 * reach)
        if link.joint.turns:
            half = 0.07 * reach
            axis = floats(link.joint.axis)
            ends = (floats(-half * c for c in axis), floats(half * c for c in axis))
            shapes.append(
                shape_between(
                    f"joint/{link.joint.name}",
                    "joint",
                    "cylinder",
                    i,
                    0.055 * reach,
                    *ends,
                )
            )
    if vehicle.end_effector:
        tip = vehicle.frame()
        shapes.append(
            Shape(
                "tip", "tip", "sphere", tip.link, (0.05 * reach,), floats(tip.position)
            )
        )
    return tuple(shapes)


def payload_shape(
    vehicle: Vehicle, mass: float, frame: str = "", com: Vec3 = ZERO3
) -> Shape:
    """Ball that draws a payload, with a volume that follows from its mass (kg)."""
    at = vehicle.frame(frame or None)
    radius = (3.0 * max(mass, 0.0) / (4.0 * math.pi * PAYLOAD_DENSITY)) ** (1.0 / 3.0)
    return Shape(
        "payload",
        "payload",
        "sphere",
        at.link,
        (radius,),
        floats(at.position + at.rotation.apply(com)),
    )


def rotor_radius(vehicle: Vehicle) -> float:
    """Radius (m) of the drawn rotor discs, small enough that neighbouring discs do not
    overlap.
    """
    return float(boom_and_disc(vehicle)[1])


def longest_boom(vehicle: Vehicle) -> float:
    """Distance (m) of the farthest rotor from the base, which scales all drawn shapes;
    0.1 without rotors.
    """
    return float(boom_and_disc(vehicle)[0])


def boom_and_disc(vehicle: Vehicle) -> tuple[Scalar, Scalar]:
    """Longest boom and radius of the rotor discs, m, over any scalar."""
    hubs = [rotor.position for rotor in vehicle.rotors]
    longest: Scalar = 0.0
    for hub in hubs:
        longest = maximum(longest, hub.norm())
    longest = where(longest > 0.0, longest, LEAST_REACH)
    # 0.45 of the way to the next hub: discs stay apart
    radius: Scalar = 0.5 * longest
    for apart in ((a - b).norm() for i, a in enumerate(hubs) for b in hubs[:i]):
        # coaxial pairs are closer than their discs are wide
        radius = where(apart > 0.15 * longest, minimum(radius, 0.45 * apart), radius)
    return longest, radius


def _rotor_shapes(vehicle: Vehicle, reach: float) -> list[Shape]:
    shapes = []
    radius = rotor_radius(vehicle)
    for rotor in vehicle.rotors:
        hub = floats(rotor.position)
        # a hub in the middle needs no boom
        if math.hypot(*hub) > 1e-6:
            shapes.append(
                shape_between(
                    f"boom/{rotor.name}",
                    "boom",
                    "capsule",
                    BASE,
                    0.03 * reach,
                    _ORIGIN,
                    hub,
                )
            )
        disc = (radius, 0.02 * reach)
        axis = turn_onto(rotor.axis)
        shapes.append(
            Shape(f"rotor/{rotor.name}", "rotor", "cylinder", BASE, disc, hub, axis)
        )
    return shapes


def _rods(vehicle: Vehicle, body: int, name: str, radius: float) -> list[Shape]:
    """Rods that draw a body of the vehicle, from its origin to its joints and
    frames.
    """
    role = "boom" if body == BASE else "link"
    return [
        shape_between(
            f"{name}/{carried}", role, "capsule", body, radius, _ORIGIN, floats(end)
        )
        for carried, end in rod_ends(vehicle, body)
    ]


def rod_ends(vehicle: Vehicle, body: int) -> list[tuple[str, Vec3]]:
    """Names and positions (m, axes of the body) of a body's joints and frames away from
    its origin, else its centre.
    """
    ends = [
        (other.joint.name, other.joint.position)
        for other in vehicle.moving
        if other.parent == body
    ]
    ends += [
        (frame.name, frame.position) for frame in vehicle.frames if frame.link == body
    ]
    if body != BASE and not ends:
        ends = [("com", vehicle.moving[body].body.com)]
    return [
        # a rod without length has no direction
        each
        for each in ends
        if not concrete(*each[1]) or math.hypot(*each[1]) > 1e-6
    ]


def _mesh_shape(number: int, look: Look) -> Shape:
    """Drawn shape of a link with an STL mesh file."""
    name, size = f"mesh{number + 1}/{look.name}", floats(look.scale)
    role = _role(look.link)
    return in_place(Shape(name, role, "mesh", look.link, size, mesh=look.file), look)


def _role(link: int) -> str:
    return "hull" if link == BASE else "link"


Poses = dict[int, tuple[Array, Array]]
"""Index of a body -> its rotations (N, 3, 3) and positions (N, 3)."""


@positional
class Placed:
    """World poses of all bodies of the vehicle at one instant: first the base, then the
    links.

    Attributes:
        rotations: (bodies, 3, 3), R_WB. positions: (bodies, 3), m.
        tip: (3,), m; the base's origin where there is no tip.
    """

    rotations: Array
    positions: Array
    tip: Array

    @property
    def poses(self) -> Poses:
        """The same as rotations and positions at one instant, by body index."""
        pairs = zip(self.rotations[:, None], self.positions[:, None], strict=True)
        return dict(enumerate(pairs, BASE))


# 16 is chosen: a miss costs 10 to 30 ms of a six-joint arm (measured)
# 16 is chosen: vehicles of a flight stay; another one costs a trace (3 ms)
@lru_cache(maxsize=16)
def _program(vehicle: Vehicle) -> Program:
    """Compiled program that computes the world poses of all bodies and the tip
    position.
    """
    frame = vehicle.frame() if vehicle.end_effector else None

    def poses(position: Vec3, quaternion: Quaternion, joints: Scalars) -> Scalars:
        q = quaternion
        length = q.norm()
        R_WB = Quaternion(*(divide(c, length) for c in q)).rotation()
        links = [
            (R_WB @ pose.R, position + R_WB.apply(pose.p))
            for pose in link_poses(vehicle, joints)
        ]
        bodies = [(R_WB, position), *links]
        # the base's link is -1
        R_tip, tip = bodies[0 if frame is None else frame.link + 1]
        tip = tip if frame is None else tip + R_tip.apply(frame.position)
        rows = [(*chain.from_iterable(R.rows), *p) for R, p in bodies]
        return (*chain.from_iterable(rows), *tip)

    # any numbers: of the examples a trace keeps the kinds alone
    return trace(
        poses, Vec3(0.1, 0.2, 0.3), Quaternion(0.9, 0.1, 0.2, 0.3), (0.1,) * vehicle.n
    )


def place(
    vehicle: Vehicle,
    position: Sequence[Scalar],
    quaternion: Sequence[Scalar],
    joints: Sequence[Scalar],
) -> Placed:
    """World poses of all bodies of the vehicle at one instant, for animations in real
    time.

    Args:
        vehicle: vehicle with concrete numbers.
        position: (3,) m, of the base.
        quaternion: (4,) wxyz, body to world; any length but zero.
        joints: (n,) rad or m.
    """
    out = np.array(
        _program(vehicle).flat(
            (*map(float, position), *map(float, quaternion), *map(float, joints))
        )
    )
    table = out[:-3].reshape(-1, 12)
    return Placed(table[:, :9].reshape(-1, 3, 3), table[:, 9:], out[-3:])


def body_poses(
    vehicle: Vehicle, position: Array, quaternion: Array, joints: Array
) -> Poses:
    """World rotations (N, 3, 3) and positions (N, 3) of all bodies of the vehicle at N
    instants.

    Args:
        vehicle: vehicle with concrete numbers.
        position: (N, 3) of the base, m.
        quaternion: (N, 4) wxyz, body to world; any length but zero.
        joints: (N, n) rad or m.

    Returns:
        body (BASE or index of a link) -> (R_WB (N, 3, 3), p_WB (N, 3)).
    """
    # of one instant ten times as fast as by arrays
    if len(position) == 1:
        return place(vehicle, position[0], quaternion[0], joints[0]).poses
    columns = [*position.T, *quaternion.T, *joints.T]
    rows = evaluate(_program(vehicle), columns, len(position))[:-3].T.reshape(
        len(position), -1, 12
    )
    return {
        BASE + k: (rows[:, k, :9].reshape(-1, 3, 3), rows[:, k, 9:])
        for k in range(rows.shape[1])
    }


def quaternions_of(rotations: Array) -> Array:
    """Unit quaternions (N, 4) wxyz with w >= 0 of rotation matrices (N, 3, 3).

    Source: Shepperd 1978, Quaternion from rotation matrix: by the largest of the four
    components.
    """
    products = np.array(quaternion_products(np.moveaxis(rotations, 0, -1)))
    rows: Array = products[
        np.einsum("iin->in", products).argmax(axis=0), :, np.arange(len(rotations))
    ]
    return unit_rows(rows * np.where(rows[:, :1] < 0.0, -1.0, 1.0))


def rotations_of(quaternions: Array) -> Array:
    """Rotation matrices (N, 3, 3) of quaternions (N, 4) wxyz of any non-zero length."""
    return matrices(Quaternion(*unit_rows(quaternions).T).rotation(), len(quaternions))


def vectors(v: Vec3, count: int) -> Array:
    """Stack the components of a vector, numbers or arrays (N,), into an array (N,
    3).
    """
    return np.stack([np.broadcast_to(doubles(c), count) for c in v], axis=1)


def matrices(R: Mat3, count: int) -> Array:
    """Stack the entries of a matrix, numbers or arrays (N,), into an array (N, 3,
    3).
    """
    entries = [np.broadcast_to(doubles(c), count) for row in R.rows for c in row]
    return np.stack(entries, axis=1).reshape(count, 3, 3)


def rotor_turns(vehicle: Vehicle, tilts: Array) -> dict[str, Array]:
    """Rotations (N, 3, 3) of every tilting rotor's disc about its hub, by shape name.

    Args:
        vehicle: vehicle with concrete numbers.
        tilts: (N, tilting rotors) rad; of a log without angles (N, 0), and then there
            are none.

    Returns:
        name of the shape -> R_BB (N, 3, 3): from the base's axes as the disc is at rest
        to those as it is turned.
    """
    axes = {
        disc_name(rotor.name): rotor.tilt.axis
        for rotor in vehicle.rotors
        if rotor.tilt is not None
    }
    if tilts.shape[1] != len(axes):
        return {}
    return {
        name: matrices(axis_rotation(axis, angle), len(angle))
        for (name, axis), angle in zip(axes.items(), tilts.T, strict=True)
    }


def disc_name(rotor: str) -> str:
    """Name of the shape of a rotor's disc."""
    return f"rotor/{rotor}"


def shape_rotation(shape: Shape, turns: dict[str, Array]) -> Array:
    """Rotation of a drawn shape in its body: (N, 3, 3) for the disc of a tilting rotor,
    else (3, 3).
    """
    still = np.array(shape.rotation)
    return turns[shape.name] @ still if shape.name in turns else still
