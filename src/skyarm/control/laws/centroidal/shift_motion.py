"""Base offset that keeps the tip in place: derivatives, arm swing, base trajectory and gusts.

Swing. With c the sideways position of the common centre of mass, sigma the tilt under a steady force, delta the tilt
beyond it and lambda the height of the centre of mass above the tip, c - (lambda / g) c'' = -lambda sigma keeps the tip.
A swing of pace w changes the right side by N, and the bounded solution moves the centre of mass by N / (1 + r),
r = lambda w^2 / g; w^2 = mean(lambda''^2) / mean(lambda'^2). An arm above the base has r < 0 and a resonance at r = -1:
there the least squares (1 + r) / ((1 + r)^2 + r^2 / 4) stands for 1 / (1 + r).

Path. With l the height of the base above the tip, the shift s = (l / g) (a + s'') keeps the tip on a path of
acceleration a; of a motion of pace w it is (l / g) a / (1 + l w^2 / g). The attitude answers a + u'', u the shift of
the centre of mass: u'' follows u' of the period before, d(u'')/dt = -w^2 u', and is pulled to that of the attitude; u'
takes one Newton step a period. w^2 = (a'^2 - a a'') / (a^2 - v a') for each horizontal axis (Kaiser 1990), bounded
before the resonance of an arm above the base.

Gusts. The least integral of tip^2 under a force d per mass that stays moves the base as
c'' = -p^2 (c + d / p^2) - 2 p c', p^2 = g / lambda: a filter of second order at the pace p. Noise is filtered more
slowly: the pace goes from ``slowest`` to p as the force leaves the filtered one by more than ``size``.

Sources: Devasia, Chen, Paden 1996 (inverse of a system whose zero dynamics are unstable); Kwakernaak, Sivan 1972
(least error of a plant with a zero in the right half plane).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from skyarm.algebra import ZERO3, Vec3
from skyarm.algebra.scalars import Scalar, divide, exp, maximum, minimum, where
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.attitude import Attitude, Posture, derivative
from skyarm.control.blocks.filters import low_pass, low_pass_share
from skyarm.control.blocks.select import data, vector_data
from skyarm.control.laws.centroidal.com_tracking import ArmMotion
from skyarm.control.laws.centroidal.force_trend import AHEAD, lateness
from skyarm.control.laws.centroidal.parameters import CentroidalParameters, GustGains
from skyarm.control.laws.centroidal.part import Step
from skyarm.control.laws.centroidal.presets import SHORTEST, arm_length
from skyarm.control.laws.centroidal.tip_tasks import level_turn, needed_shift
from skyarm.dynamics.kinematics import jacobian_columns, link_poses
from skyarm.records.units import Unit
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class ShiftMotion:
    """Filter state of two differentiators in series, for jerk and snap of the base offset."""

    acceleration: Annotated[Vec3, Unit("m/s^2", "of the base's shift, filtered")]
    jerk: Annotated[Vec3, Unit("m/s^3", "of the base's shift, filtered")]


def differentiate(
    memory: ShiftMotion, acceleration: Vec3, bandwidth: Scalar, dt: Scalar
) -> tuple[ShiftMotion, Vec3, Vec3]:
    """Next filter state, jerk and snap of the base offset, by two filtered differentiations."""
    jerk = (acceleration - memory.acceleration) * bandwidth
    snap = (jerk - memory.jerk) * bandwidth
    following = ShiftMotion(
        acceleration=vector_data(memory.acceleration + jerk * dt), jerk=vector_data(memory.jerk + snap * dt)
    )
    return following, jerk, snap


SWINGLESS = 1e-6
"""(m/s)^2: mean square of the lever's rate below which the arm stands still, and the pace counts as slow."""

SHORT = 0.03
"""m: heights of the tip against the base below which a shift says little about the tilt that it answers."""

