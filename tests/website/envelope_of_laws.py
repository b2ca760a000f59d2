"""The envelope in docs/data/results_envelope.md: tables, weakest points of the flagship
and picture, from a folder.

python tests/website/envelope_of_laws.py out/envelope    writes the blocks of that page
                                                         and docs/images/envelope.png
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from envelope_rules import FLAGSHIP, violation_rows, violations
from PIL import Image

from skyarm.studies.compare.envelope import DASH, summary_rows
from skyarm.view.pages import markdown

ROOT = Path(__file__).resolve().parents[2]
FIRST, REST = "the envelope", "more of the envelope"
"""Blocks of the page: how far the tip is within 10 mm, which the README repeats; and
the other tables."""
LEFT_OUT = ("paper_pd", "l1_adaptive")
"""Laws that the figure shows and the page's table has no room for."""
PAGE = "docs/data/results_envelope.md"
PICTURE = "docs/images/envelope.png"


TABLES = {
    "Largest value with an error of at most 10 mm": "small",
    "Largest value with an error of at most 100 mm": "large",
    "Values at which the law is lost": "lost",
    "Largest rotor jitter of the flights that are not lost, rad/s a period": "jitter",
    "Largest fraction of periods with a rotor at its limit, %": "limited",
}
"""Heading of a table of the page -> the group of `CELL` that it shows."""

CELL = re.compile(
    r"(?P<small>[\d.]+|-) / (?P<large>[\d.]+|-)(?:, lost (?P<lost>(?:from|at) [\d.,"
    r" ]*\d))?"
    r"(?:; (?P<jitter>[\d.e+-]+)(?:, (?P<limited>[\d.e+-]+) %)?)?"
)
"""A cell of the envelope's summary."""


def value_of(cell: str, group: str) -> str:
    """One value of a cell of the summary; a dash where there is none, and 0 for a limit
    that no rotor reached.
    """
    found = CELL.fullmatch(cell)
    if found is None:
        assert cell == DASH, cell
        return DASH
    if group == "limited" and found["jitter"]:
        return found["limited"] or "0"
    return found[group] or DASH


def table(rows: Sequence[Sequence[str]], group: str, laws: Sequence[str]) -> str:
    """One table of the page: a trial in each row, one value in each cell."""
    lines = [
        [name, *(value_of(cell, group) for cell in found)] for name, *found in rows
    ]
    return markdown(["trial", *(f">{law}" for law in laws)], lines)


def headed(rows: Sequence[Sequence[str]], laws: Sequence[str]) -> list[str]:
    """Every table of the page under its heading, from the rows of the summary."""
    return [
        f"### {title}\n\n{table(rows, group, laws)}\n"
        for title, group in TABLES.items()
    ]


def written(found: Mapping[str, Any]) -> dict[str, str]:
    """What stands between the marks of the page's blocks, from the content of
    ``envelope.json``.
    """
    laws, axes = [law for law in found["laws"] if law not in LEFT_OUT], found["axes"]
    weakest = (
        ", ".join(words_of(row) for row in violation_rows(violations(axes, FLAGSHIP)))
        or "none"
    )
    first, *more = headed(summary_rows(axes, laws), laws)
    more.append(
        f"Trials in which `{FLAGSHIP}` is lost and another law is not, or in which its"
        f" error is over 10 %\nlarger than that of the paper's law: {weakest}.\n"
    )
    return {FIRST: first, REST: "\n".join(more)}


def words_of(row: list[str]) -> str:
    """A violation: its trial, and which rule."""
    return f"{row[0]} {row[1].split(';')[0]}"


def marks(name: str) -> re.Pattern[str]:
    """A block of the page between its marks."""
    return re.compile(rf"<!-- {name}: make envelope -->\n(.*?)<!-- /{name} -->", re.S)


def put(file: Path, name: str, text: str) -> None:
    """Write a block between its marks."""
    whole = f"<!-- {name}: make envelope -->\n{text}<!-- /{name} -->"
    file.write_text(marks(name).sub(lambda _: whole, file.read_text("utf-8")), "utf-8")


def main(folder: Path) -> None:
    """Write blocks and picture."""
    found = json.loads((folder / "envelope.json").read_text("utf-8"))
    for name, text in written(found).items():
        put(ROOT / PAGE, name, text)
        print(text)
    # a palette: a third of the size, and nobody sees it in lines on white
    Image.open(folder / "envelope.png").convert("RGB").quantize(128).save(
        ROOT / PICTURE, optimize=True
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
