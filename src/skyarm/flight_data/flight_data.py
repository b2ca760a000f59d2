"""Measured flight: time series in SI units on one clock, and the registry of file
formats.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Annotated

import numpy as np

from skyarm.flight_data.columns_file import Columns, read_columns
from skyarm.flight_data.quantities import GRAVITY, QUANTITIES
from skyarm.records.arrays import Array, doubles
from skyarm.records.files import PathLike, must_be_one_of, one_line, require_file, shown
from skyarm.records.files.messages import comma_list
from skyarm.records.immutable import immutable, positional
from skyarm.records.registry import RegistryError, find, names
from skyarm.records.registry.contract import kind_mistake, refuse_mistake
from skyarm.records.units import Unit

PLACE = ("place.x", "place.y", "place.z")
"""Facts of a flight: place of the inertial unit from the base origin, m, base axes."""


@immutable(eq=False)
class Channel:
    """Measured quantity over time, in SI units and the axes of the library.

    Attributes:
        time: (N,) s, strictly rising.
        values: (N, k); base axes x forward, y left, z up, world axes z up; all finite.
        source: topic or columns of the file.
        names: names of the joints whose columns they are, where the file has them.

    Raises:
        ValueError: one line: wrong shapes, times that do not rise, or numbers that are
            not finite.
    """

    time: Annotated[Array, Unit("s", "time of the samples, the flight's clock")]
    values: Array
    source: str
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        time, values = doubles(self.time), doubles(self.values)
        if time.ndim != 1 or values.ndim != 2 or len(time) != len(values):
            raise ValueError(
                f"values = {values.shape} at times {time.shape}: must be (N, k) at (N,)"
            )
        if not np.isfinite(time).all() or (np.diff(time) <= 0.0).any():
            raise ValueError(
                f"time of {self.source}: must be finite and rise from row to row"
            )
        if not np.isfinite(values).all():
            raise ValueError(f"values of {self.source}: must be finite numbers")
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "values", values)

    @property
    def rate(self) -> float:
        """Sample rate (Hz) by the median time between samples; 0 for fewer than two."""
        return 1.0 / float(np.median(np.diff(self.time))) if self.time.size > 1 else 0.0

    @property
    def duration(self) -> float:
        """Time from the first sample to the last, s."""
        return float(self.time[-1] - self.time[0]) if self.time.size else 0.0

    def section(self, start: float, end: float) -> Channel:
        """Return the samples from ``start`` to ``end`` (s), both included."""
        # searchsorted leaves the end out: the next double includes it
        chosen = slice(
            *np.searchsorted(self.time, [start, np.nextafter(end, np.inf)]).tolist()
        )
        return replace(self, time=self.time[chosen], values=self.values[chosen])


@immutable(eq=False)
class FlightData:
    """Measured flight: time series from a flight's data file, by the quantity names of
    :data:`QUANTITIES`.

    Attributes:
        name: name of the flight, from its file.
        file: path that was read.
        channels: channels by name of the quantity.
        notes: losses and repairs while reading, one sentence each.
        facts: other contents of the file: vehicle, firmware, parameters, ``start`` of
            the clock in the file's own time.
        unused: topics and columns of the file that no channel was made of.
        jumps: (begin, end), s, of each step in which an estimator reset a pose: nothing
            is compared across it.

    Raises:
        ValueError: one line: a channel of an unknown name or of a wrong width.
    """

    name: str
    file: str
    channels: Mapping[str, Channel]
    notes: tuple[str, ...] = ()
    facts: Mapping[str, str | float] = field(default_factory=dict)
    unused: tuple[str, ...] = ()
    jumps: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        for name, channel in self.channels.items():
            if name not in QUANTITIES:
                raise ValueError(
                    f"channel = {shown(name)}: {must_be_one_of(QUANTITIES, name)}"
                )
            width = QUANTITIES[name].width
            count = channel.values.shape[1]
            if count != width if width else count == 0:
                raise ValueError(
                    f"channel {name}: has {count} columns: must be"
                    f" {width or 'one or more'}"
                )

    def __getitem__(self, quantity: str) -> Channel:
        """Time series of a measured quantity of the flight.

        Raises:
            ValueError: one line: the flight has none.
        """
        if quantity not in self.channels:
            there = ", ".join(self.channels) or "no channel"
            raise ValueError(
                one_line(
                    f"{self.name}: {quantity}: is not in this flight; there is {there}"
                )
            )
        return self.channels[quantity]

    def __contains__(self, quantity: object) -> bool:
        """True if the flight has a time series of the given quantity."""
        return quantity in self.channels

    def __iter__(self) -> Iterator[str]:
        """Names of the flight's measured quantities."""
        return iter(self.channels)

    @property
    def gravity(self) -> float:
        """Gravitational acceleration (m/s^2) stated in the file, else the standard
        value.
        """
        return float(self.facts.get("gravity", GRAVITY))

    @property
    def place(self) -> dict[str, float]:
        """Place (m) of the inertial unit in the base, where the file states one:
        ``place.x``, ``.y``, ``.z``.
        """
        return {name: float(self.facts[name]) for name in PLACE if name in self.facts}

    @property
    def start(self) -> float:
        """Time (s) of the first sample of any quantity of the flight."""
        return min(
            (float(each.time[0]) for each in self.channels.values() if each.time.size),
            default=0.0,
        )

    @property
    def end(self) -> float:
        """Time (s) of the last sample of any quantity of the flight."""
        return max(
            (float(each.time[-1]) for each in self.channels.values() if each.time.size),
            default=0.0,
        )

    @property
    def duration(self) -> float:
        """Time (s) from the first sample of any quantity of the flight to the last."""
        return self.end - self.start

    def section(self, start: float, end: float) -> FlightData:
        """Return the samples of all quantities from ``start`` to ``end`` (s), both
        included, on the same clock.
        """
        return replace(
            self,
            channels={
                name: each.section(start, end) for name, each in self.channels.items()
            },
        )

    def with_channels(self, changed: Mapping[str, Channel], *notes: str) -> FlightData:
        """Return the flight with some time series replaced or added, and with further
        notes.
        """
        return replace(
            self, channels={**self.channels, **changed}, notes=(*self.notes, *notes)
        )

    def with_jumps(self, spans: Iterable[tuple[float, float]]) -> FlightData:
        """Return the flight with the spans (s) in which an estimator reset its pose,
        and a note on them.
        """
        jumps = tuple(sorted((float(begin), float(end)) for begin, end in spans))
        when = ", ".join(f"{end:.2f}" for _, end in jumps)
        words = (
            f"pose: the estimator reset it at {when} s; nothing is compared across"
            " that."
        )
        return replace(self, jumps=jumps, notes=(*self.notes, words))


