"""What a part of a law buys: one row per step of the ladder, and per part that the centroidal law flies without."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.compare.columns import BASE, TOOL, Column, value
from skyarm.compare.comparison_tables import DASH, number
from skyarm.compare.entrants import Entrant

WHOLE = {"step": "paper_ct", "part": "centroidal_tip"}
"""Group -> the law that its rows are compared with: what the ladder starts from, and what a part is taken out of."""

TITLES = {
    "step": "Ablation: the paper's law made better one step at a time",
    "part": "Ablation: the centroidal law, tip mode, without one of its parts",
}

CASE = "case3_wind"

COLUMNS = (
    ("perfect", Column("perfect: case 3 base, mm", "case3", BASE)),
    ("perfect", Column("perfect: case 3 tip, mm", "case3", TOOL)),
    ("perfect", Column("perfect: wind base, mm", CASE, BASE)),
    ("perfect", Column("perfect: wind tip, mm", CASE, TOOL)),
    ("noisy", Column("noisy: wind base, mm", CASE, BASE)),
    ("noisy", Column("noisy: wind tip, mm", CASE, TOOL)),
    ("noisy", Column("noisy: wind rotor jitter, rad/s", CASE, "rotor_jitter", 1.0)),
)

SPREAD = ("plants", "plants_noisy")
"""Conditions whose share of successes is shown."""


def ablation_head() -> list[str]:
    """Names of the columns; ">" heads one of numbers."""
    return ["law", *(f">{column.head}" for _, column in COLUMNS), *(f">{CASE} success, {name}" for name in SPREAD)]


def ablation_rows(summaries: Mapping[str, Any], entrants: Mapping[str, Entrant], group: str) -> list[list[str]]:
    """Rows of a group behind the law it is compared with; none where the group did not fly.

    Args:
        summaries: by condition, case, entrant.
        entrants: in order.
        group: of ``WHOLE``.
    """
    names = [name for name, each in entrants.items() if each.group == group]
    rows = []
    for name in [WHOLE[group], *names] if names else []:
        cells = [number(value(summaries.get(condition, {}), column, name)) for condition, column in COLUMNS]
        for condition in SPREAD:
            found = summaries.get(condition, {}).get(CASE, {}).get(name)
            cells.append(DASH if found is None else f"{found['success_rate']:.1%}")
        rows.append([name, *cells])
    return rows
