"""Numeric tables of a data file, and their conversion to a measured flight by a column
mapping.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
import numpy.typing as npt

from skyarm.algebra.frames import (
    continuous,
    of_euler_angles,
    to_our_attitude,
    to_our_axes,
    turn_vectors,
    unit_rows,
)
from skyarm.flight_data.columns_file import ANGLES, TIMES, Columns, QuantitySource
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.quantities import ATTITUDE, QUANTITIES
from skyarm.flight_data.series import attitude_at
from skyarm.records.arrays import Array, doubles
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.files.messages import comma_list
from skyarm.records.immutable import immutable

RISING = 0.5
"""Least fraction of a table's rows whose times must rise."""

SMALLEST, LARGEST = 1e-6, 1e6
"""Bounds of the largest component of a quaternion in a file, which need not be of unit
length."""

UNUSED = 200
"""Largest number of unused columns that a flight lists; chosen, as a log of PX4 has
thousands."""

# sources are listed by quality, so a little jitter of rates is no reason to change
FASTER = 1.2
"""Ratio of rates above which a source replaces one of higher priority."""

FILTERED, ENOUGH = (
    re.compile(r".*vehicle_?(angular_?velocity|acceleration)", re.IGNORECASE),
    100.0,
)
"""Pattern of the topics that PX4 writes behind the filters of its controller; rate (Hz)
above which theirs is no reason to take them: a rotor's lag hides all motion beyond a
tenth of that."""


@immutable
class RawTable:
    """Numeric table with one time per row: a topic, an event type, or a whole CSV file.

    Attributes:
        columns: numbers (N,) by name; a row without one holds NaN.
        time: (N,) s since ``origin`` of the flight; empty where only a mapping knows
            the time.
        received: (N,) s, times of arrival, where they differ.
        origin: s, time 0 of ``time`` on the clock of the columns that hold times.
    """

    columns: Mapping[str, Array]
    time: Array
    received: Array | None = None
    origin: float = 0.0

    def has(self, *names: str) -> bool:
        """True if the table has all given columns; a leading minus in a name is
        ignored.
        """
        return all(
            each in self.columns or each.removeprefix("-") in self.columns
            for each in names
        )

    def numbers(self, name: str) -> Array:
        """Values (N,) of a column of the table; a leading minus in its name changes
        their sign.
        """
        return self.columns[name] if name in self.columns else -self.columns[name[1:]]


def flight_of(
    path: Path,
    tables: Mapping[str, RawTable],
    usual: Mapping[str, Sequence[QuantitySource]],
    columns: Columns | None,
    *,
    origin: float = 0.0,
    facts: Mapping[str, str | float] | None = None,
    notes: Iterable[str] = (),
) -> FlightData:
    """Make a measured flight from the numeric tables of a data file.

    Args:
        path: path of the file.
        tables: tables by topic; one of the name "" for a file of one table.
        usual: sources of each quantity that the format itself defines; the fastest that
            the file holds is taken, the first of those that are equally fast.
        columns: mapping of the user, whose quantities replace the usual ones.
        origin: s, time 0 of the tables in the file's own time.
        facts: other contents of the file.
        notes: sentences about earlier losses and repairs.

    Raises:
        ValueError: one line: a column that is not there, times that do not rise, or no
            quantity at all.
    """
    columns = columns or Columns()
    signals = dict(columns.signals)
    for name, every in usual.items():
        if name not in signals and (fastest := _fastest(tables, every)):
            signals[name] = fastest
    channels, said = dict[str, Channel](), list(notes)
    columns = replace(columns, time_unit=_time_unit(columns, tables, said))
    for name, every in usual.items():
        held = [
            each.source
            for each in every
            if (table := _holding(tables, each)) and table.has(*each.columns)
        ]
        if held and name not in signals:
            said.append(
                f"{name}: no row of {held[0]} holds numbers, so that the channel is"
                " left out."
            )
    for name in (each for each in QUANTITIES if each in signals):
        channel = _channel(name, signals[name], tables, columns, said)
        topic = signals[name].topic
        if FILTERED.fullmatch(topic) and name not in columns.signals:
            said.append(
                f"{name}: {topic} is behind PX4's filters, whose lag"
                " counts as one of the rotors."
            )
        if name == "voltage" and channel.time.size and not channel.values.any():
            said.append(
                "voltage: is 0 throughout, as without a battery monitor, and is left"
                " out."
            )
        elif channel.time.size:
            channels[name] = channel
        else:
            said.append(
                f"{name}: no row of {channel.source} holds numbers, so that the channel"
                " is left out."
            )
    if "velocity" in channels and signals["velocity"].frame:
        _turn_into_world(channels, said)
    if not channels:
        there = (
            tables
            if len(tables) > 1
            else [name for each in tables.values() for name in each.columns]
        )
        listed = "; ".join(
            [
                comma_list(there) or "no number",
                *(each.removesuffix(".") for each in said[:1]),
            ]
        )
        raise ValueError(
            f"channels = none: must hold a quantity or more; there is {listed}"
        )
    # time 0 is the first sample that is read, of whichever channel
    begin = min(float(each.time[0]) for each in channels.values())
    return FlightData(
        name=path.stem,
        file=str(path),
        channels={
            name: replace(each, time=each.time - begin)
            for name, each in channels.items()
        },
        notes=tuple(said),
        facts={**(facts or {}), "start": origin + begin},
        unused=_unused_names(tables, signals, columns.time),
    )


