"""Reader of tables of text: CSV files whose columns are mapped to quantities by ``columns.toml``."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from skyarm.flight_data.columns_file import Columns
from skyarm.flight_data.flight_data import FlightData, FlightFormat
from skyarm.flight_data.raw_tables import Table, flight_of
from skyarm.records.arrays import Array
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.files.messages import comma_list

SEPARATORS = ",;\t "
"""Characters between columns; the one that occurs most often in the head."""


def read_table(path: Path, columns: Columns | None) -> FlightData:
    """Read a CSV file: a head with the names of the columns, then a row at each instant.

    Raises:
        ValueError: one line: it is no table, it has no mapping, or the mapping does not fit. OSError: it cannot be
            read.
    """
    text = path.read_bytes().decode("utf-8-sig", "replace")
    head, _, body = text.replace("\r\n", "\n").replace("\r", "\n").lstrip("\n").partition("\n")
    separator = max(SEPARATORS, key=head.count)
    names = [name.strip() for name in next(_cells(head, separator), [])]
    if not any(names) or "\0" in head or "\ufffd" in head:
        raise ValueError(f"head = {shown(head[:60])}: must be the names of the columns")
    if columns is None:
        raise ValueError(f"columns: are missing; a columns.toml must map these: {comma_list(names)}")
    twice = sorted({name for name in names if name and names.count(name) > 1})
    wanted = _mapped_columns(columns, names)
    if found := [name for name in twice if name in wanted]:
        raise ValueError(f"head = {shown(found[0])}: names {names.count(found[0])} columns: must name one")
    places = [names.index(name) for name in wanted]
    notes: list[str] = []
    rows = _rows(body, places, separator, len(names), notes)
    if not len(rows):
        raise ValueError("rows = 0: must be one or more")
    read = {name: rows[:, k] for k, name in enumerate(wanted)}
    table = Table(columns=read, time=read[columns.time] if columns.time else np.full(len(rows), np.nan))
    others = tuple(name for name in names if name and name not in wanted)
    return replace(flight_of(path, {"": table}, {}, columns, notes=notes), unused=others)


def _mapped_columns(columns: Columns, names: Sequence[str]) -> list[str]:
    """Columns of the file that a mapping names, each once."""
    found: dict[str, None] = {}
    for name, signal in columns.signals.items():
        at = f"{columns.file}: {name}"
        if signal.topic:
            raise ValueError(f"{at}.topic = {shown(signal.topic)}: must be left out for a file of one table")
        if not signal.time and not columns.time:
            raise ValueError(f"{columns.file}: time.column: is missing; there are {comma_list(names)}")
        for column in signal.columns:
            found[_column_name(column, names, f"{at}.columns")] = None
        if signal.time:
            found[_column_name(signal.time, names, f"{at}.time")] = None
    if columns.time:
        found[_column_name(columns.time, names, f"{columns.file}: time.column")] = None
    return list(found)


def _column_name(column: str, names: Sequence[str], at: str) -> str:
    """Name of a column of the file, without the minus of a mapping."""
    if column in names:
        return column
    if column.startswith("-") and column[1:] in names:
        return column[1:]
    raise ValueError(f"{at} = {shown(column)}: {must_be_one_of(names, column)}")


def _rows(body: str, places: Sequence[int], separator: str, width: int, notes: list[str]) -> Array:
    """Numbers (N, columns) of the rows; NaN where a cell is empty or no number."""
    if not body.strip():
        return np.zeros((0, len(places)))
    if not _has_whole_rows(body, separator, width):
        return _row_by_row(body, places, separator, width, notes)
    try:
        found = np.loadtxt(io.StringIO(body), delimiter=separator, usecols=places, ndmin=2, comments=None)
    except ValueError:
        return _row_by_row(body, places, separator, width, notes)
    return np.asarray(found, dtype=float)


def _has_whole_rows(body: str, separator: str, width: int) -> bool:
    """True if each row that is not empty has the separators of the head: with one less its cells stand shifted."""
    letters = np.frombuffer(body.encode(), dtype=np.uint8)
    ends = np.flatnonzero(np.concatenate([letters, np.frombuffer(b"\n", dtype=np.uint8)]) == ord("\n"))
    places = np.flatnonzero(letters == ord(separator))
    found = np.diff(np.searchsorted(places, ends), prepend=0)
    lengths = np.diff(ends, prepend=-1) - 1
    return bool((found[lengths > 0] == width - 1).all())


def _row_by_row(body: str, places: Sequence[int], separator: str, width: int, notes: list[str]) -> Array:
    """Numbers of the rows of a table with empty cells, quotes or damage, which is named in the notes."""
    rows, short, wrong = list[list[float]](), 0, 0
    for cells in _cells(body, separator):
        if not any(cell.strip() for cell in cells):
            continue
        if len(cells) < width or any(cell.strip() for cell in cells[width:]):
            short += 1
            rows.append([np.nan] * len(places))
            continue
        row = []
        for place in places:
            cell = cells[place].strip()
            try:
                row.append(float(cell) if cell else np.nan)
            except ValueError:
                wrong += 1
                row.append(np.nan)
        rows.append(row)
    if short:
        notes.append(f"file: {short} of {len(rows)} rows have not the {width} cells of the head and count as empty.")
    if wrong:
        notes.append(f"file: {wrong} cells are no numbers and count as empty.")
    return np.array(rows, dtype=float).reshape(len(rows), len(places))


def _cells(text: str, separator: str) -> Iterator[list[str]]:
    """Yield the cells of each row of a text.

    Raises:
        ValueError: one line: a quote without end, or a cell of very many letters.
    """
    try:
        yield from csv.reader(io.StringIO(text.replace("\0", "")), delimiter=separator)
    except csv.Error as error:
        raise ValueError(f"cells: must be of a table of text ({error})") from None


TABLE = FlightFormat(read_table, suffixes=("csv", "tsv", "txt"), mapped=True)
