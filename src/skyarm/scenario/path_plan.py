"""Time scaling of a reference: upper bounds (ceilings) of ds/dt along the path, and the
time law below them.

1. The ceilings are at most the commanded speed (1), and 0 where the path turns a
  corner: where a velocity jumps.
2. ds/dt falls and rises no faster than the path's acceleration allows; a flight stands
  still at a corner for a moment.
3. What the resulting motion asks of the vehicle is judged by inverse dynamics. Where it
   is too much, the ceiling is lowered there, or the path's acceleration where that
   alone is to blame; then again from 2.

A limit applies to the motion as commanded, with its smoothing and its jerk, not to a
bound for it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from skyarm.dynamics.actuators.motion_demand import MotionSamples
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.reference.path_time import PathTime
from skyarm.reference.signals import Derivatives

STEP = 0.2
"""Time (s) between control points of the path time; its rate follows a change within
three of them."""

GRID = 0.01
"""Step of the path (s) between two speed bounds, chosen: half a sample of a reference
of 50 Hz."""

LOOK = 0.01
"""Time (s) between two instants of the flight at which the demands are evaluated."""

CALM = 0.5
"""Time (s) before and after an infeasible instant that is slowed down with it, for a
smooth motion; chosen. Half of it leads a circle, a drop, a swing and corners 0.01 to
0.2 s sooner to their end, twice as late (measured); all keep the limits."""

ACCELERATION = 1.0
"""Largest second derivative (1/s) of the path time; chosen: from a stop the commanded
speed is reached in a second."""

SLOWEST = 0.02
"""Smallest path speed ds/dt except at a corner; chosen: a path takes at most 50 times
as long."""

RATES = tuple(0.93**k for k in range(54))
"""Constant path speeds that are tried, from the commanded one to ``SLOWEST``."""

ROUNDS = 60
"""Largest number of rounds in which the path is slowed down; chosen. A circle, a drop,
a swing and corners need no more than 15 (measured)."""

DIGITS = 9
"""Decimal digits to which control points (s) are rounded, so that results do not depend
on the machine's last bits."""


@dataclass(kw_only=True)
class Ceilings:
    """Upper bounds of the path speed ds/dt, sampled every GRID seconds of the path.

    Attributes:
        rate: ds/dt. acceleration: 1/s. stops: s, corners at which the path stands
            still.
    """

    duration: float
    stops: Sequence[float] = ()
    rate: Array = field(init=False)
    acceleration: Array = field(init=False)

    def __post_init__(self) -> None:
        count = math.ceil(self.duration / GRID) + 2
        self.rate = np.ones(count)
        self.acceleration = np.full(count, ACCELERATION)

    def lower(
        self, values: Array, at: Array, to: Array, least: float, rate: float = 1.0
    ) -> None:
        """Lower the path-speed bounds at some path times (s), and around them within
        CALM seconds of flight.

        No bound is lowered below ``least``.
        """
        index = np.clip(np.round(at / GRID).astype(int), 0, len(values) - 1)
        lowered = np.full_like(values, math.inf)
        # several times may fall on one grid point, where plain indexing keeps the last
        np.minimum.at(lowered, index, to)
        # seconds of flight, at this path speed, in steps of the path
        reach = math.ceil(CALM * rate / GRID)
        padded = np.concatenate(
            [np.full(reach, math.inf), lowered, np.full(reach, math.inf)]
        )
        around = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).min(
            axis=1
        )
        np.copyto(values, np.maximum(np.minimum(values, around), least))

    def squares(self) -> Array:
        """Squared path speed (ds/dt)^2 that satisfies the speed bounds and the path's
        acceleration limit.
        """
        square = self.rate**2
        for stop in self.stops:
            index = min(round(stop / GRID), len(square) - 1)
            square[index] = 0.0
        # v dv = a ds: squares change by 2 a ds along a step of the path
        gain = 2.0 * GRID * self.acceleration
        squares = square.tolist()
        rise = gain.tolist()
        # backwards no bound is approached too fast, forwards none is left too fast
        for i in range(len(squares) - 2, -1, -1):
            squares[i] = min(squares[i], squares[i + 1] + rise[i])
        for i in range(1, len(squares)):
            squares[i] = min(squares[i], squares[i - 1] + rise[i])
        return np.array(squares)


