"""A log as CSV: a column a number, with its name and unit; written, and not read back."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import numpy.typing as npt

from skyarm.files import write_atomically
from skyarm.log.flight_log import Log
from skyarm.log.log_columns import columns

Array = npt.NDArray[np.float64]


def write_csv(log: Log, path: str | os.PathLike[str], *, with_units: bool = True) -> Path:
    """Write one CSV; numbers round-trip.

    Args:
        log: of a flight.
        path: of the file.
        with_units: heads name the unit, ``velocity_x [m/s]``; else they are names alone.
    """
    known: dict[bytes, list[str]] = {}
    every = columns(log)
    heads = [f"{each.name} [{each.unit}]" if with_units and each.unit else each.name for each in every]
    rows = zip(*(_texts(each.of(log), known) for each in every), strict=True)
    lines = "".join(f"{','.join(row)}\n" for row in rows)
    return write_atomically(path, f"{','.join(heads)}\n{lines}".encode())


def _texts(column: Array, known: dict[bytes, list[str]]) -> list[str]:
    """Shortest texts that round-trip, made once for equal columns and once for a number that stays."""
    bits = column.tobytes()
    if bits not in known:
        same = bits == bits[:8] * column.size
        texts = list(map(repr, (column[:1] if same else column).tolist()))
        known[bits] = texts * column.size if same else texts
    return known[bits]