def _fastest(
    tables: Mapping[str, RawTable], signals: Sequence[QuantitySource]
) -> QuantitySource | None:
    """Source with the highest sample rate among those that a file contains; None if it
    contains none.
    """
    best, rate = None, 0.0
    for signal in signals:
        table = _holding(tables, signal)
        needed = (*signal.columns, *filter(None, [signal.time]))
        if table is None or not table.has(*needed):
            continue
        if (
            not np.isfinite([table.numbers(each) for each in signal.columns])
            .all(axis=0)
            .any()
        ):
            continue
        span = float(np.nanmax(table.time) - np.nanmin(table.time))
        # over the whole span, so that gaps count against a source
        own = table.time.size / span if span > 0.0 else 0.0
        own = min(own, ENOUGH) if FILTERED.fullmatch(signal.topic) else own
        if best is None or own > FASTER * rate:
            best, rate = signal, own
    return best


def _holding(tables: Mapping[str, RawTable], signal: QuantitySource) -> RawTable | None:
    """Table with a quantity: that of the stated topic, or else the first with the
    stated columns; None if missing.
    """
    if signal.topic:
        return tables.get(signal.topic)
    return next((each for each in tables.values() if each.has(*signal.columns)), None)


def _table(at: str, signal: QuantitySource, tables: Mapping[str, RawTable]) -> RawTable:
    """Table from which to read a quantity, by the stated topic or columns; raise an
    error if a column is missing.

    Raises:
        ValueError: one line: no such topic or column.
    """
    table = _holding(tables, signal)
    if signal.file and signal.file not in tables:
        raise ValueError(
            f"{at}.file = {shown(signal.file)}: must be left out of a format that is no"
            " table of text"
        )
    if signal.topic and "" in tables:
        raise ValueError(
            f"{at}.topic = {shown(signal.topic)}: must be left out for a file of one"
            " table"
        )
    if signal.topic and table is None:
        raise ValueError(
            f"{at}.topic = {shown(signal.topic)}:"
            f" {must_be_one_of(tables, signal.topic)}"
        )
    if table is None and len(tables) != 1:
        raise ValueError(
            f"{at}.columns: no table has {', '.join(signal.columns)}; topic must"
            " name one"
        )
    table = table or next(iter(tables.values()))
    for column in signal.columns:
        if not table.has(column):
            raise ValueError(
                f"{at}.columns = {shown(column)}:"
                f" {must_be_one_of(table.columns, column)}"
            )
    return table


