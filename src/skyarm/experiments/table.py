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
