"""Tables of the pages, as rows of cells."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from website.generated_blocks import made

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
EQUATIONS = ROOT / "src/skyarm/control/laws/centroidal/equations"


@cache
def law_equations() -> str:
    """Equations of the centroidal law, file after file, with links by their words."""
    texts = [path.read_text("utf-8") for path in sorted(EQUATIONS.glob("*.md"))]
    return re.sub(r"\[([^\[\]]*)\]\([^()\s]*\)", r"\1", "\n".join(texts))


def rows_of(page: str, head: str) -> list[list[str]]:
    """Cells of the table with this heading."""
    return cells_of((DOCS / page).read_text("utf-8").split(head)[1].split("\n\n")[0])


def cells_of(text: str) -> list[list[str]]:
    """Cells of the rows below the rule of a table."""
    rows = [line for line in text.splitlines() if line.startswith("|")]
    rule = next((i for i, line in enumerate(rows) if re.fullmatch(r"[|:-]+", line)), -1)
    return [
        [cell.strip() for cell in line.strip("| ").split(" | ")]
        for line in rows[rule + 1 :]
    ]


@cache
def law_rows(law: str) -> dict[str, dict[str, str]]:
    """Option of a law, or option and field of one that is a table -> head of a
    column -> cell.
    """
    text = made(f"law {law}")
    heads = [cell.strip() for cell in text.splitlines()[0].strip("| ").split(" | ")]
    return {
        row[0].strip("`"): dict(zip(heads, row, strict=True)) for row in cells_of(text)
    }


def unit_of(typed: str) -> str:
    """Unit of a cell "type, unit"; "-" without one."""
    return typed.partition(", ")[2] or "-"
