"""The report of the reproduction: a page with the verdict, and a page for each case; HTML that needs no network."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from typing import TYPE_CHECKING, Any

from skyarm.log.flight_log import Log
from skyarm.paper import report_text as prose
from skyarm.paper.counted_cells import RULE, sentence
from skyarm.paper.flights import WINDOWS, first_plant
from skyarm.paper.inference_tables import (
    choices_table,
    ladder_table,
    prediction_table,
    profile_tables,
    rivals_table,
    settings_table,
)
from skyarm.paper.inferred_settings import is_of_this_study
from skyarm.paper.published import tally
from skyarm.paper.report_tables import (
    counts_table,
    definitions_table,
    experiment_table,
    headline_table,
    main_numbers_table,
    near_counts,
    not_reproduced,
    sensitivity_tables,
    summary_table,
    title_of,
)
from skyarm.records.files import file_names
from skyarm.scenario.scenario_record import PLANTS
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.view.figures.flight_plot import plot as flight_plot
from skyarm.view.figures.interactive import (
    PanelsFigure,
    experiment_figure,
    figure_json,
    plot_script,
    plot_style,
)
from skyarm.view.figures.paper_figures import PAPER_CATALOGUE
from skyarm.view.figures.style import image_bytes
from skyarm.view.figures.vehicle_drawing import vehicle_drawing
from skyarm.view.pages import bullets, details, image, page, paragraph, plot, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Logs = Mapping[str, Mapping[str, Mapping[str, Log]]]
"""plant -> case -> law -> log."""

MAIN = "report.html"
"""The page that leads to all others."""

TITLE = "Computed torque for a flying arm: the paper and two simulations"

VEHICLE = "hummingbird_arm2_rotors"
"""What flies in every case."""


CIRCLE = (7.5, 21.0)
"""s of that flight whose path is drawn."""


class Plots:
    """Interactive plots of one page: holders in the text, data at its end."""

    def __init__(self) -> None:
        self.data: list[str] = []

    def add(self, figure: PanelsFigure, caption: str) -> str:
        """Place for a plot; its data are kept for the end of the page."""
        name = f"plot-{len(self.data)}"
        self.data.append(f'<script type="application/json" id="{name}">{figure_json(figure)}</script>')
        return plot(name, caption)


@dataclass(frozen=True, kw_only=True)
class _Page:
    """A page: title, lead and facts as text; opening and sections (name, title, HTML); its plots."""

    title: str
    lead: str
    facts: str
    opening: str = ""
    sections: Sequence[tuple[str, str, str]]
    plots: Plots = field(default_factory=Plots)


def report_pages(
    results: Mapping[str, Any],
    sensitivity: Mapping[str, Any],
    logs: Logs,
    reasons: Mapping[str, Mapping[str, Mapping[str, str]]],
    figures: Mapping[int, Figure] | None = None,
    further: Mapping[str, str] | None = None,
    opening: str = "",
) -> dict[str, str]:
    """Write the report.

    Args:
        results: as in ``results.json``: "experiments" and "settings".
        sensitivity: assumption -> its value -> case -> law -> metric -> number or None.
        logs: plant -> case -> law -> log, for the interactive plots.
        reasons: case -> law -> metric -> why it differs from the paper, one line.
        figures: the paper's number -> static figure, put into the pages as images.
        further: title -> HTML of further sections.
        opening: HTML that the first page opens with.

    Returns:
        File -> a whole HTML document, all in one folder: ``report.html``, then a page for each case. Scripts, styles
        and images are inside; no address is outside the folder.
    """
    experiments, plant = results.get("experiments", {}), first_plant(results)
    drawn = {number: image_bytes(figure) for number, figure in (figures or {}).items()}
    files = case_files(experiments)
    case_of = {number: PAPER_CATALOGUE[number].case if number in PAPER_CATALOGUE else "" for number in drawn}
    left = {number: png for number, png in drawn.items() if case_of[number] not in files}
    verdict = [
        summary_table(experiments, files),
        paragraph(not_reproduced(experiments, plant)),
        details("Headline numbers against accepted ranges", headline_table(experiments)),
        details("Counts by law and plant", paragraph(RULE, "note") + counts_table(results)),
    ]
    sections = [
        ("verdict", "Verdict", "".join(verdict)),
        *((f"further-{i}", title, content) for i, (title, content) in enumerate((further or {}).items(), 1)),
        ("sensitivity", "Sensitivity to assumptions", sensitivity_tables(sensitivity, experiments, plant)),
        *([("figures", "Figures", _paper_figures(left, plant))] if left else []),
        ("assumptions", "Assumptions", _assumptions()),
        ("settings", "Settings and versions", _episodes(logs) + _settings(results.get("settings", {}))),
    ]
    facts = f"{sentence(results)} {_facts(experiments)}{'' if drawn else ' No static figures were drawn.'}"
    pages = {MAIN: _Page(title=TITLE, lead=prose.LEAD, facts=facts, opening=opening, sections=sections)}
    for case, file in files.items():
        own = {number: png for number, png in drawn.items() if case_of[number] == case}
        pages[file] = _case_page(case, experiments[case], reasons.get(case, {}), logs, own, plant)
    titles = {MAIN: "Overview", **{file: title_of(case).split(":")[0] for case, file in files.items()}}
    style = (resources.files("skyarm.paper") / "report.css").read_text("utf-8")
    footer = f"Format of the results: schema {results.get('schema', 1)}. This page needs no network."
    return {
        file: page(
            each.title, each.facts, style={"": style, "plot-style": plot_style()}, script=page_script(), pages=titles,
            sections=each.sections, name=file, lead=each.lead, footer=footer, opening=each.opening,
            data="\n".join(each.plots.data),
        )
        for file, each in pages.items()
    }  # fmt: skip


def page_script() -> str:
    """The script of a page: it draws the interactive plots, and unfolds everything for the printer."""
    return plot_script() + (resources.files("skyarm.paper") / "report_print.js").read_text("utf-8")


def case_files(cases: Iterable[str]) -> dict[str, str]:
    """Case -> the file of its page, beside :data:`MAIN`."""
    named = file_names([MAIN.removesuffix(".html"), *cases], "", ".html")
    return {case: file for case, file in named.items() if file != MAIN}


def _case_page(
    case: str,
    laws: Mapping[str, Any],
    reasons: Mapping[str, Mapping[str, str]],
    logs: Logs,
    figures: Mapping[int, bytes],
    plant: str,
) -> _Page:
    """The page of a case: its flights as curves, its main numbers, the paper's figures, every number folded."""
    plots = Plots()
    flown = {each: cases[case] for each, cases in logs.items() if cases.get(case)}
    sections = [("flights", "Flights", _flights(case, flown, plots))] if flown else []
    numbers = main_numbers_table(case, laws, plant) + details("Every number", experiment_table(case, laws, reasons))
    sections.append(("numbers", "Numbers", paragraph(prose.LEGEND, "note") + numbers))
    if figures:
        sections.append(("figures", "The paper's figures", _paper_figures(figures, plant)))
    near = {each: near_counts(laws, each) for each in PLANTS}
    facts = " ".join(
        f"{each}: of {compared} published numbers {within} are within 5 % and {fair} within 20 %."
        for each, (within, fair, compared) in near.items()
        if compared
    )
    lead = prose.CASES.get(case, "")
    return _Page(title=title_of(case), lead=lead, facts=facts, sections=sections, plots=plots)


