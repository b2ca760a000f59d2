"""Moments of inertia of solid shapes, and how easily their contacts move them.

Integration steps follow from the largest angular frequency of a body on its contacts, w^2 = stiffness * mobility. A
body that lies on a face sinks and tilts on the contacts of its corners: with r their places from the centre of mass and
n across the face, mobility is the largest eigenvalue of the sum of J J^T, J = (1 / sqrt(m), (r x n) / sqrt(I)). The
largest sum of a row's absolute values stands for it (Gershgorin 1931): the same for a centre of mass in the middle, and
never less. What slides is moved at one place, 1/m + r^2 / I.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Vec3
from skyarm.scalars import absolute, add, maximum, minimum, mul, sqrt


def uniform_moments(shape: str, size: Sequence[Any], mass: Any) -> Vec3:
    """Principal moments of a box, cylinder or sphere of uniform density about its middle, kg m^2."""
    if shape == "sphere":
        moment = 0.4 * mass * size[0] * size[0]
        return Vec3(moment, moment, moment)
    if shape == "cylinder":
        radius, length = size
        across = mass * (radius * radius / 4.0 + length * length / 12.0)
        return Vec3(across, across, 0.5 * mass * radius * radius)
    x, y, z = (each * each for each in size)
    return Vec3(mass * (y + z) / 12.0, mass * (x + z) / 12.0, mass * (x + y) / 12.0)


def largest_mobility(shape: str, size: Sequence[Any], com: Vec3, mass: Any, moments: Vec3) -> Any:
    """1/kg, of the easiest contact.

    Args:
        shape: box, cylinder or sphere.
        size: of it, m.
        com: centre of mass, seen from the middle, m.
        mass: kg.
        moments: about the centre of mass, kg m^2.
    """
    least = minimum(minimum(moments.x, moments.y), moments.z)
    if shape == "sphere":
        return 1.0 / mass + _reach(size[0], com) / least
    if shape == "cylinder":
        radius, half = size[0], 0.5 * size[1]
        halves, stands = (radius, radius, half), 1.5 * radius * radius
        faces = [
            _face(3, stands, stands, com.x, com.y, mass, moments.x, moments.y),
            _face(2, 2.0 * half * half, 0, com.z, com.x, mass, moments.z, moments.x),
            _face(2, 2.0 * half * half, 0, com.z, com.y, mass, moments.z, moments.y),
        ]
    else:
        halves = tuple(0.5 * each for each in size)
        faces = [
            _face(4, 4.0 * halves[a] * halves[a], 4.0 * halves[b] * halves[b], com[a], com[b], mass, moments[a],
                  moments[b])
            for a, b in ((0, 1), (1, 2), (2, 0))
        ]  # fmt: skip
    found = faces[0]
    for each in (*faces[1:], *(1.0 / mass + _reach(half, Vec3(0, 0, com[i])) / least for i, half in enumerate(halves))):
        found = maximum(found, each)
    return found


def _reach(distance: Any, com: Vec3) -> Any:
    """Square of the largest distance of the skin from the centre of mass, m^2."""
    away = distance
    for each in com:
        away = add(away, _size(each))
    return away * away


def _face(
    count: int, spread_a: Any, spread_b: Any, off_a: Any, off_b: Any, mass: Any, moment_a: Any, moment_b: Any
) -> Any:
    """Bound of the mobility of a face of ``count`` contacts in the axes a and b, 1/kg.

    Args:
        count: of contacts.
        spread_a: sum of squares of their places along a about the middle, m^2.
        spread_b: the same along b.
        off_a: of the centre of mass along a, m.
        off_b: the same along b.
        mass: kg.
        moment_a: about the centre of mass and the axis a, kg m^2.
        moment_b: the same about b.
    """
    # a place along b tilts about a
    sink = count / mass
    about_a = add(spread_b, mul(count * 1.0, mul(off_b, off_b))) / moment_a
    about_b = add(spread_a, mul(count * 1.0, mul(off_a, off_a))) / moment_b
    with_a = mul(_size(off_b), count / sqrt(mass * moment_a))
    with_b = mul(_size(off_a), count / sqrt(mass * moment_b))
    both = mul(mul(_size(off_a), _size(off_b)), count / sqrt(moment_a * moment_b))
    rows = (add(add(sink, with_a), with_b), add(add(about_a, with_a), both), add(add(about_b, with_b), both))
    return maximum(maximum(rows[0], rows[1]), rows[2])


def _size(value: Any) -> Any:
    """|value|; a structural zero stays one."""
    return 0 if type(value) is int and value == 0 else absolute(value)
