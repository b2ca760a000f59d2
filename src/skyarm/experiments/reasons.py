"""Why a cell differs from the paper: said only where a measured variation supports it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.experiments.campaign import Sensitivity
from skyarm.experiments.published import rounding
from skyarm.experiments.variations import Variation, variations

AGREEMENT = 0.05
"""Relative difference that counts as agreement, beside the rounding of the published number."""

WORTH_NAMING = 0.3
"""A variation is named when it removes at least this share of the difference."""

Reasons = dict[str, dict[str, dict[str, str]]]


def agrees(paper: float, ours: float, rounding: float) -> bool:
    """Within 5 % or the rounding of the published number."""
    return abs(ours - paper) <= max(AGREEMENT * abs(paper), rounding)


def reasons(results: Mapping[str, Any], sensitivity: Sensitivity) -> Reasons:
    """One line for every cell that has a published number and does not agree with it."""
    found: Reasons = {}
    for case, controllers in results["experiments"].items():
        for controller, cells in controllers.items():
            lines = found.setdefault(case, {}).setdefault(controller, {})
            credible = [each for each in variations() if _credible(each, case, controller, cells, sensitivity)]
            for metric, cell in cells.items():
                line = _line(case, controller, metric, cell, credible, sensitivity)
                if line:
                    lines[metric] = line
    return found


def _ours(cell: Mapping[str, Any]) -> float | None:
    """Our number: that of the first plant that flew."""
    value: float | None = cell["rigid_body"] if cell["rigid_body"] is not None else cell["mujoco"]
    return value


def _credible(
    varied: Variation, case: str, controller: str, cells: Mapping[str, Any], sensitivity: Sensitivity
) -> bool:
    """True if a variation moves at least as many of its controller's cells towards the paper as away from it.

    The best of a dozen variations for each cell by itself would find coincidences.
    """
    nearer = further = 0
    for metric, cell in cells.items():
        ours, value = _ours(cell), _measured(varied, case, controller, metric, sensitivity)
        if cell["paper"] is None or ours is None or value is None or metric.startswith("settling_time"):
            continue
        moved = abs(value - cell["paper"]) - abs(ours - cell["paper"])
        noticed = 0.01 * abs(cell["paper"])
        nearer, further = nearer + (moved < -noticed), further + (moved > noticed)
    return nearer > 0 and nearer >= further


def _line(
    case: str,
    controller: str,
    metric: str,
    cell: Mapping[str, Any],
    credible: list[Variation],
    sensitivity: Sensitivity,
) -> str:
    paper, ours = cell["paper"], _ours(cell)
    if paper is None:
        return ""
    if metric.startswith("settling_time"):
        return _settling(metric, paper, ours)
    if ours is None:
        return "our flight ended before the window"
    slack = rounding(case, controller, metric)
    if agrees(paper, ours, slack):
        return ""
    tried = _tried(variations(), case, controller, metric, sensitivity)
    return _supported(paper, ours, slack, tried, _tried(credible, case, controller, metric, sensitivity))


def _settling(metric: str, paper: float, ours: float | None) -> str:
    if ours is None:
        return "|e_p| never stays within 0.02 m of its steady mean; the paper's rule for settling is not published"
    if metric == "settling_time_upper_bound":
        return "" if ours <= paper else "the paper gives an upper bound; |e_p| leaves the band later"
    if abs(ours - paper) <= AGREEMENT * paper:
        return ""
    return "the paper's rule is not published; its 10 s is where the steady window begins"


Tried = list[tuple[Variation, float]]


def _supported(paper: float, ours: float, slack: float, tried: Tried, credible: Tried) -> str:
    """The credible variation that comes nearest, if it explains the difference or a good part of it."""
    if not tried:
        return "no variation was flown"
    low, high = min(value for _, value in tried), max(value for _, value in tried)
    unexplained = f"open: {low:.3g} ... {high:.3g} over the {len(tried)} variations measured"
    if not credible:
        return unexplained
    nearest, value = min(credible, key=lambda pair: abs(pair[1] - paper))
    if agrees(paper, value, slack):
        return f"consistent with {nearest.label}: {value:.3g}"
    removed = 1.0 - abs(value - paper) / abs(ours - paper)
    if removed >= WORTH_NAMING:
        return f"{nearest.label}: {value:.3g}, {100.0 * removed:.0f} % of the difference; the rest is open"
    return unexplained


def _measured(varied: Variation, case: str, controller: str, metric: str, sensitivity: Sensitivity) -> float | None:
    cells = sensitivity.get(varied.group, {}).get(varied.value, {}).get(case, {}).get(controller, {})
    return cells.get(metric)


def _tried(among: list[Variation], case: str, controller: str, metric: str, sensitivity: Sensitivity) -> Tried:
    pairs = ((each, _measured(each, case, controller, metric, sensitivity)) for each in among)
    return [(each, value) for each, value in pairs if value is not None]
