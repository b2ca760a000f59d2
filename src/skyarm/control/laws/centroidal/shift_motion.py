"""Steady force that the attitude and the base's shift follow, and memory of the shift.

Under gusts the least integral of tip^2 after a step of the force moves the base's shift by two equal poles at
p = sqrt(g / l), l the length of the arm: one is that of the shift itself, the other a filter of the force. Noise is
filtered more slowly: the filter goes from ``slowest`` to p as the force leaves the filtered one by more than ``size``,
unless it is the tip that is pushed, and is slower in gusts (``gust_rate``).

Source: Kwakernaak, Sivan 1972 (least error of a plant with a zero in the right half plane).
"""

from __future__ import annotations

import math

from skyarm.algebra import ZERO3_DATA, Vec3
from skyarm.algebra.scalars import Scalar, divide, maximum
from skyarm.control.blocks.filters import low_pass
from skyarm.control.laws.centroidal.base_shift import FIRST_SHIFT, Shift
from skyarm.control.laws.centroidal.com_tracking import ArmMotion
from skyarm.control.laws.centroidal.force_trend import AHEAD, lateness
from skyarm.control.laws.centroidal.parameters import CentroidalParameters, GustGains
from skyarm.control.laws.centroidal.part import Step
from skyarm.control.laws.centroidal.presets import SHORTEST, arm_length
from skyarm.records.immutable import immutable
from skyarm.vehicle.vehicle_records import Vehicle


@immutable
class Following:
    """Filter states of the centre of mass's shift and of the arm's motion; empty where disabled."""

    shift: Shift | tuple[()] = ()
    arm: ArmMotion | tuple[()] = ()


def first_following(par: CentroidalParameters) -> Following:
    """Initial states of shift and arm motion."""
    return Following(
        shift=() if par.tip.shift is None else FIRST_SHIFT,
        arm=() if par.center.arm_turn is None else ArmMotion(size=0.0, mean=ZERO3_DATA),
    )


QUICKEST = 10.0
"""rad/s, pace of the shift of a short arm at most; a shorter arm shifts less."""

NOISE = 2.0
"""Change of the force per mass, m/s^2, below which the shift follows slowly.

Little depends on it: half leaves 42.7 mm in turbulence of 6 m/s and 15.1 in wind steps of 3 N, this 42.4 and 15.3,
twice 42.2 and 15.5 (``fly`` of tests/control/measure_gusts.py, seeds 921 to 923).
"""


def gust_gains(share: float, vehicle: Vehicle, gravity: Scalar) -> GustGains:
    """Constants of the base offset under gusts, from a share of the arm's pendulum frequency."""
    pace = math.sqrt(float(gravity) / max(arm_length(vehicle), SHORTEST))
    return GustGains(pace=share * min(pace, QUICKEST), size=NOISE * float(vehicle.mass))


def slow_force(
    par: CentroidalParameters, before: Vec3, force: Vec3, dt: Scalar, share: Scalar = 1, rough: Scalar = 1
) -> Vec3:
    """Low-pass filtered disturbance force that the base's shift follows, N, world axes.

    ``share`` of the force acts on the base, where a jump is followed at once; ``rough`` air slows the filter.
    """
    slowest, gust = par.tip.shift_rate, None if par.tip.shift is None else par.tip.shift.gust
    if gust is None:
        held: Vec3 = low_pass(before, force, slowest, dt)
        return held
    off = before - force
    square = off.dot(off) * divide(1.0, gust.size * gust.size)
    pace = slowest + (gust.pace - slowest) * divide(share * square, square + 1.0)
    quick: Vec3 = low_pass(before, force, divide(pace, rough), dt)
    return quick


def steady_force(par: CentroidalParameters, step: Step, slow: Vec3, adapted: Vec3) -> Vec3:
    """Predicted force that the attitude balances, N, world axes."""
    steady = (slow if par.mode == "tip" else step.force) + adapted
    if par.parts.trend is None:
        return steady
    late = lateness(par)
    if par.mode == "tip":
        late = late + divide(1.0, maximum(par.tip.shift_rate, AHEAD))
    return steady + step.rate * late
