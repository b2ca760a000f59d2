"""The attitude of a base that shifts along a path.

Along a path the base tilts for its acceleration a and shifts by s to keep the tip on its reference. The shifted base
accelerates by a + s'' and tilts for that, not for a: on a circle of 1 m at 3 m/s the shift of an arm of 0.3 m is 0.20 m
for the one and 0.18 m for the other. With l the height of the base above the tip

    s = (l / g) (a + s''),

whose bounded solution for a motion of pace w (rad/s), s'' = -w^2 s, is s = (l / g) a / (1 + l w^2 / g). The common
centre of mass lies off the base by another such length, so that what the attitude answers is a + u'' with u the shift
of the centre of mass: l is the height of the centre of mass above the tip.

u'' and its derivatives are found without differentiating: u'' follows the rate u' of the period before,
d(u'')/dt = -w^2 u', and is pulled to the u'' that the attitude asks for; the next derivatives are -w^2 u' and -w^2 u''.
u' takes Newton steps of the equation above, one in a period: what the attitude with u' asks for falls by l w^2 / g of
what u' grows.

The pace of each horizontal axis comes from the reference alone: a'^2 - a a'' over a^2 - v a', both constant along a
sine, also in its rests (Kaiser 1990). An arm above the base has l < 0, and -l w^2 / g may come near to 1, where the
base meets the resonance of a pendulum upside down; the pace is bounded before.

Only the horizontal motion is answered. A base that tilts by theta also goes down by l (1 - cos theta), which on a
circle is constant and on a straight path comes and goes at twice the pace: by 37 mm along 1 m to either side with
2.5 m/s amid it. What that changes of the force, and of the attitude with it, is left to the feedback.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.attitude import Attitude
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.select import data
from skyarm.control.blocks.series_kinematics import Posture
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.laws.centroidal.swing_shift import levers, tilt_of
from skyarm.control.laws.centroidal.tip_reference import needed_shift
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, divide, maximum, minimum
from skyarm.scalars.taylor import Taylor

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
    """Memory of one horizontal axis.

    Attributes:
        size, change: means of a^2 - v a' and a'^2 - a a'' of the reference. rate, acceleration: u' and u''.
    """

    size: Annotated[Scalar, Unit("(m/s^2)^2", "mean square of the path's acceleration, doubled")]
    change: Annotated[Scalar, Unit("(m/s^3)^2", "mean square of the path's jerk, doubled")]
    rate: Annotated[Scalar, Unit("m/s", "of the shift of the centre of mass")]
    acceleration: Annotated[Scalar, Unit("m/s^2", "of the shift of the centre of mass")]


PathShift = tuple[AxisShift, AxisShift]
"""Memory of x and y, world axes."""

AT_REST = AxisShift(size=0.0, change=0.0, rate=0.0, acceleration=0.0)


def with_shift(path: PathShift | tuple[()], base: list[Vec3], level: Posture, gravity: Any) -> list[Vec3]:
    """The base's reference, value to fourth derivative, with the motion that the attitude answers beside it.

    The position stays that of the reference, and so does all of z.

    Args:
        path: memory; empty where the attitude answers the reference alone.
        base: without the shift, world axes.
        level: posture of the references of a level base.
        gravity: m/s^2.
    """
    if not path:
        return base
    per = _per(level, gravity)
    x, y = (
        (axis.rate, axis.acceleration, axis.rate * -w2, axis.acceleration * -w2)
        for axis, w2 in ((axis, square_of_pace(axis, per)) for axis in path)
    )
    return [base[0], *(Vec3(a.x + u, a.y + v, a.z) for a, u, v in zip(base[1:], x, y, strict=True))]


def moved_path(
    path: PathShift | tuple[()],
    base: list[Vec3],
    asked: list[Vec3],
    yaw: Taylor,
    level: Posture,
    turned: Posture,
    still: Attitude,
    par: CentroidalParameters,
    dt: Any,
) -> PathShift | tuple[()]:
    """The memory one period later.

    Args:
        path: memory; empty where it is left out.
        base: reference without the shift, value to fourth derivative, world axes.
        asked: shift of the base that the attitude asks for, with two derivatives.
        yaw: heading.
        level: posture of the references of a level base.
        turned: posture of the arm under the attitude.
        still: that attitude, of what :func:`with_shift` gave.
        par: constants.
        dt: control period, s.
    """
    rate = None if par.tip.shift is None else par.tip.shift.path_rate
    if not path or rate is None:
        return path
    per, lever = _per(level, par.model.gravity), levers(level)
    com = needed_shift(level.com, yaw, turned.com, still)
    tilt = tilt_of(asked[0], level)
    # what an arm that swings under a steady tilt asks for is no motion along the path: see swing_shift
    u1, u2 = (asked[k] - com[k] + tilt * lever[k] for k in (1, 2))
    rows = zip(path, zip(*base, strict=True), u1, u2, strict=False)
    x, y = (moved_axis(axis, reference, (a, b), per, rate, dt) for axis, reference, a, b in rows)
    return x, y


def square_of_pace(axis: AxisShift, per: Any) -> Any:
    """w^2, (rad/s)^2; ``per`` is l / g in s^2."""
    most = divide(BELOW, maximum(maximum(per, per * (-BELOW / ABOVE)), LEAST))
    return minimum(divide(maximum(axis.change, 0.0), maximum(axis.size, 0.0) + STILL), most)


def _per(level: Posture, gravity: Any) -> Any:
    return divide(levers(level)[0], gravity)


def moved_axis(
    axis: AxisShift, reference: tuple[Any, ...], asked: tuple[Any, Any], per: Any, rate: Any, dt: Any
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
