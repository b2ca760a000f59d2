"""The report's counts, and its section on the inferred settings."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from skyarm.identify.study import Cell
from skyarm.paper.counted_cells import RULE, counts, inferred, stated
from skyarm.paper.impossible import impossible
from skyarm.paper.inference_tables import (
    PlainTable,
    choices_table,
    ladder_table,
    prediction_table,
    profile_tables,
    rivals_table,
    settings_table,
)
from skyarm.paper.inferred_settings import is_of_this_study
from skyarm.paper.report.report_markup import bullets, details, table, text, typographic
from skyarm.scenario.scenario_record import PLANTS

LEAD = (
    "The paper leaves joint friction, latency and the clocks of its recordings open. These settings were searched for "
    "so that its numbers come out: they are inferred after seeing the numbers, not read. One vector of settings stands "
    "for all flights. What speaks for them is what they say of flights that the search has not seen."
)

OTHER = "This search was made with another version of the study: skyarm reproduce --infer makes it anew."


def counts_table(results: Mapping[str, Any]) -> str:
    """The counts by law and plant, and the rule by which they were counted."""
    experiments, facts = results.get("experiments", {}), results.get("settings", {}).get("inferred", {})
    rows = []
    for title, column_of, free in (
        ("as stated", stated, "0 numbers, 0 choices"),
        ("inferred", inferred, f"{facts.get('numbers', '-')} numbers, {facts.get('choices', '-')} choices"),
    ):
        for plant in PLANTS:
            for law in ("PD", "CT", ""):
                found = counts(experiments, column_of(plant), partial(_of_law, law))
                if found:
                    row = (title, plant, law or "both", free, *(str(found[f"within_{s}%"]) for s in (5, 10, 25)))
                    rows.append((*row, str(found["cells"])))
    head = ("column", "plant", "law", "free", ">within 5 %", ">within 10 %", ">within 25 %", ">of")
    counted = PlainTable("How many of the paper's numeric cells each column comes near", head, rows)
    return f'<p class="note">{text(RULE)}</p>{html_of(counted)}'


def inferred_section(
    results: Mapping[str, Any], predicted: Mapping[str, Any], evidence: Mapping[str, Any], plant: str
) -> str:
    """Settings and what they say of flights that were not seen; ladder, choices, profiles, rivals, open ends folded."""
    note = "" if is_of_this_study(evidence) else f'<p class="note">{text(OTHER)}</p>'
    opened = (settings_table(evidence), prediction_table(results, predicted, plant))
    collapsed = details("Ladder: one setting after the other", html_of(ladder_table(evidence)))
    collapsed += details("Choices taken otherwise", html_of(choices_table(evidence)))
    collapsed += details("Loss over each number", "".join(map(html_of, profile_tables(evidence))))
    collapsed += details("Rivals", html_of(rivals_table(evidence)))
    collapsed += details("What stays open", bullets(impossible(results, plant)))
    return f"<p>{text(LEAD)}</p>{note}{''.join(map(html_of, opened))}{collapsed}"


def _of_law(law: str, cell: Cell) -> bool:
    return cell.flight.endswith(law)


def html_of(plain: PlainTable) -> str:
    """A plain table as HTML."""
    rows = []
    for row in plain.rows:
        cells = [f'<th scope="row">{text(row[0])}</th>']
        for name, cell in zip(plain.head[1:], row[1:], strict=True):
            right = name.startswith(">")
            kind = ' class="num"' if right else ' class="unit"' if name == "unit" else ""
            cells.append(f"<td{kind}>{typographic(text(cell)) if right else text(cell)}</td>")
        rows.append("".join(cells))
    return table(text(plain.title), list(plain.head), [("", rows)], "text")
