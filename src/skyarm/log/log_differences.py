"""Comparison of two logs: first differing instant and quantity, size and growth of the
differences.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.log.log_columns import columns
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.records.text_tables import aligned_lines


@immutable
class Difference:
    """Differences of two logs in one column: first different time and values, and
    largest difference.

    Attributes:
        name, unit: name and unit of the column. time: first instant at which they
            differ, s.
        first, second: numbers there.
        largest: size of the largest difference. at: its time, s.
    """

    name: str
    unit: str
    time: float
    first: float
    second: float
    largest: float
    at: float


@immutable
class LogDifferences:
    """All differences between two logs over their common instants.

    Attributes:
        instants: number of common instants, and number of each log's.
        columns: differing columns, the earliest first, of one time in the order of the
            log's columns.
        unmatched: columns that only one of them has.
    """

    instants: tuple[int, int, int]
    columns: tuple[Difference, ...]
    unmatched: tuple[str, ...]

    @property
    def equal(self) -> bool:
        """True if both logs have the same instants and the same values."""
        both, first, second = self.instants
        return both == first == second and not self.columns and not self.unmatched


def log_differences(a: Log, b: Log, tolerance: float = 0.0) -> LogDifferences:
    """Compare two logs number by number; returns the differing columns.

    Args:
        a: one log.
        b: the other.
        tolerance: differences up to this size count as none, in the SI unit of each
            column. 0 asks for equal numbers; NaN equals NaN, and a zero one of the
            other sign.
    """
    # by time, because the logs may have other rates or ends
    times, ours, theirs = np.intersect1d(a.time, b.time, return_indices=True)
    named = {each.name: each for each in columns(a)}
    others = {each.name: each for each in columns(b)}
    differing = []
    for name, column in named.items():
        # time is matched already
        if name in others and name != "time":
            pair = column.of(a)[ours], others[name].of(b)[theirs]
            differing += list(_difference(name, column.unit, times, pair, tolerance))
    # a stable sort: columns of one instant stay in the order of the log
    differing.sort(key=lambda each: each.time)
    unmatched = tuple(
        name for name in {**named, **others} if (name in named) != (name in others)
    )
    return LogDifferences(
        instants=(len(times), len(a.time), len(b.time)),
        columns=tuple(differing),
        unmatched=unmatched,
    )


def _difference(
    name: str, unit: str, times: Array, pair: tuple[Array, Array], tolerance: float
) -> Iterator[Difference]:
    first, second = pair
    with np.errstate(invalid="ignore"):
        # of two infinities it is NaN, and they are the same all the same
        size = np.abs(first - second)
        same = (
            (first == second)
            # a log that ends with NaN in both flew the same
            | (np.isnan(first) & np.isnan(second))
            | (size <= tolerance)
        )
    apart = np.flatnonzero(~same)
    if not apart.size:
        return
    k = int(apart[0])
    # a NaN on one side only is the largest difference there is
    size = np.where(same, 0.0, np.where(np.isnan(size), np.inf, size))
    most = int(size.argmax())
    yield Difference(
        name=name,
        unit=unit,
        time=float(times[k]),
        first=float(first[k]),
        second=float(second[k]),
        largest=float(size[most]),
        at=float(times[most]),
    )


MOST_COLUMNS = 12
"""Number of quantities that a terminal shows; ``--json`` has all."""


def difference_lines(
    differences: LogDifferences, labels: tuple[str, str], tolerance: float
) -> list[str]:
    """Text of the first difference between two logs, and of the largest difference in
    each quantity.
    """
    both, first, second = differences.instants
    within = f" within {tolerance:g}" if tolerance else ""
    lines = []
    if first != second:
        lines.append(
            f"control periods: {first} in {labels[0]}, {second} in {labels[1]}, {both}"
            " in both"
        )
    if differences.unmatched:
        lines.append(f"columns of one log alone: {', '.join(differences.unmatched)}")
    if not differences.columns:
        return [*lines, f"every number is the same{within} in {both} control periods"]
    one, *_ = differences.columns
    numbers = f"{one.first!r} and {one.second!r} {one.unit}".rstrip()
    lines.append(
        f"first difference{f' above {tolerance:g}' if tolerance else ''}: at"
        f" {one.time:g} s, {one.name} = {numbers}, {abs(one.first - one.second):.3g}"
        " apart"
    )
    rows = [("quantity", "unit", "from, s", "largest", "at, s")]
    rows += [
        (each.name, each.unit, f"{each.time:g}", f"{each.largest:.3g}", f"{each.at:g}")
        for each in differences.columns[:MOST_COLUMNS]
    ]
    lines += [line.rstrip() for line in aligned_lines(rows)]
    return lines + more_lines(len(differences.columns) - MOST_COLUMNS, "quantities")


def more_lines(count: int, what: str) -> list[str]:
    """Line of text with the number of differences that are not listed; no line for
    zero.
    """
    return [f"and {count} {what} more, which --json lists"] if count > 0 else []
