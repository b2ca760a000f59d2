"""Open tables of plain text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from skyarm.files import printable

NOTHING = 1e-12
"""Numbers below this are rounding and are shown as 0."""


def table_of(*columns: str, left: int = 1) -> Table:
    """An open table whose first ``left`` columns hold words and whose others hold numbers."""
    table = Table(box=None, pad_edge=False, show_header=any(columns), header_style="dim")
    for i, column in enumerate(columns):
        table.add_column(Text(column), justify="left" if i < left else "right", overflow="fold")
    return table


def add(table: Table, *cells: str) -> None:
    """Add a row of plain text: rich would read [s] in a cell as markup."""
    table.add_row(*(Text(printable(cell)) for cell in cells))


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows as lines that never wrap or lose digits, however narrow the terminal: first column left, others right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        " ".join(
            cell.rjust(width) if i else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]


def titled(title: str, table: Table) -> RenderableType:
    """A title as a line of its own: rich's would wrap at the width of the table."""
    return Group(Text(printable(title), style="bold"), table)


def shown(value: float, digits: int = 3) -> str:
    """Significant digits; rounding errors of zero as 0."""
    return "0" if abs(value) < NOTHING else f"{value:.{digits}g}"
