"""Comparison of controllers on the cases of Barakou et al. 2026 and harder ones, with tables of the results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

from skyarm.records.files import versions
from skyarm.records.immutable import immutable, positional
from skyarm.studies.compare.cell_flights import JITTER, LIMITED, CellFlights, Document, Record
from skyarm.studies.compare.entrants import ENTRANTS, Entrant
from skyarm.studies.compare.run_suite import DPI, Refused, SummarySuite
from skyarm.studies.compare.suite import CASES, Condition, conditions
from skyarm.view.figures.comparison_figures import Share, laws_figure
from skyarm.view.figures.style import image_bytes
from skyarm.view.pages import DASH, Report, Section, Table, image, number

SUITE = "paper-suite"
SHARE = "flights with the tip within 20 mm in the last 5 s\nperturbed plants with noise, Case 3 in wind"

BRIEF, WIDEST = ("step", "part"), "case3_wind"
"""Groups of entrants that meet perturbed plants in one case only; their tables show the effect of a part of a law."""


@immutable
class Comparison(SummarySuite[CellFlights]):
    """Benchmark that compares all shipped controllers on the same cases and perturbed plants.

    Attributes:
        entrants: controllers in order. conditions: conditions in order. seed: seed of plants and noise.
        plant: "rigid_body" or "mujoco".
    """

    entrants: Mapping[str, Entrant] = field(default_factory=lambda: ENTRANTS)
    conditions: Mapping[str, Condition] = field(default_factory=conditions)
    seed: int = 0
    plant: str = "rigid_body"

    name, file = SUITE, "results"

    @property
    def options(self) -> Document:
        """Settings of the comparison as plain data: controllers, flights per condition, seed and plant."""
        flights = {name: each.episodes for name, each in self.conditions.items()}
        return {"laws": list(self.entrants), "conditions": flights, "seed": self.seed, "plant": self.plant}

    def flights(self) -> list[CellFlights]:
        """All flights of the comparison, grouped by controller, condition and case."""
        return [
            CellFlights(entrant=entrant, case=CASES[case], condition=condition, seed=self.seed, plant=self.plant)
            for entrant in self.entrants.values()
            for condition in self.conditions.values()
            for case in condition.cases
            if not condition.spread or case == WIDEST or entrant.group not in BRIEF
        ]

    def plan_cells(self) -> tuple[list[CellFlights], Refused]:
        """All flights of the comparison, and an empty mapping, since no controller is excluded."""
        return self.flights(), {}

    def pictures(self, found: Record) -> dict[str, bytes]:
        """Pictures of the comparison report by file name: errors and success rates of all controllers."""
        return {"laws.png": comparison_picture(found, list(self.entrants))}

    def report(self, found: Record, pictures: Mapping[str, bytes] | None = None) -> Report:
        """Comparison report with one table for each condition, such as noisy measurements."""
        return comparison_report(found, self.entrants, self.conditions, (pictures or {}).get("laws.png"))


def comparison_picture(found: Record, names: Sequence[str]) -> bytes:
    """PNG of the tip errors and success rates of all controllers."""
    summaries = found["summaries"]
    errors = {
        title: [value(summaries.get(condition, {}), WIND_TIP, name) for name in names]
        for title, condition in (("perfect state", "perfect"), ("noise and delay", "noisy"))
        if condition in summaries
    }
    wrong = summaries.get("plants_noisy", {}).get("case3_wind", {})
    figure = laws_figure(
        names,
        errors,
        [_share(wrong.get(name)) for name in names],
        error_label="mean tip error [mm]\ntrue plant, Case 3 in wind",
        share_label=SHARE if wrong else f"{SHARE}\n(not flown)",
    )
    return image_bytes(figure, dpi=DPI)


def _share(summary: Record | None) -> Share | None:
    if summary is None or summary["success_rate"] is None:
        return None
    return Share(summary["success_rate"], *summary["success_interval"])


@positional
class ReportColumn:
    """Column of a results table: heading, case, metric, and the factor from SI to the heading's unit."""

    head: str
    case: str
    metric: str
    factor: float = 1e3


BASE, JOINT, TOOL = (f"{what}_error_mean_continuous" for what in ("position", "joint", "ee"))

TRACKING = (
    ReportColumn("case 1 base, mm", "case1", BASE),
    ReportColumn("case 1 joints, mrad", "case1", JOINT),
    ReportColumn("case 2 base, mm", "case2", BASE),
    ReportColumn("case 2 joints, mrad", "case2", JOINT),
    ReportColumn("gust base x, mm", "case2_gust", "gust_peak_x_continuous"),
    ReportColumn("gust tip x, mm", "case2_gust", "gust_ee_peak_x_continuous"),
    ReportColumn("case 3 base, mm", "case3", BASE),
    ReportColumn("case 3 tip, mm", "case3", TOOL),
    ReportColumn("wind base, mm", "case3_wind", BASE),
    ReportColumn("wind tip, mm", "case3_wind", TOOL),
    ReportColumn("45 deg tip, mm", "case3_wind_45", TOOL),
    ReportColumn("side tip, mm", "case3_wind_side", TOOL),
    ReportColumn("50 g, wind tip, mm", "case3_wind_payload", TOOL),
)
"""Columns of tracking errors on the true plant."""

