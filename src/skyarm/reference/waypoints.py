"""Minimum-snap motions through waypoints, as fast as the flight limits allow.

A multirotor's thrust and attitude follow from the acceleration of its base, its body
rate from the jerk: f = m |a + g|, tilt = angle of a + g against the vertical, rate =
part of the jerk across the thrust over |a + g|; the angular acceleration is that of the
snap alike, products of the rate left out. A motion that is stretched in time by s has
accelerations smaller by s^2, jerks by s^3 and snaps by s^4, so that one stretch meets
all limits. The arm's own motion, drag and the lag of the rotors are neglected: keep a
margin for them.
Sources: Mellinger, Kumar 2011 (time allocation, flat outputs); Richter, Bry, Roy 2013.

Tables:

* ``waypoints``: points = [[x, y, z], ...]; start (s, 0), times (s after the start, of
  each point; left out: as fast as the limits let); speed (m/s), acceleration (m/s^2),
  tilt (rad), rate (rad/s) and spin (rad/s^2) of roll and pitch, thrust (over the
  weight)
* ``phases``: position = [x, y, z] at the start; phases = [{ kind = "hold" | "go_to" |
  "pick" | "place", ... }]; the limits of ``waypoints``

Each begins and ends at rest, and stays before and after.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Annotated

import numpy as np

from skyarm.records.arrays import Array, doubles, stack_values
from skyarm.records.files import Fields, number, require_file, shown, three_numbers
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import immutable
from skyarm.records.leaves import parts
from skyarm.records.units import Unit
from skyarm.records.units import positive as positive_unit
from skyarm.reference.signals import Signal
from skyarm.reference.splines import minimum_snap, snap_cost, snap_pieces, span_powers
from skyarm.reference.task_records import Setting
from skyarm.reference.trajectory import Trajectory

Place = tuple[float, float, float]

Points = Sequence[Place]

LOOKS = 60
"""Number of instants of each piece at which the limits are evaluated: speed and
acceleration are at most 0.13 % higher between them (80 drawn ways)."""

ROUNDS = 15
"""Largest number of improvements of the time distribution over the pieces. The snap is
then within 1e-7 of that after 300 (64 drawn ways), before the first 22 % above it."""

SLOWEST = 1e9
"""Longest duration (s) of a motion."""

SHORTEST = 1e-3
"""Distance (m) below which two waypoints are the same."""


@immutable
class FlightLimits:
    """Limits, or peak values, of speed, acceleration, tilt, body rate and thrust of a
    motion.

    Attributes:
        thrust: largest over the weight.

    The defaults are chosen: gentle flights of small multirotors.
    """

    speed: Annotated[float, positive_unit("m/s", "largest speed of a motion")] = 1.0
    acceleration: Annotated[
        float, positive_unit("m/s^2", "largest acceleration of a motion")
    ] = 1.0
    tilt: Annotated[float, positive_unit("rad", "largest tilt of the base")] = 0.35
    rate: Annotated[
        float, positive_unit("rad/s", "largest rate of roll and of pitch")
    ] = 1.0
    spin: Annotated[
        float,
        positive_unit("rad/s^2", "largest angular acceleration of roll and of pitch"),
    ] = 5.0
    thrust: Annotated[
        float,
        Unit("", "largest thrust over the weight; at most 0.9 of what the rotors have"),
    ] = 1.5

    def within(self, limits: FlightLimits) -> bool:
        """True if no peak value exceeds the corresponding flight limit."""
        return all(getattr(self, name) <= getattr(limits, name) for name in LIMITS)


LIMITS = tuple(parts(FlightLimits()))


def through(points: Points, times: Sequence[float]) -> Trajectory:
    """Minimum-snap trajectory through points at given times, from rest to rest."""
    x, y, z = (minimum_snap(times, [p[axis] for p in points]) for axis in range(3))
    return Trajectory(x=x, y=y, z=z)


def allocate(points: Points, limits: FlightLimits, gravity: float) -> tuple[float, ...]:
    """Times (s) of waypoints for the fastest minimum-snap motion within the flight
    limits.

    The pieces' shares of the time make the snap small; then the whole is stretched
    until every limit holds.
    """
    # a tuple, by which the result is kept
    return _allocate(tuple(points), limits, gravity)


# a check, a run and a sweep of one file ask for the same times; 64 is chosen, four
# points cost 30 ms (measured)
@lru_cache(maxsize=64)
def _allocate(
    points: Points, limits: FlightLimits, gravity: float
) -> tuple[float, ...]:
    # with equal accelerations the time of a way goes with the root of its length
    spans = [max(math.dist(a, b), SHORTEST) ** 0.5 for a, b in pairwise(points)]
    shares = _shares(points, [s / sum(spans) for s in spans])
    unit = tuple(accumulate(shares, initial=0.0))
    derivatives = sample_derivatives(through(points, unit), unit)

    def meets(stretch: float) -> bool:
        return peaks(
            [d / stretch ** (k + 1) for k, d in enumerate(derivatives)], gravity
        ).within(limits)

    high = 1.0
    while not meets(high) and high < SLOWEST:
        high *= 2.0
    low = 0.5 * high
    # bisection needs a time that is too short
    while meets(low) and low > 1.0 / SLOWEST:
        low, high = 0.5 * low, low
    # 40 halvings: to 1e-12 of the time
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if meets(middle) else (middle, high)
    return tuple(high * t for t in unit)


def _shares(points: Points, shares: list[float]) -> list[float]:
    """Shares of the total time between successive waypoints that minimise snap, by
    gradient descent.
    """
    cost, slopes = _cost(points, shares)
    # step sizes are chosen: longer after a gain, shorter after a loss
    step = 0.3
    for _ in range(ROUNDS if len(shares) > 1 else 0):
        # the shares add up to 1, so only differences of the slopes move them
        mean = sum(slope * share for slope, share in zip(slopes, shares, strict=True))
        ways = [slope - mean for slope in slopes]
        size = max(map(abs, ways)) or 1.0
        moved = [
            # as logarithms, so that no share falls to 0
            share * math.exp(-step * way / size)
            for share, way in zip(shares, ways, strict=True)
        ]
        moved = [share / sum(moved) for share in moved]
        new_cost, new_slopes = _cost(points, moved)
        if new_cost < cost:
            shares, cost, slopes = moved, new_cost, new_slopes
            step = min(1.5 * step, 0.5)
        else:
            step *= 0.3
    return shares


def _cost(
    points: Points, shares: Sequence[float], small: float = 1e-4
) -> tuple[float, list[float]]:
    """Least snap for shares of the time, and its change with the logarithm of each
    share, by finite differences.
    """
    # one column a share that is changed, and the last for none: one spline of lanes
    lanes = np.tile(np.array(shares)[:, None], len(shares) + 1)
    np.fill_diagonal(lanes, lanes.diagonal() * (1.0 + small))
    spans = span_powers([*accumulate(lanes, initial=np.zeros(len(shares) + 1))])
    values = [np.array(point)[:, None] for point in points]
    x, y, z = np.asarray(snap_cost(spans, snap_pieces(spans, values))).tolist()
    # forward differences, to a thousandth: the slopes only choose a direction
    *moved, cost = (a + b + c for a, b, c in zip(x, y, z, strict=True))
    return cost, [(each - cost) / small for each in moved]


def sample_derivatives(motion: Trajectory, times: Sequence[float]) -> list[Array]:
    """Velocity, acceleration, jerk and snap of a trajectory at many times, as four
    arrays (3, N).
    """
    # a piece's end is the next one's beginning; the last end holds still, but just
    # before it the snap may be the largest of all
    end = np.nextafter(times[-1], times[0])
    pieces = [np.linspace(a, b, LOOKS, endpoint=False) for a, b in pairwise(times)]
    at = np.concatenate([*pieces, [end]])
    rows = [signal.derivatives(at) for signal in (motion.x, motion.y, motion.z)]
    return [stack_values(len(at), [row[k] for row in rows]) for k in (1, 2, 3, 4)]


def peaks(derivatives: Sequence[Array], gravity: float) -> FlightLimits:
    """Peak speed, acceleration, tilt, body rate and thrust of a motion, from its
    sampled derivatives.
    """
    velocity, acceleration, jerk, snap = derivatives
    force = acceleration + np.array([[0.0], [0.0], [gravity]])
    # in free fall there is no direction of thrust; its rates then count as enormous
    size = np.maximum(_length(force), 1e-9)

    def across(vectors: Array) -> float:
        """Largest component of vectors perpendicular to the thrust, divided by the
        thrust.
        """
        along = (force * vectors).sum(axis=0) / size
        return float((_length(vectors - force * (along / size)) / size).max())

    return FlightLimits(
        speed=float(_length(velocity).max()),
        acceleration=float(_length(acceleration).max()),
        tilt=float(np.arctan2(np.sqrt(force[0] ** 2 + force[1] ** 2), force[2]).max()),
        rate=across(jerk),
        spin=across(snap),
        thrust=float(size.max() / max(gravity, 1e-9)),
    )


def _length(vectors: Array) -> Array:
    return np.asarray(np.sqrt((vectors * vectors).sum(axis=0)))


# times for 300 points take 5 s; a spline of 2000 rows takes 0.2 s
MOST_POINTS = 300
MOST_ROWS = 2000


FARTHEST, CLOSEST, LEAST = 1e6, 1e-3, 1e-6
"""Largest size of a position, value or time (m, s), shortest time between two points
(s), and smallest limit; beyond them powers of the times overflow."""

INSTANTS, SWING = 20, 1.0
"""Number of instants between two points at which a motion is evaluated, and its largest
overshoot over the range of its values; plausible motions overshoot by some tenths."""


def within(
    value: float, at: str, low: float = -FARTHEST, high: float = FARTHEST
) -> float:
    """Check that a number is between two bounds (inclusive) and return it."""
    if not low <= value <= high:
        raise ValueError(f"{at} = {value:g}: must be from {low:g} to {high:g}")
    return value


def number_within(
    fields: Fields,
    name: str,
    *default: object,
    low: float = -FARTHEST,
    high: float = FARTHEST,
) -> float:
    """Read a number of a table and check that it is between two bounds (inclusive)."""
    return within(fields.number(name, *default), fields.at(name), low, high)


def positive(
    fields: Fields,
    name: str,
    *default: object,
    low: float = 0.0,
    high: float = FARTHEST,
) -> float:
    """Read a positive number of a table and check that it is between two bounds
    (inclusive).
    """
    return within(
        fields.number(name, *default, low=0.0, strict=True), fields.at(name), low, high
    )


def waypoints_table(fields: Fields, setting: Setting) -> Trajectory:
    """Minimum-snap trajectory through the waypoints of a motion table."""
    points = points_of(fields.take("points"), fields.at("points"))
    if not 2 <= len(points) <= MOST_POINTS:
        raise ValueError(
            f"{fields.at('points')} = {len(points)} points: must be 2 to {MOST_POINTS}"
        )
    start = number_within(fields, "start", 0.0)
    limits = limits_of(fields, setting)
    if not fields.states("times"):
        require_way(
            None, points, [f"{fields.at('points')}[{i}]" for i in range(len(points))]
        )
        times = allocate(points, limits, setting.gravity)
    else:
        times = rising(fields.numbers("times"), fields.at("times"))
        if len(times) != len(points):
            raise ValueError(
                f"{fields.at('times')} = {len(times)} times: must be one for each of"
                f" {len(points)} points"
            )
        for axis in range(3):
            require_near([p[axis] for p in points], times, fields.at("times"))
    return through(points, [start + t for t in times])


def samples_signal(fields: Fields) -> Signal:
    """Minimum-snap time signal through the values in a column of a CSV file."""
    return minimum_snap(*_samples_of(fields))


def samples_as_spline(fields: Fields) -> dict[str, Entry]:
    """Table of a spline signal that states the values of a column of a CSV file."""
    times, values = _samples_of(fields)
    fields.take("kind", None)
    fields.done()
    return {"kind": "spline", "times": [*times], "values": [*values]}


def _samples_of(fields: Fields) -> tuple[list[float], list[float]]:
    """Times (s) and values in a column of a CSV file."""
    names = [fields.take("time", "time"), fields.take("column")]
    if not all(isinstance(name, str) for name in names):
        raise ValueError(
            f"{fields.at('column')} = {shown(names[1])}: must be the name of a column"
        )
    start = number_within(fields, "start", 0.0)
    times, values = _read_columns(fields, names)
    require_near(values, times, f"{fields.at('file')}: {names[1]}")
    return [start + t for t in times], values


def spline_signal(fields: Fields) -> Signal:
    """Minimum-snap time signal through given values at given times of a signal
    table.
    """
    times = rising(fields.numbers("times"), fields.at("times"))
    values = tuple(
        within(v, f"{fields.at('values')}[{i}]")
        for i, v in enumerate(fields.numbers("values"))
    )
    if len(values) != len(times) or not 2 <= len(times) <= MOST_ROWS:
        raise ValueError(
            f"{fields.at('values')} = {len(values)} values: must be one for each of 2"
            f" to {MOST_ROWS} times"
        )
    require_near(values, times, fields.at("times"))
    return minimum_snap(times, values)


def limits_of(fields: Fields, setting: Setting) -> FlightLimits:
    """Read flight limits from a motion table; thrust at most 0.9 of the rotors'
    maximum.
    """
    if setting.vehicle is not None and not setting.vehicle.rotors:
        raise ValueError(
            f"{fields.where}: needs a vehicle with rotors; {setting.vehicle.name!r} has"
            " none"
        )
    usual = FlightLimits()
    # the rest is for errors, which no plan knows
    most = 0.9 * setting.thrust_to_weight
    thrust = fields.number("thrust", min(usual.thrust, most))
    if not 1.0 < thrust <= max(most, 1.0):
        allowed = (
            f"must be above 1 and at most {most:.3g}, 0.9 of the rotors' highest thrust"
            " over the weight"
        )
        raise ValueError(f"{fields.at('thrust')} = {thrust:.4g}: {allowed}")
    limits = {
        name: positive(fields, name, getattr(usual, name), low=LEAST)
        for name in LIMITS
        if name != "thrust"
    }
    if limits["tilt"] >= 0.5 * math.pi:
        raise ValueError(
            f"{fields.at('tilt')} = {limits['tilt']!r}: must be below pi/2 rad"
        )
    return FlightLimits(**limits, thrust=thrust)


def points_of(entries: object, at: str) -> Points:
    """Read a list of waypoints, each three coordinates in m."""
    if not isinstance(entries, list):
        raise ValueError(f"{at} = {shown(entries)}: must be a list of points [x, y, z]")
    return [_place(entry, f"{at}[{i}]") for i, entry in enumerate(entries)]


def place_of(fields: Fields, name: str, *default: object) -> Place:
    """Read a position (m) of three coordinates from a table."""
    return _place(fields.take(name, *default), fields.at(name))


def _place(entry: object, at: str) -> Place:
    x, y, z = (within(c, f"{at}[{i}]") for i, c in enumerate(three_numbers(entry, at)))
    return x, y, z


def require_way(
    start: Sequence[float] | None, points: Points, names: Sequence[str]
) -> None:
    """Refuse successive waypoints at the same position.

    Args:
        start: place of the task before, m; None where the points begin the path.
        points: points of the path, m.
        names: names of their fields.
    """
    path = points if start is None else [start, *points]
    # the first point of a path that begins with it has no way to it
    ends = names[len(names) - len(path) + 1 :]
    for (a, b), name in zip(pairwise(path), ends, strict=True):
        if math.dist(a, b) < SHORTEST:
            said = "where the task is already" if a is start else "the point before"
            raise ValueError(
                f"{name} = {shown(list(b))}: must be {SHORTEST:g} m or more from {said}"
            )


def rising(times: tuple[float, ...], at: str) -> tuple[float, ...]:
    """Check that times increase and return them."""
    if len(times) < 2 or any(b - a < CLOSEST for a, b in pairwise(times)):
        allowed = (
            f"must be at least two times, each {CLOSEST:g} s or more after the one"
            " before"
        )
        raise ValueError(f"{at} = {shown(list(times))}: {allowed}")
    for i, t in enumerate(times):
        within(t, f"{at}[{i}]")
    return times


def require_near(values: Sequence[float], times: Sequence[float], at: str) -> None:
    """Refuse waypoint times between which the smooth motion overshoots far beyond its
    values.

    A short piece beside a long one does that: the motion is smooth there, and at any
    price.

    Raises:
        ValueError: one line: the swing and when.
    """
    low, high = min(values), max(values)
    looks = np.concatenate(
        [np.linspace(a, b, INSTANTS, endpoint=False) for a, b in pairwise(times)]
    )
    # a spline without motion is one number at all times
    motion = np.broadcast_to(
        doubles(minimum_snap(times, values).derivatives(looks)[0]), looks.shape
    )
    away = np.maximum(motion - high, low - motion)
    worst = int(np.argmax(away))
    if away[worst] > SWING * (high - low) + LEAST:
        said = f"swings {away[worst]:.3g} beyond them at {looks[worst]:.4g} s"
        raise ValueError(
            f"{at}: the smooth motion through the values {said}; must be times in step"
            " with the distances"
        )


def _read_columns(fields: Fields, names: list[str]) -> list[list[float]]:
    """Read columns of a CSV file by name; the times in the first must increase.

    Raises:
        ValueError: one line: file, line, column, what is allowed.
    """
    name = fields.take("file")
    if not isinstance(name, str):
        raise ValueError(
            f"{fields.at('file')} = {shown(name)}: must be the path of a CSV file"
        )
    path = Path(name)
    at = f"{fields.at('file')} = {shown(name)}"
    require_file(path, at)
    try:
        # spreadsheets begin their files with a byte order mark
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file, skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{at}: must be a CSV file of UTF-8 text ({error})") from None
    if not 2 <= len(rows) <= MOST_ROWS:
        raise ValueError(
            f"{at}: must have 2 to {MOST_ROWS} rows below its header, not {len(rows)}"
        )
    for each in names:
        if each not in rows[0]:
            raise ValueError(
                f"{at}: must have a column {shown(each)} in its header; there are"
                f" {shown([*rows[0]])}"
            )
    columns = [
        [_cell(row[each], f"{at}: row {i}: {each}") for i, row in enumerate(rows, 1)]
        for each in names
    ]
    for i, (a, b) in enumerate(pairwise(columns[0]), 2):
        if not b - a >= CLOSEST:
            allowed = f"must be {CLOSEST:g} s or more after {a!r} of the row before"
            raise ValueError(f"{at}: row {i}: {names[0]} = {b!r}: {allowed}")
    return columns


def _cell(text: str | None, at: str) -> float:
    try:
        value = number(float(text or ""), at)
    except ValueError:
        raise ValueError(
            f"{at} = {shown(text or '')}: must be a finite number"
        ) from None
    return within(value, at)
