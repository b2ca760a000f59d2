"""Time signals that can be redirected to a new goal during a flight.

From the instant ``start`` on the signal is the quintic polynomial that begins with the
value, velocity and acceleration of that instant and comes to rest at the goal after
``duration``; then it stays there.
Source: the quintic with its six end conditions, Craig 2005, Introduction to Robotics,
section 7.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars import maximum, minimum, where
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, positive
from skyarm.reference.signals import Derivatives, Signal
from skyarm.reference.trajectory import Trajectory

FIELDS = ("start", "duration", "value", "velocity", "acceleration", "goal")
"""Fields of a redirected signal that a new goal changes."""

NEVER = 1e9
"""Start time (s) of a signal without a goal, later than any flight."""

LOOKS = 21
"""Number of instants at which speed and acceleration of a motion are evaluated: their
largest is at most 1.1 % above (2000 random starts), from rest 0.2 %."""

DURATIONS = np.geomspace(0.1, 300.0, 165)
"""Candidate durations (s) of a motion to a goal, 5 % apart: so much longer than the
shortest one the chosen may be. A list, as of a motion that begins fast a longer
duration may exceed a limit by more, and there is no sign to bisect by."""


@immutable
class Redirected(Signal):
    """Time signal that moves to a goal from ``start`` on and then stays there; before,
    it equals another signal.

    Attributes:
        signal: time signal until ``start``. value, velocity, acceleration: values at
            ``start``.
    """

    signal: Signal
    start: Annotated[Scalar, Unit("s", "time at which the new motion begins")] = NEVER
    duration: Annotated[Scalar, positive("s", "duration of the motion to the goal")] = (
        1.0
    )
    value: Annotated[
        Scalar, Unit("", "value at the start, in the unit of the signal")
    ] = 0.0
    velocity: Annotated[
        Scalar, Unit("1/s", "first derivative at the start, in the unit of the signal")
    ] = 0.0
    acceleration: Annotated[
        Scalar,
        Unit("1/s^2", "second derivative at the start, in the unit of the signal"),
    ] = 0.0
    goal: Annotated[Scalar, Unit("", "value at the end, in the unit of the signal")] = (
        0.0
    )

    def derivatives(self, t: Scalar) -> Derivatives:
        """Value and derivatives one to four at time t (s)."""
        before = self.signal.derivatives(t)
        # kept within the motion: both branches are evaluated, and powers would overflow
        u = minimum(maximum((t - self.start) / self.duration, 0.0), 1.0)
        moving = quintic(
            u, self.duration, self.value, self.velocity, self.acceleration, self.goal
        )
        resting = (self.goal, 0.0, 0.0, 0.0, 0.0)
        return tuple(
            where(t < self.start, a, where(t < self.start + self.duration, b, c))
            for a, b, c in zip(before, moving, resting, strict=True)
        )

    def switch_times(self) -> tuple[float, ...]:
        """Switch times (s) of the signal up to the start, then start and end of the
        motion.
        """
        start = float(self.start)
        # a goal that never comes has no switches
        own = (start, start + float(self.duration)) if start < NEVER else ()
        return (*(s for s in self.signal.switch_times() if s < start), *own)


def quintic(
    u: Scalar,
    duration: Scalar,
    value: Scalar,
    velocity: Scalar,
    acceleration: Scalar,
    goal: Scalar,
) -> Scalars:
    """Quintic motion to rest at a goal: value and derivatives one to four, by time.

    Args:
        u: share of the duration that has passed, 0 to 1.
        duration: s.
        value: at the beginning, as ``velocity`` (1/s) and ``acceleration`` (1/s^2).
        velocity: at the beginning.
        acceleration: at the beginning.
        goal: at the end, at rest.
    """
    a1, a2 = velocity * duration, 0.5 * acceleration * duration * duration
    # what value, slope and bend of the start leave to the goal at u = 1
    h, w, s = goal - value - a1 - a2, -(a1 + 2.0 * a2), -2.0 * a2
    a3 = 10.0 * h - 4.0 * w + 0.5 * s
    a4 = -15.0 * h + 7.0 * w - s
    a5 = 6.0 * h - 3.0 * w + 0.5 * s
    rate = 1.0 / duration
    return (
        value + u * (a1 + u * (a2 + u * (a3 + u * (a4 + u * a5)))),
        (a1 + u * (2.0 * a2 + u * (3.0 * a3 + u * (4.0 * a4 + u * (5.0 * a5))))) * rate,
        (2.0 * a2 + u * (6.0 * a3 + u * (12.0 * a4 + u * (20.0 * a5)))) * rate * rate,
        (6.0 * a3 + u * (24.0 * a4 + u * (60.0 * a5))) * rate * rate * rate,
        (24.0 * a4 + u * (120.0 * a5)) * rate * rate * rate * rate,
    )


def shortest_duration(
    begins: Sequence[tuple[float, float, float]],
    goals: Sequence[float],
    speed: float,
    acceleration: float,
) -> float:
    """Shortest common duration (s) of quintic motions to rest within a speed and an
    acceleration limit.

    Where the motions begin so fast that no duration meets both limits, that which
    exceeds them least.

    Args:
        begins: value, velocity and acceleration of each signal at the beginning.
        goals: goal of each signal.
        speed: largest, in the unit of the signals per second.
        acceleration: largest, per second squared.
    """
    durations = DURATIONS[:, None]
    u = np.linspace(0.0, 1.0, LOOKS)
    # 1 at least: of durations within all limits argmin takes the first, the shortest
    most = np.ones(len(DURATIONS))
    for begin, goal in zip(begins, goals, strict=True):
        moving = quintic(u, durations, *begin, goal)
        for row, limit in ((moving[1], speed), (moving[2], acceleration)):
            most = np.maximum(most, np.abs(np.asarray(row)).max(axis=1) / limit)
    return float(DURATIONS[np.argmin(most)])


def redirectable(trajectory: Trajectory) -> Trajectory:
    """Copy of a trajectory whose base, heading and joints can be given goals in
    flight.
    """
    x, y, z, yaw = (
        Redirected(signal=each)
        for each in (trajectory.x, trajectory.y, trajectory.z, trajectory.yaw)
    )
    return replace(
        trajectory,
        x=x,
        y=y,
        z=z,
        yaw=yaw,
        joints=tuple(Redirected(signal=k) for k in trajectory.joints),
    )