def _channel(
    name: str,
    signal: QuantitySource,
    tables: Mapping[str, RawTable],
    columns: Columns,
    notes: list[str],
) -> Channel:
    """Convert table columns to a time series in SI units and the library's axes; lost
    samples are noted.
    """
    table = _table(f"{columns.file}: {name}", signal, tables)
    time = _time(name, signal, table, columns if name in columns.signals else Columns())
    # cells without numbers are NaN, and are counted below
    with np.errstate(all="ignore"):
        given = np.stack([table.numbers(each) for each in signal.columns], axis=1)
        values = _in_si(name, signal, given * signal.scale)
    whole = np.isfinite(values).all(axis=1) & np.isfinite(time)
    if name == "quaternion":
        size = np.abs(np.where(np.isfinite(values), values, 0.0)).max(axis=1)
        whole &= (size > SMALLEST) & (size < LARGEST)
    due = _rows_due(np.flatnonzero(whole), time[whole], whole.size)
    time, values = time[whole], values[whole]
    rising = rising_rows(time)
    rows, lost = time.size, time.size - rising.size
    if rising.size < RISING * rows:
        raise ValueError(
            f"time of {name}: rises in {rising.size} of {rows} rows only: must rise"
        )
    time, values = time[rising], values[rising]
    if name == "quaternion" and time.size:
        # q and -q are one attitude: one sign throughout, with w at the start above 0
        values = continuous(unit_rows(values)) * (-1.0 if values[0, 0] < 0.0 else 1.0)
    channel = Channel(
        time=time, values=values, source=signal.source, names=signal.names
    )
    if due < whole.size:
        notes.append(
            f"{name}: has numbers in {rows} of {whole.size} rows only,"
            f" {channel.rate:.4g} Hz."
        )
    if due > rows:
        notes.append(
            f"{name}: {due - rows} of {due} rows are without numbers and are left out."
        )
    if lost:
        notes.append(
            f"{name}: {lost} of {rows} rows are left out, as their times do not rise."
        )
    return channel


FEWEST = 10
"""Least number of steps that determine the rate of rows with numbers."""

REGULAR, NEAR = 0.8, 0.34
"""Fraction of steps between rows with numbers that must agree, and their relative
deviation, for a quantity that is logged less often: of every third row a step may be a
row more or less."""


