"""Motions of least snap through waypoints, as fast as a multirotor's limits let them.

A multirotor's thrust and attitude follow from the acceleration of its base, its body rate from the jerk: f = m |a + g|,
tilt = angle of a + g against the vertical, rate = part of the jerk across the thrust over |a + g|; the angular
acceleration is that of the snap alike, products of the rate left out. A motion that is stretched in time by s has
accelerations smaller by s^2, jerks by s^3 and snaps by s^4, so that one stretch meets all limits. The arm's own motion,
drag and the lag of the rotors are neglected: keep a margin for them.
Sources: Mellinger, Kumar 2011 (time allocation, flat outputs); Richter, Bry, Roy 2013.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.reference.minimum_snap import minimum_snap, snap_cost
from skyarm.reference.trajectory import Trajectory

Array = npt.NDArray[np.float64]

Points = Sequence[tuple[float, float, float]]

LOOKS = 60
"""Instants of each piece at which the limits are looked at."""

ROUNDS = 15
"""Most improvements of the share of the time that each piece gets."""

SLOWEST = 1e9
"""s that a motion takes at most."""

SHORTEST = 1e-3
"""m between waypoints: they are one place below this."""


@dataclass(frozen=True, kw_only=True, slots=True)
class FlightLimits:
    """What a motion may ask of the vehicle.

    Attributes:
        speed: m/s. acceleration: m/s^2. tilt: rad. rate: rad/s, of roll and pitch. spin: rad/s^2, of roll and pitch.
        thrust: largest over the weight.
    """

    speed: float = 1.0
    acceleration: float = 1.0
    tilt: float = 0.35
    rate: float = 1.0
    spin: float = 5.0
    thrust: float = 1.5


@dataclass(frozen=True, kw_only=True, slots=True)
class Demand:
    """The largest that a motion asks for, in the units of :class:`FlightLimits`."""

    speed: float
    acceleration: float
    tilt: float
    rate: float
    spin: float
    thrust: float

    def within(self, limits: FlightLimits) -> bool:
        """Whether all limits are met."""
        return all(getattr(self, name) <= getattr(limits, name) for name in LIMITS)


LIMITS = ("speed", "acceleration", "tilt", "rate", "spin", "thrust")


def through(points: Points, times: Sequence[float]) -> Trajectory:
    """The motion of least snap through points at given times, from rest to rest."""
    x, y, z = (minimum_snap(times, [p[axis] for p in points]) for axis in range(3))
    return Trajectory(x=x, y=y, z=z)


def allocate(points: Points, limits: FlightLimits, gravity: float) -> tuple[float, ...]:
    """Times, the first 0, of the fastest motion of least snap of its form that meets the limits.

    The pieces' shares of the time make the snap small; then the whole is stretched until every limit holds.
    """
    spans = [max(math.dist(a, b), SHORTEST) ** 0.5 for a, b in itertools.pairwise(points)]
    shares = _shares(points, [s / sum(spans) for s in spans])
    unit = _times(shares)
    derivatives = _looks(through(points, unit), unit)

    def meets(stretch: float) -> bool:
        return _demand(derivatives, gravity, stretch).within(limits)

    high = 1.0
    while not meets(high) and high < SLOWEST:
        high *= 2.0
    low = 0.5 * high
    while meets(low) and low > 1.0 / SLOWEST:
        low, high = 0.5 * low, low
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if meets(middle) else (middle, high)
    return tuple(high * t for t in unit)


def demand(motion: Trajectory, times: Sequence[float], gravity: float) -> Demand:
    """The largest that a motion asks for, at instants between each two of the times."""
    return _demand(_looks(motion, times), gravity, 1.0)


def _shares(points: Points, shares: list[float]) -> list[float]:
    """Shares of the time that make the snap least, by steps down its gradient that keep the sum."""
    cost = _cost(points, shares)
    step = 0.3
    for _ in range(ROUNDS if len(shares) > 1 else 0):
        small = 1e-4
        slopes = []
        for i, share in enumerate(shares):
            moved = [*shares[:i], share * (1.0 + small), *shares[i + 1 :]]
            slopes.append((_cost(points, moved) - cost) / small)
        mean = sum(slope * share for slope, share in zip(slopes, shares, strict=True))
        ways = [slope - mean for slope in slopes]
        size = max(abs(way) for way in ways) or 1.0
        moved = [share * math.exp(-step * way / size) for share, way in zip(shares, ways, strict=True)]
        moved = [share / sum(moved) for share in moved]
        found = _cost(points, moved)
        if found < cost:
            shares, cost, step = moved, found, min(1.5 * step, 0.5)
        else:
            step *= 0.3
    return shares


def _cost(points: Points, shares: Sequence[float]) -> float:
    times = _times(shares)
    return sum(snap_cost(minimum_snap(times, [p[axis] for p in points])) for axis in range(3))


def _times(spans: Sequence[float]) -> tuple[float, ...]:
    times = [0.0]
    for span in spans:
        times.append(times[-1] + span)
    return tuple(times)


def _looks(motion: Trajectory, times: Sequence[float]) -> list[Array]:
    """Velocity, acceleration, jerk and snap (3, N) of a motion."""
    at = np.concatenate([np.linspace(a, b, LOOKS, endpoint=False) for a, b in itertools.pairwise(times)])
    rows = [signal.derivatives(at) for signal in (motion.x, motion.y, motion.z)]
    return [
        np.stack([np.broadcast_to(np.asarray(row[k], dtype=float), at.shape) for row in rows]) for k in (1, 2, 3, 4)
    ]


def _demand(derivatives: Sequence[Array], gravity: float, stretch: float) -> Demand:
    velocity, acceleration, jerk, snap = (d / stretch ** (k + 1) for k, d in enumerate(derivatives))
    force = acceleration + np.array([[0.0], [0.0], [gravity]])
    size = np.maximum(_length(force), 1e-9)

    def across(vectors: Array) -> float:
        """Largest part across the thrust, over the thrust."""
        along = (force * vectors).sum(axis=0) / size
        return float((_length(vectors - force * (along / size)) / size).max())

    return Demand(
        speed=float(_length(velocity).max()),
        acceleration=float(_length(acceleration).max()),
        tilt=float(np.arctan2(np.sqrt(force[0] ** 2 + force[1] ** 2), force[2]).max()),
        rate=across(jerk),
        spin=across(snap),
        thrust=float(size.max() / max(gravity, 1e-9)),
    )


def _length(vectors: Array) -> Array:
    return np.asarray(np.sqrt((vectors * vectors).sum(axis=0)))
