"""Markdown tables that the measuring scripts print: as they stand on the pages, one
value a cell.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import islice


def print_table(heads: Sequence[str], rows: Iterable[Sequence[object]] = ()) -> None:
    """Print a table row by row; a head that begins with ">" has a column aligned right.

    Rows may come from a generator: each is printed as it is measured.
    """
    print()
    print_row([head.removeprefix(">") for head in heads])
    print(
        "|" + "".join("-:|" if head.startswith(">") else "-|" for head in heads),
        flush=True,
    )
    for row in rows:
        print_row(row)


def print_row(cells: Sequence[object]) -> None:
    """Print one row; an empty cell is a dash."""
    print(f"| {' | '.join(str(cell) or '-' for cell in cells)} |", flush=True)


def progress(text: str) -> None:
    """Show a line on the standard error, which is no part of a table."""
    print(text, file=sys.stderr, flush=True)


def mean_and_largest(values: Sequence[float], digits: int) -> list[str]:
    """Two cells: mean and largest of the flights; empty without a flight."""
    numbers = [float(each) for each in values]
    if not numbers:
        return ["", ""]
    return [f"{sum(numbers) / len(numbers):.{digits}f}", f"{max(numbers):.{digits}f}"]


def print_part(
    doc: str,
    parts: Mapping[
        str, tuple[Sequence[str], Callable[[int, int], Iterable[Sequence[object]]]]
    ],
    *,
    seeds: int,
    seed: int,
) -> None:
    """Command line of a script with several tables: print the one that is named.

    Args:
        doc: help. parts: name of a table -> heads, and function of seeds and seed that
            yields rows as they are flown.
        seeds, seed: defaults of the noisy flights of a row.
    """
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "table",
        choices=parts,
        nargs="?" if len(parts) == 1 else None,
        default=next(iter(parts)),
    )
    parser.add_argument(
        "--seeds", type=int, default=seeds, help="noisy flights of a row"
    )
    parser.add_argument("--seed", type=int, default=seed)
    parser.add_argument(
        "--small", action="store_true", help="two rows of two flights: seconds"
    )
    given = parser.parse_args()
    heads, rows = parts[given.table]
    found = rows(2 if given.small else given.seeds, given.seed)
    print_table(heads, islice(found, 2) if given.small else found)
