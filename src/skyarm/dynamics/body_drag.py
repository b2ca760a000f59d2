"""Aerodynamic drag of the airframe."""

from __future__ import annotations

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import mul, same
from skyarm.vehicle import BodyDrag


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
    speed = velocity_B.smooth_norm()
    factor = mul(mul(-0.5, par.air_density), speed)
    return par.area.hadamard(velocity_B) * factor
