"""Numbers and tables as lines of text with aligned columns."""

from __future__ import annotations

from collections.abc import Sequence

NOTHING = 1e-12
"""Size below which a number is rounding and is shown as 0."""

Row = tuple[str, ...]
"""Cells of one line of a table."""


def shown_number(value: float, digits: int = 3) -> str:
    """Format a number with a few significant digits; values below 1e-12 become 0."""
    # a number that should be zero would print as 1e-17
    return "0" if abs(value) < NOTHING else f"{value:.{digits}g}"


def aligned_lines(rows: Sequence[Sequence[str]]) -> list[str]:
    """Format table rows as text lines with aligned columns, the first to the left,
    others to the right.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        " ".join(
            cell.rjust(width) if i else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]
