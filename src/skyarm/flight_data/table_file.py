"""Reader of CSV files, whose columns are mapped to quantities by ``columns.toml``."""

from __future__ import annotations

import csv
import io
import math
import re
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from skyarm.flight_data.columns_file import TIMES, Columns
from skyarm.flight_data.flight_data import FlightData, FlightFormat
from skyarm.flight_data.raw_tables import RawTable, flight_of
from skyarm.records.arrays import Array
from skyarm.records.files import errors_as, require_file, shown
from skyarm.records.files.messages import comma_list

SEPARATORS = ",;\t "
"""Possible column separators; the first that cuts the head and most rows into as many
cells is used."""

UTF_16 = b"\xff\xfe", b"\xfe\xff"
"""First bytes of text of 16 bits, as Windows writes it."""

JUDGED = 100
"""Number of rows by which the separator is chosen."""


def read_table(path: Path, columns: Columns | None) -> FlightData:
    """Read a CSV file with a header line of column names and one row per instant, and
    other files that a mapping names.

    Raises:
        ValueError: one line: it is no table, it has no mapping, or the mapping does not
            fit. OSError: it cannot be read.
    """
    notes: list[str] = []
    if columns is None or not any(each.file for each in columns.signals.values()):
        return flight_of(
            path, {"": _table_of(path, columns, notes)}, {}, columns, notes=notes
        )
    of_files = {
        name: replace(each, topic=each.topic or each.file or path.name)
        for name, each in columns.signals.items()
    }
    tables = {}
    for name in dict.fromkeys(
        [path.name, *(each.file for each in columns.signals.values() if each.file)]
    ):
        require_file(path.parent / name, f"file = {shown(name)}")
        here = {
            quantity: each
            for quantity, each in columns.signals.items()
            if (each.file or path.name) == name
        }
        of_file: list[str] = []
        with errors_as(ValueError, f"{name}: "):
            tables[name] = _table_of(
                path.parent / name, replace(columns, signals=here), of_file
            )
        # a note begins with the word file, in whose place the name of this one stands
        notes += [f"{name}{each.removeprefix('file')}" for each in of_file]
    return flight_of(path, tables, {}, replace(columns, signals=of_files), notes=notes)


def _table_of(path: Path, columns: Columns | None, notes: list[str]) -> RawTable:
    """Columns of a text file that a mapping names; the others are empty."""
    data = path.read_bytes()
    text = data.decode("utf-16" if data.startswith(UTF_16) else "utf-8-sig", "replace")
    lost = "\ufffd"
    # western Windows writes degree signs so
    if lost in text.lstrip().partition("\n")[0] and lost.encode() not in data:
        western = data.decode("cp1252", "replace")
        text = (
            western
            if western.lstrip().splitlines()[0].replace("\t", "").isprintable()
            else text
        )
    text = re.sub(r"^\s*sep=.\n", "", text.replace("\r\n", "\n").replace("\r", "\n"))
    head, _, body = text.lstrip("\n").partition("\n")
    first_rows = "\n".join(body.split("\n", JUDGED)[:JUDGED])
    separator = max(
        SEPARATORS, key=lambda each: (_alike(head, first_rows, each), head.count(each))
    )
    names = [name.strip() for name in next(_cells(head, separator), [])]
    if not any(names) or "\0" in head or "\ufffd" in head:
        raise ValueError(f"head = {shown(head[:60])}: must be the names of the columns")
    if columns is None:
        raise ValueError(
            f"columns: are missing; a columns.toml must map these: {comma_list(names)}"
        )
    signals = columns.signals.values()
    mapped = {
        columns.time,
        *(each for signal in signals for each in (*signal.columns, signal.time)),
    }
    used = [
        name for name in dict.fromkeys(names) if name and mapped & {name, f"-{name}"}
    ]
    if twice := sorted(name for name in used if names.count(name) > 1):
        raise ValueError(
            f"head = {shown(twice[0])}: names {names.count(twice[0])} columns: must"
            " name one"
        )
    unit = TIMES[columns.time_unit or "s"]
    times = {
        name: unit for name in (columns.time, *(each.time for each in signals)) if name
    }
    rows = numbers_of_rows(
        body,
        {name: names.index(name) for name in used},
        separator,
        len(names),
        notes,
        times,
    )
    if not len(rows):
        raise ValueError("rows = 0: must be one or more")
    # not read: a mapping names none of them
    others = dict.fromkeys(filter(None, names), np.zeros(0))
    return RawTable(
        columns={**others, **dict(zip(used, rows.T, strict=True))}, time=np.zeros(0)
    )


