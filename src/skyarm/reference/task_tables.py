"""Motions that are tasks, from tables: waypoints, samples of a file, phases.

* ``waypoints``: points = [[x, y, z], ...]; start (s, 0), times (s after the start, of each point; left out: as fast as
  the limits let); speed (m/s), acceleration (m/s^2), tilt (rad), rate (rad/s) and spin (rad/s^2) of roll and
  pitch, thrust (over the weight)
* ``samples``: file (CSV with a header), columns = [time, x, y, z] (their names); start
* ``phases``: position = [x, y, z] at the start; phases = [{ kind = "hold" | "go_to" | "pick" | "place", ... }]; the
  limits of ``waypoints``

Each begins and ends at rest, and stays before and after.
"""

from __future__ import annotations

import csv
import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.files import Fields, number, shown, unreadable
from skyarm.reference.minimum_snap import minimum_snap
from skyarm.reference.polynomials import Polynomials
from skyarm.reference.setting import Setting
from skyarm.reference.signals import Signal
from skyarm.reference.trajectory import Trajectory
from skyarm.reference.waypoints import LIMITS, SHORTEST, FlightLimits, Points, allocate, through

MOST_POINTS = 60
MOST_ROWS = 2000


FARTHEST, CLOSEST, LEAST = 1e6, 1e-3, 1e-6
"""Largest size of a place, value or time (m, s), shortest time between two points (s), least limit: beyond them
powers of the times are no numbers any more.
"""

LOOKS, SWING = 20, 1.0
"""Instants between two times at which a motion is looked at, and how far it may leave the range of its values, over
that range: motions that somebody means leave it by some tenths.
"""


def within(value: float, at: str, low: float = -FARTHEST, high: float = FARTHEST) -> float:
    """A number between bounds, both allowed."""
    if not low <= value <= high:
        raise ValueError(f"{at} = {value:g}: must be from {low:g} to {high:g}")
    return value


def start_of(fields: Fields) -> float:
    """When a motion begins, s."""
    return within(fields.number("start", 0.0), fields.at("start"))


def waypoints_table(fields: Fields, setting: Setting) -> Trajectory:
    """The motion of least snap through ``points``."""
    points = points_of(fields.take("points"), fields.at("points"))
    if not 2 <= len(points) <= MOST_POINTS:
        raise ValueError(f"{fields.at('points')} = {len(points)} points: must be 2 to {MOST_POINTS}")
    start, limits = start_of(fields), limits_of(fields, setting)
    if fields.take("times", None) is None:
        require_apart(points, fields.at("points"))
        times: tuple[float, ...] = allocate(points, limits, setting.gravity)
    else:
        times = rising(fields.numbers("times"), fields.at("times"))
        if len(times) != len(points):
            raise ValueError(f"{fields.at('times')} = {len(times)} times: must be one for each of {len(points)} points")
        for axis in range(3):
            require_near([p[axis] for p in points], times, fields.at("times"))
    return through(points, [start + t for t in times])


def samples_table(fields: Fields, setting: Setting) -> Trajectory:
    """The smooth motion through the rows of a file."""
    names = fields.take("columns", ["time", "x", "y", "z"])
    if not isinstance(names, list) or len(names) != 4 or not all(isinstance(name, str) for name in names):
        raise ValueError(f"{fields.at('columns')} = {shown(names)}: must be four names, of time, x, y and z")
    start = start_of(fields)
    times, *columns = read_columns(fields, names)
    for name, column in zip(names[1:], columns, strict=True):
        require_near(column, times, f"{fields.at('file')}: {name}")
    x, y, z = (minimum_snap([start + t for t in times], column) for column in columns)
    return Trajectory(x=x, y=y, z=z)


def samples_signal(fields: Fields) -> Signal:
    """The smooth signal through one column of a file."""
    names = [fields.take("time", "time"), fields.take("column")]
    if not all(isinstance(name, str) for name in names):
        raise ValueError(f"{fields.at('column')} = {shown(names[1])}: must be the name of a column")
    start = start_of(fields)
    times, values = read_columns(fields, names)
    require_near(values, times, f"{fields.at('file')}: {names[1]}")
    return minimum_snap([start + t for t in times], values)


def spline_signal(fields: Fields) -> Signal:
    """The signal of least snap through ``values`` at ``times``."""
    times = rising(fields.numbers("times"), fields.at("times"))
    values = tuple(within(v, f"{fields.at('values')}[{i}]") for i, v in enumerate(fields.numbers("values")))
    if len(values) != len(times) or not 2 <= len(times) <= MOST_ROWS:
        raise ValueError(
            f"{fields.at('values')} = {len(values)} values: must be one for each of 2 to {MOST_ROWS} times"
        )
    require_near(values, times, fields.at("times"))
    found: Polynomials = minimum_snap(times, values)
    return found


def limits_of(fields: Fields, setting: Setting) -> FlightLimits:
    """What a motion may ask of the vehicle; the thrust never more than nine tenths of what its rotors give."""
    if setting.vehicle is not None and not setting.vehicle.rotors:
        raise ValueError(f"{fields.where}: needs a vehicle with rotors; {setting.vehicle.name!r} has none")
    usual = FlightLimits()
    most = 0.9 * setting.thrust_to_weight
    thrust = fields.number("thrust", min(usual.thrust, most))
    if not 1.0 < thrust <= max(most, 1.0):
        allowed = f"must be above 1 and at most {most:.3g}, 0.9 of the rotors' highest thrust over the weight"
        raise ValueError(f"{fields.at('thrust')} = {thrust:.4g}: {allowed}")
    found = {
        name: within(fields.number(name, getattr(usual, name), low=0.0, strict=True), fields.at(name), LEAST)
        for name in LIMITS
        if name != "thrust"
    }
    if found["tilt"] >= 0.5 * math.pi:
        raise ValueError(f"{fields.at('tilt')} = {found['tilt']!r}: must be below pi/2 rad")
    return FlightLimits(**found, thrust=thrust)


