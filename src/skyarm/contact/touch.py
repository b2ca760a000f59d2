"""What happens where a surface and a point meet: one pair of Hunt-Crossley contact with a bristle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Vec3
from skyarm.contact.material import LIGHTEST, Material


@dataclass(frozen=True, kw_only=True, slots=True)
class Touch:
    """What a surface does to a point, world axes.

    Attributes:
        depth: penetration, m; negative outside. slip: velocity of the point relative to the surface, m/s.
        normal: N, along ``axis``, the surface's outward normal.
        friction: N. bristle_rate: m/s. spot: where it acts, seen from the point, m.
    """

    depth: Any
    slip: Vec3
    normal: Any
    axis: Vec3
    friction: Vec3
    bristle_rate: Vec3
    spot: Vec3

    @property
    def force(self) -> Vec3:
        """Both forces, N."""
        total: Vec3 = self.axis * self.normal + self.friction
        return total


def touch_of(
    material: Material,
    depth: Any,
    axis: Vec3,
    spot: Vec3,
    slip: Vec3,
    held: Vec3,
    step: Any,
    mass: Any = LIGHTEST,
    *,
    mean: Any = None,
) -> Touch:
    """The touch of a point and a surface.

    Args:
        material: of the surface.
        depth: penetration, m.
        axis: the surface's outward normal, world axes.
        spot: where they touch, seen from the point, m.
        slip: velocity of the point relative to the surface at the spot, m/s.
        held: the bristle's deflection as the memory has it, m.
        step: longest integration step of the whole contact, s.
        mass: kg that the pair moves at least.
        mean: s, in which a point makes the way that the depth is a mean over; the material's longest step of a contact
            with a vehicle if left out.
    """
    bristle = _across(held, axis)  # a round surface's normal turns
    rate = material.bristle_rate(bristle, _across(slip, axis), depth, material.bristle_length / step)
    normal = material.normal_force(depth, -slip.dot(axis), mean)
    friction = material.friction_force(bristle, rate, normal, mass)
    return Touch(depth=depth, slip=slip, normal=normal, friction=friction, spot=spot, bristle_rate=rate, axis=axis)


def _across(vector: Vec3, n: Vec3) -> Vec3:
    """The part of a vector across a unit vector; across an axis of the world it is of two numbers by structure."""
    axis = n.coordinate_axis()
    if axis is None:
        across: Vec3 = vector - n * vector.dot(n)
        return across
    return Vec3(*(0 if i == axis else c for i, c in enumerate(vector)))
