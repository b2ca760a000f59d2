"""Tables of the pages, as rows of cells."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

from skyarm.control.catalogue import LAWS

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = (DOCS / "scenario_files.md").read_text("utf-8").split("## Options of the laws")[1].split("## Safety")[0]
ROWS = [[cell.strip() for cell in line.split("|")[1:-1]] for line in PAGE.splitlines() if line.startswith("|")]
for before, row in pairwise(ROWS):
    row[0] = row[0] or before[0]  # the law of the row above
LAW_ROWS = [row for row in ROWS if "`" in row[0] and "`" in row[1]]
EXACT_ROWS = {row[0].strip("`"): row for row in ROWS if "`" in row[0] and "`" not in row[1]}


def laws_of(cell):
    """Laws that a row is about."""
    named = re.findall(r"`(\w+)`", cell)
    return [law for law in LAWS if law not in named] if cell.startswith("all but") else named


def rows_of(page: str, head: str) -> list[list[str]]:
    """Cells of the table with this heading."""
    text = (DOCS / page).read_text("utf-8").split(head)[1].split("\n\n")[0]
    return [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in text.splitlines()[2:]]
