"""Tracking of the centre of mass: the force that moves it, with two derivatives.

p_c,d = p_d + R_q h(th_d): the base's reference plus the arm's, with R_q the quasi-static attitude. Taking R_q from the
force of the centre of mass itself would invert the zero dynamics h theta'' + g theta = x'', which are undamped for a
hanging arm and unstable for an arm on top; so the base is exact as far as R_q is the attitude.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import E_Z, ZERO3, Mat3, Vec3
from skyarm.control.blocks.attitude import Attitude, reachable
from skyarm.control.blocks.series_kinematics import derivative
from skyarm.control.blocks.sideways_force import Reach, across, applied
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.scalars import divide, mul, sqrt
from skyarm.scalars.taylor import Taylor


@dataclass(frozen=True, slots=True)
class Thrust:
    """Force that the centre of mass is moved with.

    Attributes:
        force: wanted, series of second order, world axes, N.
        along: N, of it along the present thrust axis. across: what the rotors give beside it, body axes, N.
        acceleration: a_c, m/s^2, that they give.
    """

    force: Vec3
    along: Any
    acceleration: Vec3
    across: Vec3 = ZERO3


def quasi_static(
    par: CentroidalParameters, mass: Any, base: list[Vec3], disturbance: Vec3, rates: Sequence[Vec3] = (ZERO3, ZERO3)
) -> Vec3:
    """Force that the base's reference alone asks for, with two derivatives, N: m (p_d'' + g) - d.

    ``rates`` are what is known of the disturbance's derivatives, N/s and N/s^2.
    """
    first, second = rates
    wanted = [
        (base[2] + E_Z * par.model.gravity) * mass - disturbance,
        base[3] * mass - first,
        base[4] * mass - second,
    ]
    series = (Taylor.of_derivatives(each) for each in zip(*wanted, strict=True))
    return reachable(Vec3(*series), par.tilt, par.thrust_floor)


def goal(base: list[Vec3], h: list[Vec3], still: Attitude, moving: bool) -> list[Vec3]:
    """Reference of the centre of mass, value to fourth derivative, from those of the base and h(th_d) in base axes.

    ``moving`` differentiates R_q too in velocity and acceleration, which its own motion needs: that of the reference
    and of slow disturbances, not of errors.
    """
    if not moving:
        return [p + still.R.apply(each) for p, each in zip(base, h, strict=True)]
    w, alpha = still.rate, still.acceleration
    carried = [
        h[0],
        w.cross(h[0]) + h[1],
        alpha.cross(h[0]) + w.cross(w.cross(h[0])) + w.cross(h[1]) * 2.0 + h[2],
        *h[3:],
    ]
    return [p + still.R.apply(each) for p, each in zip(base, carried, strict=True)]


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
    force_rate: Vec3 = ZERO3,
    force_bend: Vec3 = ZERO3,
    reach: Reach | None = None,
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
        force_rate: what is known of its derivative, N/s.
        force_bend: of its second derivative, N/s^2.
        reach: of the force across the thrust axis, if the rotors shall give one.
    """
    kv, gravity, limit = par.base.velocity, E_Z * par.model.gravity, par.base.pull
    e, ed = position - wanted[0], velocity - wanted[1]
    off = [e]
    pull = [_attraction(par, off) + kv.scaled(ed)]
    force = (wanted[2] + gravity - _bounded(pull, limit)) * mass - disturbance
    per_mass = divide(1.0, mass)
    edd = (applied(reach, [force], R, w) + disturbance) * per_mass - gravity - wanted[2]
    off.append(ed)
    pull.append(_attraction(par, off) + kv.scaled(edd))
    first = (wanted[3] - _bounded(pull, limit)) * mass - force_rate
    eddd = (applied(reach, [force, first], R, w) + force_rate) * per_mass - wanted[3]
    off.append(edd)
    pull.append(_attraction(par, off) + kv.scaled(eddd))
    second = (wanted[4] - _bounded(pull, limit)) * mass - force_bend
    series = (Taylor((f, g, mul(0.5, h))) for f, g, h in zip(force, first, second, strict=True))
    held = reachable(Vec3(*series), par.tilt, par.thrust_floor)
    pushed = applied(reach, [derivative(held, 0)], R, w)
    return Thrust(
        force=held,
        along=derivative(held, 0).dot(R.column(2)),
        acceleration=(pushed + disturbance) * per_mass - gravity,
        across=ZERO3 if reach is None else across(R.apply_T(pushed)),
    )


def _attraction(par: CentroidalParameters, errors: list[Vec3]) -> Vec3:
    """Highest given derivative of kp e, or of what stands for it where the law brakes in time.

    The velocity that kp e + kv e' settles at is kp / kv e, which no bounded thrust can stop from far away. With
    e_0 = 2 a (kv / kp)^2 it is kp e / (1 + |e / e_0|^4)^(1/8): near by kp e, far away the velocity sqrt(2 a |e|), which
    falls at the rate a (``par.approach``).
    """
    kp, kv = par.base.position, par.base.velocity
    if not par.brakes:
        return kp.scaled(errors[-1])
    near = [divide(p * p, v * v * (2.0 * par.approach)) for p, v in zip(kp, kv, strict=True)]
    series = [Taylor.of_derivatives(each) for each in zip(*errors, strict=True)]
    x, y, z = (each * share for each, share in zip(series, near, strict=True))
    square = x * x + y * y + z * z
    left = 1.0 / sqrt(sqrt(sqrt(square * square + 1.0)))
    return Vec3(*(p * (each * left).derivative(len(errors) - 1) for p, each in zip(kp, series, strict=True)))


def _bounded(pull: list[Vec3], limit: Any) -> Vec3:
    """Highest given derivative of pull / sqrt(1 + |pull|^2 / limit^2): a smooth bound that small pulls do not feel."""
    series = [Taylor.of_derivatives(each) for each in zip(*pull, strict=True)]
    square = series[0] * series[0] + series[1] * series[1] + series[2] * series[2]
    share = 1.0 / sqrt(square * divide(1.0, limit * limit) + 1.0)
    return Vec3(*((each * share).derivative(len(pull) - 1) for each in series))
