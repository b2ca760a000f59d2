"""The tables of the report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.paper.agreement import difference, reversed_orders
from skyarm.paper.flights import CONTINUOUS
from skyarm.paper.published import TITLES, printed, said
from skyarm.paper.reasons import HEADING
from skyarm.paper.report.report_headlines import CLAIMS, Experiments, claim_row, order_row
from skyarm.paper.report.report_markup import (
    DASH,
    FAIR,
    NEAR,
    bound_cell,
    details,
    difference_cell,
    number_cell,
    table,
    text,
    typographic,
)
from skyarm.paper.report.report_metrics import METRICS, metric
from skyarm.paper.variations import GROUPS, variations
from skyarm.scenario.scenario_record import PLANTS

Cells = Mapping[str, Mapping[str, Any]]
Measured = Mapping[str, Mapping[str, Mapping[str, Any]]]
Variants = Mapping[str, Measured]

CONTROLLERS = {"CT": "CT: hybrid geometric computed torque", "PD": "PD: decoupled baseline"}
TELLING = 0.02
"""Spread of relative differences below which no variant is called the nearest."""
VERDICT_CAPTION = (
    "Headline numbers against accepted ranges, which are this project's own: an earlier, independent prototype reached "
    "them with the same assumptions"
)
MAIN_METRICS = (
    *("position_error_mean", "position_error_max", "held_position_error", "ee_error_mean", "ee_error_max"),
    *("joint_error_mean", "joint_error_max", "peak_x", "pitch_rms", "pitch_mean", "peak_pitch", "tau1_rms"),
    *("iae_position", "hover_offset"),
)
"""In the first table of a case's page, as far as the case has them; all others are folded below it."""

KEY_METRICS = ("position_error_mean", "ee_error_mean", "pitch_rms", "joint_error_mean", "tau1_rms")


def headline_table(experiments: Experiments) -> str:
    """Verdicts on the headline numbers."""
    head = ["Claim", "Unit", ">Paper", ">Accepted", ">rigid_body", "Verdict", ">mujoco", "Verdict"]
    rows = [*(claim_row(claim, experiments) for claim in CLAIMS), order_row(experiments)]
    return table(VERDICT_CAPTION, head, [("", rows)], "verdicts")


def reversed_table(experiments: Experiments, plant: str) -> str:
    """Where the law that is better in the paper is the worse one here, folded; a sentence where there is none."""
    rows = []
    for case, name in reversed_orders(experiments, plant):
        ct, pd = (experiments[case][controller][name] for controller in ("CT", "PD"))
        title = f"{TITLES.get(case, case)}: {metric(name).label}"
        values = [number_cell(each.get(column)) for column in ("paper", plant) for each in (ct, pd)]
        rows.append("".join([f'<th scope="row">{text(title)}</th>', f"<td>{text(metric(name).unit)}</td>", *values]))
    head = ["Metric", "Unit", ">Paper CT", ">Paper PD", f">{plant} CT", f">{plant} PD"]
    if not rows:
        return f"<p>In no metric is the better law of the paper the worse one here ({text(plant)}).</p>"
    summary = (
        f"Not reproduced: {len(rows)} metrics in which the better law of the paper is the worse one here ({plant})"
    )
    return details(summary, table(f"The paper and {text(plant)}, both laws", head, [("", rows)], "reversed"))


def near_counts(laws: Mapping[str, Cells], plant: str) -> tuple[int, int, int]:
    """Published numbers of a case that a plant comes near: (within 5 %, within 20 %, compared)."""
    found = [difference(cell.get(plant), cell.get("paper")) for cells in laws.values() for cell in cells.values()]
    sizes = [abs(value) for value in found if value is not None]
    near, fair = (sum(size <= limit for size in sizes) for limit in (NEAR, FAIR))
    return near, fair, len(sizes)


def summary_table(experiments: Experiments, files: Mapping[str, str]) -> str:
    """How many of the paper's numbers each plant comes near; each case leads to its page, which ``files`` names."""
    rows = []
    for case, laws in experiments.items():
        cells = [f'<th scope="row"><a href="{text(files[case])}">{text(TITLES.get(case, case))}</a></th>']
        for plant in PLANTS:
            counts = near_counts(laws, plant)
            cells += [f'<td class="num">{count if counts[-1] else DASH}</td>' for count in counts]
        rows.append("".join(cells))
    head = [
        "Case",
        *(f">{plant}: {label}" for plant in PLANTS for label in ("within 5 %", "within 20 %", "compared")),
    ]
    return table("How many published numbers lie near ours; each case has a page", head, [("", rows)], "summary")


def main_numbers_table(case: str, laws: Mapping[str, Cells], plant: str) -> str:
    """The numbers of a case that one asks for first, both laws side by side, as stated."""
    names = [name for name in MAIN_METRICS if any(name in cells for cells in laws.values())]
    head = ["Metric", "Unit", *(f">{law} {what}" for law in laws for what in ("paper", "ours", "- paper"))]
    rows = []
    for name in names:
        meant = metric(name)
        cells = [f'<th scope="row">{text(meant.label)}</th><td class="unit">{text(meant.unit)}</td>']
        for law, found in laws.items():
            cell = found.get(name, {})
            paper, ours = cell.get("paper"), cell.get(plant)
            cells += [_paper_cell(case, law, name, paper), number_cell(ours), difference_cell(ours, paper)]
        rows.append("".join(cells))
    caption = f"{text(TITLES.get(case, case))}: main numbers, {text(plant)}, as stated"
    return table(caption, head, [("", rows)], "main") if rows else ""


