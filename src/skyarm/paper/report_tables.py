"""The tables of the reproduction: paper and ours, with their differences and what they may come from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from skyarm.paper.counted_cells import RULE, counts, inferred_value, sentence, stated_value
from skyarm.paper.flights import first_plant
from skyarm.paper.published import (
    CLAIMS,
    CONTINUOUS,
    METRICS,
    TITLES,
    Experiments,
    Number,
    count_ordered,
    digits,
    finite_or_none,
    metric,
    percent,
    printed_number,
    published_number,
    relative,
    reversed_orders,
)
from skyarm.paper.reasons import HEADING, Reasons
from skyarm.paper.report_text import ASSUMED, INFERRED_SETTINGS, OPEN
from skyarm.paper.variations import GROUPS, variations
from skyarm.scenario.scenario_record import PLANTS
from skyarm.view.pages import Mark, details, grouped_table, markdown, table

Cells = Mapping[str, Mapping[str, Any]]
Cell = str | Mark
Variants = Mapping[str, Experiments]

DASH, MINUS = "\N{EN DASH}", "\N{MINUS SIGN}"
NEAR, FAIR = 0.05, 0.20
"""Relative differences up to which a value counts as near and as fair."""

SIGNS = {"near": ("\N{BLACK CIRCLE}", "within 5 %"), "fair": ("\N{CIRCLE WITH LEFT HALF BLACK}", "within 20 %"),
         "far": ("\N{WHITE CIRCLE}", "beyond 20 %")}  # fmt: skip
"""Grade -> symbol and words, so that the tint is never the only sign."""

VERDICTS = {
    True: Mark(text="\N{CHECK MARK} within", grade="pass"),
    False: Mark(text="\N{BALLOT X} outside", grade="miss"),
    None: Mark(text=DASH, grade="none"),
}

CONTROLLERS = {"CT": "CT: hybrid geometric computed torque", "PD": "PD: decoupled baseline"}
TELLING = 0.02
"""Spread of relative differences below which no variant is called the nearest."""

MAIN_METRICS = (
    *("position_error_mean", "position_error_max", "held_position_error", "ee_error_mean", "ee_error_max"),
    *("joint_error_mean", "joint_error_max", "peak_x", "pitch_rms", "pitch_mean", "peak_pitch", "tau1_rms"),
    *("iae_position", "hover_offset"),
)
"""In the first table of a case's page, as far as the case has them; all others are folded below it."""


def typographic(written: str) -> str:
    """A written number with a typographic minus."""
    return written.replace("-", MINUS)


def number_cell(value: Number, *, written: str = "", strong: bool = False) -> Mark:
    """A number as written, or rounded for reading; whole for machines. A dash if it is missing or not finite."""
    finite = finite_or_none(value)
    if finite is None:
        return Mark(text=DASH, grade="none")
    return Mark(text=typographic(written or digits(finite)), value=value, strong=strong)


def _mark(text: str, grade: str, words: str = "") -> Mark:
    symbol, usual = SIGNS[grade]
    return Mark(text=text, grade=grade, sign=symbol, words=words or usual)


def difference_cell(ours: Number, paper: Number) -> Mark:
    """A relative difference in percent, graded by how near it is."""
    size = relative(ours, paper)
    if size is None:
        return Mark(text=DASH, grade="none")
    grade = "near" if abs(size) <= NEAR else "fair" if abs(size) <= FAIR else "far"
    return _mark(typographic(percent(ours, paper)).replace(" ", "\N{NO-BREAK SPACE}"), grade)


def bound_cell(ours: Number, paper: Number) -> Mark:
    """The verdict on a number of which the paper states an upper bound only."""
    value, bound = finite_or_none(ours), finite_or_none(paper)
    if value is None or bound is None:
        return Mark(text=DASH, grade="none")
    return _mark("below", "near", "met") if value <= bound else _mark("above", "far", "not met")


def _paper_cell(case: str, controller: str, name: str, paper: Any) -> Cell:
    """The published number with the digits it was printed with."""
    if paper is None and published_number(case, controller, name):
        return typographic(published_number(case, controller, name))
    written = printed_number(case, controller, name)
    return number_cell(paper, written=written if written and float(written) == paper else "")


def title_of(case: str) -> str:
    """The title of a case; its name for a case outside the paper."""
    return TITLES.get(case, case)


