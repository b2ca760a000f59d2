"""Table 2 and the section 5 numbers as Markdown: paper, ours on both plants, difference, reason."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.paper import agreement as compare
from skyarm.paper.counted_cells import RULE, sentence
from skyarm.paper.flights import CONTINUOUS, first_plant
from skyarm.paper.impossible import impossible
from skyarm.paper.published import TITLES, said
from skyarm.paper.reasons import HEADING, Reasons
from skyarm.paper.report.report_metrics import metric
from skyarm.scenario.scenario_record import PLANTS

ASSUMED = (
    "Assumed, since the paper does not say: commands reach rotors and joints without latency (RotorS has about three "
    "physics steps); joint damping of 0.001 N m s/rad on both joints; linear ramps in Case 1."
)


INFERRED_SETTINGS = (
    "Inferred: settings that the paper does not give, searched for so that its numbers come out, the same for every "
    "flight; inference.md has them, the evidence for each, and what they predict of flights they have not seen."
)


def number(value: float | None) -> str:
    """Three significant digits, or a dash."""
    return "-" if value is None else compare.digits(value)


def difference(cell: Mapping[str, Any], plant: str) -> str:
    """Relative difference of a plant from the paper in percent; "" where there is none."""
    relative = compare.difference(cell.get(plant), cell["paper"])
    return "" if relative is None else compare.percent(relative)


def markdown(results: Mapping[str, Any], reasons: Reasons) -> str:
    """All experiments, one table each."""
    plant = first_plant(results)
    columns = " | ".join(f"{which}: {each}" for which in ("as stated", "inferred") for each in PLANTS)
    head = f"| metric | unit | | paper | {columns} | as stated - paper | inferred - paper | {HEADING} |"
    lines = [
        "# Paper and ours",
        "",
        f"{sentence(results)} {RULE}",
        "",
        "Paper: Barakou, Tzafestas, Valavanis, Drones 2026, 10, 274. Windows, metrics, assumptions: see report.html.",
        f"Metrics against the held 50 Hz reference. Differences: {plant} against the paper, a larger magnitude is +.",
        "",
        ASSUMED,
        "",
        INFERRED_SETTINGS,
        "",
        _reversals(results, plant),
    ]
    for case, controllers in results["experiments"].items():
        lines += ["", f"## {TITLES[case]}", "", head, "|---" * 11 + "|"]
        names = [n for n in dict.fromkeys(n for c in controllers.values() for n in c) if not n.endswith(CONTINUOUS)]
        for name in names:
            for controller, cells in controllers.items():
                if name in cells:
                    why = reasons.get(case, {}).get(controller, {}).get(name, "")
                    lines.append(_row(case, controller, name, cells[name], plant, why))
    lines += ["", "## What stays open", "", *(f"- {line}" for line in impossible(results, plant))]
    return "\n".join([*lines, ""])


def _reversals(results: Mapping[str, Any], plant: str) -> str:
    """One line that names where the paper's order of CT and PD comes out the other way."""
    pairs = compare.reversed_orders(results["experiments"], plant)
    named = "; ".join(f"{TITLES[case].split(':')[0]} {name}" for case, name in pairs)
    return f"Not reproduced, the better controller of the paper is the worse one here ({plant}): {named or 'nothing'}."


def _row(case: str, controller: str, name: str, cell: Mapping[str, Any], plant: str, why: str) -> str:
    paper, found = said(case, controller, name) or "-", cell.get("inferred", {})
    ours = " | ".join(number(value) for column in (cell, found) for value in (column.get(each) for each in PLANTS))
    apart = f"{difference(cell, plant)} | {difference({**found, 'paper': cell['paper']}, plant)}"
    escaped = why.replace("|", "\\|")  # |e_p| would end the cell
    return f"| {name} | {metric(name).unit} | {controller} | {paper} | {ours} | {apart} | {escaped} |"


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
"""Rows of the README's table: case, metric, words."""


def short_markdown(results: Mapping[str, Any]) -> str:
    """The README's table: paper, as stated and inferred, each rigid_body / mujoco, for CT and PD."""
    names = [f"{law} {what}" for law in ("CT", "PD") for what in ("paper", "as stated", "inferred")]
    lines = [f"| | unit | {' | '.join(names)} |", "|---" * 8 + "|"]
    for case, name, words in SHORT:
        row = [words, metric(name).unit]
        for controller in ("CT", "PD"):
            cell = results["experiments"][case][controller][name]
            row.append(said(case, controller, name) or "-")
            row += [" / ".join(number(each.get(plant)) for plant in PLANTS) for each in (cell, cell["inferred"])]
        lines.append(f"| {' | '.join(row)} |")
    lines += ["", f"Each {' / '.join(PLANTS)} plant."]
    return "\n".join(lines)
