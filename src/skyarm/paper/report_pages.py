"""HTML report of the reproduction of Barakou et al. 2026: its tables, an overview and a
page per case.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from importlib import resources
from itertools import chain

from skyarm.log.flight_log import Log
from skyarm.paper import report_text as prose
from skyarm.paper.counted_cells import (
    RULE,
    counts,
    in_case,
    inferred_value,
    sentence,
    stated_value,
)
from skyarm.paper.flights import first_plant
from skyarm.paper.inference_tables import (
    choices_table,
    ladder_table,
    prediction_table,
    profile_tables,
    rivals_table,
    settings_table,
)
from skyarm.paper.inferred_settings import is_of_this_study
from skyarm.paper.published import (
    CONTINUOUS,
    METRICS,
    TITLES,
    Experiments,
    Number,
    Record,
    digits,
    finite_or_none,
    metric,
    percent,
    phrase,
    printed_number,
    published_number,
    relative,
    reversed_orders,
    short_title,
)
from skyarm.paper.report_text import ASSUMED, INFERRED_SETTINGS, OPEN
from skyarm.paper.variations import GROUPS, variations
from skyarm.paper.verdict_sentences import verdict
from skyarm.records.files import file_names
from skyarm.scenario.scenario_record import PLANTS
from skyarm.view.figures.flight_plot import plot as flight_plot
from skyarm.view.figures.paper_figures import PAPER_CATALOGUE
from skyarm.view.figures.style import Picture
from skyarm.view.pages import (
    Mark,
    bullets,
    details,
    grouped_table,
    image,
    markdown,
    page,
    paragraph,
    table,
)

Cells = Mapping[str, Record]
Cell = str | Mark
Variants = Mapping[str, Mapping[str, Mapping[str, Mapping[str, Number]]]]
"""Value of an assumption -> case -> law -> metric -> number."""

DASH, MINUS = "\N{EN DASH}", "\N{MINUS SIGN}"
CONTROLLERS = {
    "CT": "CT: hybrid geometric computed torque",
    "PD": "PD: decoupled baseline",
}
TELLING = 0.02
"""Spread of relative differences below which no variant is called the nearest."""


def typographic(written: str) -> str:
    """Replace the hyphen of a negative number by a typographic minus."""
    return written.replace("-", MINUS)


def number_cell(value: Number, *, written: str = "", strong: bool = False) -> Cell:
    """HTML table cell of a number with three digits and its full value as data; a dash
    if it is missing.
    """
    finite = finite_or_none(value)
    return (
        DASH
        if finite is None
        else Mark(
            text=typographic(written or digits(finite)), value=value, strong=strong
        )
    )


def difference_text(ours: Number, paper: Number) -> str:
    """Text of the relative difference from a published number in percent; a dash if a
    number is missing.
    """
    return typographic(percent(ours, paper)).replace(" ", "\N{NO-BREAK SPACE}") or DASH


def bound_text(ours: Number, paper: Number) -> str:
    """Text on whether a number is below the published upper bound; a dash if it is
    missing.
    """
    value, bound = finite_or_none(ours), finite_or_none(paper)
    if value is None or bound is None:
        return DASH
    return "below" if value <= bound else "above"


def _paper_cell(case: str, controller: str, name: str, paper: Number) -> Cell:
    """HTML table cell of a published number with its printed digits."""
    if paper is None and published_number(case, controller, name):
        return typographic(published_number(case, controller, name))
    # printed digits stand only for the number that was compared
    written = printed_number(case, controller, name)
    return number_cell(
        paper, written=written if written and float(written) == paper else ""
    )


def title_of(case: str) -> str:
    """Title of a published case, such as "Case 1: hover, arm ramps"; other cases keep
    their name.
    """
    return TITLES.get(case, case)


def reversed_by_case(experiments: Experiments, plant: str) -> dict[str, list[str]]:
    """Metrics in words whose better law is another one than in the paper, by case."""
    found: dict[str, list[str]] = {}
    for case, name in reversed_orders(experiments, plant):
        found.setdefault(short_title(case), []).append(phrase(name))
    return found


REVERSED = (
    "Metrics whose better law of the two is another one here than in the paper ({}):"
)


def reversed_list(experiments: Experiments, plant: str) -> str:
    """HTML list of the metrics whose better law is another one than in the paper, by
    case.
    """
    found = [
        f"{case}: {', '.join(names)}."
        for case, names in reversed_by_case(experiments, plant).items()
    ]
    return paragraph(REVERSED.format(plant)) + bullets(found or ["none."])


def verdict_table(
    experiments: Experiments, files: Mapping[str, str], plant: str
) -> str:
    """HTML table of how many published numbers each case reproduces within 25 %, with
    links to the cases' pages.
    """
    columns = (stated_value(plant), inferred_value(plant))
    rows = []
    for case in experiments:
        found = [counts(experiments, column, in_case(case)) for column in columns]
        near = [str(each["within_25%"]) if each else DASH for each in found]
        many = next((str(each["cells"]) for each in found if each), DASH)
        rows.append([Mark(text=title_of(case), href=files[case]), many, *near])
    caption = f"Numbers of the paper that agree within 25 % ({plant})"
    return table(
        ["Case", ">numbers", ">as stated", ">inferred"], rows, caption, "summary"
    )


def counts_table(experiments: Experiments) -> str:
    """HTML table of how many published numbers each case reproduces within 25, 10 and 5
    %, on every plant.
    """
    columns = {
        f">{title}, {plant}": column(plant)
        for title, column in (("as stated", stated_value), ("inferred", inferred_value))
        for plant in PLANTS
    }
    found = {
        case: [counts(experiments, each, in_case(case)) for each in columns.values()]
        for case in experiments
    }
    groups = []
    # from the widest share, which the verdict is about, to the closest
    for share in (25, 10, 5):
        name = f"within_{share}%"
        rows = [
            [title_of(case), *(str(each[name]) if each else DASH for each in numbers)]
            for case, numbers in found.items()
        ]
        groups.append((f"within {share} %", rows))
    return grouped_table(
        ["Case", *columns],
        groups,
        "Numbers of the paper that agree, on both plants",
        "summary",
    )


def experiment_table(case: str, controllers: Mapping[str, Cells]) -> str:
    """HTML table of the published and simulated numbers of one case."""
    head = [
        *(
            "Metric",
            "Unit",
            ">Paper",
            ">as stated: rigid_body",
            ">mujoco",
            ">rigid_body - paper",
            ">mujoco - paper",
        ),
        *(">inferred: rigid_body", ">mujoco", ">inferred rigid_body - paper"),
    ]
    groups = [
        (
            CONTROLLERS.get(law, law),
            [
                _metric_row(case, law, name, cell)
                for name, cell in cells.items()
                if not name.endswith(CONTINUOUS)
            ],
        )
        for law, cells in controllers.items()
    ]
    return grouped_table(
        head,
        groups,
        f"{title_of(case)}: errors against the held 50 Hz reference",
        "wide",
    )


def _metric_row(case: str, controller: str, name: str, cell: Record) -> list[Cell]:
    meant = metric(name)
    paper = cell.get("paper")
    inferred = cell.get("inferred", {})
    compare = bound_text if meant.bound else difference_text
    return [
        Mark(text=meant.label, title=meant.definition or name),
        meant.unit,
        _paper_cell(case, controller, name, paper),
        *(number_cell(cell.get(plant)) for plant in PLANTS),
        *(compare(cell.get(plant), paper) for plant in PLANTS),
        *(number_cell(inferred.get(plant)) for plant in PLANTS),
        compare(inferred.get(PLANTS[0]), paper),
    ]


def sensitivity_tables(
    sensitivity: Mapping[str, Variants], experiments: Experiments, plant: str
) -> str:
    """Collapsible HTML tables of metrics under varied assumptions, one table for each
    assumption.
    """
    parts = []
    assumed = {(each.group, each.value) for each in variations() if each.change is None}
    for group, variants in sensitivity.items():
        if not variants:
            continue
        title = GROUPS.get(group, group.replace("_", " "))
        caption = f"{title}, {plant}; bold: nearest to the paper; dash: not measurable"
        heads = [
            f">{value}{' (assumed)' if (group, value) in assumed else ''}"
            for value in variants
        ]
        groups = [
            (
                f"{title_of(case)}, {controller}",
                [
                    _variant_row(case, controller, name, variants, experiments)
                    for name in names
                ],
            )
            for (case, controller), names in _cells_of(variants).items()
        ]
        parts.append(
            details(
                title,
                grouped_table(
                    ["Metric", "Unit", ">Paper", *heads], groups, caption, "variants"
                ),
            )
        )
    return "".join(parts) or "<p>No variation was flown.</p>"


def _cells_of(variants: Variants) -> dict[tuple[str, str], dict[str, None]]:
    """Metrics of the flights in which one assumption was changed, all changes together,
    by case and controller.
    """
    cells: dict[tuple[str, str], dict[str, None]] = {}
    for cases in variants.values():
        for case, controllers in cases.items():
            for controller, values in controllers.items():
                cells.setdefault((case, controller), {}).update(dict.fromkeys(values))
    return cells


def _variant_row(
    case: str, controller: str, name: str, variants: Variants, experiments: Experiments
) -> list[Cell]:
    paper = experiments.get(case, {}).get(controller, {}).get(name, {}).get("paper")
    values = [
        cases.get(case, {}).get(controller, {}).get(name) for cases in variants.values()
    ]
    sizes = [relative(value, paper) for value in values]
    distances = [abs(size) for size in sizes if size is not None]
    telling = max(distances, default=0.0) - min(distances, default=0.0) > TELLING
    bold = [
        telling and size is not None and abs(size) == min(distances) for size in sizes
    ]
    cells = [
        number_cell(value, strong=strong)
        for value, strong in zip(values, bold, strict=True)
    ]
    return [
        metric(name).label,
        metric(name).unit,
        _paper_cell(case, controller, name, paper),
        *cells,
    ]


def definitions_table() -> str:
    """HTML table of the definitions of all published metrics."""
    rows = [(m.label, name, m.unit, m.definition) for name, m in METRICS.items()]
    return table(
        ("Metric", "Name", "Unit", "Definition"),
        rows,
        "Definitions; windows are half-open",
        "text",
    )


def markdown_tables(results: Record) -> str:
    """Markdown tables of the published and simulated numbers of all cases."""
    plant = first_plant(results)
    columns = [
        f"{which}: {each}" for which in ("as stated", "inferred") for each in PLANTS
    ]
    head = [
        "metric",
        "unit",
        "",
        "paper",
        *columns,
        "as stated - paper",
        "inferred - paper",
    ]
    blocks = [
        "# Numbers of the paper and of the simulation",
        "\n".join(f"- {words}" for words in verdict(results)),
        f"{sentence(results)} {RULE}",
        (
            "Paper: Barakou, Tzafestas, Valavanis, Drones 2026, 10, 274. Windows,"
            " metrics, assumptions: see report.html.\nMetrics against the held 50 Hz"
            f" reference. Differences: {plant} against the paper, a larger magnitude"
            " is +."
        ),
        ASSUMED,
        INFERRED_SETTINGS,
        (
            f"{REVERSED.format(plant)}"
            f" {_in_a_line(reversed_by_case(results['experiments'], plant))}."
        ),
    ]
    for case, controllers in results["experiments"].items():
        every = dict.fromkeys(chain.from_iterable(controllers.values()))
        rows = []
        for name in (n for n in every if not n.endswith(CONTINUOUS)):
            rows += [
                _row(case, controller, name, cells[name], plant)
                for controller, cells in controllers.items()
                if name in cells
            ]
        blocks += [f"## {title_of(case)}", markdown(head, rows)]
    blocks += ["## What stays open", "\n".join(f"- {line}" for line in OPEN)]
    return "\n\n".join(blocks) + "\n"


def _in_a_line(found: Mapping[str, Sequence[str]]) -> str:
    return (
        "; ".join(f"{case}, {', '.join(names)}" for case, names in found.items())
        or "none"
    )


def _row(case: str, controller: str, name: str, cell: Record, plant: str) -> list[str]:
    paper = published_number(case, controller, name) or "-"
    inferred = cell.get("inferred", {})
    ours = [digits(column.get(each)) for column in (cell, inferred) for each in PLANTS]
    apart = [percent(column.get(plant), cell["paper"]) for column in (cell, inferred)]
    return [metric(name).label, metric(name).unit, controller, paper, *ours, *apart]


LogsOfLaws = Mapping[str, Mapping[str, Log]]
"""case -> law -> log."""

Logs = Mapping[str, LogsOfLaws]
"""plant -> case -> law -> log."""

MAIN = "report.html"
"""File name of the start page."""

TITLE = "The paper on computed torque for a flying arm, reproduced"

CIRCLE = (7.5, 21.0)
"""Interval (s) of the flight whose path is drawn."""


def report_pages(
    results: Record,
    sensitivity: Record,
    logs: Logs,
    pictures: Mapping[str, bytes] | None = None,
    inferred: str = "",
    opening: str = "",
) -> dict[str, str]:
    """HTML pages of the reproduction's report: file name -> document.

    Args:
        results: content of ``results.json``: "experiments" and "settings".
        sensitivity: assumption -> its value -> case -> law -> metric -> number or None.
        logs: plant -> case -> law -> log, for what is said of the flights.
        pictures: name -> PNG: of the paper's figures ("figure_03"), and of each flight
            (:func:`flight_figures`).
        inferred: HTML of the section on inferred settings.
        opening: HTML that the first page opens with.

    Returns:
        File -> a whole HTML document, all in one folder: ``report.html``, then a page
        for each case. Scripts, styles and images are inside; no address is outside the
        folder.
    """
    experiments = results["experiments"]
    plant = first_plant(results)
    drawn = pictures or {}
    files = case_files(experiments)
    sections = [
        ("verdict", "Every count", _counts(results, plant)),
        *([("inferred", "Inferred settings", inferred)] if inferred else []),
        (
            "sensitivity",
            "Sensitivity to assumptions",
            sensitivity_tables(sensitivity, experiments, plant),
        ),
        ("assumptions", "Assumptions", _assumptions()),
        (
            "settings",
            "Settings and versions",
            _episodes(logs) + _settings(results.get("settings", {})),
        ),
    ]
    titles = {
        MAIN: "Overview",
        **{file: short_title(case) for case, file in files.items()},
    }
    style = (resources.files("skyarm.paper") / "report.css").read_text("utf-8")
    footer = (
        f"Format of the results: schema {results.get('schema', 1)}. This page needs no"
        " network."
    )
    make = partial(
        page, style={"": style}, script=page_script(), pages=titles, footer=footer
    )
    pages = {
        MAIN: make(
            TITLE,
            verdict(results),
            name=MAIN,
            lead=prose.LEAD,
            opening=verdict_table(experiments, files, plant) + opening,
            sections=sections,
        )
    }
    for case, file in files.items():
        pages[file] = make(
            title_of(case),
            (),
            name=file,
            lead=prose.CASES.get(case, ""),
            sections=_case_sections(case, experiments[case], logs, drawn, plant),
        )
    return pages


def page_script() -> str:
    """JavaScript of the report's pages, which unfolds all blocks before printing."""
    return (resources.files("skyarm.paper") / "report_print.js").read_text("utf-8")


