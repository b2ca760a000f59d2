"""Motion of the base's shift: its derivatives, while the arm swings under a tilted base and along a path.

Swing. Under a sideways force the base tilts by sigma, and shifts to keep the tip. When the arm swings, the required
shift changes, and the tilt for its acceleration carries the tip further than the shift brings it back. With c the
sideways position of the common centre of mass, delta the tilt beyond sigma and lambda the height of the centre of mass
above the tip,

    c'' = -g delta,   tip = c + lambda (sigma + delta),   thus   c - (lambda / g) c'' = -lambda sigma

keeps the tip. A swing of pace w (rad/s) changes the right side by N = -sigma (lambda - its mean), N'' = -w^2 N, and the
bounded solution moves the centre of mass by N / (1 + r), r = lambda w^2 / g. An arm above the base has r < 0 and a
resonance at r = -1: there the least squares (1 + r) / ((1 + r)^2 + r^2 / 4) stands for 1 / (1 + r).
The pace is the root of mean(lambda''^2) / mean(lambda'^2) along the reference, exact for one frequency.
Derived for this law; the inverse of a system whose zero dynamics are unstable: Devasia, Chen, Paden 1996.

Path. Along a path the base tilts for its acceleration a and shifts by s to keep the tip; it thus accelerates by a + s''
and tilts for that. With l the height of the base above the tip

    s = (l / g) (a + s''),

whose bounded solution for a motion of pace w is s = (l / g) a / (1 + l w^2 / g). The attitude answers a + u'' with u
the shift of the centre of mass, for which l is its height above the tip. Nothing is differentiated: u'' follows the
rate u' of the period before, d(u'')/dt = -w^2 u', and is pulled to the u'' of the attitude; the next derivatives are
-w^2 u' and -w^2 u''. u' takes one Newton step a period: the u' of the attitude falls by l w^2 / g of what u' grows.

The pace of each horizontal axis comes from the reference: a'^2 - a a'' over a^2 - v a', both constant along a sine
(Kaiser 1990). Of an arm above the base l < 0, and the pace is bounded before the resonance at -l w^2 / g = 1. Vertical
motion, by l (1 - cos theta) at a tilt theta, is left to the feedback.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.algebra.scalars import Scalar, divide, maximum, minimum, where
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.attitude import Attitude, Posture, derivative
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.select import data, vector_data
from skyarm.control.laws.centroidal.com_tracking import ArmMotion
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.laws.centroidal.tip_tasks import needed_shift
from skyarm.records.units import Unit


@dataclass(frozen=True, kw_only=True, slots=True)
class ShiftMotion:
    """Memory of two differentiators in a row, of the acceleration of the base's shift."""

    acceleration: Annotated[Vec3, Unit("m/s^2", "of the base's shift, filtered")]
    jerk: Annotated[Vec3, Unit("m/s^3", "of the base's shift, filtered")]


def differentiate(
    memory: ShiftMotion, acceleration: Vec3, bandwidth: Scalar, dt: Scalar
) -> tuple[ShiftMotion, Vec3, Vec3]:
    """The memory one period later, jerk and snap of the shift; ``bandwidth`` of each differentiator in rad/s."""
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
    """Memory: mean squares of the first and the second derivative of the tip's height below the centre of mass."""

    rate: Annotated[Scalar, Unit("(m/s)^2", "mean square of the lever's rate")]
    acceleration: Annotated[Scalar, Unit("(m/s^2)^2", "mean square of the lever's acceleration")]


@dataclass(frozen=True, slots=True)
class SwingShift:
    """The shift to its second derivative (m to m/s^2, world axes); third and fourth of the swing's part.

    ``steady`` is its acceleration without the swing's part.
    """

    offset: tuple[Vec3, Vec3, Vec3]
    steady: Vec3
    jerk: Vec3
    snap: Vec3


def levers(level: Posture) -> list[Scalar]:
    """Height of the centre of mass above the tip with four derivatives, m, of a level base."""
    return [derivative(level.com, k).z - derivative(level.tip, k).z for k in range(5)]


def tilt_of(needed: Vec3, level: Posture) -> Vec3:
    """The tilt that a shift answers, rad: the shift over the height of the tip against the base."""
    height = derivative(level.tip, 0).z
    per_height = divide(height, height * height + SHORT * SHORT)
    return Vec3(needed.x * per_height, needed.y * per_height, 0)


