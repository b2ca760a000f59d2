"""Tables of the controller comparison: errors in every case, and success rates on perturbed plants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from skyarm.records.files import versions
from skyarm.records.immutable import immutable
from skyarm.studies.compare.cells import JITTER, LIMITED
from skyarm.studies.compare.entrants import ENTRANTS, Entrant
from skyarm.studies.compare.run_suite import Record
from skyarm.studies.compare.suite import CASES, Condition
from skyarm.view.pages import DASH, Report, Section, Table, image, number


@immutable(kw_only=False)
class Column:
    """Column of a results table: heading, case, metric, and the factor from SI to the heading's unit."""

    head: str
    case: str
    metric: str
    factor: float = 1e3


BASE, JOINT, TOOL = (f"{what}_error_mean_continuous" for what in ("position", "joint", "ee"))

TRACKING = (
    Column("case 1 base, mm", "case1", BASE),
    Column("case 1 joints, mrad", "case1", JOINT),
    Column("case 2 base, mm", "case2", BASE),
    Column("case 2 joints, mrad", "case2", JOINT),
    Column("gust base x, mm", "case2_gust", "gust_peak_x_continuous"),
    Column("gust tip x, mm", "case2_gust", "gust_ee_peak_x_continuous"),
    Column("case 3 base, mm", "case3", BASE),
    Column("case 3 tip, mm", "case3", TOOL),
    Column("wind base, mm", "case3_wind", BASE),
    Column("wind tip, mm", "case3_wind", TOOL),
    Column("45 deg tip, mm", "case3_wind_45", TOOL),
    Column("side tip, mm", "case3_wind_side", TOOL),
    Column("50 g, wind tip, mm", "case3_wind_payload", TOOL),
)
"""Where the laws are on the truth."""

WHICH = "gust: of Case 2; wind, 45 deg, side, 50 g: of Case 3"
"""Which case a head means that names none."""

COST = (
    *(
        column
        for head, case in (
            *(("gust", "case2_gust"), ("case 3", "case3"), ("wind", "case3_wind"), ("45 deg", "case3_wind_45")),
            *(("side", "case3_wind_side"), ("50 g, wind", "case3_wind_payload")),
        )
        for column in (
            Column(f"{head} jitter, rad/s", case, JITTER, 1.0),
            Column(f"{head} at a limit, %", case, LIMITED, 100.0),
        )
    ),
    Column("joint torque 1, mN m RMS", "case3_wind", "tau1_rms"),
    Column("attitude motion, rad/s", "case3_wind", "rate_rms", 1.0),
    Column("largest tilt, deg", "case3_wind", "tilt_max", 57.29577951308232),
)
"""What the errors were bought with: rotor jitter and saturation wherever the tip's error is shown."""

COST_WORDS = "What they were bought with (periods with a rotor at its limit; torque, motion and tilt: Case 3 in wind)"

CAPTION = (
    "Case 3 in wind. Left: mean tip error over 10 to 20 s on the true plant. Right: share of noisy wrong plants "
    "(condition plants_noisy) on which the flight succeeds, with its interval (95 %)"
)

FEW = 10
"""Below this a share says how many flights it is of; and where others flew more."""

WRONG_NOTE = (
    "A success flies to its end and keeps the tip within 20 mm all through the last 5 s (intervals: Wilson, 95 %). "
    "Laws that keep the joints on their references carry the tip away with every tilt and cannot succeed in strong "
    "wind, however exact their base. Tip: mean over 10 to 20 s; of the flights that came to their end mean and 95th "
    "percentile."
)

TRUTH_NOTE = "Means over 10 to 20 s against the continuous reference; the gust: peaks from its start on."

GROUPS = {
    "paper": "the paper's controllers",
    "step": "the paper's law made better one step at a time",
    "published": "other laws",
    "centroidal": "the centroidal law",
    "part": "the centroidal law without one of its parts",
    "own": "user-defined laws",
}
"""Group of an entrant -> its title."""


def value(summaries: Record, column: Column, entrant: str) -> float | None:
    """Mean of a column's metric for a controller, in the column's unit; None if no flight was completed."""
    found = summaries.get(column.case, {}).get(entrant)
    spread = found["metrics"].get(column.metric) if found else None
    return None if spread is None else spread["mean"] * column.factor


def title_of(laws: Sequence[str]) -> str:
    """Title of a comparison of these controllers; for two of them "A against B"."""
    if len(laws) == 2:
        return f"{laws[0]} against {laws[1]}"
    if set(ENTRANTS) <= set(laws):
        return "All laws compared"
    return laws[0] if len(laws) == 1 else f"{len(laws)} laws compared"