def _counts(results: Record, plant: str) -> str:
    """HTML section with all counts of agreement, their rule, and the reversed orders of
    the laws.
    """
    experiments = results["experiments"]
    folded = details("Within 25, 10 and 5 %, on both plants", counts_table(experiments))
    return paragraph(RULE) + folded + reversed_list(experiments, plant)


def case_files(cases: Iterable[str]) -> dict[str, str]:
    """File names of the report's case pages, by case."""
    named = file_names([MAIN.removesuffix(".html"), *cases], "", ".html")
    return {case: file for case, file in named.items() if file != MAIN}


def _case_sections(
    case: str, laws: Record, logs: Logs, drawn: Mapping[str, bytes], plant: str
) -> list[tuple[str, str, str]]:
    """Sections of a case's page: plots of its flights, table of its numbers, and
    redrawn figures.
    """
    # figures show the first plant that has flown the case
    flown = next((each for each, cases in logs.items() if cases.get(case)), "")
    flights = _flights(case, drawn, flown)
    redrawn = _paper_figures(case, drawn, plant)
    return [
        *([("flights", "Flights", flights)] if flights else []),
        ("numbers", "Numbers", experiment_table(case, laws)),
        *([("figures", "The paper's figures", redrawn)] if redrawn else []),
    ]


