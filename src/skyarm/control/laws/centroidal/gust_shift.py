"""Shift of the base under a changing force, at the pace of least tip error.

With c sideways of the common centre of mass, theta its tilt, lambda the height of the centre of mass above the tip of a
hanging arm and d the force per mass

    c'' = g theta + d,   tip = c - lambda theta,   thus   c'' = p^2 (c - tip) + d,   p^2 = g / lambda.

No law can hold the tip while d changes: sigma = c' + p c grows as sigma' = p sigma + d - p^2 tip unless the tip moves.
For a force that stays, the least integral of tip^2 is tip = (2 / p) (sigma + d / p), which moves the base as

    c'' = -p^2 (c + d / p^2) - 2 p c',

both poles at the pace p of an inverted pendulum: the required shift -d / p^2 through a filter of second order, which
gives its velocity and acceleration too. Noise is filtered more slowly: the pace goes from ``slowest`` to p as the force
leaves the filtered one by more than ``size``.
Source: Kwakernaak, Sivan 1972 (least error of a plant with a zero in the right half plane); the mirrored pole at p.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from skyarm.algebra import ZERO3, Vec3
from skyarm.algebra.scalars import Scalar, divide, exp, maximum
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.attitude import Attitude, Posture, derivative
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.select import vector_data
from skyarm.control.laws.centroidal.force_trend import AHEAD, lateness
from skyarm.control.laws.centroidal.parameters import CentroidalParameters, GustGains
from skyarm.control.laws.centroidal.part import Step
from skyarm.control.laws.centroidal.presets import SHORTEST, arm_length
from skyarm.control.laws.centroidal.tip_tasks import level_turn
from skyarm.dynamics.kinematics import jacobian_columns, link_poses
from skyarm.records.units import Unit
from skyarm.vehicle.vehicle_records import Vehicle

QUICKEST = 10.0
"""rad/s, pace of the shift of a short arm at most; a shorter arm shifts less."""

NOISE = 0.3
"""m/s^2: changes of the force per mass below which the shift follows slowly."""


@dataclass(frozen=True, kw_only=True, slots=True)
class GustMemory:
    """Memory in addition to the filtered force."""

    rate: Annotated[Vec3, Unit("N/s", "of the filtered force, world axes")]


@dataclass(frozen=True, slots=True)
class SlowForce:
    """Filtered force, N, its first two derivatives, N/s and N/s^2, and the filter's memory."""

    force: Vec3
    rate: Vec3 = ZERO3
    bend: Vec3 = ZERO3
    memory: GustMemory | tuple[()] = ()


def gust_gains(share: float, vehicle: Vehicle, gravity: Scalar) -> GustGains:
    """Constants for a share of the pendulum's pace; the arm's length approximates the height above the tip."""
    pace = math.sqrt(float(gravity) / max(arm_length(vehicle), SHORTEST))
    return GustGains(pace=share * min(pace, QUICKEST), size=NOISE * float(vehicle.mass))


def slow_force(
    par: CentroidalParameters, before: Vec3, memory: GustMemory | tuple[()], force: Vec3, dt: Scalar
) -> SlowForce:
    """The force that the shift follows (N, world axes), one period later: first order, second order with ``gust``.

    The filter's step is exact for a constant force, so that it is stable at any period.
    """
    slowest, gust = par.tip.shift_rate, None if par.tip.shift is None else par.tip.shift.gust
    if gust is None or not memory:
        return SlowForce(before + (force - before) * low_pass_share(slowest, dt))
    off = before - force
    square = off.dot(off) * divide(1.0, gust.size * gust.size)
    w = slowest + (gust.pace - slowest) * divide(square, square + 1.0)
    turn = w * dt
    left = exp(-turn)
    away = (off * (1.0 + turn) + memory.rate * dt) * left
    rate = vector_data((memory.rate * (1.0 - turn) - off * (w * turn)) * left)
    return SlowForce(vector_data(force + away), rate, away * -(w * w) - rate * (2.0 * w), GustMemory(rate=rate))


def steady_force(par: CentroidalParameters, step: Step, slow: SlowForce, adapted: Vec3) -> tuple[Vec3, SlowForce]:
    """Force that the attitude balances (N, world axes), and the filtered one with its derivatives, predicted."""
    steady, rate, shift = (slow.force if par.mode == "tip" else step.force) + adapted, step.rate, par.tip.shift
    if step.trend is None:
        return steady, slow
    late = lateness(par)
    if par.mode != "tip" or shift is None or shift.gust is None:
        if par.mode == "tip":
            late = late + divide(1.0, maximum(par.tip.shift_rate, AHEAD))
        return steady + rate * late, slow
    # a change that can be predicted is followed as it is, the rest through the filter
    level, share = step.trend
    left = 1.0 - share
    force = steady + (level - slow.force) * share + rate * late
    return force, dataclasses.replace(slow, rate=slow.rate * left + rate, bend=slow.bend * left)


def shift_acceleration(
    par: CentroidalParameters, still: Attitude, force: Vec3, turned: Sequence[Taylor], level: Posture, bend: Vec3
) -> Vec3:
    """Acceleration of the base's shift from the filtered force's second derivative, m/s^2, world axes.

    It jumps with the force; its derivatives would require more torque than rotors have, and are left out.

    Args:
        par: constants.
        still: quasi-static attitude.
        force: of the rotors, series, N, world axes.
        turned: joints of the arm whose links are turned as those of a level base.
        level: its posture.
        bend: second derivative of the disturbance, N/s^2, world axes, the opposite of that of ``force``.
    """
    vehicle, R, f = par.model.vehicle, still.R, derivative(force, 0)
    alpha = R.apply_T(bend.cross(f) * divide(1.0, f.dot(f)))
    moved = alpha.cross(derivative(level.tip, 0))
    if vehicle.n:
        values = tuple(q.derivative(0) for q in turned)
        bends = level_turn(vehicle, par.tip, alpha, link_poses(vehicle, values))
        for column, each in zip(jacobian_columns(vehicle, vehicle.frame(), values), bends, strict=True):
            moved = moved + column.linear * each
    return R.apply(moved) * -1.0