@positional
class FlightFormat:
    """File format of measured flights: its reader function, suffixes and first bytes.

    Attributes:
        read: (path, columns or None) -> flight.
        suffixes: endings of its files, without dot.
        begins: first bytes of its files, of which any decides before a suffix does.
        mapped: its files define no quantities, so that ``columns.toml`` beside a file
            is read for it.
        several: its files may hold several flights; ``read`` reads that of the number
            ``columns.log``, if it is not 0.
    """

    read: Callable[[Path, Columns | None], FlightData]
    suffixes: tuple[str, ...] = ()
    begins: tuple[bytes, ...] = ()
    mapped: bool = False
    several: bool = False


BAG_FOLDER = "db3"
"""Suffix whose format also reads folders."""

COLUMNS_FILE = "columns.toml"
"""Name of the column mapping that is read if it lies next to a flight and no other is
given."""

PAUSE = 5.0
"""Length (s) of a gap in all channels from which on it separates two flights of a
file; chosen, beyond the gaps of a logger that loses rows."""


def split_path(path: PathLike) -> tuple[str, int]:
    """Path of a file, and the number of the flight in it, of ``FILE#2``; 0 for a path
    without one.
    """
    text = os.fspath(path)
    match = (
        # a file whose own name ends so is meant itself
        None if os.path.exists(text) else re.fullmatch(r"(.+)#(\d+)", text, re.DOTALL)
    )
    return (match[1], int(match[2])) if match else (text, 0)


def choose_log(
    every: Sequence[str],
    columns: Columns | None,
    usual: int,
    notes: list[str],
    why: str,
) -> tuple[int, dict[str, str | float]]:
    """Place of the flight to read among several of a file, and facts that list them.

    Args:
        every: description of each flight of the file.
        columns: mapping of the user, with the number of the flight from 1 on; 0 for the
            usual one.
        usual: place of the flight that is read if none is chosen.
        notes: sentences about the file, extended here.
        why: meaning of the usual flight, such as "longest".

    Raises:
        ValueError: one line: a number that no flight has.
    """
    number = columns.log if columns else 0
    # a file of one flight has a first one, too
    if number > max(1, len(every)):
        raise ValueError(
            f"flight #{number}: must be 1 to {max(1, len(every))}, the flights of this"
            " file"
        )
    if len(every) < 2:
        return 0, {}
    place = number - 1 if number else usual
    if not number:
        listed = comma_list(every)
        notes.append(
            f"file: holds flights of {listed}; the {why} is read, #{place + 1}; write"
            " FILE#1 for the first."
        )
    return place, {f"flight #{k + 1}": words for k, words in enumerate(every)}


