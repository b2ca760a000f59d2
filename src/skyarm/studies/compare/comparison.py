"""Comparison of controllers on the cases of Barakou et al. 2026 and harder ones, with
tables of the results.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from itertools import chain, product

from skyarm.records.immutable import immutable
from skyarm.studies.compare.cell_flights import CellFlights, Document, Record
from skyarm.studies.compare.entrants import ENTRANTS, Entrant
from skyarm.studies.compare.run_suite import DPI, Pngs, Refused, SummarySuite
from skyarm.studies.compare.suite import CASES, Condition, conditions
from skyarm.studies.trial.table import COLUMNS, TableColumn, report_of
from skyarm.view.figures.comparison_figures import Share, laws_figure
from skyarm.view.figures.style import image_bytes
from skyarm.view.pages import DASH, Report, Section, Table, image, table_of

SUITE = "paper-suite"
SHARE = (
    "flights with the tip within 20 mm in the last 5 s\nperturbed plants with noise,"
    " Case 3 in wind"
)

BRIEF, WIDEST = ("step", "part"), "case3_wind"
"""Groups of entrants that meet perturbed plants in one case only; their tables show the
effect of a part of a law."""


Entrants = Mapping[str, Entrant]
"""Controllers by name, in the order of the tables."""


@immutable
class Comparison(SummarySuite[CellFlights]):
    """Benchmark that compares all shipped controllers on the same cases and perturbed
    plants.

    Attributes:
        entrants: controllers in order. conditions: conditions in order. seed: seed of
            plants and noise.
        plant: "rigid_body" or "mujoco".
    """

    entrants: Entrants = field(default_factory=lambda: ENTRANTS)
    conditions: Mapping[str, Condition] = field(default_factory=conditions)
    seed: int = 0
    plant: str = "rigid_body"

    name, file = SUITE, "results"

    @property
    def options(self) -> Document:
        """Settings of the comparison as plain data: controllers, flights per condition,
        seed and plant.
        """
        flights = {name: each.episodes for name, each in self.conditions.items()}
        return {
            "laws": list(self.entrants),
            "conditions": flights,
            "seed": self.seed,
            "plant": self.plant,
        }

    def plan_cells(self) -> tuple[list[CellFlights], Refused]:
        """All flights of the comparison, grouped by controller, condition and case; no
        controller is excluded.
        """
        cells = list[CellFlights]()
        groups = product(self.entrants.values(), self.conditions.values())
        for entrant, condition in groups:
            brief = condition.spread is not None and entrant.group in BRIEF
            cells += [
                CellFlights(
                    entrant=entrant,
                    case=CASES[case],
                    condition=condition,
                    seed=self.seed,
                    plant=self.plant,
                )
                for case in condition.cases
                if not brief or case == WIDEST
            ]
        return cells, {}

    def pictures(self, found: Record) -> dict[str, bytes]:
        """Pictures of the comparison report by file name: errors and success rates of
        all controllers.
        """
        return {"laws.png": comparison_picture(found, list(self.entrants))}

    def report(self, found: Record, pictures: Pngs = None) -> Report:
        """Comparison report with one table for each condition, such as noisy
        measurements.
        """
        return comparison_report(
            found, self.entrants, self.conditions, (pictures or {}).get("laws.png")
        )


def comparison_picture(found: Record, names: Sequence[str]) -> bytes:
    """PNG of the tip errors and success rates of all controllers."""
    summaries = found["summaries"]
    errors = {
        title: [wind_tip(summaries[condition], name) for name in names]
        for title, condition in (
            ("perfect state", "perfect"),
            ("noise and delay", "noisy"),
        )
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


def wind_tip(summaries: Record, entrant: str) -> float | None:
    """Mean tip error of a controller in the wind of case 3, mm; None if it completed no
    flight.
    """
    mean = WIND_TIP.statistic_of(_metrics(summaries, WIND_TIP.case, entrant))
    return None if mean is None else mean * WIND_TIP.factor


def _share(summary: Record | None) -> Share | None:
    if summary is None or summary["success_rate"] is None:
        return None
    return Share(summary["success_rate"], *summary["success_interval"])


TRACKING, COST = COLUMNS["tracking"], COLUMNS["cost"]
"""Columns of tracking errors on the true plant, and of rotor jitter and saturation next
to the tip error."""

MEAN, TAIL, *EFFORT = COLUMNS["plants"]
"""Columns of perturbed plants: tip error, mean and 95 %; jitter and saturation."""

WIND_TIP = next(column for column in TRACKING if column.head == "wind tip, mm")

WHICH = "gust: of Case 2; wind, 45 deg, side, 50 g: of Case 3"
"""Text on the case to which a head without a case refers."""

COST_WORDS = (
    "Control activity (periods with a rotor at its limit; torque, motion and tilt: Case"
    " 3 in wind)"
)

CAPTION = (
    "Case 3 in wind. Left: mean tip error over 10 to 20 s on the true plant. Right:"
    " fraction of perturbed plants with noise (condition plants_noisy) on which the"
    " flight succeeds, with its interval (95 %)"
)

FEW = 10
"""Number of flights below which a fraction states its number of flights, as where
others flew more."""

WRONG_NOTE = (
    "A success completes and keeps the tip within 20 mm all through the last 5 s"
    " (intervals: Wilson, 95 %). Laws that keep the joints on their references carry"
    " the tip away with every tilt and cannot succeed in strong wind, however exact"
    " their base. Tip: mean over 10 to 20 s; of completed flights mean and 95th"
    " percentile."
)

TRUTH_NOTE = (
    "Means over 10 to 20 s against the continuous reference; the gust: peaks from its"
    " start on."
)

GROUPS = {
    "paper": "the paper's controllers",
    "step": "the paper's law made better one step at a time",
    "published": "other laws",
    "centroidal": "the centroidal law",
    "part": "the centroidal law without one of its parts",
    "own": "user-defined laws",
}
"""Group of an entrant -> its title."""


def _metrics(summaries: Record, case: str, entrant: str) -> Record:
    """Statistics of the metrics of a controller in a case; none where it does not
    fly.
    """
    flown: Record = summaries.get(case, {}).get(entrant, {"metrics": {}})
    metrics: Record = flown["metrics"]
    return metrics


def title_of(laws: Sequence[str]) -> str:
    """Title of a comparison of controllers, such as "A against B" for two of them."""
    if len(laws) == 2:
        return f"{laws[0]} against {laws[1]}"
    # whatever else flies with the shipped ones
    if set(ENTRANTS) <= set(laws):
        return "All laws compared"
    return laws[0] if len(laws) == 1 else f"{len(laws)} laws compared"


def comparison_report(
    found: Record,
    entrants: Entrants,
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
    sections.append(
        Section(title="Cases", tables=[Table(head=("case", "what"), rows=cases)])
    )
    laws = [(name, GROUPS[each.group], each.title) for name, each in entrants.items()]
    count = "1 law" if len(entrants) == 1 else f"{len(entrants)} laws"
    return report_of(
        title_of(list(entrants)),
        f"{count}, seed {found.get('seed')}, plant {found.get('plant')}",
        sections,
        opening=image(CAPTION, CAPTION, picture, wide=True) if picture else "",
        page_only=[
            Section(
                title="Laws", tables=[Table(head=("law", "kind", "what"), rows=laws)]
            )
        ],
    )


def main_sections(
    found: Record, entrants: Entrants, conditions: Mapping[str, Condition]
) -> list[Section]:
    """Report sections, one for each simulated condition, with the errors of all
    controllers.
    """
    sections = []
    for name, condition in conditions.items():
        summaries = found["summaries"].get(name)
        if summaries:
            flights = (
                "One flight"
                if condition.episodes == 1
                else f"{condition.episodes} flights"
            )
            sections.append(
                Section(
                    title=f"{name}: {condition.title}",
                    notes=[f"{flights} of each case."],
                    remark=WRONG_NOTE if condition.spread else TRUTH_NOTE,
                    tables=_tables(summaries, entrants, condition),
                )
            )
    return sections


def _tables(summaries: Record, entrants: Entrants, condition: Condition) -> list[Table]:
    if condition.spread:
        words = ("success", "tip, mm: mean / 95 %", "jitter, rad/s; at a limit, %")
        heads = [f"{case} {word}" for case in condition.cases for word in words]
        rows = plants_rows(summaries, entrants, condition.cases)
        return [_table_by_kind(heads, rows, entrants, "Successes, tip errors")]
    return [
        _table_by_kind(
            [each.head for each in columns],
            truth_rows(summaries, entrants, columns),
            entrants,
            caption,
        )
        for columns, caption in ((TRACKING, f"Errors ({WHICH})"), (COST, COST_WORDS))
    ]


def _table_by_kind(
    heads: Sequence[str],
    rows: list[list[str]],
    entrants: Entrants,
    caption: str,
) -> Table:
    """Results table with its rows grouped by kind of controller, such as published
    ones.
    """
    groups = [
        (title, [row for row in rows if entrants[row[0]].group == group])
        for group, title in GROUPS.items()
    ]
    return replace(
        table_of(["law", *heads], rows, title=caption),
        groups=[each for each in groups if each[1]],
    )


def truth_rows(
    summaries: Record, entrants: Entrants, columns: Sequence[TableColumn]
) -> list[list[str]]:
    """Table rows of errors on the unperturbed plant, one per controller with any
    result.
    """
    return [
        [
            name,
            *(
                column.text(_metrics(summaries, column.case, name))
                for column in columns
            ),
        ]
        for name in entrants
        if any(name in summaries.get(column.case, {}) for column in columns)
    ]


def plants_rows(
    summaries: Record, entrants: Entrants, cases: Sequence[str]
) -> list[list[str]]:
    """Table rows for perturbed plants: success rate with interval and tip error of each
    controller.
    """
    rows = [
        [
            name,
            *chain.from_iterable(
                _plants(summaries.get(case, {}), name) for case in cases
            ),
        ]
        for name in entrants
    ]
    # laws that met no perturbed plant have no row
    return [row for row in rows if set(row[1:]) - {DASH}]


def _plants(laws: Record, name: str) -> list[str]:
    """Cells of one controller on perturbed plants in one case."""
    if name not in laws:
        return [DASH, DASH, DASH]
    count, metrics = laws[name]["episodes"], laws[name]["metrics"]
    # an interval does not show that others flew more, or that all flew few
    few = (
        f" of {count}"
        if count < max(FEW, *(each["episodes"] for each in laws.values()))
        else ""
    )
    share = laws[name]["success_rate"]
    low, high = laws[name]["success_interval"]
    return [
        f"{share:.1%} [{low:.1%}, {high:.1%}]{few}",
        (
            f"{MEAN.text(metrics)} / {TAIL.text(metrics)}"
            if metrics.get(MEAN.metric)
            else DASH
        ),
        "; ".join(each.text(metrics) for each in EFFORT),
    ]