WIND_TIP = next(c for c in TRACKING if c.case == "case3_wind" and c.metric.startswith("ee"))

WHICH = "gust: of Case 2; wind, 45 deg, side, 50 g: of Case 3"
"""Text on the case to which a head without a case refers."""

COST = (
    *(
        column
        for head, case in (
            *(("gust", "case2_gust"), ("case 3", "case3"), ("wind", "case3_wind"), ("45 deg", "case3_wind_45")),
            *(("side", "case3_wind_side"), ("50 g, wind", "case3_wind_payload")),
        )
        for column in (
            ReportColumn(f"{head} jitter, rad/s", case, JITTER, 1.0),
            ReportColumn(f"{head} at a limit, %", case, LIMITED, 100.0),
        )
    ),
    ReportColumn("joint torque 1, mN m RMS", "case3_wind", "tau1_rms"),
    ReportColumn("attitude motion, rad/s", "case3_wind", "rate_rms", 1.0),
    ReportColumn("largest tilt, deg", "case3_wind", "tilt_max", 57.29577951308232),
)
"""Columns of control activity: rotor jitter and saturation next to the tip error."""

COST_WORDS = "Control activity (periods with a rotor at its limit; torque, motion and tilt: Case 3 in wind)"

CAPTION = (
    "Case 3 in wind. Left: mean tip error over 10 to 20 s on the true plant. Right: fraction of perturbed "
    "plants with noise (condition plants_noisy) on which the flight succeeds, with its interval (95 %)"
)

FEW = 10
"""Number of flights below which a fraction states its number of flights, as where others flew more."""

WRONG_NOTE = (
    "A success completes and keeps the tip within 20 mm all through the last 5 s (intervals: Wilson, 95 %). "
    "Laws that keep the joints on their references carry the tip away with every tilt and cannot succeed in strong "
    "wind, however exact their base. Tip: mean over 10 to 20 s; of completed flights mean and 95th percentile."
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


def value(summaries: Record, column: ReportColumn, entrant: str) -> float | None:
    """Mean of a column's metric for a controller, in the column's unit; None if no flight was completed."""
    statistics = summaries.get(column.case, {}).get(entrant)
    spread = statistics["metrics"].get(column.metric) if statistics else None
    return None if spread is None else spread["mean"] * column.factor


def title_of(laws: Sequence[str]) -> str:
    """Title of a comparison of controllers, such as "A against B" for two of them."""
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
        entrants: controllers in order.
        conditions: conditions in order.
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
        rows = plants_rows(summaries, entrants, condition.cases)
        return [_table_by_kind(head, rows, entrants, "Successes, tip errors")]
    tables = []
    for columns, caption in ((TRACKING, f"Errors ({WHICH})"), (COST, COST_WORDS)):
        head, rows = ["law", *(f">{each.head}" for each in columns)], truth_rows(summaries, entrants, columns)
        tables.append(_table_by_kind(head, rows, entrants, caption))
    return tables


def _table_by_kind(head: list[str], rows: list[list[str]], entrants: Mapping[str, Entrant], caption: str) -> Table:
    """Results table with its rows grouped by kind of controller, such as published ones."""
    groups = [(title, [row for row in rows if entrants[row[0]].group == group]) for group, title in GROUPS.items()]
    return Table(head=head, rows=rows, caption=caption, groups=[(title, some) for title, some in groups if some])


def truth_rows(summaries: Record, entrants: Mapping[str, Entrant], columns: Sequence[ReportColumn]) -> list[list[str]]:
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
            statistics = summaries.get(case, {}).get(name)
            if statistics is None:
                cells += [DASH, DASH, DASH]
                continue
            spread, (low, high) = statistics["metrics"].get(TOOL), statistics["success_interval"]
            bought = (
                (statistics["metrics"].get(metric), factor) for metric, factor in ((JITTER, 1.0), (LIMITED, 100.0))
            )
            others = max(each["episodes"] for each in summaries[case].values())
            few = f" of {statistics['episodes']}" if statistics["episodes"] < max(FEW, others) else ""
            cells.append(f"{statistics['success_rate']:.1%} [{low:.1%}, {high:.1%}]{few}")
            cells.append(DASH if spread is None else f"{number(spread['mean'], 1e3)} / {number(spread['p95'], 1e3)}")
            cells.append("; ".join(number(each and each["mean"], factor) for each, factor in bought))
        if any(cell != DASH for cell in cells):
            rows.append([name, *cells])
    return rows
