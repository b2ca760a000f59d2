"""The report: one HTML page that needs no network, from the results of the paper's experiments."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable, Mapping
from importlib import resources
from string import Template
from typing import TYPE_CHECKING, Any

from skyarm.figures.embed import image_bytes, plot_script, plot_style
from skyarm.figures.figure_list import PAPER_CATALOGUE
from skyarm.figures.interactive import damping_figure, experiment_figure, tool_path_figure
from skyarm.figures.interactive_spec import PanelsFigure, PathFigure, figure_json
from skyarm.log.flight_log import Log
from skyarm.paper.agreement import known
from skyarm.paper.counted_cells import sentence
from skyarm.paper.flights import WINDOWS, first_plant
from skyarm.paper.published import TITLES
from skyarm.paper.report import report_text as prose
from skyarm.paper.report.report_headlines import tally
from skyarm.paper.report.report_inferred import counts_section
from skyarm.paper.report.report_markup import bullets, details, section, table, text
from skyarm.paper.report.report_tables import (
    definitions_table,
    experiment_table,
    headline_table,
    reversed_table,
    sensitivity_tables,
    summary_table,
)
from skyarm.scenario.scenario_record import PLANTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = "Computed torque for a flying arm: the paper and two simulations"

Logs = Mapping[str, Mapping[str, Mapping[str, Log]]]
"""plant -> experiment -> controller -> log."""

DAMPING_PANELS = (
    ("case2", "position_error_mean", "Case 2: position error, mean [m]"),
    ("case2", "pitch_rms", "Case 2: pitch RMS [rad]"),
    ("case2", "joint_error_mean", "Case 2: joint error, mean [rad]"),
    ("case3", "ee_error_mean", "Case 3: end-effector error, mean [m]"),
    ("case3", "pitch_rms", "Case 3: pitch RMS [rad]"),
    ("case3", "tau1_rms", "Case 3: torque of joint 1, RMS [N m]"),
)


def report_html(
    results: Mapping[str, Any],
    sensitivity: Mapping[str, Any],
    logs: Logs,
    reasons: Mapping[str, Mapping[str, Mapping[str, str]]],
    figures: Mapping[int, Figure] | None = None,
    further: Mapping[str, str] | None = None,
) -> str:
    """Write the report.

    Args:
        results: as in ``results.json``: "experiments" and "settings".
        sensitivity: assumption -> its value -> experiment -> controller -> metric -> number or None.
        logs: plant -> experiment -> controller -> log, for the interactive plots.
        reasons: experiment -> controller -> metric -> why it differs from the paper, one line.
        figures: the paper's number -> static figure, put into the page as images.
        further: title -> HTML of a section of its own, on what goes beyond the paper.

    Returns:
        A whole HTML document: scripts, styles and images inside, no address outside.
    """
    experiments, plant = results.get("experiments", {}), first_plant(results)
    plots, script = _Plots(), plot_script()
    verdict = (
        counts_section(results)
        + headline_table(experiments)
        + reversed_table(experiments, plant)
        + summary_table(experiments)
    )
    sections = [
        ("verdict", "Verdict", verdict),
        ("experiments", "Experiments", _experiments(experiments, reasons, logs, plots)),
        ("sensitivity", "Sensitivity to assumptions", _sensitivity(sensitivity, experiments, plant, plots)),
        ("figures", "Figures 3-18", _paper_figures(figures or {}, plant)),
        *((f"further-{i}", title, content) for i, (title, content) in enumerate((further or {}).items(), 1)),
        ("assumptions", "Assumptions", bullets(prose.ASSUMPTIONS)),
        ("not-modelled", "What is not modelled", bullets(prose.NOT_MODELLED)),
        ("definitions", "Definitions", f"<p>{text(prose.READING)}</p>{definitions_table()}"),
        ("settings", "Settings and versions", _episodes(logs) + _settings(results.get("settings", {}))),
    ]
    return _template("report_page.html").substitute(
        title=text(TITLE),
        style=_resource("report.css"),
        lead=text(prose.LEAD),
        facts=text(f"{sentence(results)} {_facts(experiments)}"),
        contents="".join(f'<li><a href="#{name}">{text(title)}</a></li>' for name, title, _ in sections),
        body="\n".join(section(name, title, content) for name, title, content in sections),
        footer=f"Format of the results: schema {text(results.get('schema', 1))}. This page needs no network.",
        data=plots.data(),
        plot_style=plot_style(),
        script=script,
        # the browser runs this script and no other, whatever stands in the page
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii"),
    )


class _Plots:
    """Interactive plots of one page: holders in the text, data at its end."""

    def __init__(self) -> None:
        self._specs: list[str] = []

    def add(self, figure: PanelsFigure | PathFigure, caption: str) -> str:
        """Place for a plot; its data are kept for the end of the page."""
        name = f"plot-{len(self._specs)}"
        self._specs.append(f'<script type="application/json" id="{name}">{figure_json(figure)}</script>')
        hint = "<noscript><p>The interactive plots need JavaScript; the static figures do not.</p></noscript>"
        body = f'<div class="plot" data-plot="{name}" role="group" aria-label="{text(caption)}">{hint}</div>'
        return f'<figure class="interactive">{body}<figcaption>{text(caption)}</figcaption></figure>'

    def data(self) -> str:
        """All specifications."""
        return "\n".join(self._specs)


def _resource(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def _template(name: str) -> Template:
    return Template(_resource(name))


def _facts(experiments: Mapping[str, Any]) -> str:
    parts = []
    for plant in PLANTS:
        met, judged = tally(experiments, plant)
        if judged:
            parts.append(f"{plant}: {met} of {judged} headline claims met.")
    if parts:
        parts.append("The accepted ranges are this project's own.")
    return " ".join(parts) or "No headline number was measured."


def _experiments(experiments: Mapping[str, Any], reasons: Mapping[str, Any], logs: Logs, plots: _Plots) -> str:
    parts = [f'<p class="note">{text(prose.READING)} {text(prose.LEGEND)}</p>']
    for case, controllers in experiments.items():
        title = TITLES.get(case, case)
        parts.append(f'<h3 id="{text(case)}">{text(title)}</h3>')
        parts.append(experiment_table(case, controllers, reasons.get(case, {})))
        flown = {plant: cases[case] for plant, cases in logs.items() if cases.get(case)}
        if flown:
            figure = experiment_figure(flown, WINDOWS.get(case))
            parts.append(plots.add(figure, f"{title}: choose curves in the legend. {prose.HOLDS}"))
        if flown and case == "case3":
            parts.append(
                plots.add(
                    tool_path_figure(flown),
                    f"{title}: path of the end effector, desired and flown; the vertical axis is stretched.",
                )
            )
    return "".join(parts)


def _sensitivity(sensitivity: Mapping[str, Any], experiments: Mapping[str, Any], plant: str, plots: _Plots) -> str:
    damping = sensitivity.get("joint_damping") or {}
    if not damping:
        return sensitivity_tables(sensitivity, experiments, plant)
    paper = {
        case: {
            controller: {name: known(cell.get("paper")) for name, cell in cells.items()}
            for controller, cells in controllers.items()
        }
        for case, controllers in experiments.items()
    }
    figure = damping_figure(damping, paper, DAMPING_PANELS)
    caption = f"{len(DAMPING_PANELS)} numbers over the assumed joint damping, {plant}; dotted: the paper."
    return plots.add(figure, caption) + sensitivity_tables(sensitivity, experiments, plant)


def _paper_figures(figures: Mapping[int, Figure], plant: str) -> str:
    if not figures:
        return "<p>No static figures were drawn.</p>"
    parts = []
    for number, figure in sorted(figures.items()):
        spec = PAPER_CATALOGUE.get(number)
        caption = f"Figure {number}. {spec.caption}" if spec else f"Figure {number}."
        image = base64.b64encode(image_bytes(figure)).decode("ascii")
        shown = f'<img src="data:image/png;base64,{image}" alt="{text(caption)}">'
        parts.append(f'<figure id="figure-{number}">{shown}<figcaption>{text(caption)}</figcaption></figure>')
    look = "CT solid and dark, PD dashed and lighter, grey: window of the metrics."
    note = f"Layout of the paper, {text(plant)} plant. {look}"
    return f'<p class="note">{note} {text(prose.HOLDS)}</p><div class="paper">{"".join(parts)}</div>'


def _episodes(logs: Logs) -> str:
    flown = [
        (f"{plant}, {TITLES.get(case, case)}, {controller}", log)
        for plant, cases in logs.items()
        for case, controllers in cases.items()
        for controller, log in controllers.items()
    ]
    ended = [(name, log) for name, log in flown if log.status != "completed"]
    if not ended:
        return f"<p>All {len(flown)} episodes flew to their end.</p>" if flown else ""
    lines = [f"{name}: {log.status} at {log.info['end_time']:g} s, {log.info['cause']}" for name, log in ended]
    return f"<p>{len(ended)} of {len(flown)} episodes ended early:</p>{bullets(lines)}"


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
