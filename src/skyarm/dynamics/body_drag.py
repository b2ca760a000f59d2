"""Aerodynamic drag of the airframe."""

from __future__ import annotations

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import mul, same, sqrt
from skyarm.vehicle import BodyDrag

_STILL = 1e-24
"""m^2/s^2, under the root: changes no bit of a speed above 1e-4 m/s, and the derivative
at rest is 0 instead of NaN."""


def body_drag(par: BodyDrag, velocity_B: Vec3) -> Vec3:
    """Drag force on the base origin, base axes, N: -1/2 rho area_i |v| v_i.

    Args:
        par: areas per axis, m^2, and air density.
        velocity_B: velocity of the base relative to the air, base axes, m/s.
    Source: Hoerner 1965, chapter 1 (quadratic drag), with one area per axis.
    """
    if all(same(area, 0) for area in par.area):
        # no drag in the description: an int 0 is structure and folds away
        return par.area
    speed = sqrt(velocity_B.dot(velocity_B) + _STILL)
    factor = mul(mul(-0.5, par.air_density), speed)
    return par.area.hadamard(velocity_B) * factor