def _kinds(case: str) -> dict[str, str]:
    """Kinds of plots of a case's flights, each with its words."""
    kinds = {"tracking": "base and joints", "tip": "tip and its error"}
    # Case 3 alone flies a path; elsewhere the base hovers
    return kinds | {"path": "path of the tip"} if case == "case3" else kinds


def flight_figures(
    logs: LogsOfLaws,
) -> dict[str, Callable[[], Picture]]:
    """Functions that make the figures of a plant's flights over time, by name: base,
    joints and tip in each case.

    Args:
        logs: case -> law -> log.
    """
    return {
        f"{case}_{kind}": partial(
            flight_plot, laws, kind=kind, window=CIRCLE if kind == "path" else None
        )
        for case, laws in logs.items()
        for kind in _kinds(case)
    }


def _flights(case: str, drawn: Mapping[str, bytes], plant: str) -> str:
    """HTML plots of a case's flights over time; empty without any."""
    images = ""
    for kind, words in _kinds(case).items():
        png = drawn.get(f"{case}_{kind}")
        if png is not None:
            caption = f"{title_of(case)}: {words}, desired and flown, on {plant}."
            images += image(caption, caption, png, wide=kind == "path")
    return images


def _paper_figures(case: str, drawn: Mapping[str, bytes], plant: str) -> str:
    """HTML section with a case's published figures, redrawn from simulated flights;
    empty without any.
    """
    parts = []
    for number, spec in sorted(PAPER_CATALOGUE.items()):
        png = drawn.get(figure_name(number))
        if spec.case == case and png is not None:
            caption = f"Figure {number}. {spec.caption}"
            parts.append(
                image(caption, caption, png, name=f"figure-{number}", kind="figure")
            )
    note = paragraph(
        f"Layout of the paper, {plant} plant. {prose.LOOK} {prose.HOLDS}", "note"
    )
    return f'{note}<div class="paper">{"".join(parts)}</div>' if parts else ""


