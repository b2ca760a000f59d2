"""The comparison as one page, and its tables for other pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from skyarm.compare.ablations import TITLES, WHOLE, ablation_head, ablation_rows
from skyarm.compare.columns import COST, COST_CASE, TRACKING, WHICH, WRONG, Column
from skyarm.compare.comparison_tables import plants_rows, step_rows, title_of, truth_rows
from skyarm.compare.entrants import Entrant
from skyarm.compare.suite import CASES, Condition
from skyarm.files import versions
from skyarm.pages import grouped, image, page, section, table

WRONG_NOTE = (
    "A success flies to its end and keeps the tip within 20 mm all through the last 5 s (intervals: Wilson, 95 %). "
    "Laws that keep the joints on their references carry the tip away with every tilt and cannot succeed in strong "
    "wind, however exact their base. Tip: mean over 10 to 20 s; of the flights that came to their end mean and 95th "
    "percentile."
)

TRUTH_NOTE = "Means over 10 to 20 s against the continuous reference; the gust: peaks from its start on."

ABLATION_NOTE = "Means as in the tables above; successes on perturbed plants in the wind. The first row is the whole."

GROUPS = {
    "paper": "the paper's controllers",
    "step": "the paper's law made better one step at a time",
    "published": "other laws",
    "centroidal": "the centroidal law",
    "part": "the centroidal law without one of its parts",
}

EVERY_GROUP = {**GROUPS, "own": "laws of one's own"}
"""And of what was added from outside."""


def comparison_page(
    found: Mapping[str, Any],
    entrants: Mapping[str, Entrant],
    conditions: Mapping[str, Condition],
    pictures: Mapping[str, bytes],
) -> str:
    """HTML of all tables and pictures.

    Args:
        found: as of :func:`skyarm.compare.comparison_tables.report`.
        entrants: in order.
        conditions: in order.
        pictures: caption -> PNG.
    """
    body = ["".join(image(caption, caption, png, wide=True) for caption, png in pictures.items())]
    body += [section(title, content) for title, content in main_tables(found, entrants, conditions)]
    times = step_rows(found)
    if times:
        body.append(section("One control step", table(("law", ">median, us", ">99 %, us"), times)))
    body.append(section("Laws", table(("law", "kind", "what"), _laws(entrants))))
    body.append(section("Cases", table(("case", "what"), [(case.name, case.title) for case in CASES.values()])))
    laws = "1 law" if len(entrants) == 1 else f"{len(entrants)} laws"
    facts = f"{laws}, seed {found['seed']}, plant {found['plant']}; skyarm {versions()['skyarm']}"
    return page(title_of(list(entrants)), facts, "\n".join(body))


def main_tables(
    found: Mapping[str, Any], entrants: Mapping[str, Entrant], conditions: Mapping[str, Condition]
) -> list[tuple[str, str]]:
    """(Title, HTML) of the tables of every condition that flew, and of what a part buys."""
    parts = []
    for name, condition in conditions.items():
        summaries = found["summaries"].get(name)
        if summaries:
            note = f"{_flights(condition)} of each case. {WRONG_NOTE if condition.spread else TRUTH_NOTE}"
            parts.append((f"{name}: {condition.title}", _note(note) + _tables(summaries, entrants, condition)))
    for group in WHOLE:
        rows = ablation_rows(found["summaries"], entrants, group)
        if rows:
            parts.append((TITLES[group], _note(ABLATION_NOTE) + table(ablation_head(), rows, TITLES[group])))
    return parts


def _flights(condition: Condition) -> str:
    return "One flight" if condition.episodes == 1 else f"{condition.episodes} flights"


def _note(words: str) -> str:
    return f'<p class="note">{escape(words)}</p>'


def _tables(summaries: Mapping[str, Any], entrants: Mapping[str, Entrant], condition: Condition) -> str:
    if condition.spread:
        head = ["law"]
        for case in condition.cases:
            head += [f">{case} success", f">{case} tip, mm: mean / 95 %"]
        # an interval must not break inside: a wide table breaks before it
        rows = [
            [cell.replace(", ", ",\N{NO-BREAK SPACE}") for cell in row]
            for row in plants_rows(summaries, entrants, condition.cases)
        ]
        return grouped(head, _by_kind(rows, entrants), "Successes and tip errors")
    columns: Sequence[Column] = WRONG if condition.change else TRACKING
    return "".join(
        grouped(
            ("law", *(f">{c.head}" for c in each)), _by_kind(truth_rows(summaries, entrants, each), entrants), caption
        )
        for caption, each in ((f"Errors ({WHICH})", columns), (f"What they were bought with, in {COST_CASE}", COST))
    )


def _by_kind(rows: Sequence[Sequence[str]], entrants: Mapping[str, Entrant]) -> list[tuple[str, list[Sequence[str]]]]:
    """Rows under the title of their law's kind."""
    found = [(title, [row for row in rows if entrants[row[0]].group == group]) for group, title in EVERY_GROUP.items()]
    return [(title, some) for title, some in found if some]


def _laws(entrants: Mapping[str, Entrant]) -> list[tuple[str, str, str]]:
    return [(name, EVERY_GROUP[each.group], each.title) for name, each in entrants.items()]
