"""Marks that readers who did not know a page gave it, and how much of the page that
they read is still there.

    python tests/website/page_marks.py                           every page, its marks,
                                                                 what is left of the
                                                                 text read
    python tests/website/page_marks.py docs/sweeps.md 8.75 8.5   note the marks of
                                                                 readers for a page as
                                                                 it is now

A mark is the sum of five answers, each 0 to 2, less 0.25 for each sentence read twice,
at most 2. That of a page is the lowest. A page that changed by more than a third since
it was read has lost its marks: it is read anew.
"""

from __future__ import annotations

import datetime
import sys
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from zlib import crc32

ROOT = Path(__file__).resolve().parents[2]
MARKS = Path(__file__).with_name("page_marks.toml")
LINES = 60
"""Number of lines of a page, drawn by their hash, that its sketch remembers."""

LEAST = 2 / 3
"""Fraction of these lines that a page must still have."""

SHORT = 20
"""Letters below which a line is on many pages."""


def hashes(text: str) -> set[str]:
    """Hashes of the lines of a page, four hexadecimal digits each; short lines are left
    out.
    """
    lines = (" ".join(line.split()) for line in text.splitlines())
    return {
        f"{crc32(line.encode()) & 0xFFFF:04x}" for line in lines if len(line) >= SHORT
    }


def sketch(text: str) -> str:
    """Sketch of a page: the smallest hashes of its lines, in place of a random
    sample.
    """
    return "".join(sorted(hashes(text))[:LINES])


def left(remembered: str, text: str) -> float:
    """Fraction of the remembered lines that a text still has."""
    lines = [remembered[at : at + 4] for at in range(0, len(remembered), 4)]
    return sum(line in hashes(text) for line in lines) / len(lines)


def marked() -> Mapping[str, Mapping[str, Any]]:
    """Marks, date and sketch by page."""
    return tomllib.loads(MARKS.read_text("utf-8")) if MARKS.is_file() else {}


def note(page: str, marks: Sequence[float], text: str) -> None:
    """Write the marks of a page, in the order of the pages."""
    pages = {name: dict(entry) for name, entry in marked().items()}
    pages[page] = {
        "marks": [float(mark) for mark in marks],
        "date": datetime.date.today(),
        "sketch": sketch(text),
    }
    tables = (
        f'["{name}"]\nmarks = {entry["marks"]}\ndate = {entry["date"]}\nsketch ='
        f' "{entry["sketch"]}"\n'
        for name, entry in sorted(pages.items())
    )
    MARKS.write_text("# Written by page_marks.py.\n\n" + "\n".join(tables), "utf-8")


def main(words: Sequence[str]) -> int:
    """Note marks, or list them."""
    if words:
        page, *marks = words
        note(page, [float(mark) for mark in marks], (ROOT / page).read_text("utf-8"))
        return 0
    for name, entry in sorted(marked().items(), key=lambda row: min(row[1]["marks"])):
        there = left(entry["sketch"], (ROOT / name).read_text("utf-8"))
        print(
            f"{min(entry['marks']):5.2f}  {name:42} {entry['date']}  {there:4.0%} of"
            " the lines read"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
