"""The bench as one page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.compare.columns import COST, TRACKING, WRONG
from skyarm.compare.entrants import Entrant
from skyarm.compare.suite import CASES, Condition
from skyarm.compare.tables import plants_rows, step_rows, truth_rows
from skyarm.files import versions
from skyarm.pages import image, page, section, table

WRONG_NOTE = (
    "A success flies to its end and keeps the tip within 20 mm all through the last 5 s (intervals: Wilson, 95 %). "
    "Laws that keep the joints on their references carry the tip away with every tilt and cannot succeed in strong "
    "wind, however exact their base. Tip: mean over 10 to 20 s; of the flights that came to their end mean and 95th "
    "percentile."
)

GROUPS = {
    "paper": "the paper's controllers",
    "step": "the paper's law made better one step at a time",
    "rival": "other laws",
    "exact": "the exact law",
    "part": "the exact law without one of its parts",
}


def comparison_page(
    found: Mapping[str, Any],
    entrants: Mapping[str, Entrant],
    conditions: Mapping[str, Condition],
    pictures: Mapping[str, bytes],
) -> str:
    """HTML of all tables and pictures.

    Args:
        found: as of :func:`skyarm.compare.tables.report`.
        entrants: in order.
        conditions: in order.
        pictures: caption -> PNG.
    """
    body = ["".join(image(caption, caption, png) for caption, png in pictures.items())]
    for name, condition in conditions.items():
        summaries = found["summaries"].get(name)
        if summaries:
            note = f'<p class="note">{condition.episodes} flights of each case. {_note(condition)}</p>'
            body.append(section(f"{name}: {condition.title}", note + _tables(summaries, entrants, condition)))
    times = step_rows(found)
    if times:
        body.append(section("One control step", table(("law", "median, us", "99 %, us"), times)))
    body.append(section("Laws", table(("law", "kind", "what"), _laws(entrants))))
    body.append(section("Cases", table(("case", "what"), [(case.name, case.title) for case in CASES.values()])))
    facts = f"{len(entrants)} laws, seed {found['seed']}, plant {found['plant']}; skyarm {versions()['skyarm']}"
    return page("All laws on one bench", facts, "\n".join(body))


def _note(condition: Condition) -> str:
    if condition.spread:
        return WRONG_NOTE
    return "Means over 10 to 20 s against the continuous reference; the gust: peaks from its start on."


def _tables(summaries: Mapping[str, Any], entrants: Mapping[str, Entrant], condition: Condition) -> str:
    if condition.spread:
        head = ["law"]
        for case in condition.cases:
            head += [f"{case} success", "tip, mm: mean / 95 %"]
        return table(head, plants_rows(summaries, entrants, condition.cases))
    columns: Sequence[Any] = WRONG if condition.change else TRACKING
    return "".join(
        table(("law", *(c.head for c in each)), truth_rows(summaries, entrants, each)) for each in (columns, COST)
    )


def _laws(entrants: Mapping[str, Entrant]) -> list[tuple[str, str, str]]:
    return [(name, GROUPS[each.group], each.title) for name, each in entrants.items()]
