"""Markdown tables that the measuring scripts print: as they stand on the pages, one value a cell."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence


def print_table(heads: Sequence[str], rows: Iterable[Sequence[object]] = ()) -> None:
    """Print a table row by row; a head that begins with ">" has a column aligned right.

    Rows may come from a generator: each is printed as it is measured.
    """
    print()
    print_row([head.removeprefix(">") for head in heads])
    print("|" + "".join("-:|" if head.startswith(">") else "-|" for head in heads), flush=True)
    for row in rows:
        print_row(row)


def print_row(cells: Sequence[object]) -> None:
    """Print one row; an empty cell is a dash."""
    print(f"| {' | '.join(str(cell) or '-' for cell in cells)} |", flush=True)


def progress(text: str) -> None:
    """Show a line on the standard error, which is no part of a table."""
    print(text, file=sys.stderr, flush=True)