def _alike(head: str, rows: str, separator: str) -> float:
    """Fraction of rows that a separator cuts into as many cells as the head; 0 if it
    cuts nothing.
    """
    width = len(next(_cells(head, separator), []))
    alike = [
        len(cells) >= width > 1 and not any(cells[width:])
        for cells in _cells(rows, separator)
        if any(cells)
    ]
    return sum(alike) / max(1, len(alike))


def numbers_of_rows(
    body: str,
    places: Mapping[str, int],
    separator: str,
    width: int,
    notes: list[str],
    times: Mapping[str, float] | None = None,
) -> Array:
    """Numeric values (N, columns) of the rows; NaN for empty or non-numeric cells, and
    for incomplete rows.

    Args:
        body: rows of the file.
        places: index of each column to read, by its name.
        separator: sign between cells; other than a comma, cells may have decimal
            commas.
        width: number of cells in the head.
        notes: sentences on losses, extended here.
        times: columns that may hold dates as ISO 8601 writes them, and the unit (s) of
            their numbers.

    Raises:
        ValueError: one line: a column without any number.
    """
    # eight bytes a number: lists of floats take four times as much, and logs are long
    numbers, first_wrong = array("d"), dict[str, str]()
    count = short = wrong = decimal = 0
    point = "." if separator == "," else ","
    for cells in _cells(body, separator):
        filled = [cell.strip() for cell in cells]
        if not any(filled):
            continue
        row = [math.nan] * len(places)
        # a cell too few or too many shifts those behind it, so none of the row counts
        if len(filled) < width or any(filled[width:]):
            short += 1
            filled = []
        for k, (name, place) in enumerate(places.items() if filled else ()):
            try:
                row[k] = float(filled[place].replace(point, ".") or "nan")
                decimal += "," in filled[place]
            except ValueError:
                if (
                    times
                    and name in times
                    and not math.isnan(seconds := _unix_time(filled[place]))
                ):
                    row[k] = seconds / times[name]
                    continue
                # cut, as a cell may be a whole list and the message is one line
                first_wrong.setdefault(name, filled[place][:40])
                wrong += 1
        numbers.extend(row)
        count += 1
    if short:
        notes.append(
            f"file: {short} of {count} rows have not the {width} cells of the head and"
            " count as empty."
        )
    table = np.array(numbers).reshape(count, len(places))
    for name, column in zip(places, table.T, strict=True):
        if name in first_wrong and np.isnan(column).all():
            cell = shown(first_wrong[name])
            raise ValueError(
                f"{name} = {cell}: must be a number in each cell; split lists, write"
                " times as ISO 8601"
            )
    if wrong:
        notes.append(f"file: {wrong} cells are no numbers and count as empty.")
    if decimal:
        notes.append(f"file: {decimal} cells have a decimal comma.")
    return table


def _unix_time(cell: str) -> float:
    """Unix time (s) of a date as ISO 8601 writes it, UTC where it states no zone; NaN
    if it is none.
    """
    try:
        # a minus in front is a sign; behind the first letter it is one of a date
        date = datetime.fromisoformat(cell if "-" in cell[1:] else f"1970-01-01T{cell}")
    except ValueError:
        return math.nan
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()


def _cells(text: str, separator: str) -> Iterator[list[str]]:
    """Yield the cells of each row of a CSV text.

    Raises:
        ValueError: one line: a quote without end, or a cell of very many letters.
    """
    try:
        yield from csv.reader(
            io.StringIO(text.replace("\0", "")),
            delimiter=separator,
            skipinitialspace=True,
        )
    except csv.Error as error:
        raise ValueError(f"cells: must be of a table of text ({error})") from None


TABLE = FlightFormat(read_table, suffixes=("csv", "tsv", "txt"), mapped=True)
