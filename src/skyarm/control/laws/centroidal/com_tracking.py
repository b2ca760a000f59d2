"""Tracking of the centre of mass: the force that moves it, with two derivatives.

p_c,d = p_d + R_q h(th_d): the base's reference plus the arm's, with R_q the quasi-static attitude. Differentiating R_q
too would invert the zero dynamics h theta'' + g theta = x'', which are undamped for a hanging arm and unstable for an
arm on top; so the base is exact as far as R_q is the attitude.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.algebra import E_Z, Mat3, Vec3
from skyarm.control.blocks.attitude import reachable
from skyarm.control.blocks.series_kinematics import derivative
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.scalars import divide, mul, sqrt
from skyarm.scalars.taylor import Taylor


@dataclass(frozen=True, slots=True)
class Thrust:
    """Wanted force (series of second order, world axes, N), its part along the present thrust axis, and a_c, m/s^2."""

    force: Vec3
    along: Any
    acceleration: Vec3


def quasi_static(par: CentroidalParameters, mass: Any, base: list[Vec3], disturbance: Vec3) -> Vec3:
    """Force that the base's reference alone asks for, with two derivatives, N: m (p_d'' + g) - d."""
    wanted = [(base[2] + E_Z * par.model.gravity) * mass - disturbance, base[3] * mass, base[4] * mass]
    series = (Taylor.of_derivatives(each) for each in zip(*wanted, strict=True))
    return reachable(Vec3(*series), par.tilt, par.thrust_floor)


def goal(base: list[Vec3], com: Vec3, R_q: Mat3) -> list[Vec3]:
    """Reference of the centre of mass, value to fourth derivative, from those of the base and h(th_d) in base axes."""
    return [p + R_q.apply(derivative(com, k)) for k, p in enumerate(base)]


def thrust(
    par: CentroidalParameters,
    mass: Any,
    *,
    wanted: list[Vec3],
    position: Vec3,
    velocity: Vec3,
    R: Mat3,
    w: Vec3,
    disturbance: Vec3,
) -> Thrust:
    """Force m (p_c,d'' + g e_3 + PD) - d and its derivatives, which use the acceleration that the real thrust gives.

    Args:
        par: constants.
        mass: of the vehicle, kg.
        wanted: reference of the centre of mass, value to fourth derivative.
        position: of the centre of mass, world axes, m.
        velocity: the same, m/s.
        R: R_WB.
        w: body rate, rad/s.
        disturbance: N, world axes.
    """
    kp, kv, gravity, limit = par.base.position, par.base.velocity, E_Z * par.model.gravity, par.base.pull
    e, ed = position - wanted[0], velocity - wanted[1]
    pull = [kp.scaled(e) + kv.scaled(ed)]
    force = (wanted[2] + gravity - _bounded(pull, limit)) * mass - disturbance
    b3, b3d = R.column(2), R.apply(w.cross(E_Z))
    along = force.dot(b3)
    per_mass = divide(1.0, mass)
    edd = (b3 * along + disturbance) * per_mass - gravity - wanted[2]
    pull.append(kp.scaled(ed) + kv.scaled(edd))
    first = (wanted[3] - _bounded(pull, limit)) * mass
    change = first.dot(b3) + force.dot(b3d)
    eddd = (b3 * change + b3d * along) * per_mass - wanted[3]
    pull.append(kp.scaled(edd) + kv.scaled(eddd))
    second = (wanted[4] - _bounded(pull, limit)) * mass
    series = (Taylor((f, g, mul(0.5, h))) for f, g, h in zip(force, first, second, strict=True))
    held = reachable(Vec3(*series), par.tilt, par.thrust_floor)
    pushed = derivative(held, 0).dot(b3)
    return Thrust(held, pushed, (b3 * pushed + disturbance) * per_mass - gravity)


def _bounded(pull: list[Vec3], limit: Any) -> Vec3:
    """Highest given derivative of pull / sqrt(1 + |pull|^2 / limit^2): a smooth bound that small pulls do not feel."""
    series = [Taylor.of_derivatives(each) for each in zip(*pull, strict=True)]
    square = series[0] * series[0] + series[1] * series[1] + series[2] * series[2]
    share = 1.0 / sqrt(square * divide(1.0, limit * limit) + 1.0)
    return Vec3(*((each * share).derivative(len(pull) - 1) for each in series))
