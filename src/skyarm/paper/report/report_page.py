"""The report: a page that says what came out, and a page for each case; HTML that needs no network."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from skyarm.figures.interactive import damping_figure
from skyarm.figures.paper_figures import PAPER_CATALOGUE
from skyarm.figures.style import image_bytes
from skyarm.files import file_names
from skyarm.paper.agreement import known
from skyarm.paper.counted_cells import sentence
from skyarm.paper.flights import first_plant
from skyarm.paper.published import TITLES
from skyarm.paper.report import report_text as prose
from skyarm.paper.report.report_case import Logs, case_page, paper_figures_html
from skyarm.paper.report.report_frame import MAIN, Page, Plots, page_html
from skyarm.paper.report.report_headlines import tally
from skyarm.paper.report.report_inferred import counts_table
from skyarm.paper.report.report_markup import bullets, details, table, text
from skyarm.paper.report.report_opening import Opening, opening_html
from skyarm.paper.report.report_tables import (
    definitions_table,
    headline_table,
    reversed_table,
    sensitivity_tables,
    summary_table,
)
from skyarm.scenario.scenario_record import PLANTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = "Computed torque for a flying arm: the paper and two simulations"

DAMPING_PANELS = (
    ("case2", "position_error_mean", "Case 2: position error, mean [m]"),
    ("case2", "pitch_rms", "Case 2: pitch RMS [rad]"),
    ("case2", "joint_error_mean", "Case 2: joint error, mean [rad]"),
    ("case3", "ee_error_mean", "Case 3: tip error, mean [m]"),
    ("case3", "pitch_rms", "Case 3: pitch RMS [rad]"),
    ("case3", "tau1_rms", "Case 3: torque of joint 1, RMS [N m]"),
)


def report_pages(
    results: Mapping[str, Any],
    sensitivity: Mapping[str, Any],
    logs: Logs,
    reasons: Mapping[str, Mapping[str, Mapping[str, str]]],
    figures: Mapping[int, Figure] | None = None,
    further: Mapping[str, str] | None = None,
    opening: Opening | None = None,
) -> dict[str, str]:
    """Write the report.

    Args:
        results: as in ``results.json``: "experiments" and "settings".
        sensitivity: assumption -> its value -> case -> law -> metric -> number or None.
        logs: plant -> case -> law -> log, for the interactive plots.
        reasons: case -> law -> metric -> why it differs from the paper, one line.
        figures: the paper's number -> static figure, put into the pages as images.
        further: title -> HTML of a section of its own, on what goes beyond the paper.
        opening: what the first page opens with.

    Returns:
        File -> a whole HTML document, all in one folder: ``report.html``, then a page for each case. Scripts, styles
        and images are inside; no address is outside the folder.
    """
    experiments, plant, plots = results.get("experiments", {}), first_plant(results), Plots()
    drawn = {number: image_bytes(figure) for number, figure in (figures or {}).items()}
    files = case_files(experiments)
    by_case = {case: {n: png for n, png in drawn.items() if _case_of(n) == case} for case in files}
    left = {n: png for n, png in drawn.items() if _case_of(n) not in files}
    verdict = (
        summary_table(experiments, files)
        + reversed_table(experiments, plant)
        + details("Headline numbers against accepted ranges", headline_table(experiments))
        + details("Counts by law and plant", counts_table(results))
    )
    sections = [
        ("verdict", "Verdict", verdict),
        *((f"further-{i}", title, content) for i, (title, content) in enumerate((further or {}).items(), 1)),
        ("sensitivity", "Sensitivity to assumptions", _sensitivity(sensitivity, experiments, plant, plots)),
        *([("figures", "Figures", paper_figures_html(left, plant))] if left else []),
        ("assumptions", "Assumptions", _assumptions()),
        ("settings", "Settings and versions", _episodes(logs) + _settings(results.get("settings", {}))),
    ]
    facts = f"{sentence(results)} {_facts(experiments)}{'' if drawn else ' No static figures were drawn.'}"
    pages = {
        MAIN: Page(
            title=TITLE,
            lead=prose.LEAD,
            facts=facts,
            opening=opening_html(opening),
            sections=sections,
            plots=plots,
        )
    }
    for case, file in files.items():
        pages[file] = case_page(case, experiments[case], reasons.get(case, {}), logs, by_case[case], plant)
    titles = {MAIN: "Overview", **{file: TITLES.get(case, case).split(":")[0] for case, file in files.items()}}
    return {file: page_html(page, file, titles, results.get("schema", 1)) for file, page in pages.items()}


def case_files(cases: Iterable[str]) -> dict[str, str]:
    """Case -> the file of its page, beside :data:`skyarm.paper.report.report_frame.MAIN`."""
    return {case: file for case, file in file_names([MAIN.removesuffix(".html"), *cases], "", ".html").items()
            if file != MAIN}  # fmt: skip


def _case_of(number: int) -> str:
    spec = PAPER_CATALOGUE.get(number)
    return spec.case if spec else ""


def _facts(experiments: Mapping[str, Any]) -> str:
    parts = []
    for plant in PLANTS:
        met, judged = tally(experiments, plant)
        if judged:
            parts.append(f"{plant}: {met} of {judged} headline claims met.")
    if parts:
        parts.append("The accepted ranges are this project's own.")
    return " ".join(parts) or "No headline number was measured."


def _sensitivity(sensitivity: Mapping[str, Any], experiments: Mapping[str, Any], plant: str, plots: Plots) -> str:
    damping = sensitivity.get("joint_damping") or {}
    if not damping:
        return sensitivity_tables(sensitivity, experiments, plant)
    paper = {
        case: {law: {name: known(cell.get("paper")) for name, cell in cells.items()} for law, cells in laws.items()}
        for case, laws in experiments.items()
    }
    figure = damping_figure(damping, paper, DAMPING_PANELS)
    caption = f"{len(DAMPING_PANELS)} numbers over the assumed joint damping, {plant}; dotted: the paper."
    return plots.add(figure, caption) + sensitivity_tables(sensitivity, experiments, plant)


def _assumptions() -> str:
    folded = details("Everything that is assumed", bullets(prose.ASSUMPTIONS))
    folded += details("What is not modelled", bullets(prose.NOT_MODELLED))
    return f"<p>{text(prose.READING)}</p>{folded}{details('Definitions of the metrics', definitions_table())}"


def _episodes(logs: Logs) -> str:
    flown = [
        (f"{plant}, {TITLES.get(case, case)}, {law}", log)
        for plant, cases in logs.items()
        for case, laws in cases.items()
        for law, log in laws.items()
    ]
    if not flown:
        return ""
    ended = [(name, log) for name, log in flown if log.status != "completed"]
    lines = [f"{name}: {log.status} at {log.info['end_time']:g} s, {log.info['cause']}" for name, log in ended]
    found = f"<p>{len(ended)} of {len(flown)} episodes ended early:</p>{bullets(lines)}"
    if not ended:
        found = f"<p>All {len(flown)} episodes flew to their end.</p>"
    lacking = [f"{name}: {line}" for name, log in flown for line in log.shortfall.lines]
    return found + (f"<p>They lacked:</p>{bullets(lacking)}" if lacking else "")


def _settings(settings: Mapping[str, Any]) -> str:
    rows = [
        f'<th scope="row"><code>{text(name)}</code></th><td>{text(value)}</td>' for name, value in _flat(settings, "")
    ]
    return details("Everything the numbers depend on", table("Settings", ["Name", "Value"], [("", rows)], "text"))


def _flat(settings: Mapping[str, Any], prefix: str) -> Iterable[tuple[str, Any]]:
    """Nested settings as dotted names."""
    for name, value in settings.items():
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", "none" if value is None or value in ([], {}) else value