def headline_table(experiments: Experiments) -> str:
    """Verdicts on the headline numbers."""
    rows = []
    for claim in CLAIMS:
        paper = dict.fromkeys(filter(None, (printed_number(*cell, claim.name) for cell in claim.cells)))
        row: list[Cell] = [
            claim.title,
            metric(claim.name).unit,
            typographic(" \N{HORIZONTAL ELLIPSIS} ".join(paper)) or DASH,
        ]
        row.append(_span([claim.low, claim.high]))
        for plant in PLANTS:
            row += [_span(claim.values(experiments, plant)), VERDICTS[claim.meets(experiments, plant)]]
        rows.append(row)
    row = ["CT below PD in every mean error of base and tip, and in Cases 2 and 3 in pitch", "", DASH, "all"]
    for plant in PLANTS:
        count, total = count_ordered(experiments, plant)
        row += [f"{count} of {total}" if total else DASH, VERDICTS[count == total if total else None]]
    head = ["Claim", "Unit", ">Paper", ">Accepted", *(each for plant in PLANTS for each in (f">{plant}", "Verdict"))]
    caption = (
        "Headline numbers against accepted ranges, which are this project's own: an earlier, independent prototype "
        "reached them with the same assumptions"
    )
    return table(head, [*rows, row], caption, "verdicts")


def _span(values: Sequence[float]) -> str:
    """One number if all look alike, else smallest to largest."""
    ends = dict.fromkeys(typographic(digits(value)) for value in (min(values), max(values))) if values else {}
    return " \N{HORIZONTAL ELLIPSIS} ".join(ends) or DASH


def not_reproduced(experiments: Experiments, plant: str) -> str:
    """Metrics in which the better law of the paper is the worse one here."""
    pairs = reversed_orders(experiments, plant)
    named = "; ".join(f"{title_of(case).split(':')[0]} {name}" for case, name in pairs) or "nothing"
    return f"Not reproduced, the better controller of the paper is the worse one here ({plant}): {named}."


def near_counts(laws: Mapping[str, Cells], plant: str) -> tuple[int, int, int]:
    """Published numbers of a case that a plant comes near: (within 5 %, within 20 %, compared)."""
    found = [relative(cell.get(plant), cell.get("paper")) for cells in laws.values() for cell in cells.values()]
    sizes = [abs(value) for value in found if value is not None]
    near, fair = (sum(size <= limit for size in sizes) for limit in (NEAR, FAIR))
    return near, fair, len(sizes)


def summary_table(experiments: Experiments, files: Mapping[str, str]) -> str:
    """Number of the paper's values that each plant comes near; each case leads to its page, which ``files`` names."""
    rows = []
    for case, laws in experiments.items():
        found = [near_counts(laws, plant) for plant in PLANTS]
        counted = [str(count) if each[-1] else DASH for each in found for count in each]
        rows.append([Mark(text=title_of(case), href=files[case]), *counted])
    labels = ("within 5 %", "within 20 %", "compared")
    head = ["Case", *(f">{plant}: {label}" for plant in PLANTS for label in labels)]
    return table(head, rows, "How many published numbers lie near ours; each case has a page", "summary")


def counts_table(results: Mapping[str, Any]) -> str:
    """Cells near the paper's by column, plant and law."""
    experiments, facts = results.get("experiments", {}), results.get("settings", {}).get("inferred", {})
    rows = []
    for title, column_of, free in (
        ("as stated", stated_value, "0 numbers, 0 choices"),
        ("inferred", inferred_value, f"{facts.get('numbers', '-')} numbers, {facts.get('choices', '-')} choices"),
    ):
        for plant in PLANTS:
            for law in ("PD", "CT", ""):
                found = counts(experiments, column_of(plant), _of_law(law))
                if found:
                    near = (str(found[f"within_{share}%"]) for share in (5, 10, 25))
                    rows.append((title, plant, law or "both", free, *near, str(found["cells"])))
    head = ("column", "plant", "law", "free", ">within 5 %", ">within 10 %", ">within 25 %", ">of")
    return table(head, rows, "How many of the paper's numeric cells each column comes near", "text")


def _of_law(law: str) -> Callable[[Any], bool]:
    return lambda cell: bool(cell.flight.endswith(law))