def _flights(case: str, flown: Mapping[str, Mapping[str, Log]], plots: Plots) -> str:
    shown, *others = flown
    drawn = f"{shown}; {', '.join(others)} can be chosen in the legend" if others else shown
    caption = f"{title_of(case)}: errors of base, joints and tip, roll and pitch over time, on {drawn}. {prose.HOLDS}"
    found = plots.add(experiment_figure(flown, WINDOWS.get(case)), caption)
    if case == "case3":
        caption = f"{title_of(case)}: path of the tip, desired and flown, on {shown}."
        found += image(caption, caption, image_bytes(flight_plot(flown[shown], kind="path", window=CIRCLE)), wide=True)
    return found


def _paper_figures(figures: Mapping[int, bytes], plant: str) -> str:
    """The paper's figures as drawn from our flights."""
    parts = []
    for number, png in sorted(figures.items()):
        spec = PAPER_CATALOGUE.get(number)
        caption = f"Figure {number}. {spec.caption}" if spec else f"Figure {number}."
        parts.append(image(caption, caption, png, name=f"figure-{number}", kind="figure"))
    note = paragraph(f"Layout of the paper, {plant} plant. {prose.LOOK} {prose.BANDS}", "note")
    return f'{note}<div class="paper">{"".join(parts)}</div>'