def _rows_due(rows: npt.NDArray[np.intp], time: Array, count: int) -> int:
    """Number of rows that should contain a quantity, by the regular steps of its own
    times or else of its rows.

    Args:
        rows: indices of the rows that contain numbers.
        time: (N,) s, of these rows.
        count: number of rows of the table, all of them due if the steps are irregular.
    """
    between = np.diff(rows) - 1
    if step := _usual_step(np.diff(time)):
        # a gap in time loses no more rows than the table has there
        lost = np.clip(np.round(np.diff(time) / step) - 1.0, 0.0, between)
        return rows.size + int(lost.sum())
    # the ceiling of the quotient
    return -(-count // (round(_usual_step(between + 1)) or 1))


def _usual_step(steps: npt.ArrayLike) -> float:
    """Median of regular steps; 0 if they are few or irregular, as with missing rows."""
    size = doubles(steps)
    usual = float(np.median(size)) if size.size >= FEWEST else 0.0
    return (
        usual
        if usual > 0.0 and np.mean(np.abs(size - usual) <= NEAR * usual) >= REGULAR
        else 0.0
    )


FASTEST, SLOWEST, SLOWER = 20_000.0, 5.0, 0.5
"""Rates (Hz) between which the fastest quantity of a flight lies, and below which none
does."""

SINCE, UNTIL = 9.5e8, 4.1e9
"""Unix times (s) from 2000 to 2100."""


def _time_unit(
    columns: Columns, tables: Mapping[str, RawTable], notes: list[str]
) -> str:
    """Unit of the times of a mapping: the stated one, or that with which rate and date
    can be true.

    Raises:
        ValueError: one line: a stated unit that cannot be true, or two units that can.
    """
    steps, dates = list[float](), list[float]()
    for signal in columns.signals.values():
        table = _holding(tables, signal)
        column = signal.time or columns.time
        if table is not None and column and table.has(column, *signal.columns):
            rows = np.stack([table.numbers(each) for each in (column, *signal.columns)])
            time = rows[0, np.isfinite(rows).all(axis=0)]
            rising = np.diff(time)[np.diff(time) > 0.0]
            if rising.size >= FEWEST:
                steps.append(float(np.median(rising)))
                dates.append(float(np.median(time)))
    if not steps:
        return columns.time_unit or "s"
    step = min(steps)
    date = dates[0]
    unit = columns.time_unit
    # seconds are what is meant if nothing is said: slow ones are doubted, too, and not
    # taken for milliseconds
    least = dict.fromkeys(TIMES, SLOWEST) | ({} if unit else {"s": SLOWER})
    able = [
        each
        for each, size in TIMES.items()
        if least[each] <= 1.0 / (step * size) <= FASTEST
    ]
    dated = [each for each in able if SINCE <= date * TIMES[each] <= UNTIL]
    rates = ", ".join(f"{each}: {1.0 / (step * TIMES[each]):.4g} Hz" for each in able)
    if (
        unit
        and able
        and unit not in able
        and not SLOWER <= 1.0 / (step * TIMES[unit]) <= FASTEST
    ):
        raise ValueError(
            f"{columns.file}: time.unit = {shown(unit)}: cannot be true of steps of"
            f" {step:.4g}; try {rates}"
        )
    if unit:
        return unit
    likely = [*dated, "s"] if step * SLOWEST <= 1.0 and "s" in able else dated
    if not likely and len(able) > 1:
        raise ValueError(
            f"{columns.file}: time.unit: is missing; steps of {step:.4g} may be {rates}"
        )
    found = [*likely, *able, "s"][0]
    if found != "s":
        notes.append(
            f"time: is taken for {found}, as its steps are {step:.4g}; a columns.toml"
            " may state another unit."
        )
    return found


def _time(
    name: str, signal: QuantitySource, table: RawTable, columns: Columns
) -> Array:
    """Times (s) of the samples of a source."""
    column = signal.time or columns.time
    if column and not table.has(column):
        place = f"{name}.time" if signal.time else "time.column"
        raise ValueError(
            f"{columns.file}: {place} = {shown(column)}:"
            f" {must_be_one_of(table.columns, column)}"
        )
    if column:
        time = table.numbers(column) * TIMES[columns.time_unit or "s"]
        # times that begin a second before the origin are of another clock, as since the
        # start of a program
        begin = time[np.isfinite(time)][:1]
        return time - table.origin if (begin > table.origin - 1.0).all() else time
    if not table.time.size:
        raise ValueError(
            f"{columns.file}: time.column: is missing; there are"
            f" {comma_list(list(table.columns))}"
        )
    return (
        table.received
        if signal.stamp == "receive" and table.received is not None
        else table.time
    )


def _in_si(name: str, signal: QuantitySource, given: Array) -> Array:
    """Convert the numbers of a quantity to SI units and the library's axes."""
    quantity = QUANTITIES[name]
    if quantity.axes == ATTITUDE:
        euler = given.shape[1] == 3
        w, *xyz = (
            of_euler_angles(*given.T * ANGLES[signal.unit or "rad"])
            if euler
            else (given[:, signal.order.index(letter)] for letter in "wxyz")
        )
        x, y, z = (-each if signal.inverse else each for each in xyz)
        return np.stack(
            [*to_our_attitude(w, x, y, z, signal.frame, signal.world)], axis=1
        )
    values = given * quantity.units[signal.unit or quantity.unit]
    if name == "rotor_commands":
        values = (values - signal.low) / (signal.high - signal.low)
    # FRD and NED become our axes by the same change of signs, of y and z
    turned = signal.frame == "FRD" if signal.frame else signal.world == "NED"
    return np.stack([*to_our_axes(*values.T)], axis=1) if turned else values


def _turn_into_world(channels: dict[str, Channel], notes: list[str]) -> None:
    """Rotate the velocity channel from base axes to world axes; it is dropped if there
    is no attitude.
    """
    velocity = channels.pop("velocity")
    if "quaternion" not in channels:
        notes.append(
            "velocity: is in base axes, and the flight has no attitude to turn it by;"
            " it is left out."
        )
        return
    attitude = channels["quaternion"]
    inside = velocity.section(float(attitude.time[0]), float(attitude.time[-1]))
    if lost := velocity.time.size - inside.time.size:
        notes.append(
            f"velocity: {lost} of {velocity.time.size} rows lie outside the attitude"
            " and are left out."
        )
    if inside.time.size:
        values = turn_vectors(attitude_at(attitude, inside.time), inside.values)
        channels["velocity"] = replace(
            inside, values=values, source=f"{velocity.source}, turned by the attitude"
        )


def shares_of(
    outputs: RawTable, names: Sequence[str], low: float, high: float
) -> RawTable:
    """Outputs to rotors as shares of their range, at least 0."""
    columns = {
        # an output below its range stops the motor and does not push backwards
        f"output {name}": np.maximum(0.0, (outputs.numbers(name) - low) / (high - low))
        for name in names
    }
    return replace(outputs, columns=columns)


COUNTS = (3, 4, 6, 8)
"""Numbers of rotors that equal least outputs may tell."""


VALIDITY = {
    "xy_valid": ("x", "y"),
    "z_valid": ("z",),
    "v_xy_valid": ("vx", "vy"),
    "v_z_valid": ("vz",),
}
"""Flags of PX4's local position -> columns that hold nothing where they are 0."""


def valid_rows(
    topic: str,
    table: RawTable,
    notes: list[str],
    flags: Mapping[str, Sequence[str]] = VALIDITY,
) -> RawTable:
    """Table of an estimate, with NaN in the columns of a flag where the estimator
    states it as 0; they are counted.
    """
    columns, lost = dict(table.columns), list[str]()
    for flag in (each for each in flags if table.has(each)):
        invalid = table.numbers(flag) == 0.0
        columns |= {
            each: np.where(invalid, np.nan, table.numbers(each))
            for each in flags[flag]
            if table.has(each)
        }
        lost += [f"{flag} in {invalid.sum()}"] if invalid.any() else []
    if lost:
        notes.append(
            f"{topic}: is not valid by {', '.join(lost)} of {table.time.size} rows,"
            " which are left out."
        )
    return replace(table, columns=columns)


def alike_outputs(
    outputs: RawTable, names: Sequence[str], notes: list[str]
) -> list[str]:
    """Columns of the first outputs that move and have the same least value: those of
    rotors; none if they are few.
    """
    sent = [outputs.columns[each] for each in names]
    ends = [(np.nanmin(each), np.nanmax(each)) for each in sent]
    # an output that never moves drives no rotor, so the least is below the most
    alike = [low == ends[0][0] < high for low, high in ends]
    # one that is not alike ends the rotors
    rotors = [*names[: [*alike, False].index(False)]]
    if len(rotors) in COUNTS:
        notes.append(
            f"rotor_commands: {len(rotors)} rotors are assumed, as so many outputs have"
            " the same least value."
        )
        return rotors
    notes.append(
        "rotor_commands: are left out, as nothing says which outputs drive rotors; a"
        " columns.toml may do so."
    )
    return []


def rising_rows(time: Array) -> npt.NDArray[np.intp]:
    """Indices of the longest subsequence of strictly increasing times."""
    if (np.diff(time) > 0.0).all():
        return np.arange(time.size)
    # patience sorting: tails[k] is the least end of a rising run of k + 1 rows
    tails, last = list[float](), list[int]()
    before = np.full(time.size, -1, dtype=np.intp)
    for row, stamp in enumerate(time.tolist()):
        place = bisect_left(tails, stamp)
        if place:
            before[row] = last[place - 1]
        tails[place : place + 1], last[place : place + 1] = [stamp], [row]
    rows = list[int]()
    row = last[-1]
    while row >= 0:
        rows.append(row)
        row = int(before[row])
    return np.array(rows[::-1], dtype=np.intp)


def _unused_names(
    tables: Mapping[str, RawTable], signals: Mapping[str, QuantitySource], time: str
) -> tuple[str, ...]:
    """Unused topics of a file; for tables without topic names, its unused columns."""
    if any(signal.topic for signal in signals.values()):
        # by identity: tables are records of arrays, which have no truth of equality
        read = {id(_holding(tables, signal)) for signal in signals.values()}
        names = [name for name, each in tables.items() if id(each) not in read]
    else:
        columns = {time}
        for each in signals.values():
            columns |= {each.time, *(name.removeprefix("-") for name in each.columns)}
        there = chain.from_iterable(each.columns for each in tables.values())
        names = [name for name in there if name not in columns]
    return tuple(names[:UNUSED])
