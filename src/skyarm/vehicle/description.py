"""Conversion of the numbers of a vehicle file: exact zeros and ones become constants of
compiled code.

What stands as 0 or 1 in a file, and what is computed from it to exactly 0.0 (a product
of inertia of a symmetric body), is structure and folds away; every other number stays
data (see :mod:`skyarm.algebra.scalars`).
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from skyarm.algebra import Mat3, Quaternion, Sym3, Vec3
from skyarm.algebra.quaternion import euler_rotation
from skyarm.records.coerce import TOLERANCE
from skyarm.records.files import must_be_one_of
from skyarm.vehicle.check import refuse
from skyarm.vehicle.linkage import Body

ROUNDING = 1e-15
"""Distance from 0, 1 or -1 below which an entry of a rotation becomes that number;
sin(pi) is 1.2e-16 in floating point."""


def zero_is_structure(value: float) -> int | float:
    """Convert an exact zero to a constant of compiled code; other numbers stay
    variable.
    """
    return 0 if value == 0.0 else float(value)


def vector(values: Iterable[Any]) -> Vec3:
    """Vector of three numbers, in which exact zeros and ones become constants of
    compiled code.
    """
    return Vec3.from_numbers(list(map(float, values)))


def unit_axis(field: str, numbers: Iterable[Any]) -> Vec3:
    """Unit vector in the direction of a nonzero vector."""
    values = list(map(float, numbers))
    length = math.hypot(*values)
    if not (length > 0.0 and math.isfinite(length)):
        refuse(
            field,
            values,
            "must have a direction (three finite numbers, not all zero; any length)",
        )
    # dividing by 1 +- 1e-16 would turn the exact ones of an axis into other numbers
    if abs(length - 1.0) <= ROUNDING:
        length = 1.0
    return Vec3.from_numbers([value / length for value in values])


def rotation(R: Mat3) -> Mat3:
    """Rotation matrix with entries rounded to 0 and 1 where sin and cos left rounding
    errors.
    """
    return Mat3.from_numbers([[_snap(float(entry)) for entry in row] for row in R.rows])


def _snap(entry: float) -> float:
    nearest = float(round(entry))
    return nearest if abs(entry - nearest) <= ROUNDING else entry


def rotation_rpy(rpy: Sequence[float]) -> Mat3:
    """Rotation matrix Rz(yaw) Ry(pitch) Rx(roll) of angles in rad: child axes to parent
    axes.

    Source: URDF specification, element origin.
    """
    return rotation(
        euler_rotation(tuple(map(math.sin, rpy)), tuple(map(math.cos, rpy)))
    )


def rpy_of(rotation: Mat3) -> tuple[float, float, float]:
    """Roll, pitch and yaw (rad) about fixed axes; in full also where the pitch is a
    right angle.
    """
    R = [[float(each) for each in row] for row in rotation.rows]
    yaw = math.atan2(R[1][0], R[0][0])
    # yaw is taken from the first column first: at a pitch of a right angle the last
    # angle absorbs the rest
    s, c = math.sin(yaw), math.cos(yaw)
    pitch = math.atan2(-R[2][0], c * R[0][0] + s * R[1][0])
    return (
        math.atan2(s * R[0][2] - c * R[1][2], c * R[1][1] - s * R[0][1]),
        pitch,
        yaw,
    )


Vector = tuple[float, float, float]

Matrix = tuple[Vector, Vector, Vector]

UPRIGHT: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def turn_onto(axis: Iterable[Any]) -> Matrix:
    """Rotation matrix (rows) of the smallest rotation that turns the z axis onto a
    given axis.
    """
    way = [*map(float, axis)]
    length = math.hypot(*way)
    if length == 0.0:
        return UPRIGHT
    x, y, z = (component / length for component in way)
    across = x * x + y * y
    if z < 0.0 and across == 0.0:
        # half a turn about any axis across z is as small: x is chosen
        return ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
    # 1 / (1 + z), which loses its digits next to the lower pole
    k = 1.0 / (1.0 + z) if z > 0.0 else (1.0 - z) / across
    return (
        (1.0 - k * x * x, -k * x * y, x),
        (-k * x * y, 1.0 - k * y * y, y),
        (-x, -y, z),
    )


def unit_quaternion(R: Mat3) -> list[float]:
    """Unit quaternion w, x, y, z of a rotation matrix.

    Source: Shepperd 1978, Quaternion from rotation matrix: by the largest of the four
    components.
    """
    # the largest row loses the fewest digits; its sign is free, as q and -q are one
    # rotation
    row = max(quaternion_products(R.rows), key=lambda each: math.hypot(*each))
    return [float(each) / math.hypot(*row) for each in row]


def rotation_quaternion(field: str, wxyz: Sequence[float]) -> Mat3:
    """Rotation matrix of a quaternion, whose length must be 1 to 1e-6."""
    length = math.hypot(*wxyz)
    if not abs(length - 1.0) <= TOLERANCE:
        refuse(
            field,
            list(wxyz),
            f"must be of unit length within {TOLERANCE:g}; its length is {length:.9g}",
        )
    return rotation(Quaternion(*map(float, wxyz)).normalized().rotation())


def quaternion_products(R: Any) -> list[list[Any]]:
    """Products (4 x 4) of the components w, x, y, z of a rotation matrix's quaternion,
    times 4.

    Each row is a multiple of the quaternion; that of the largest diagonal entry keeps
    the most digits.

    Args:
        R: three rows of three numbers or arrays.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R
    a, b, c, d, e, f = zy - yz, xz - zx, yx - xy, yx + xy, xz + zx, zy + yz
    w = 1.0 + xx + yy + zz
    x = 1.0 + xx - yy - zz
    y = 1.0 - xx + yy - zz
    z = 1.0 - xx - yy + zz
    return [[w, a, b, c], [a, x, d, e], [b, d, y, f], [c, e, f, z]]