def _facts(experiments: Mapping[str, Any]) -> str:
    counted = {plant: tally(experiments, plant) for plant in PLANTS}
    parts = [f"{plant}: {met} of {judged} headline claims met." for plant, (met, judged) in counted.items() if judged]
    own = ["The accepted ranges are this project's own."] if parts else ["No headline number was measured."]
    return " ".join([*parts, *own])


def _assumptions() -> str:
    folded = {
        "Everything that is assumed": bullets(prose.ASSUMPTIONS),
        "What is not modelled": bullets(prose.NOT_MODELLED),
        "Definitions of the metrics": definitions_table(),
    }
    return paragraph(prose.READING) + "".join(details(title, content) for title, content in folded.items())


def _episodes(logs: Logs) -> str:
    flown = [
        (f"{plant}, {title_of(case)}, {law}", log)
        for plant, cases in logs.items()
        for case, laws in cases.items()
        for law, log in laws.items()
    ]
    if not flown:
        return ""
    ended = [(name, log) for name, log in flown if log.status != "completed"]
    lines = [f"{name}: {log.status} at {log.info['end_time']:g} s, {log.info['cause']}" for name, log in ended]
    found = paragraph(f"{len(ended)} of {len(flown)} episodes ended early:") + bullets(lines)
    if not ended:
        found = paragraph(f"All {len(flown)} episodes flew to their end.")
    lacking = [f"{name}: {line}" for name, log in flown for line in log.shortfall.lines]
    return found + (paragraph("They lacked:") + bullets(lacking) if lacking else "")


def _settings(settings: Mapping[str, Any]) -> str:
    return details(
        "Everything the numbers depend on", table(("Name", "Value"), _flat(settings, ""), "Settings", "text")
    )


def _flat(settings: Mapping[str, Any], prefix: str) -> Iterable[tuple[str, str]]:
    """Nested settings as dotted names."""
    for name, value in settings.items():
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", "none" if value is None or value in ([], {}) else str(value)


def inferred_section(
    results: Mapping[str, Any], predicted: Mapping[str, Any], evidence: Mapping[str, Any], plant: str
) -> str:
    """Settings and what they say of flights that were not seen; ladder, choices, profiles, rivals, open ends folded."""
    opened = [settings_table(evidence), prediction_table(results, predicted, plant)]
    folded = {
        "Ladder: one setting after the other": [ladder_table(evidence)],
        "Choices taken otherwise": [choices_table(evidence)],
        "Loss over each number": profile_tables(evidence),
        "Rivals": [rivals_table(evidence)],
    }
    parts = [paragraph(prose.INFERRED)]
    parts += [] if is_of_this_study(evidence) else [paragraph(prose.OTHER_STUDY, "note")]
    parts += [each.html() for each in opened]
    parts += [details(title, "".join(each.html() for each in tables)) for title, tables in folded.items()]
    return "".join([*parts, details("What stays open", bullets(prose.OPEN))])


def vehicle_section() -> str:
    """The paper's vehicle as it flies here: a drawing with frames, joints and rotors."""
    name = "The vehicle from three sides"
    words = f"{name}: frames, joints with their positive senses, and rotors of {VEHICLE}. Sizes of bodies are guesses."
    return image(name, words, image_bytes(vehicle_drawing(load_vehicle(VEHICLE)), dpi=150.0), wide=True)