RESONANT = 0.25
"""Weight of r^2 in the least squares of an arm above the base."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SwingPace:
    """Mean squared derivatives of the centre of mass's height above the tip, which give the arm's swing frequency."""

    rate: Annotated[Scalar, Unit("(m/s)^2", "mean square of the lever's rate")]
    acceleration: Annotated[Scalar, Unit("(m/s^2)^2", "mean square of the lever's acceleration")]


@dataclass(frozen=True, slots=True)
class SwingShift:
    """Base offset under arm swing with two derivatives (m, world axes), and the swing's part of jerk and snap.

    ``steady`` is its acceleration without the swing's part.
    """

    offset: tuple[Vec3, Vec3, Vec3]
    steady: Vec3
    jerk: Vec3
    snap: Vec3


def levers(level: Posture) -> list[Scalar]:
    """Height of the centre of mass above the tip of a level vehicle, m, with four derivatives."""
    return [derivative(level.com, k).z - derivative(level.tip, k).z for k in range(5)]


def tilt_of(needed: Vec3, level: Posture) -> Vec3:
    """Tilt (rad) that a base offset compensates: the offset over the tip's height relative to the base."""
    height = derivative(level.tip, 0).z
    per_height = divide(height, height * height + SHORT * SHORT)
    return Vec3(needed.x * per_height, needed.y * per_height, 0)


def swing_pace(memory: SwingPace, lever: list[Scalar], rate: Scalar, dt: Scalar) -> SwingPace:
    """Swing statistics of the arm after one period; filter ``rate`` in 1/s."""
    share = low_pass_share(rate, dt)
    return SwingPace(
        rate=memory.rate + (lever[1] * lever[1] - memory.rate) * share,
        acceleration=memory.acceleration + (lever[2] * lever[2] - memory.acceleration) * share,
    )


def shift_for_swing(memory: SwingPace, needed: list[Vec3], level: Posture, gravity: Scalar) -> SwingShift:
    """Base offset that keeps the tip in place while the arm swings.

    ``needed`` is the shift (m, world axes) required by each instant, with two derivatives.
    """
    lever = levers(level)
    square = divide(memory.acceleration, memory.rate + SWINGLESS)
    per = divide(lever[0], gravity)
    r = per * square
    damped = where(r < 0.0, RESONANT, 0.0) * r
    # 1 - share = gain w^2, so that a swing about an unknown mean needs its acceleration only
    gain = per * divide(1.0 + r + damped, (1.0 + r) * (1.0 + r) + damped * r)
    share = 1.0 - gain * square
    tilt = tilt_of(needed[0], level)
    swing = [tilt * -each for each in lever]
    steady = needed[2] - swing[2]
    offset = (needed[0] + swing[2] * gain, needed[1] + swing[1] * (share - 1.0), steady + swing[2] * share)
    return SwingShift(offset, steady, swing[3] * share, swing[4] * share)


def move_shift(
    par: CentroidalParameters, before: Following, needed: list[Vec3], level: Posture, dt: Scalar, own: Vec3 = ZERO3
) -> tuple[Following, list[Vec3]]:
    """Filter the base offset that keeps a tip in place; return the filter states and its smooth derivatives.

    ``needed`` has two derivatives; ``own`` (m/s^2, world axes) jumps with a force and is not differentiated.
    """
    gains, shift, pace = par.tip.shift, before.shift, before.pace
    if gains is None or not shift:
        return before, needed
    if gains.swing_rate is None or not pace:
        shift, jerk, snap = differentiate(shift, needed[2] - own, gains.bandwidth, dt)
        return dataclasses.replace(before, shift=shift), [*needed, jerk, snap]
    pace = swing_pace(pace, levers(level), gains.swing_rate, dt)
    swung = shift_for_swing(pace, needed, level, par.model.gravity)
    shift, jerk, snap = differentiate(shift, swung.steady - own, gains.bandwidth, dt)
    after = dataclasses.replace(before, shift=shift, pace=pace)
    return after, [*swung.offset, jerk + swung.jerk, snap + swung.snap]


STILL = 0.1
"""(m/s^2)^2: ``size`` of an axis, twice its mean square, below which it counts as at rest."""

FOLLOWING = 2.0
"""1/s, at which u'' is pulled to what the attitude asks for: slowly, so that jumps of the reference's snap pass by."""