def load_flight(
    path: PathLike, columns: PathLike | Columns | None = None, *, kind: str = ""
) -> FlightData:
    """Read a measured flight from a file.

    Args:
        path: path of the file, or of the folder of a ROS 2 bag; ``FILE#2`` for the
            second flight of a file.
        columns: mapping from topics or columns to quantities, or the path of one, whose
            quantities replace those that the format itself defines; for a table of text
            ``columns.toml`` beside it if left out.
        kind: registered name of the format; by first bytes and suffix of the file if
            left out.

    Raises:
        ValueError: one line: no such file or format, a damaged file, or a mapping that
            does not fit.
    """
    name, number = split_path(path)
    at = f"flight = {shown(path)}"
    file = Path(name)
    if not os.path.isdir(file):
        require_file(file, at)
    named = kind or format_name(path)
    form = _checked(named, find("flight_format", named, "kind" if kind else ""))
    if (
        columns is None
        and form.mapped
        and (beside := file.parent / COLUMNS_FILE).is_file()
    ):
        columns = beside
    mapping = (
        columns
        if columns is None or isinstance(columns, Columns)
        else read_columns(columns)
    )
    try:
        flight = form.read(
            file,
            (
                replace(mapping or Columns(), log=number)
                if number and form.several
                else mapping
            ),
        )
        if not number:
            return flight
        if not form.several:
            flight = _part(flight, number)
        return replace(flight, name=f"{flight.name}#{number}", file=os.fspath(path))
    except OSError as error:
        raise ValueError(
            f"{at}: must be readable ({error.strerror or error})"
        ) from None
    except ValueError as error:
        raise ValueError(one_line(f"{at}: {error}")) from None


def parts_of(flight: FlightData) -> list[tuple[float, float]]:
    """Beginning and end (s) of each flight of a file, between pauses of all
    channels.
    """
    time = np.unique(
        np.concatenate(
            [each.time for each in flight.channels.values()] or [np.zeros(0)]
        )
    )
    parts = np.split(time, np.flatnonzero(np.diff(time) > PAUSE) + 1)
    return [(float(each[0]), float(each[-1])) for each in parts if each.size]


def _part(flight: FlightData, number: int) -> FlightData:
    """One of several flights of a file that pauses of all channels separate, on the
    clock of the file.
    """
    parts = parts_of(flight)
    # for its error of a number that no part has; notes and words are not used
    place, _ = choose_log([""] * len(parts), Columns(log=number), 0, [], "")
    inside = flight.section(*parts[place])
    return replace(
        inside,
        channels={
            name: each for name, each in inside.channels.items() if each.time.size
        },
    )


def format_name(path: PathLike) -> str:
    """Name of the format of a flight file, by its first bytes or else its suffix;
    user-defined formats come first.

    Raises:
        ValueError: one line: an empty file, or a format that is not known.
    """
    file = Path(split_path(path)[0])
    at = f"flight = {shown(path)}"
    folder = file.is_dir()
    head = b""
    if not folder:
        with file.open("rb") as stream:
            # longer than the beginning of any format that ships
            head = stream.read(64)
    formats = {
        name: _checked(name, find("flight_format", name))
        # later registrations first, so that a user's format goes before those that ship
        for name in reversed(names("flight_format"))
    }
    suffix = BAG_FOLDER if folder else file.suffix.removeprefix(".").lower()
    # first bytes decide before a suffix, which says less of what a file holds
    begun = [
        name
        for name, each in formats.items()
        if each.begins and head.startswith(each.begins)
    ]
    if fitting := [
        *begun,
        *(name for name, each in formats.items() if suffix in each.suffixes),
    ]:
        return fitting[0]
    if not folder and not head:
        raise ValueError(f"{at}: is empty")
    allowed = ", ".join(
        f"{name} ({', '.join(formats[name].suffixes) or 'no suffix'})"
        for name in reversed(formats)
    )
    raise ValueError(
        f"{at}: format {suffix or 'without suffix'!r} is unknown: must be one of"
        f" {allowed}"
    )


def _checked(name: str, registered: object) -> FlightFormat:
    """Check that a registered format is a FlightFormat, and return it."""
    refuse_mistake(kind_mistake("flight_format", registered), "flight_format", name)
    if not isinstance(registered, FlightFormat):
        raise RegistryError(
            f"flight_format {name!r}: is {shown(registered)}: must be"
            " FlightFormat(read, suffixes, begins)"
        )
    return registered