def main_numbers_table(case: str, laws: Mapping[str, Cells], plant: str) -> str:
    """The most important numbers of a case, both laws side by side, as stated."""
    rows = []
    for name in MAIN_METRICS:
        if any(name in cells for cells in laws.values()):
            row: list[Cell] = [metric(name).label, metric(name).unit]
            for law, found in laws.items():
                cell = found.get(name, {})
                paper, ours = cell.get("paper"), cell.get(plant)
                row += [_paper_cell(case, law, name, paper), number_cell(ours), difference_cell(ours, paper)]
            rows.append(row)
    head = ["Metric", "Unit", *(f">{law} {what}" for law in laws for what in ("paper", "ours", "- paper"))]
    return table(head, rows, f"{title_of(case)}: main numbers, {plant}, as stated", "main") if rows else ""


def experiment_table(case: str, controllers: Mapping[str, Cells], reasons: Mapping[str, Mapping[str, str]]) -> str:
    """Everything measured in one experiment; the twins against the continuous reference are collapsed."""
    head = [
        *("Metric", "Unit", ">Paper", ">as stated: rigid_body", ">mujoco", ">rigid_body - paper", ">mujoco - paper"),
        *(">inferred: rigid_body", ">mujoco", ">inferred rigid_body - paper", HEADING.capitalize()),
    ]

    def groups(*, twins: bool) -> list[tuple[str, list[list[Cell]]]]:
        found = []
        for law, cells in controllers.items():
            names = [name for name in cells if name.endswith(CONTINUOUS) == twins]
            why = reasons.get(law, {})
            rows = [_metric_row(case, law, name, cells[name], why.get(name, "")) for name in names]
            found.append((CONTROLLERS.get(law, law), rows))
        return found

    title = title_of(case)
    page = grouped_table(head, groups(twins=False), f"{title}: errors against the held 50 Hz reference", "wide")
    twins = groups(twins=True)
    if any(rows for _, rows in twins):
        inner = grouped_table(head, twins, f"{title}: errors against the continuous reference", "wide")
        page += details("The same against the continuous reference", inner)
    return page


def _metric_row(case: str, controller: str, name: str, cell: Mapping[str, Any], why: str) -> list[Cell]:
    meant, paper, found = metric(name), cell.get("paper"), cell.get("inferred", {})
    compare = bound_cell if meant.bound else difference_cell
    return [
        Mark(text=meant.label, title=meant.definition or name),
        meant.unit,
        _paper_cell(case, controller, name, paper),
        *(number_cell(cell.get(plant)) for plant in PLANTS),
        *(compare(cell.get(plant), paper) for plant in PLANTS),
        *(number_cell(found.get(plant)) for plant in PLANTS),
        compare(found.get(PLANTS[0]), paper),
        Mark(text=why, grade="why"),
    ]


def sensitivity_tables(sensitivity: Mapping[str, Variants], experiments: Experiments, plant: str) -> str:
    """A folded table for each assumption varied on a plant."""
    parts = []
    assumed = {(each.group, each.value) for each in variations() if each.is_assumption}
    for group, variants in sensitivity.items():
        if not variants:
            continue
        title = GROUPS.get(group, group.replace("_", " "))
        caption = f"{title}, {plant}; bold: nearest to the paper; dash: not measurable"
        heads = [f">{value}{' (assumed)' if (group, value) in assumed else ''}" for value in variants]
        groups = [
            (
                f"{title_of(case)}, {controller}",
                [_variant_row(case, controller, name, variants, experiments) for name in names],
            )
            for (case, controller), names in _cells_of(variants).items()
        ]
        parts.append(details(title, grouped_table(["Metric", "Unit", ">Paper", *heads], groups, caption, "variants")))
    return "".join(parts) or "<p>No variation was flown.</p>"


def _cells_of(variants: Variants) -> dict[tuple[str, str], dict[str, None]]:
    """(case, controller) -> metrics, in order of first appearance."""
    found: dict[tuple[str, str], dict[str, None]] = {}
    for cases in variants.values():
        for case, controllers in cases.items():
            for controller, values in controllers.items():
                found.setdefault((case, controller), {}).update(dict.fromkeys(values))
    return found


def _variant_row(case: str, controller: str, name: str, variants: Variants, experiments: Experiments) -> list[Cell]:
    paper = experiments.get(case, {}).get(controller, {}).get(name, {}).get("paper")
    values: list[Any] = [cases.get(case, {}).get(controller, {}).get(name) for cases in variants.values()]
    sizes = [relative(value, paper) for value in values]
    distances = [abs(size) for size in sizes if size is not None]
    telling = max(distances, default=0.0) - min(distances, default=0.0) > TELLING
    bold = [telling and size is not None and abs(size) == min(distances) for size in sizes]
    cells = [number_cell(value, strong=strong) for value, strong in zip(values, bold, strict=True)]
    return [metric(name).label, metric(name).unit, _paper_cell(case, controller, name, paper), *cells]