def follow(ceilings: Ceilings, duration: float) -> PathTime:
    """Time law of the fastest motion along the path within speed bounds, with a short
    rest at each stop.
    """
    square = ceilings.squares()
    # ten small steps in each step of the law, chosen
    parts = 10
    small = STEP / parts
    stops = [stop for stop in sorted(ceilings.stops) if stop < duration]
    first = 0.0 if stops and stops[0] <= 0.0 else _first_rate(square)
    # five points on a line through 0 (_first_rate): the sixth completes a quintic
    points = [(i - 2) * STEP * first for i in range(5)]
    stops = [stop for stop in stops if stop > 0.0]
    s, t, rest = points[-1], 2.0 * STEP, 0
    # the quintic at t has control points up to three steps later
    while t < duration + 3.0 * STEP:
        for _ in range(parts):
            t += small
            if rest:
                rest -= 1
                continue
            at = s / GRID
            index = min(int(at), len(square) - 2)
            share = min(at - index, 1.0)
            w = square[index] + share * (square[index + 1] - square[index])
            if stops:
                w = min(w, 2.0 * ceilings.acceleration[index] * (stops[0] - s))
            # from rest a square of 0 would never leave it: one step of acceleration
            # does
            rate = max(math.sqrt(max(w, 0.0)), ceilings.acceleration[index] * small)
            # a reference that is slowed never runs ahead of the commanded one
            s = min(s + rate * small, t)
            if stops and s >= stops[0] - rate * small:
                # six equal control points are all of a quintic: it stands still at the
                # corner
                s, rest = stops.pop(0), 6 * parts
        points.append(s)
    return PathTime(points=tuple(round(p, DIGITS) for p in points), step=STEP)


def _first_rate(square: Array) -> float:
    """Largest initial path speed ds/dt that the speed bounds allow over the first two
    spacings of control points.

    Of the control points in these s(0) is made: they stand on one line, so that it is
    exactly 0.
    """
    rates = (
        share
        for share in RATES
        if square[: round(2.0 * STEP * share / GRID) + 1].min() >= share**2
    )
    return next(rates, SLOWEST)


@immutable
class PathPlan:
    """Result of planning: time law of the reference, and the largest remaining demand
    on the vehicle.

    Attributes:
        path_time: time law; None if the reference is feasible as commanded.
        beyond: largest demand as a fraction of its limit, at most 1 if feasible. limit:
            index of that limit.
        at: place on the path of the largest demand, s.
    """

    path_time: PathTime | None
    beyond: float
    limit: int
    at: float


SLACK = 1.002
"""Ratio of demand to limit up to which a limit counts as satisfied; chosen: a motion
may end this little above it."""

NOTHING = 1e-7
"""Lag (s) that counts as rounding."""


@immutable
class Judge:
    """Evaluator of the demands of a motion on the vehicle, relative to the vehicle's
    limits.

    Attributes:
        motion: motion from the path parameter and its derivatives at K instants, and
            from these instants, s.
        shares: demands of a motion as fractions of the limits. at_rest: static demands
            of its postures, a lower bound.
    """

    motion: Callable[[Derivatives, Array], MotionSamples]
    shares: Callable[[MotionSamples], Array]
    at_rest: Callable[[MotionSamples], Array]

    def over(self, s: Derivatives, time: Array) -> Array:
        """Ratio of demand to allowed demand, (limits, K); the static demand of a
        posture is always allowed.
        """
        with np.errstate(all="ignore"):
            motion = self.motion(s, time)
            ratios = np.asarray(
                self.shares(motion) / np.maximum(1.0, self.at_rest(motion))
            )
        sound = np.isfinite(ratios).all(axis=0)
        if not sound.all():
            at = float(s[0][int(np.argmin(sound))])
            raise ValueError(
                f"reference: asks for what is not finite at {at:.3g} s; must have a"
                " motion to plan for"
            )
        return ratios


