"""The page of one case: its flights as curves, its main numbers, the paper's figures, every number folded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.figures.interactive import experiment_figure, tool_path_figure
from skyarm.figures.paper_figures import PAPER_CATALOGUE
from skyarm.log.flight_log import Log
from skyarm.paper.flights import WINDOWS
from skyarm.paper.published import TITLES
from skyarm.paper.report import report_text as prose
from skyarm.paper.report.report_frame import Page, Plots
from skyarm.paper.report.report_markup import details, image, text
from skyarm.paper.report.report_tables import experiment_table, main_numbers_table, near_counts
from skyarm.scenario.scenario_record import PLANTS

Logs = Mapping[str, Mapping[str, Mapping[str, Log]]]
"""plant -> case -> law -> log."""


def case_page(
    case: str,
    laws: Mapping[str, Any],
    reasons: Mapping[str, Mapping[str, str]],
    logs: Logs,
    figures: Mapping[int, bytes],
    plant: str,
) -> Page:
    """The page of a case.

    Args:
        case: its name.
        laws: CT and PD -> metric -> cell.
        reasons: law -> metric -> why it differs from the paper.
        logs: of all cases.
        figures: the paper's number -> PNG, of this case.
        plant: that flew first.
    """
    title, plots = TITLES.get(case, case), Plots()
    flown = {each: cases[case] for each, cases in logs.items() if cases.get(case)}
    sections = []
    if flown:
        sections.append(("flights", "Flights", _flights(case, flown, plots)))
    numbers = main_numbers_table(case, laws, plant) + details("Every number", experiment_table(case, laws, reasons))
    sections.append(("numbers", "Numbers", f'<p class="note">{text(prose.LEGEND)}</p>{numbers}'))
    if figures:
        sections.append(("figures", "The paper's figures", paper_figures_html(figures, plant)))
    return Page(
        title=title,
        lead=prose.CASES.get(case, ""),
        facts=" ".join(filter(None, (_near(laws, each) for each in PLANTS))),
        sections=sections,
        plots=plots,
    )


def _flights(case: str, flown: Mapping[str, Mapping[str, Log]], plots: Plots) -> str:
    title = TITLES.get(case, case)
    shown, *others = flown
    drawn = f"{shown}; {', '.join(others)} can be chosen in the legend" if others else shown
    caption = f"{title}: errors of base, joints and tip, roll and pitch over time, on {drawn}. {prose.HOLDS}"
    found = plots.add(experiment_figure(flown, WINDOWS.get(case)), caption)
    if case == "case3":
        caption = f"{title}: path of the tip, desired and flown, on {drawn}; the vertical axis is stretched."
        found += plots.add(tool_path_figure(flown), caption)
    return found


def _near(laws: Mapping[str, Any], plant: str) -> str:
    near, fair, compared = near_counts(laws, plant)
    if not compared:
        return ""
    return f"{plant}: of {compared} published numbers {near} are within 5 % and {fair} within 20 %."


def paper_figures_html(figures: Mapping[int, bytes], plant: str) -> str:
    """The paper's figures as drawn from our flights."""
    parts = []
    for number, png in sorted(figures.items()):
        spec = PAPER_CATALOGUE.get(number)
        caption = f"Figure {number}. {spec.caption}" if spec else f"Figure {number}."
        parts.append(f'<figure id="figure-{number}">{image(png, caption)}</figure>')
    note = f"Layout of the paper, {text(plant)} plant. {prose.LOOK} {prose.BANDS}"
    return f'<p class="note">{note}</p><div class="paper">{"".join(parts)}</div>'
