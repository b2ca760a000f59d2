"""Table 2 and the section 5 numbers as Markdown: paper, ours on both plants, difference, reason."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.experiments import compare
from skyarm.experiments.paper import CONTINUOUS, first_plant
from skyarm.experiments.published import TITLES, printed
from skyarm.experiments.reasons import HEADING, Reasons
from skyarm.experiments.report_metrics import metric
from skyarm.simulate.scenario import PLANTS

ASSUMED = (
    "Assumed, since the paper does not say: commands reach rotors and joints without latency (RotorS has about three "
    "physics steps); joint damping of 0.001 N m s/rad on both joints; linear ramps in Case 1."
)


def number(value: float | None) -> str:
    """Three significant digits, or a dash."""
    return "-" if value is None else compare.digits(value)


def difference(cell: Mapping[str, Any], plant: str) -> str:
    """Relative difference of a plant from the paper in percent; "" where there is none."""
    relative = compare.difference(cell[plant], cell["paper"])
    return "" if relative is None else compare.percent(relative)


def markdown(results: Mapping[str, Any], reasons: Reasons) -> str:
    """All experiments, one table each."""
    plant = first_plant(results)
    head = f"| metric | unit | | paper | {' | '.join(PLANTS)} | difference | {HEADING} |"
    lines = [
        "# Paper and ours",
        "",
        "Paper: Barakou, Tzafestas, Valavanis, Drones 2026, 10, 274. Windows, metrics, assumptions: see report.html.",
        f"Metrics against the held 50 Hz reference. Difference: {plant} against the paper, a larger magnitude is +.",
        "",
        ASSUMED,
        "",
        _reversals(results, plant),
    ]
    for case, controllers in results["experiments"].items():
        lines += ["", f"## {TITLES[case]}", "", head, "|---" * 8 + "|"]
        names = [n for n in dict.fromkeys(n for c in controllers.values() for n in c) if not n.endswith(CONTINUOUS)]
        for name in names:
            for controller, cells in controllers.items():
                if name in cells:
                    why = reasons.get(case, {}).get(controller, {}).get(name, "")
                    lines.append(_row(case, controller, name, cells[name], plant, why))
    return "\n".join([*lines, ""])


def _reversals(results: Mapping[str, Any], plant: str) -> str:
    """One line that names where the paper's order of CT and PD comes out the other way."""
    pairs = compare.reversed_orders(results["experiments"], plant)
    named = "; ".join(f"{TITLES[case].split(':')[0]} {name}" for case, name in pairs)
    return f"Not reproduced, the better controller of the paper is the worse one here ({plant}): {named or 'nothing'}."


def _row(case: str, controller: str, name: str, cell: Mapping[str, Any], plant: str, why: str) -> str:
    paper = printed(case, controller, name) or "-"
    ours = " | ".join(number(cell[each]) for each in PLANTS)
    escaped = why.replace("|", "\\|")  # |e_p| would end the cell
    return f"| {name} | {metric(name).unit} | {controller} | {paper} | {ours} | {difference(cell, plant)} | {escaped} |"


SHORT = (
    ("case2", "hover_offset", "height offset in hover", ("0.035", "0.035")),
    ("case1", "held_position_error", "Case 1, position while the arm is held", ("-", "0.13-0.14")),
    ("case2", "position_error_mean", "Case 2, position mean", ("", "")),
    ("case2", "pitch_rms", "Case 2, pitch RMS", ("", "")),
    ("case2", "joint_error_mean", "Case 2, joint error mean (order reversed)", ("", "")),
    ("case3", "position_error_mean", "Case 3, position mean", ("", "")),
    ("case3", "ee_error_mean", "Case 3, end-effector mean", ("", "")),
    ("case3", "joint_error_mean", "Case 3, joint error mean (order reversed)", ("", "")),
    ("case2_gust", "peak_x", "Case 2 gust, peak along x", ("", "")),
    ("case3_wind", "position_error_mean", "Case 3 wind, position mean", ("", "")),
    ("case3_wind", "ee_error_mean", "Case 3 wind, end-effector mean", ("", "")),
    ("case3_wind", "ee_error_max", "Case 3 wind, end-effector max", ("", "")),
)
"""Rows of the README's table: case, metric, words, what section 5 says of CT and PD where Table 2 is silent."""


def short_markdown(results: Mapping[str, Any]) -> str:
    """The README's table: paper / rigid_body / mujoco for CT and PD."""
    lines = ["| | unit | CT paper | CT ours | PD paper | PD ours |", "|---" * 6 + "|"]
    for case, name, words, said in SHORT:
        row = [words, metric(name).unit]
        for controller, text in zip(("CT", "PD"), said, strict=True):
            cell = results["experiments"][case][controller][name]
            row += [printed(case, controller, name) or text, " / ".join(number(cell[plant]) for plant in PLANTS)]
        lines.append(f"| {' | '.join(row)} |")
    lines += ["", f"Ours: {' / '.join(PLANTS)} plant."]
    return "\n".join(lines)