def swing_pace(memory: SwingPace, lever: list[Scalar], rate: Scalar, dt: Scalar) -> SwingPace:
    """The memory one period later; ``rate`` in 1/s."""
    share = low_pass_share(rate, dt)
    return SwingPace(
        rate=memory.rate + (lever[1] * lever[1] - memory.rate) * share,
        acceleration=memory.acceleration + (lever[2] * lever[2] - memory.acceleration) * share,
    )


def shift_for_swing(memory: SwingPace, needed: list[Vec3], level: Posture, gravity: Scalar) -> SwingShift:
    """The shift that the tip needs while the arm swings.

    Args:
        memory: of the swing's pace.
        needed: shift required by each instant, with two derivatives, world axes.
        level: posture of the references of a level base, series of fourth order.
        gravity: m/s^2.
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
    """Memory one period later, and the shift with as many derivatives as the law uses.

    Args:
        par: constants.
        before: memory, one period earlier.
        needed: shift required by each instant, with two derivatives.
        level: posture of the references of a level base.
        dt: control period, s.
        own: part of its acceleration that jumps with a force and is not differentiated, m/s^2, world axes.
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
    """Memory of one horizontal axis: means of a^2 - v a' and a'^2 - a a'' of the reference; u' and u''."""

    size: Annotated[Scalar, Unit("(m/s^2)^2", "mean square of the path's acceleration, doubled")]
    change: Annotated[Scalar, Unit("(m/s^3)^2", "mean square of the path's jerk, doubled")]
    rate: Annotated[Scalar, Unit("m/s", "of the shift of the centre of mass")]
    acceleration: Annotated[Scalar, Unit("m/s^2", "of the shift of the centre of mass")]


PathShift = tuple[AxisShift, AxisShift]
"""Memory of x and y, world axes."""

AT_REST = AxisShift(size=0.0, change=0.0, rate=0.0, acceleration=0.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class Following:
    """Memory of the demands: shift of the base, motion of the arm, paces of swing and path; empty if left out."""

    shift: ShiftMotion | tuple[()] = ()
    arm: ArmMotion | tuple[()] = ()
    pace: SwingPace | tuple[()] = ()
    path: PathShift | tuple[()] = ()


def first_following(par: CentroidalParameters) -> Following:
    """Memory before the first step: everything rests."""
    zero, moves = Vec3(0.0, 0.0, 0.0), par.tip.shift
    return Following(
        shift=() if moves is None else ShiftMotion(acceleration=zero, jerk=zero),
        arm=() if par.center.arm_turn is None else ArmMotion(size=0.0, mean=zero),
        pace=() if moves is None or moves.swing_rate is None else SwingPace(rate=0.0, acceleration=0.0),
        path=() if moves is None or moves.path_rate is None else (AT_REST, AT_REST),
    )


def with_shift(path: PathShift | tuple[()], base: list[Vec3], level: Posture, gravity: Scalar) -> list[Vec3]:
    """The base's reference, value to fourth derivative, with the horizontal shift in all but its position.

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
    """The memory one period later.

    Args:
        path: memory; empty where it is left out.
        base: reference without the shift, value to fourth derivative, world axes.
        asked: shift of the base under the attitude, with two derivatives.
        yaw: heading.
        level: posture of the references of a level base.
        turned: posture of the arm under the attitude.
        still: that attitude, of the result of :func:`with_shift`.
        par: constants.
        dt: control period, s.
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


def square_of_pace(axis: AxisShift, per: Scalar) -> Any:
    """w^2, (rad/s)^2; ``per`` is l / g in s^2."""
    most = divide(BELOW, maximum(maximum(per, per * (-BELOW / ABOVE)), LEAST))
    return minimum(divide(maximum(axis.change, 0.0), maximum(axis.size, 0.0) + STILL), most)


def _per(level: Posture, gravity: Scalar) -> Any:
    return divide(levers(level)[0], gravity)


def axis_step(
    axis: AxisShift, reference: tuple[Scalar, ...], asked: tuple[Scalar, Scalar], per: Scalar, rate: Scalar, dt: Scalar
) -> AxisShift:
    """Memory of an axis one period later; ``asked`` are u' and u'' of the present attitude, ``rate`` in 1/s."""
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
