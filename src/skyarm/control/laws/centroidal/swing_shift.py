"""The base's shift while an arm swings under a tilted base.

A force from the side tilts the base by sigma. The arm cannot give way sideways, so the base shifts by n to keep the
tip on its reference. When the arm swings, the height of the tip below the base changes, and with it the shift that is
needed. A base that followed this shift would have to tilt for its acceleration, and that tilt carries the tip further
than the shift brings it back: 0.3 m of arm swinging by 0.5 rad at 1 Hz under 14 degrees of tilt needs 11 mm of shift,
twice a second; the base tilts by 10 degrees for it, and the tip is 45 mm off.

With c the sideways position of the common centre of mass, delta the tilt beside sigma and lambda the height of the
centre of mass above the tip,

    c'' = -g delta,   tip = c + lambda (sigma + delta),   thus   c - (lambda / g) c'' = -lambda sigma

keeps the tip. A swing of pace w (rad/s) changes the right side by N = -sigma (lambda - its mean), so that N'' = -w^2 N
and the centre of mass moves by N / (1 + r), r = lambda w^2 / g, in place of N. The bounded solution for a motion that
goes on; the other solutions grow, as those of a pendulum upside down do. An arm above the base has r < 0 and meets
its own resonance at r = -1: there the least squares (1 + r) / ((1 + r)^2 + r^2 / 4) stands for 1 / (1 + r).

The pace is the root of mean(lambda''^2) / mean(lambda'^2) along the reference, exact where one frequency swings.
Derived for this law; the inverse of a system whose zero dynamics are unstable: Devasia, Chen, Paden 1996.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.series_kinematics import Posture, derivative
from skyarm.control.laws.centroidal.parameters import ShiftGains
from skyarm.control.laws.centroidal.tip_reference import ShiftMotion, differentiated
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, divide, where

STILL = 1e-6
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
    """The shift with derivatives: ``offset`` to the second as it is known; what the swing adds to third and fourth.

    Attributes:
        offset: m to m/s^2, world axes.
        steady: its acceleration without the swing's part.
        jerk, snap: of the swing's part.
    """

    offset: tuple[Vec3, Vec3, Vec3]
    steady: Vec3
    jerk: Vec3
    snap: Vec3


def levers(level: Posture) -> list[Any]:
    """Height of the centre of mass above the tip with four derivatives, m, of a level base."""
    return [derivative(level.com, k).z - derivative(level.tip, k).z for k in range(5)]


def tilt_of(needed: Vec3, level: Posture) -> Vec3:
    """The tilt that a shift answers, rad: the shift over the height of the tip against the base."""
    height = derivative(level.tip, 0).z
    per_height = divide(height, height * height + SHORT * SHORT)
    return Vec3(needed.x * per_height, needed.y * per_height, 0)


def followed_pace(memory: SwingPace, lever: list[Any], rate: Any, dt: Any) -> SwingPace:
    """The memory one period later; ``rate`` in 1/s."""
    share = low_pass_share(rate, dt)
    return SwingPace(
        rate=memory.rate + (lever[1] * lever[1] - memory.rate) * share,
        acceleration=memory.acceleration + (lever[2] * lever[2] - memory.acceleration) * share,
    )


def shift_for_swing(memory: SwingPace, needed: list[Vec3], level: Posture, gravity: Any) -> SwingShift:
    """The shift that the tip needs while the arm swings.

    Args:
        memory: of the swing's pace.
        needed: shift that each instant asks for by itself, with two derivatives, world axes.
        level: posture of the references of a level base, series of fourth order.
        gravity: m/s^2.
    """
    lever = levers(level)
    square = divide(memory.acceleration, memory.rate + STILL)
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


def moved_shift(
    gains: ShiftGains | None,
    gravity: Any,
    shift: ShiftMotion | tuple[()],
    pace: SwingPace | tuple[()],
    needed: list[Vec3],
    level: Posture,
    dt: Any,
    own: Vec3 = ZERO3,
) -> tuple[ShiftMotion | tuple[()], SwingPace | tuple[()], list[Vec3]]:
    """Memories of the shift's motion one period later, and the shift with as many derivatives as the law has of it.

    Args:
        gains: constants; None leaves the motion out.
        gravity: m/s^2.
        shift: memory of its differentiators; empty where they are left out.
        pace: memory of the swing's pace; empty where that is left out.
        needed: shift that each instant asks for, with two derivatives.
        level: posture of the references of a level base.
        dt: control period, s.
        own: of its acceleration what jumps with a force and is not differentiated, m/s^2, world axes.
    """
    if gains is None or not isinstance(shift, ShiftMotion):
        return shift, pace, needed
    if gains.swing_rate is None or not isinstance(pace, SwingPace):
        shift, jerk, snap = differentiated(shift, needed[2] - own, gains.bandwidth, dt)
        return shift, pace, [*needed, jerk, snap]
    pace = followed_pace(pace, levers(level), gains.swing_rate, dt)
    swung = shift_for_swing(pace, needed, level, gravity)
    shift, jerk, snap = differentiated(shift, swung.steady - own, gains.bandwidth, dt)
    return shift, pace, [*swung.offset, jerk + swung.jerk, snap + swung.snap]