def even_rates(judge: Judge, ceilings: Ceilings) -> None:
    """Lower the bounds along the path to the largest constant path speed that is
    feasible at each position.
    """
    # half a step more: rounding must not take the last place
    path = np.arange(-BEYOND, ceilings.duration + BEYOND + 0.5 * GRID, GRID)
    inside = (path > -0.5 * GRID) & (path < ceilings.duration + 0.5 * GRID)
    open_ = np.ones(len(path), dtype=bool)
    still = np.zeros_like(path)
    for rate in RATES:
        if rate <= SLOWEST or not open_.any():
            break
        # at a constant path speed the path is rate t, without higher derivatives
        over = judge.over((path, still + rate, still, still, still), path / rate).max(
            axis=0
        )
        # a point where a faster rate was feasible is done
        open_ &= (over > SLACK) & inside
        if open_.any():
            ceilings.lower(
                ceilings.rate,
                path[open_],
                # to the next slower rate, as this one is not feasible there
                np.full(int(open_.sum()), rate * RATES[1]),
                SLOWEST,
                rate,
            )


def plan(judge: Judge, ceilings: Ceilings) -> PathPlan:
    """Plan the time law: lower the bounds until the motion, with its speed changes,
    satisfies all limits.
    """
    duration = ceilings.duration
    time = np.arange(0.0, duration + BEYOND + 0.5 * LOOK, LOOK)
    inside = time < duration + 0.5 * LOOK
    even_rates(judge, ceilings)
    # a lower ceiling may make a motion worse, so the best round is kept
    best = PathPlan(path_time=None, beyond=math.inf, limit=0, at=0.0)
    for _ in range(ROUNDS):
        path_time = follow(ceilings, duration)
        s = path_time.derivatives(time)
        over = judge.over(s, time)[:, inside]
        s = s[0][inside], s[1][inside], s[2], s[3], s[4]
        worst = float(over.max())
        if worst < best.beyond:
            i, k = np.unravel_index(int(np.argmax(over)), over.shape)
            as_commanded = float(np.abs(s[0] - time[inside]).max()) < NOTHING
            best = PathPlan(
                path_time=None if as_commanded else path_time,
                beyond=worst,
                limit=int(i),
                at=float(s[0][k]),
            )
        if worst <= SLACK:
            break
        _calm(ceilings, s, over.max(axis=0))
    return best


def _calm(ceilings: Ceilings, s: Derivatives, over: Array) -> None:
    """Slightly lower the bounds of path speed and acceleration where the motion exceeds
    a vehicle limit.
    """
    more = over > SLACK
    place, rate = s[0][more], np.maximum(s[1][more], SLOWEST)
    index = np.clip(np.round(place / GRID).astype(int), 0, len(ceilings.rate) - 1)
    calmest = ceilings.acceleration[index] <= LEAST_ACCELERATION
    calmer = CALMER * ceilings.acceleration[index]
    # one path speed for all places, to turn seconds of flight into path
    around = float(np.median(rate))
    ceilings.lower(ceilings.acceleration, place, calmer, LEAST_ACCELERATION, around)
    # what is on its way to a ceiling is not helped by a lower one
    there = (rate > THERE * ceilings.rate[index]) | calmest
    if there.any():
        # accelerations go with the square of the rate, jerks with its cube; small
        # steps, since neighbours slow down, too
        # half to 7 percent, chosen: a round gets somewhere, and not too far
        slower = np.clip(over[more] ** -0.35, 0.93, 0.995) * rate
        ceilings.lower(ceilings.rate, place[there], slower[there], SLOWEST, around)


CALMER = 0.85
"""Factor by which the path's acceleration limit is lowered in one step; chosen: 15
steps take it to its least."""

THERE = 0.8
"""Fraction of a speed bound above which the path speed counts as limited by it."""

LEAST_ACCELERATION = 0.1
"""Smallest acceleration limit (1/s) of the path; chosen: a tenth of the usual one."""

BEYOND = 0.3
"""Time (s) that is evaluated beyond both ends of the flight for differences and
means."""