def inertia(values: Iterable[Any]) -> Sym3:
    """Inertia matrix (kg m^2) from entries xx yy zz or xx yy zz xy xz yz."""
    return Sym3.from_numbers(*map(float, values))


def body(parts: Sequence[Body]) -> Body:
    """Merge the parts of one link into one body; exact zeros become constants of
    compiled code.
    """
    # a part that weighs nothing would still move the centre of mass by a rounding error
    weighed = [
        part for part in parts if any((part.mass, *part.inertia.entries))
    ] or parts[:1]
    whole = weighed[0] if len(weighed) == 1 else Body.of_parts(weighed)
    return Body(
        mass=float(whole.mass),
        com=vector(whole.com),
        inertia=inertia(whole.inertia.entries),
        planar=any(part.planar for part in parts),
    )


def tree_order(parents: Mapping[str, str], root: str, field: str) -> list[str]:
    """Order links so that every parent precedes its children, and otherwise keep the
    given order.

    Args:
        parents: name of each link's parent; ``root`` is the base.
        root: the base's name.
        field: words for a link's parent in a message, with ``{}`` for the link.

    Raises:
        VehicleError: a parent that does not exist, or links that form a ring.
    """
    names = list(parents)
    children: dict[str, list[int]] = {name: [] for name in (root, *names)}
    for index, (name, parent) in enumerate(parents.items()):
        if parent not in children:
            refuse(
                field.format(name),
                parent,
                must_be_one_of([each for each in children if each != name], parent),
            )
        children[parent].append(index)
    # Kahn's order with a heap: the earliest link of the file whose parent stands is
    # next
    order: list[str] = []
    ready = list(children[root])  # in the order of the file, so a heap
    while ready:
        name = names[heapq.heappop(ready)]
        order.append(name)
        for index in children[name]:
            heapq.heappush(ready, index)
    if len(order) < len(names):
        placed = set(order)
        ring = _ring(parents, next(name for name in names if name not in placed))
        refuse(
            field.format(ring[0]),
            parents[ring[0]],
            f"closed chains are not supported ({' -> '.join(ring)})",
        )
    return order


def _ring(parents: Mapping[str, str], start: str) -> list[str]:
    """Link names along a cycle of parents that is reached from a start link; the first
    name is repeated at the end.
    """
    walked = [start]
    while parents[walked[-1]] not in walked:
        walked.append(parents[walked[-1]])
    return [*walked[walked.index(parents[walked[-1]]) :], parents[walked[-1]]]