def comparison_report(
    found: Record,
    entrants: Mapping[str, Entrant],
    conditions: Mapping[str, Condition],
    picture: bytes | None = None,
) -> Report:
    """Build the report of a controller comparison from its statistics.

    Args:
        found: ``summaries`` by condition, case, entrant.
        entrants: in order.
        conditions: in order.
        picture: PNG of all laws.
    """
    sections = main_sections(found, entrants, conditions)
    cases = [(case.name, case.title) for case in CASES.values()]
    sections.append(Section(title="Cases", tables=[Table(head=("case", "what"), rows=cases)]))
    laws = [(name, GROUPS[each.group], each.title) for name, each in entrants.items()]
    count = "1 law" if len(entrants) == 1 else f"{len(entrants)} laws"
    return Report(
        title=title_of(list(entrants)),
        facts=f"{count}, seed {found.get('seed')}, plant {found.get('plant')}; skyarm {versions()['skyarm']}",
        opening=image(CAPTION, CAPTION, picture, wide=True) if picture else "",
        sections=sections,
        page_only=[Section(title="Laws", tables=[Table(head=("law", "kind", "what"), rows=laws)])],
    )


def main_sections(found: Record, entrants: Mapping[str, Entrant], conditions: Mapping[str, Condition]) -> list[Section]:
    """Report sections, one for each simulated condition, with the errors of all controllers."""
    sections = []
    for name, condition in conditions.items():
        summaries = found["summaries"].get(name)
        if summaries:
            flights = "One flight" if condition.episodes == 1 else f"{condition.episodes} flights"
            sections.append(
                Section(
                    title=f"{name}: {condition.title}",
                    notes=[f"{flights} of each case."],
                    remark=WRONG_NOTE if condition.spread else TRUTH_NOTE,
                    tables=_tables(summaries, entrants, condition),
                )
            )
    return sections


def _tables(summaries: Record, entrants: Mapping[str, Entrant], condition: Condition) -> list[Table]:
    if condition.spread:
        words = ("success", "tip, mm: mean / 95 %", "jitter, rad/s; at a limit, %")
        head = ["law", *(f">{case} {word}" for case in condition.cases for word in words)]
        return [
            _table_by_kind(head, plants_rows(summaries, entrants, condition.cases), entrants, "Successes, tip errors")
        ]
    return [
        _table_by_kind(
            ["law", *(f">{c.head}" for c in columns)], truth_rows(summaries, entrants, columns), entrants, caption
        )
        for columns, caption in (
            (TRACKING, f"Errors ({WHICH})"),
            (COST, COST_WORDS),
        )
    ]


def _table_by_kind(head: list[str], rows: list[list[str]], entrants: Mapping[str, Entrant], caption: str) -> Table:
    """Results table with its rows grouped by kind of controller, such as published ones."""
    found = [(title, [row for row in rows if entrants[row[0]].group == group]) for group, title in GROUPS.items()]
    return Table(head=head, rows=rows, caption=caption, groups=[(title, some) for title, some in found if some])


def truth_rows(summaries: Record, entrants: Mapping[str, Entrant], columns: Sequence[Column]) -> list[list[str]]:
    """Table rows of errors on the unperturbed plant, one per controller with any result."""
    return [
        [name, *(number(value(summaries, column, name)) for column in columns)]
        for name in entrants
        if any(name in summaries.get(column.case, {}) for column in columns)
    ]


def plants_rows(summaries: Record, entrants: Mapping[str, Entrant], cases: Sequence[str]) -> list[list[str]]:
    """Table rows for perturbed plants: success rate with interval and tip error of each controller."""
    rows = []
    for name in entrants:
        cells = []
        for case in cases:
            found = summaries.get(case, {}).get(name)
            if found is None:
                cells += [DASH, DASH, DASH]
                continue
            spread, (low, high) = found["metrics"].get(TOOL), found["success_interval"]
            bought = ((found["metrics"].get(metric), factor) for metric, factor in ((JITTER, 1.0), (LIMITED, 100.0)))
            others = max(each["episodes"] for each in summaries[case].values())
            few = f" of {found['episodes']}" if found["episodes"] < max(FEW, others) else ""
            cells.append(f"{found['success_rate']:.1%} [{low:.1%}, {high:.1%}]{few}")
            cells.append(DASH if spread is None else f"{number(spread['mean'], 1e3)} / {number(spread['p95'], 1e3)}")
            cells.append("; ".join(number(each and each["mean"], factor) for each, factor in bought))
        if any(cell != DASH for cell in cells):
            rows.append([name, *cells])
    return rows