BELOW, ABOVE = 1.0, 0.5
"""The largest l w^2 / g that is reckoned with, of an arm below the base and of one above."""

LEAST = 1e-6
"""s^2: l / g below which the pace is not bounded."""


@dataclass(frozen=True, kw_only=True, slots=True)
class AxisShift:
    """Statistics of the base trajectory along one axis, and rate and acceleration of the centre-of-mass offset."""

    size: Annotated[Scalar, Unit("(m/s^2)^2", "mean square of the path's acceleration, doubled")]
    change: Annotated[Scalar, Unit("(m/s^3)^2", "mean square of the path's jerk, doubled")]
    rate: Annotated[Scalar, Unit("m/s", "of the shift of the centre of mass")]
    acceleration: Annotated[Scalar, Unit("m/s^2", "of the shift of the centre of mass")]


PathShift = tuple[AxisShift, AxisShift]
"""Memory of x and y, world axes."""

AT_REST = AxisShift(size=0.0, change=0.0, rate=0.0, acceleration=0.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class Following:
    """Filter states of base offset, arm motion, arm swing and base trajectory; empty where disabled."""

    shift: ShiftMotion | tuple[()] = ()
    arm: ArmMotion | tuple[()] = ()
    pace: SwingPace | tuple[()] = ()
    path: PathShift | tuple[()] = ()


def first_following(par: CentroidalParameters) -> Following:
    """Initial filter states of base offset, arm motion, arm swing and base trajectory."""
    zero, moves = Vec3(0.0, 0.0, 0.0), par.tip.shift
    return Following(
        shift=() if moves is None else ShiftMotion(acceleration=zero, jerk=zero),
        arm=() if par.center.arm_turn is None else ArmMotion(size=0.0, mean=zero),
        pace=() if moves is None or moves.swing_rate is None else SwingPace(rate=0.0, acceleration=0.0),
        path=() if moves is None or moves.path_rate is None else (AT_REST, AT_REST),
    )


def with_shift(path: PathShift | tuple[()], base: list[Vec3], level: Posture, gravity: Scalar) -> list[Vec3]:
    """Base reference with the horizontal centre-of-mass offset added to its four derivatives.

    ``path`` is empty where the attitude answers the reference alone; ``level`` the references' posture on a level base.
    """
    if not path:
        return base
    per = _per(level, gravity)
    x, y = (
        (axis.rate, axis.acceleration, axis.rate * -w2, axis.acceleration * -w2)
        for axis, w2 in ((axis, square_of_pace(axis, per)) for axis in path)
    )
    return [base[0], *(Vec3(a.x + u, a.y + v, a.z) for a, u, v in zip(base[1:], x, y, strict=True))]


def path_step(
    path: PathShift | tuple[()],
    base: list[Vec3],
    asked: list[Vec3],
    yaw: Taylor,
    level: Posture,
    turned: Posture,
    still: Attitude,
    par: CentroidalParameters,
    dt: Scalar,
) -> PathShift | tuple[()]:
    """Statistics of the base trajectory and centre-of-mass offset along x and y, one period later.

    ``asked`` is the shift of the base under the attitude ``still``, that of the result of :func:`with_shift`; ``level``
    and ``turned`` are the postures of a level base's references and of the arm under the attitude.
    """
    rate = None if par.tip.shift is None else par.tip.shift.path_rate
    if not path or rate is None:
        return path
    per, lever = _per(level, par.model.gravity), levers(level)
    com = needed_shift(level.com, yaw, turned.com, still)
    tilt = tilt_of(asked[0], level)
    # the shift of an arm that swings under a steady tilt is no motion along the path
    u1, u2 = (asked[k] - com[k] + tilt * lever[k] for k in (1, 2))
    rows = zip(path, zip(*base, strict=True), u1, u2, strict=False)
    x, y = (axis_step(axis, reference, (a, b), per, rate, dt) for axis, reference, a, b in rows)
    return x, y


def square_of_pace(axis: AxisShift, per: Scalar) -> Scalar:
    """Squared angular frequency (rad/s)^2 of the base's motion along one axis, bounded before resonance."""
    most = divide(BELOW, maximum(maximum(per, per * (-BELOW / ABOVE)), LEAST))
    return minimum(divide(maximum(axis.change, 0.0), maximum(axis.size, 0.0) + STILL), most)


def _per(level: Posture, gravity: Scalar) -> Scalar:
    return divide(levers(level)[0], gravity)


def axis_step(
    axis: AxisShift, reference: tuple[Scalar, ...], asked: tuple[Scalar, Scalar], per: Scalar, rate: Scalar, dt: Scalar
) -> AxisShift:
    """Trajectory statistics of one axis, one period later."""
    _, v, a, jerk, snap = reference
    share = low_pass_share(rate, dt)
    w2, size = square_of_pace(axis, per), maximum(axis.size, 0.0)
    newton = divide(1.0, 1.0 + maximum(per, 0.0) * w2)
    pull = (asked[1] * divide(size, size + STILL) - axis.acceleration) * FOLLOWING
    return AxisShift(
        size=data(axis.size + (a * a - v * jerk - axis.size) * share),
        change=data(axis.change + (jerk * jerk - a * snap - axis.change) * share),
        rate=data(axis.rate + (asked[0] - axis.rate) * newton + axis.acceleration * dt),
        acceleration=data(axis.acceleration + (pull - axis.rate * w2) * dt),
    )


QUICKEST = 10.0
"""rad/s, pace of the shift of a short arm at most; a shorter arm shifts less."""

NOISE = 0.3
"""m/s^2: changes of the force per mass below which the shift follows slowly."""


@dataclass(frozen=True, kw_only=True, slots=True)
class GustMemory:
    """State of the second-order force filter under gusts: rate of the filtered force."""

    rate: Annotated[Vec3, Unit("N/s", "of the filtered force, world axes")]


@dataclass(frozen=True, slots=True)
class SlowForce:
    """Filtered disturbance force (N) with two derivatives, and the filter's state."""

    force: Vec3
    rate: Vec3 = ZERO3
    bend: Vec3 = ZERO3
    memory: GustMemory | tuple[()] = ()


def gust_gains(share: float, vehicle: Vehicle, gravity: Scalar) -> GustGains:
    """Constants of the base offset under gusts, from a share of the arm's pendulum frequency."""
    pace = math.sqrt(float(gravity) / max(arm_length(vehicle), SHORTEST))
    return GustGains(pace=share * min(pace, QUICKEST), size=NOISE * float(vehicle.mass))


def slow_force(
    par: CentroidalParameters, before: Vec3, memory: GustMemory | tuple[()], force: Vec3, dt: Scalar
) -> SlowForce:
    """Low-pass filtered disturbance force that the base offset follows, N, world axes.

    The filter's step is exact for a constant force, so that it is stable at any period.
    """
    slowest, gust = par.tip.shift_rate, None if par.tip.shift is None else par.tip.shift.gust
    if gust is None or not memory:
        return SlowForce(low_pass(before, force, slowest, dt))
    off = before - force
    square = off.dot(off) * divide(1.0, gust.size * gust.size)
    w = slowest + (gust.pace - slowest) * divide(square, square + 1.0)
    turn = w * dt
    left = exp(-turn)
    away = (off * (1.0 + turn) + memory.rate * dt) * left
    rate = vector_data((memory.rate * (1.0 - turn) - off * (w * turn)) * left)
    return SlowForce(vector_data(force + away), rate, away * -(w * w) - rate * (2.0 * w), GustMemory(rate=rate))


def steady_force(par: CentroidalParameters, step: Step, slow: SlowForce, adapted: Vec3) -> tuple[Vec3, SlowForce]:
    """Predicted force that the attitude balances (N, world axes), and the filtered disturbance force."""
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
    """Acceleration of the base offset from the second derivative of the disturbance force, m/s^2, world axes.

    It jumps with the force; its derivatives would require more torque than rotors have, and are left out.

    ``force`` (N, world axes) is the rotors', a series; ``turned`` and ``level`` are the joints of an arm whose links
    are turned as those of a level base, and its posture.
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
