"""HTML report of the reproduction of Barakou et al. 2026: an overview and a page per case."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING

from skyarm.log.flight_log import Log
from skyarm.records.files import file_names
from skyarm.studies.paper import report_text as prose
from skyarm.studies.paper.counted_cells import RULE
from skyarm.studies.paper.flights import first_plant
from skyarm.studies.paper.inference_tables import (
    choices_table,
    ladder_table,
    prediction_table,
    profile_tables,
    rivals_table,
    settings_table,
)
from skyarm.studies.paper.inferred_settings import is_of_this_study
from skyarm.studies.paper.published import Record
from skyarm.studies.paper.report_tables import (
    counts_table,
    definitions_table,
    experiment_table,
    reversed_list,
    sensitivity_tables,
    title_of,
    verdict_table,
)
from skyarm.studies.paper.verdict_sentences import verdict
from skyarm.view.figures.flight_plot import plot as flight_plot
from skyarm.view.figures.paper_figures import PAPER_CATALOGUE
from skyarm.view.figures.style import image_bytes
from skyarm.view.pages import bullets, details, image, page, paragraph, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Logs = Mapping[str, Mapping[str, Mapping[str, Log]]]
"""plant -> case -> law -> log."""

MAIN = "report.html"
"""File name of the start page."""

TITLE = "The paper on computed torque for a flying arm, reproduced"

CIRCLE = (7.5, 21.0)
"""Interval (s) of the flight whose path is drawn."""


@dataclass(frozen=True, kw_only=True)
class _Page:
    """Content of an HTML page of the report: title, lead, facts, opening paragraph, and sections."""

    title: str
    lead: str
    facts: Sequence[str] = ()
    opening: str = ""
    sections: Sequence[tuple[str, str, str]]


def report_pages(
    results: Record,
    sensitivity: Record,
    logs: Logs,
    figures: Mapping[int, Figure] | None = None,
    inferred: str = "",
    opening: str = "",
) -> dict[str, str]:
    """HTML pages of the reproduction's report: file name -> document.

    Args:
        results: content of ``results.json``: "experiments" and "settings".
        sensitivity: assumption -> its value -> case -> law -> metric -> number or None.
        logs: plant -> case -> law -> log, for the plots of flights.
        figures: the paper's number -> static figure, put into the page of its case as an image.
        inferred: HTML of the section on inferred settings.
        opening: HTML that the first page opens with.

    Returns:
        File -> a whole HTML document, all in one folder: ``report.html``, then a page for each case. Scripts, styles
        and images are inside; no address is outside the folder.
    """
    experiments, plant = results.get("experiments", {}), first_plant(results)
    drawn = {number: image_bytes(figure) for number, figure in (figures or {}).items()}
    files = case_files(experiments)
    sections = [
        ("verdict", "Every count", _counts(results, plant)),
        *([("inferred", "Inferred settings", inferred)] if inferred else []),
        ("sensitivity", "Sensitivity to assumptions", sensitivity_tables(sensitivity, experiments, plant)),
        ("assumptions", "Assumptions", _assumptions()),
        ("settings", "Settings and versions", _episodes(logs) + _settings(results.get("settings", {}))),
    ]
    opened = verdict_table(experiments, files, plant) + opening
    pages = {MAIN: _Page(title=TITLE, lead=prose.LEAD, facts=verdict(results), opening=opened, sections=sections)}
    for case, file in files.items():
        own = {number: png for number, png in drawn.items() if PAPER_CATALOGUE[number].case == case}
        pages[file] = _case_page(case, experiments[case], logs, own, plant)
    titles = {MAIN: "Overview", **{file: title_of(case).split(":")[0] for case, file in files.items()}}
    style = (resources.files("skyarm.studies.paper") / "report.css").read_text("utf-8")
    footer = f"Format of the results: schema {results.get('schema', 1)}. This page needs no network."
    return {
        file: page(**vars(each), style={"": style}, script=page_script(), pages=titles, name=file, footer=footer)
        for file, each in pages.items()
    }


def page_script() -> str:
    """JavaScript of the report's pages, which unfolds all blocks before printing."""
    return (resources.files("skyarm.studies.paper") / "report_print.js").read_text("utf-8")


def _counts(results: Record, plant: str) -> str:
    """HTML section with all counts of agreement, their rule, and the reversed orders of the laws."""
    experiments = results.get("experiments", {})
    folded = details("Within 25, 10 and 5 %, on both plants", counts_table(experiments))
    return paragraph(RULE) + folded + reversed_list(experiments, plant)


def case_files(cases: Iterable[str]) -> dict[str, str]:
    """File names of the report's case pages, by case."""
    named = file_names([MAIN.removesuffix(".html"), *cases], "", ".html")
    return {case: file for case, file in named.items() if file != MAIN}


def _case_page(case: str, laws: Record, logs: Logs, figures: Mapping[int, bytes], plant: str) -> _Page:
    """Report page of a case: plots of its flights, table of its numbers, and redrawn figures."""
    flown = {each: cases[case] for each, cases in logs.items() if cases.get(case)}
    sections = [
        *([("flights", "Flights", _flights(case, flown))] if flown else []),
        ("numbers", "Numbers", experiment_table(case, laws)),
        *([("figures", "The paper's figures", _paper_figures(figures, plant))] if figures else []),
    ]
    return _Page(title=title_of(case), lead=prose.CASES.get(case, ""), sections=sections)


def _flights(case: str, flown: Mapping[str, Mapping[str, Log]]) -> str:
    """HTML plots of a case's flights over time: base, joints and tip."""
    plant, laws = next(iter(flown.items()))
    kinds = {"tracking": "base and joints", "tip": "tip and its error"}
    if case == "case3":
        kinds["path"] = "path of the tip"
    images = ""
    for kind, words in kinds.items():
        caption = f"{title_of(case)}: {words}, desired and flown, on {plant}."
        drawn = flight_plot(laws, kind=kind, window=CIRCLE if kind == "path" else None)
        images += image(caption, caption, image_bytes(drawn), wide=kind == "path")
    return images


def _paper_figures(figures: Mapping[int, bytes], plant: str) -> str:
    """HTML section with the published figures, redrawn from simulated flights."""
    parts = []
    for number, png in sorted(figures.items()):
        caption = f"Figure {number}. {PAPER_CATALOGUE[number].caption}"
        parts.append(image(caption, caption, png, name=f"figure-{number}", kind="figure"))
    note = paragraph(f"Layout of the paper, {plant} plant. {prose.LOOK} {prose.HOLDS}", "note")
    return f'{note}<div class="paper">{"".join(parts)}</div>'


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
    summary = paragraph(f"{len(ended)} of {len(flown)} episodes ended early:") + bullets(lines)
    if not ended:
        summary = paragraph(f"All {len(flown)} episodes flew to their end.")
    lacking = [f"{name}: {line}" for name, log in flown for line in log.shortfall.lines]
    return summary + (paragraph("They lacked:") + bullets(lacking) if lacking else "")


def _settings(settings: Record) -> str:
    return details(
        "Everything the numbers depend on", table(("Name", "Value"), _flat(settings, ""), "Settings", "text")
    )


def _flat(settings: Record, prefix: str) -> Iterable[tuple[str, str]]:
    """Flatten nested settings to dotted names with text values."""
    for name, value in settings.items():
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", "none" if value is None or value in ([], {}) else str(value)


def inferred_section(results: Record, predicted: Record, evidence: Record, plant: str) -> str:
    """HTML section on the inferred settings and their predictions, with the evidence tables collapsed."""
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