def figure_name(number: int) -> str:
    """Name of a redrawn figure's picture and file, by the paper's number."""
    return f"figure_{number:02d}"


def _assumptions() -> str:
    folded = {
        "Everything that is assumed": bullets(prose.ASSUMPTIONS),
        "What is not modelled": bullets(prose.NOT_MODELLED),
        "Definitions of the metrics": definitions_table(),
    }
    return paragraph(prose.READING) + "".join(
        details(title, content) for title, content in folded.items()
    )


def _episodes(logs: Logs) -> str:
    flown = []
    for plant, cases in logs.items():
        for case, laws in cases.items():
            title = f"{plant}, {title_of(case)}"
            flown += [(f"{title}, {law}", log) for law, log in laws.items()]
    if not flown:
        return ""
    ended = [(name, log) for name, log in flown if log.status != "completed"]
    lines = [
        f"{name}: {log.status} at {log.info['end_time']:g} s, {log.info['cause']}"
        for name, log in ended
    ]
    summary = paragraph(
        f"{len(ended)} of {len(flown)} episodes ended early:"
    ) + bullets(lines)
    if not ended:
        summary = paragraph(f"All {len(flown)} episodes flew to their end.")
    lacking = [f"{name}: {line}" for name, log in flown for line in log.shortfall.lines]
    return summary + (paragraph("They lacked:") + bullets(lacking) if lacking else "")


