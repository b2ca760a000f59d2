"""Comparison of controllers on the cases of Barakou et al. 2026 and harder ones, up to perturbed plants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

from skyarm.records.immutable import immutable
from skyarm.studies.compare.cells import Flights
from skyarm.studies.compare.comparison_report import TRACKING, comparison_report, value
from skyarm.studies.compare.entrants import ENTRANTS, Entrant
from skyarm.studies.compare.run_suite import DPI, Document, Record, Refused
from skyarm.studies.compare.suite import CASES, Condition, conditions
from skyarm.studies.compare.summary import SummarySuite
from skyarm.view.figures.comparison_figures import Share, laws_figure
from skyarm.view.figures.style import image_bytes
from skyarm.view.pages import Report

SUITE = "paper-suite"
SHARE = "flights with the tip within 20 mm in the last 5 s\nnoisy wrong plants, Case 3 in wind"
WIND_TIP = next(c for c in TRACKING if c.case == "case3_wind" and c.metric.startswith("ee"))

BRIEF, WIDEST = ("step", "part"), "case3_wind"
"""Groups of entrants that meet perturbed plants in one case only: their tables say what a part of a law is worth."""


@immutable
class Comparison(SummarySuite[Flights]):
    """Benchmark that compares all shipped controllers on the same cases and perturbed plants.

    Attributes:
        entrants: in order. conditions: in order. seed: of plants and noise. plant: "rigid_body" or "mujoco".
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

    def flights(self) -> list[Flights]:
        """All flights of the comparison, grouped by controller, condition and case."""
        return [
            Flights(entrant=entrant, case=CASES[case], condition=condition, seed=self.seed, plant=self.plant)
            for entrant in self.entrants.values()
            for condition in self.conditions.values()
            for case in condition.cases
            if not condition.spread or case == WIDEST or entrant.group not in BRIEF
        ]

    def plan_cells(self) -> tuple[list[Flights], Refused]:
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