def points_of(entries: Any, at: str) -> Points:
    """Points of a list of lists of three numbers."""
    if not isinstance(entries, list):
        raise ValueError(f"{at} = {shown(entries)}: must be a list of points [x, y, z]")
    found = []
    for i, entry in enumerate(entries):
        x, y, z = place_of(Fields({"point": entry}, at), "point", f"{at}[{i}]")
        found.append((x, y, z))
    return found


def place_of(fields: Fields, name: str, at: str, *default: Any) -> tuple[float, float, float]:
    """Three numbers, m."""
    entry = fields.take(name, *default)
    if not isinstance(entry, (list, tuple)) or len(entry) != 3:
        raise ValueError(f"{at} = {shown(entry)}: must be three numbers")
    x, y, z = (within(number(c, f"{at}[{i}]"), f"{at}[{i}]") for i, c in enumerate(entry))
    return x, y, z


def require_apart(points: Points, at: str) -> None:
    """Refuse points that follow each other at one place."""
    for i, (a, b) in enumerate(itertools.pairwise(points)):
        if math.dist(a, b) < SHORTEST:
            raise ValueError(f"{at}[{i + 1}] = {shown(list(b))}: must be {SHORTEST:g} m or more from the point before")


def require_way(start: Sequence[float], points: Points, names: Sequence[str]) -> None:
    """Refuse a way with points that follow each other at one place.

    Args:
        start: where the task is before, m.
        points: of the way, m.
        names: of their fields.
    """
    for i, (a, b) in enumerate(itertools.pairwise([start, *points])):
        if math.dist(a, b) < SHORTEST:
            said = "the point before" if i else "where the task is already"
            raise ValueError(f"{names[i]} = {shown(list(b))}: must be {SHORTEST:g} m or more from {said}")


def rising(times: tuple[float, ...], at: str) -> tuple[float, ...]:
    """Times that rise."""
    if len(times) < 2 or any(b - a < CLOSEST for a, b in itertools.pairwise(times)):
        allowed = f"must be at least two times, each {CLOSEST:g} s or more after the one before"
        raise ValueError(f"{at} = {shown(list(times))}: {allowed}")
    for i, t in enumerate(times):
        within(t, f"{at}[{i}]")
    return times


def require_near(values: Sequence[float], times: Sequence[float], at: str) -> None:
    """Refuse given times between which the motion of least snap swings far away from its values.

    A short piece beside a long one does that: the motion is smooth there, and at any price.

    Raises:
        ValueError: one line: the swing and when.
    """
    low, high = min(values), max(values)
    looks = np.concatenate([np.linspace(a, b, LOOKS, endpoint=False) for a, b in itertools.pairwise(times)])
    motion = np.broadcast_to(np.asarray(minimum_snap(times, values).derivatives(looks)[0], dtype=float), looks.shape)
    away = np.maximum(motion - high, low - motion)
    worst = int(np.argmax(away))
    if away[worst] > SWING * (high - low) + LEAST:
        said = f"swings {away[worst]:.3g} beyond them at {looks[worst]:.4g} s"
        raise ValueError(f"{at}: the smooth motion through the values {said}; must be times in step with the distances")


def read_columns(fields: Fields, names: list[str]) -> list[list[float]]:
    """Columns of a CSV file by name, the first of times that rise.

    Raises:
        ValueError: one line: file, line, column, what is allowed.
    """
    name = fields.take("file")
    if not isinstance(name, str):
        raise ValueError(f"{fields.at('file')} = {shown(name)}: must be the path of a CSV file")
    path, at = Path(name), f"{fields.at('file')} = {shown(name)}"
    reason = unreadable(path)
    if reason:
        raise ValueError(f"{at}: {reason}")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{at}: must be a CSV file of UTF-8 text ({error})") from None
    header = [cell.strip() for cell in rows[0]] if rows else []
    for each in names:
        if each not in header:
            raise ValueError(f"{at}: must have a column {shown(each)} in its header; there are {shown(header)}")
    if not 3 <= len(rows) <= MOST_ROWS + 1:
        raise ValueError(f"{at}: must have 2 to {MOST_ROWS} rows below its header, not {max(len(rows) - 1, 0)}")
    places = [header.index(each) for each in names]
    columns = [
        [_cell(row, place, f"{at}: row {i}", header[place]) for i, row in enumerate(rows[1:], 1)] for place in places
    ]
    for i, (a, b) in enumerate(zip(columns[0], columns[0][1:], strict=False), 2):
        if not b - a >= CLOSEST:
            allowed = f"must be {CLOSEST:g} s or more after {a!r} of the row before"
            raise ValueError(f"{at}: row {i}: {names[0]} = {b!r}: {allowed}")
    return columns


def _cell(row: list[str], place: int, at: str, name: str) -> float:
    text = row[place].strip() if place < len(row) else ""
    try:
        value = number(float(text), f"{at}: {name}")
    except ValueError:
        raise ValueError(f"{at}: {name} = {shown(text)}: must be a finite number") from None
    return within(value, f"{at}: {name}")