def experiment_table(case: str, controllers: Mapping[str, Cells], reasons: Mapping[str, Mapping[str, str]]) -> str:
    """Everything measured in one experiment; the twins against the continuous reference are collapsed."""
    head = [
        "Metric",
        "Unit",
        ">Paper",
        ">as stated: rigid_body",
        ">mujoco",
        ">rigid_body - paper",
        ">mujoco - paper",
        ">inferred: rigid_body",
        ">mujoco",
        ">inferred rigid_body - paper",
        HEADING.capitalize(),
    ]
    held: list[tuple[str, list[str]]] = []
    twins: list[tuple[str, list[str]]] = []
    for controller, cells in controllers.items():
        why = reasons.get(controller, {})
        rows = {name: _metric_row(case, controller, name, cell, why.get(name, "")) for name, cell in cells.items()}
        title = CONTROLLERS.get(controller, controller)
        held.append((title, [row for name, row in rows.items() if not name.endswith(CONTINUOUS)]))
        twins.append((title, [row for name, row in rows.items() if name.endswith(CONTINUOUS)]))
    title = text(TITLES.get(case, case))
    page = table(f"{title}: errors against the held 50 Hz reference", head, held, "wide")
    if any(rows for _, rows in twins):
        inner = table(f"{title}: errors against the continuous reference", head, twins, "wide")
        page += details("The same against the continuous reference", inner)
    return page


def _metric_row(case: str, controller: str, name: str, cell: Mapping[str, Any], why: str) -> str:
    meant, paper = metric(name), cell.get("paper")
    label = f'<th scope="row"><abbr title="{text(meant.definition or name)}">{text(meant.label)}</abbr></th>'
    compare = bound_cell if meant.bound else difference_cell
    cells = [label, f'<td class="unit">{text(meant.unit)}</td>', _paper_cell(case, controller, name, paper)]
    cells += [number_cell(cell.get(plant)) for plant in PLANTS]
    cells += [compare(cell.get(plant), paper) for plant in PLANTS]
    found = cell.get("inferred", {})
    cells += [number_cell(found.get(plant)) for plant in PLANTS] + [compare(found.get(PLANTS[0]), paper)]
    return "".join([*cells, f'<td class="why">{text(why)}</td>'])


def _paper_cell(case: str, controller: str, name: str, paper: Any) -> str:
    """The published number with the digits it was printed with."""
    if paper is None and said(case, controller, name):
        return f'<td class="num">{typographic(said(case, controller, name))}</td>'
    written = printed(case, controller, name)
    return number_cell(paper, written=written if written and float(written) == paper else "")


def sensitivity_tables(sensitivity: Mapping[str, Variants], experiments: Experiments, plant: str) -> str:
    """Two folded tables per assumption varied on a plant: the key metrics, and everything else."""
    parts = []
    assumed = {each.group: each.value for each in variations() if each.assumed}
    for group, variants in sensitivity.items():
        if not variants:
            continue
        title = GROUPS.get(group, group.replace("_", " "))
        caption = f"{text(title)}, {text(plant)}; <strong>bold</strong>: nearest to the paper; dash: not measurable"
        own = assumed.get(group, "")
        key, rest = (_variant_table(caption, own, variants, experiments, key=key) for key in (True, False))
        parts.append(details(title, key + details("Other metrics", rest)))
    return "".join(parts) or "<p>No variation was flown.</p>"


def _variant_table(caption: str, assumed: str, variants: Variants, experiments: Experiments, *, key: bool) -> str:
    heads = [f">{name} (assumed)" if name == assumed else f">{name}" for name in variants]
    groups = []
    for case, controller, names in _cells_of(variants):
        chosen = [n for n in names if n in KEY_METRICS] if key else [n for n in names if n not in KEY_METRICS]
        rows = [_variant_row(case, controller, name, variants, experiments) for name in chosen]
        if rows:
            groups.append((f"{TITLES.get(case, case)}, {controller}", rows))
    return table(caption, ["Metric", "Unit", ">Paper", *heads], groups, "variants")


def _cells_of(variants: Variants) -> list[tuple[str, str, list[str]]]:
    """(case, controller, metrics) in order of first appearance."""
    found: dict[tuple[str, str], dict[str, None]] = {}
    for cases in variants.values():
        for case, controllers in cases.items():
            for controller, values in controllers.items():
                found.setdefault((case, controller), {}).update(dict.fromkeys(values))
    return [(case, controller, list(names)) for (case, controller), names in found.items()]


def _variant_row(case: str, controller: str, name: str, variants: Variants, experiments: Experiments) -> str:
    meant = metric(name)
    paper = experiments.get(case, {}).get(controller, {}).get(name, {}).get("paper")
    values = [cases.get(case, {}).get(controller, {}).get(name) for cases in variants.values()]
    distances = [abs(size) for value in values if (size := difference(value, paper)) is not None]
    nearest, farthest = min(distances, default=0.0), max(distances, default=0.0)
    cells = [f'<th scope="row">{text(meant.label)}</th><td class="unit">{text(meant.unit)}</td>']
    cells.append(_paper_cell(case, controller, name, paper))
    for value in values:
        size = difference(value, paper)
        telling = farthest - nearest > TELLING
        mark = "strong" if telling and size is not None and abs(size) == nearest else ""
        cells.append(number_cell(value, mark=mark))
    return "".join(cells)


def definitions_table() -> str:
    """Definitions of every metric."""
    rows = [
        f'<th scope="row">{text(m.label)}</th><td><code>{text(name)}</code></td><td>{text(m.unit)}</td>'
        f"<td>{text(m.definition)}</td>"
        for name, m in METRICS.items()
    ]
    return table("Definitions; windows are half-open", ["Metric", "Name", "Unit", "Definition"], [("", rows)], "text")
