"""Tables of numbers as a file holds them, and the measured flight that a mapping makes of them."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from skyarm.flight_data.columns_file import ANGLES, TIMES, Columns, Signal
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.quantities import ATTITUDE, BODY, QUANTITIES
from skyarm.flight_data.series import attitude_at, continuous, unit_rows
from skyarm.records.arrays import Array, Mask
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.immutable import immutable

RISING = 0.5
"""Least share of the rows of a table whose times must rise."""

SMALLEST, LARGEST = 1e-6, 1e6
"""Bounds of the largest number of a quaternion in a file, which need not be of unit length."""

UNUSED = 200
"""Names of unused columns that a flight lists at most."""


@immutable
class Table:
    """Rows of a file that have a time in common: a topic, an event, or a whole CSV file.

    Attributes:
        columns: numbers (N,) by name; a row without one holds NaN.
        time: (N,) s since ``origin`` of the flight.
        received: (N,) s, times of arrival, where they differ.
    """

    columns: Mapping[str, Array]
    time: Array
    received: Array | None = None

    def column(self, name: str) -> Array | None:
        """Numbers of a column; a minus before its name turns their sign; None if there is none."""
        if name in self.columns:
            return self.columns[name]
        if name.startswith("-") and name[1:] in self.columns:
            return -self.columns[name[1:]]
        return None


def flight_of(
    path: Path,
    tables: Mapping[str, Table],
    usual: Mapping[str, Sequence[Signal]],
    columns: Columns | None,
    *,
    origin: float = 0.0,
    facts: Mapping[str, str | float] | None = None,
    notes: Sequence[str] = (),
) -> FlightData:
    """Make a measured flight from the tables of a file.

    Args:
        path: of the file.
        tables: by topic.
        usual: sources of each quantity that the format itself defines; the fastest that the file holds is taken, the
            first of those that are equally fast.
        columns: mapping of the user, whose quantities replace the usual ones.
        origin: s, time 0 of the tables in the file's own time.
        facts: other contents of the file.
        notes: of what was lost or repaired before.

    Raises:
        ValueError: one line: a column that is not there, times that do not rise, or no quantity at all.
    """
    own = {} if columns is None else columns.signals
    chosen = {name: signal for name, every in usual.items() if name not in own for signal in _fastest(tables, every)}
    signals = {**chosen, **own}
    found: dict[str, Channel] = {}
    said = list(notes)
    for name in (each for each in QUANTITIES if each in signals):
        channel = _channel(name, signals[name], tables, columns if name in own else None, said)
        if channel.time.size:
            found[name] = channel
        else:
            said.append(f"{name}: no row of {channel.source} holds numbers, so that the channel is left out.")
    if not found:
        there = (
            ", ".join(tables) if len(tables) > 1 else ", ".join(next(iter(tables.values())).columns) if tables else ""
        )
        raise ValueError(f"channels = none: must hold a quantity or more; there is {there or 'no number'}")
    if "velocity" in found and signals["velocity"].frame:
        found["velocity"] = _into_world(found, said)
        if not found["velocity"].time.size:
            del found["velocity"]
    begin = min(float(each.time[0]) for each in found.values())
    shifted = {name: replace(each, time=each.time - begin) for name, each in found.items()}
    return FlightData(
        name=path.stem,
        file=str(path),
        channels=shifted,
        notes=tuple(said),
        facts={**(facts or {}), "start": origin + begin},
        unused=_unused_names(tables, signals),
    )


def _fastest(tables: Mapping[str, Table], signals: Sequence[Signal]) -> list[Signal]:
    """Signal of the highest rate among those that a file holds, as a list of one; empty if it holds none."""
    best: list[Signal] = []
    rate = 0.0
    for signal in signals:
        table = tables.get(signal.topic) if signal.topic else _first_with(tables, signal.columns)
        if table is None or not table.time.size or any(table.column(each) is None for each in signal.columns):
            continue
        if signal.time and table.column(signal.time) is None:
            continue
        if not np.isfinite(_numbers_of(table, signal.columns[0])).any():
            continue
        span = float(np.nanmax(table.time) - np.nanmin(table.time))
        own = table.time.size / span if span > 0.0 else 0.0
        if not best or own > 1.2 * rate:
            best, rate = [signal], own
    return best


def _first_with(tables: Mapping[str, Table], columns: Sequence[str]) -> Table | None:
    """First table that has all of the given columns."""
    return next(
        (each for each in tables.values() if all(each.column(name) is not None for name in columns)),
        None,
    )


def _table(name: str, signal: Signal, tables: Mapping[str, Table], where: str) -> Table:
    """Table that holds a signal."""
    at = f"{where}{name}"
    if signal.topic:
        if signal.topic not in tables:
            raise ValueError(f"{at}.topic = {shown(signal.topic)}: {must_be_one_of(tables, signal.topic)}")
        table = tables[signal.topic]
    else:
        found = _first_with(tables, signal.columns)
        if found is None and len(tables) > 1:
            raise ValueError(f"{at}.columns: no table has {', '.join(signal.columns)}; topic must name one")
        table = next(iter(tables.values())) if found is None else found
    for column in signal.columns:
        if table.column(column) is None:
            raise ValueError(f"{at}.columns = {shown(column)}: {must_be_one_of(table.columns, column)}")
    return table


def _channel(
    name: str, signal: Signal, tables: Mapping[str, Table], columns: Columns | None, notes: list[str]
) -> Channel:
    """Channel of a quantity in SI units and our axes; what was lost is appended to the notes."""
    where = "" if columns is None else f"{columns.file}: "
    table = _table(name, signal, tables, where)
    time = _time(name, signal, table, columns, where)
    with np.errstate(all="ignore"):
        values = _in_si(name, signal, np.stack([_numbers_of(table, each) for each in signal.columns], axis=1))
    whole = np.isfinite(values).all(axis=1) & np.isfinite(time)
    if name == "quaternion":
        size = np.abs(np.where(np.isfinite(values), values, 0.0)).max(axis=1)
        whole &= (size > SMALLEST) & (size < LARGEST)
    if not whole.all():
        every = _rows_apart(whole)
        due = -(-whole.size // every)
        lost = max(0, due - int(whole.sum()))
        time, values = time[whole], values[whole]
        if every > 1:
            rate = Channel(time=time[rising_rows(time)], values=values[rising_rows(time)], source="").rate
            notes.append(f"{name}: has numbers in every {_ordinal(every)} row only, {rate:.4g} Hz.")
        if lost:
            notes.append(f"{name}: {lost} of {due} rows are without numbers and are left out.")
    kept = rising_rows(time)
    if kept.size < time.size:
        if kept.size < RISING * time.size:
            raise ValueError(f"time of {name}: rises in {kept.size} of {time.size} rows only: must rise")
        notes.append(f"{name}: {time.size - kept.size} of {time.size} rows are left out, as their times do not rise.")
        time, values = time[kept], values[kept]
    if name == "quaternion":
        values = continuous(unit_rows(values))
        if len(values) and values[0, 0] < 0.0:
            values = -values
    return Channel(time=time, values=values, source=signal.source, names=signal.names)


FEWEST = 10
"""Steps that tell a rate of rows with numbers."""

REGULAR, NEAR = 0.8, 0.34
"""Share of the steps between rows with numbers that are alike, by this part, where a quantity is logged more seldom."""


def _rows_apart(whole: Mask) -> int:
    """Rows from one with numbers to the next where these come at a rate of their own; 1 where rows are missing."""
    steps = np.diff(np.flatnonzero(whole))
    if steps.size < FEWEST:
        return 1
    usual = round(float(np.median(steps)))
    return usual if np.mean(np.abs(steps - usual) <= NEAR * usual) >= REGULAR else 1


def _ordinal(count: int) -> str:
    """Number in a row as text: 2nd, 3rd, 4th, 11th."""
    endings = {1: "st", 2: "nd", 3: "rd"}
    return f"{count}{'th' if count % 100 in (11, 12, 13) else endings.get(count % 10, 'th')}"


def _numbers_of(table: Table, column: str) -> Array:
    """Numbers of a column that is there."""
    found = table.column(column)
    assert found is not None
    return found


def _time(name: str, signal: Signal, table: Table, columns: Columns | None, where: str) -> Array:
    """Times of the rows of a signal, s."""
    wanted = signal.time or ("" if columns is None else columns.time)
    if not wanted:
        return table.received if signal.stamp == "receive" and table.received is not None else table.time
    found = table.column(wanted)
    if found is None:
        field_name = f"{name}.time" if signal.time else "time.column"
        raise ValueError(f"{where}{field_name} = {shown(wanted)}: {must_be_one_of(table.columns, wanted)}")
    unit = "s" if columns is None else columns.time_unit
    return found * TIMES[unit]


def _in_si(name: str, signal: Signal, given: Array) -> Array:
    """Numbers of a quantity in SI units and our axes."""
    quantity = QUANTITIES[name]
    if quantity.axes == ATTITUDE:
        return _quaternions(signal, given)
    values = given * quantity.units[signal.unit or quantity.unit]
    if name == "rotor_commands":
        values = (values - signal.low) / (signal.high - signal.low)
    turned = signal.frame == "FRD" if quantity.axes == BODY or signal.frame else signal.world == "NED"
    return values * [1.0, -1.0, -1.0] if turned else values


def _quaternions(signal: Signal, given: Array) -> Array:
    """Quaternions w, x, y, z from our base axes to our world axes, from those of a file or from Euler angles."""
    if given.shape[1] == 3:
        half = given * (0.5 * ANGLES[signal.unit or "rad"])
        (cr, cp, cy), (sr, sp, sy) = np.cos(half).T, np.sin(half).T
        w, x = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
        y, z = cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy
    elif signal.order == "xyzw":
        x, y, z, w = given.T
    else:
        w, x, y, z = given.T
    if signal.inverse:
        x, y, z = -x, -y, -z
    if signal.frame == "FRD":  # base axes turned by half a turn about x: the factor i from the right
        w, x, y, z = -x, w, z, -y
    if signal.world == "NED":  # world axes likewise: from the left
        w, x, y, z = -x, w, -z, y
    return np.stack([w, x, y, z], axis=1)


def turn_vectors(quaternions: Array, vectors: Array) -> Array:
    """Vectors (N, 3) turned by quaternions (N, 4), w first."""
    w, v = quaternions[:, :1], quaternions[:, 1:]
    twice = 2.0 * np.cross(v, vectors)
    return vectors + w * twice + np.cross(v, twice)


def to_base(quaternions: Array, vectors: Array) -> Array:
    """Vectors (N, 3) in base axes from those in world axes; quaternions (N, 4), w first, base to world."""
    return turn_vectors(quaternions * [1.0, -1.0, -1.0, -1.0], vectors)


def _into_world(found: Mapping[str, Channel], notes: list[str]) -> Channel:
    """Channel of a velocity in world axes, from one in base axes and the attitude."""
    velocity = found["velocity"]
    if "quaternion" not in found:
        notes.append("velocity: is in base axes, and the flight has no attitude to turn it by; it is left out.")
        return Channel(time=np.zeros(0), values=np.zeros((0, 3)), source=velocity.source)
    attitude = found["quaternion"]
    inside = velocity.section(float(attitude.time[0]), float(attitude.time[-1]))
    if lost := velocity.time.size - inside.time.size:
        notes.append(f"velocity: {lost} of {velocity.time.size} rows lie outside the attitude and are left out.")
    values = turn_vectors(attitude_at(attitude, inside.time), inside.values)
    return Channel(time=inside.time, values=values, source=f"{velocity.source}, turned by the attitude")


def rising_rows(time: Array) -> npt.NDArray[np.intp]:
    """Rows of the longest run of strictly rising times, of which rows between may be left out."""
    if (np.diff(time) > 0.0).all():
        return np.arange(time.size)
    tails: list[float] = []
    last: list[int] = []
    before = np.full(time.size, -1, dtype=np.intp)
    for row, stamp in enumerate(time.tolist()):
        place = bisect_left(tails, stamp)
        if place:
            before[row] = last[place - 1]
        if place == len(tails):
            tails.append(stamp)
            last.append(row)
        else:
            tails[place], last[place] = stamp, row
    kept, row = [], last[-1] if last else -1
    while row >= 0:
        kept.append(row)
        row = int(before[row])
    return np.array(kept[::-1], dtype=np.intp)


def _unused_names(tables: Mapping[str, Table], signals: Mapping[str, Signal]) -> tuple[str, ...]:
    """Names of the topics that no quantity was made of; of the columns, where topics have no names of their own."""
    topics = {signal.topic for signal in signals.values()}
    free = [signal for signal in signals.values() if not signal.topic]
    used = {each.removeprefix("-") for signal in free for each in (*signal.columns, signal.time)}
    if any(topics):
        found = [name for name, each in tables.items() if name not in topics and not used & set(each.columns)]
        return tuple(found[:UNUSED])
    return tuple([name for each in tables.values() for name in each.columns if name not in used][:UNUSED])