def definitions_table() -> str:
    """Definitions of every metric."""
    rows = [(m.label, name, m.unit, m.definition) for name, m in METRICS.items()]
    return table(("Metric", "Name", "Unit", "Definition"), rows, "Definitions; windows are half-open", "text")


def markdown_tables(results: Mapping[str, Any], reasons: Reasons) -> str:
    """All experiments, one table each."""
    plant = first_plant(results)
    columns = [f"{which}: {each}" for which in ("as stated", "inferred") for each in PLANTS]
    head = ["metric", "unit", "", "paper", *columns, "as stated - paper", "inferred - paper", HEADING]
    blocks = [
        "# Paper and ours",
        f"{sentence(results)} {RULE}",
        "Paper: Barakou, Tzafestas, Valavanis, Drones 2026, 10, 274. Windows, metrics, assumptions: see report.html.\n"
        f"Metrics against the held 50 Hz reference. Differences: {plant} against the paper, a larger magnitude is +.",
        ASSUMED,
        INFERRED_SETTINGS,
        not_reproduced(results["experiments"], plant),
    ]
    for case, controllers in results["experiments"].items():
        names = [n for n in dict.fromkeys(n for c in controllers.values() for n in c) if not n.endswith(CONTINUOUS)]
        rows = [
            _row(case, controller, name, cells[name], plant, reasons.get(case, {}).get(controller, {}).get(name, ""))
            for name in names
            for controller, cells in controllers.items()
            if name in cells
        ]
        blocks += [f"## {title_of(case)}", markdown(head, rows)]
    blocks += ["## What stays open", "\n".join(f"- {line}" for line in OPEN)]
    return "\n\n".join(blocks) + "\n"


def _row(case: str, controller: str, name: str, cell: Mapping[str, Any], plant: str, why: str) -> list[str]:
    paper, found = published_number(case, controller, name) or "-", cell.get("inferred", {})
    ours = [digits(column.get(each)) for column in (cell, found) for each in PLANTS]
    apart = [percent(column.get(plant), cell["paper"]) for column in (cell, found)]
    return [
        name,
        metric(name).unit,
        controller,
        paper,
        *ours,
        *apart,
        why.replace("|", "\\|"),
    ]  # |e_p| would end the cell


SHORT = (
    ("case2", "hover_offset", "height offset in hover"),
    ("case1", "held_position_error", "Case 1, position while the arm is held"),
    ("case2", "position_error_mean", "Case 2, position mean"),
    ("case2", "pitch_rms", "Case 2, pitch RMS"),
    ("case2", "joint_error_mean", "Case 2, joint error mean (as stated: order reversed)"),
    ("case3", "position_error_mean", "Case 3, position mean"),
    ("case3", "ee_error_mean", "Case 3, tip mean"),
    ("case3", "joint_error_mean", "Case 3, joint error mean (as stated: order reversed)"),
    ("case2_gust", "peak_x", "Case 2 gust, peak along x"),
    ("case3_wind", "position_error_mean", "Case 3 wind, position mean"),
    ("case3_wind", "ee_error_mean", "Case 3 wind, tip mean"),
    ("case3_wind", "ee_error_max", "Case 3 wind, tip max"),
)
"""Rows of the short table of docs/the_paper.md: case, metric, words."""


def short_markdown(results: Mapping[str, Any]) -> str:
    """The short table: paper, as stated and inferred, each rigid_body / mujoco, for CT and PD."""
    rows = []
    for case, name, words in SHORT:
        row = [words, metric(name).unit]
        for controller in ("CT", "PD"):
            cell = results["experiments"][case][controller][name]
            row.append(published_number(case, controller, name) or "-")
            row += [" / ".join(digits(each.get(plant)) for plant in PLANTS) for each in (cell, cell["inferred"])]
        rows.append(row)
    head = ["", "unit", *(f"{law} {what}" for law in ("CT", "PD") for what in ("paper", "as stated", "inferred"))]
    return f"{markdown(head, rows)}\n\nEach {' / '.join(PLANTS)} plant."