def _settings(settings: Record) -> str:
    return details(
        "Everything the numbers depend on",
        table(("Name", "Value"), _flat(settings, ""), "Settings", "text"),
    )


def _flat(settings: Record, prefix: str) -> Iterable[tuple[str, str]]:
    """Flatten nested settings to dotted names with text values."""
    for name, value in settings.items():
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield (
                f"{prefix}{name}",
                ("none" if value is None or value in ([], {}) else str(value)),
            )


def inferred_section(
    results: Record, predicted: Record, evidence: Record, plant: str
) -> str:
    """HTML section on the inferred settings and their predictions, with the evidence
    tables collapsed.
    """
    opened = [settings_table(evidence), prediction_table(results, predicted, plant)]
    folded = {
        "Ladder: one setting after the other": [ladder_table(evidence)],
        "Choices taken otherwise": [choices_table(evidence)],
        "Loss over each number": profile_tables(evidence),
        "Rivals": [rivals_table(evidence)],
    }
    parts = [paragraph(prose.INFERRED)]
    parts += (
        [] if is_of_this_study(evidence) else [paragraph(prose.OTHER_STUDY, "note")]
    )
    parts += [each.html() for each in opened]
    parts += [
        details(title, "".join(each.html() for each in tables))
        for title, tables in folded.items()
    ]
    return "".join([*parts, details("What stays open", bullets(prose.OPEN))])
