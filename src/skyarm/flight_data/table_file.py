"""Reader of CSV files, whose columns are mapped to quantities by ``columns.toml``."""

from __future__ import annotations

import csv
import io
import math
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from skyarm.flight_data.columns_file import Columns
from skyarm.flight_data.flight_data import FlightData, FlightFormat
from skyarm.flight_data.raw_tables import RawTable, flight_of
from skyarm.records.arrays import Array
from skyarm.records.files import shown
from skyarm.records.files.messages import comma_list

SEPARATORS = ",;\t "
"""Possible column separators; the one that occurs most often in the head is used."""


def read_table(path: Path, columns: Columns | None) -> FlightData:
    """Read a CSV file with a header line of column names and one row per instant.

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
    signals = columns.signals.values()
    mapped = {columns.time, *(each for signal in signals for each in (*signal.columns, signal.time))}
    used = [name for name in dict.fromkeys(names) if name and mapped & {name, f"-{name}"}]
    if twice := sorted(name for name in used if names.count(name) > 1):
        raise ValueError(f"head = {shown(twice[0])}: names {names.count(twice[0])} columns: must name one")
    notes: list[str] = []
    rows = _rows(body, [names.index(name) for name in used], separator, len(names), notes)
    if not len(rows):
        raise ValueError("rows = 0: must be one or more")
    others = dict.fromkeys(filter(None, names), np.zeros(0))  # not read: a mapping names none of them
    table = RawTable(columns={**others, **dict(zip(used, rows.T, strict=True))}, time=np.zeros(0))
    return flight_of(path, {"": table}, {}, columns, notes=notes)


def _rows(body: str, places: Sequence[int], separator: str, width: int, notes: list[str]) -> Array:
    """Numeric values (N, columns) of the rows; NaN for empty or non-numeric cells, and for incomplete rows."""
    numbers, count, short, wrong = array("d"), 0, 0, 0
    for cells in _cells(body, separator):
        filled = [cell.strip() for cell in cells]
        if not any(filled):
            continue
        row = [math.nan] * len(places)
        if len(filled) < width or any(filled[width:]):
            short += 1
            filled = []
        for k, place in enumerate(places if filled else ()):
            try:
                row[k] = float(filled[place] or "nan")
            except ValueError:
                wrong += 1
        numbers.extend(row)
        count += 1
    if short:
        notes.append(f"file: {short} of {count} rows have not the {width} cells of the head and count as empty.")
    if wrong:
        notes.append(f"file: {wrong} cells are no numbers and count as empty.")
    return np.array(numbers).reshape(count, len(places))


def _cells(text: str, separator: str) -> Iterator[list[str]]:
    """Yield the cells of each row of a CSV text.

    Raises:
        ValueError: one line: a quote without end, or a cell of very many letters.
    """
    try:
        yield from csv.reader(io.StringIO(text.replace("\0", "")), delimiter=separator)
    except csv.Error as error:
        raise ValueError(f"cells: must be of a table of text ({error})") from None


TABLE = FlightFormat(read_table, suffixes=("csv", "tsv", "txt"), mapped=True)
