"""Table 2 and the section 5 numbers as Markdown: paper, ours on both plants, difference, reason."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.experiments.paper import CONTINUOUS
from skyarm.experiments.reasons import Reasons

TITLES = {
    "case1": "Case 1: hover, arm ramps",
    "case2": "Case 2: hover, arm trajectory",
    "case3": "Case 3: circle, arm trajectory",
    "case2_gust": "Case 2 in a gust of 3 s",
    "case3_wind": "Case 3 in constant wind",
}


def number(value: float | None) -> str:
    """Three significant digits, or a dash."""
    return "-" if value is None else f"{value:.3g}"


def difference(cell: Mapping[str, Any]) -> str:
    """Relative difference of our first plant from the paper."""
    ours = cell["rigid_body"] if cell["rigid_body"] is not None else cell["mujoco"]
    if cell["paper"] is None or ours is None or cell["paper"] == 0.0:
        return ""
    return f"{100.0 * (ours / cell['paper'] - 1.0):+.0f} %"


def markdown(results: Mapping[str, Any], reasons: Reasons) -> str:
    """All experiments, one table each."""
    lines = [
        "# Paper and ours",
        "",
        "Paper: Barakou, Tzafestas, Valavanis, Drones 2026, 10, 274. Windows, metrics, assumptions: see report.html.",
        "Metrics against the held 50 Hz reference. m, rad, N m, s. Difference: rigid_body against the paper.",
    ]
    for case, controllers in results["experiments"].items():
        lines += ["", f"## {TITLES[case]}", "", "| metric | | paper | rigid_body | mujoco | difference | reason |"]
        lines += ["|---|---|---|---|---|---|---|"]
        names = [n for n in dict.fromkeys(n for c in controllers.values() for n in c) if not n.endswith(CONTINUOUS)]
        for name in names:
            for controller, cells in controllers.items():
                if name in cells:
                    why = reasons.get(case, {}).get(controller, {}).get(name, "")
                    lines.append(_row(name, controller, cells[name], why))
    return "\n".join([*lines, ""])


def _row(name: str, controller: str, cell: Mapping[str, Any], why: str) -> str:
    values = (number(cell[key]) for key in ("paper", "rigid_body", "mujoco"))
    escaped = why.replace("|", "\\|")  # |e_p| would end the cell
    return f"| {name} | {controller} | {' | '.join(values)} | {difference(cell)} | {escaped} |"


SHORT = (
    ("hover_offset", "height offset in hover", (("case2", "CT"), ("case2", "PD")), ("0.035", "0.035")),
    (
        "held_position_error",
        "Case 1, position while the arm is held",
        (("case1", "CT"), ("case1", "PD")),
        ("-", "0.13-0.14"),
    ),
    ("position_error_mean", "Case 2, position mean", (("case2", "CT"), ("case2", "PD")), ("-", "-")),
    ("pitch_rms", "Case 2, pitch RMS (rad)", (("case2", "CT"), ("case2", "PD")), ("-", "-")),
    ("position_error_mean", "Case 3, position mean", (("case3", "CT"), ("case3", "PD")), ("-", "-")),
    ("ee_error_mean", "Case 3, end-effector mean", (("case3", "CT"), ("case3", "PD")), ("-", "-")),
    ("peak_x", "Case 2 gust, peak along x", (("case2_gust", "CT"), ("case2_gust", "PD")), ("-", "-")),
    ("position_error_mean", "Case 3 wind, position mean", (("case3_wind", "CT"), ("case3_wind", "PD")), ("-", "-")),
    ("ee_error_mean", "Case 3 wind, end-effector mean", (("case3_wind", "CT"), ("case3_wind", "PD")), ("-", "-")),
    ("ee_error_max", "Case 3 wind, end-effector max", (("case3_wind", "CT"), ("case3_wind", "PD")), ("-", "-")),
)
"""Rows of the README's table: metric, words, cells of CT and PD, what section 5 says where a table is silent."""


def short_markdown(results: Mapping[str, Any]) -> str:
    """The README's table: paper / rigid_body / mujoco for CT and PD."""
    lines = ["| m | CT paper | CT ours | PD paper | PD ours |", "|---|---|---|---|---|"]
    for metric, words, cells, text in SHORT:
        row = [words]
        for (case, controller), said in zip(cells, text, strict=True):
            cell = results["experiments"][case][controller][metric]
            paper = said if cell["paper"] is None else number(cell["paper"])
            row += [paper, f"{number(cell['rigid_body'])} / {number(cell['mujoco'])}"]
        lines.append(f"| {' | '.join(row)} |")
    lines += ["", "Ours: rigid_body / mujoco plant."]
    return "\n".join(lines)
