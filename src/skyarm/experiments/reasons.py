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
            for metric, cell in cells.items():
                line = _line(case, controller, metric, cell, sensitivity)
                if line:
                    lines[metric] = line
    return found


def _line(case: str, controller: str, metric: str, cell: Mapping[str, Any], sensitivity: Sensitivity) -> str:
    paper = cell["paper"]
    if paper is None:
        return ""
    ours = cell["rigid_body"] if cell["rigid_body"] is not None else cell["mujoco"]
    if metric.startswith("settling_time"):
        return _settling(metric, paper, ours)
    if ours is None:
        return "our flight ended before the window"
    slack = rounding(case, controller, metric)
    if agrees(paper, ours, slack):
        return ""
    return _supported(paper, ours, slack, _tried(case, controller, metric, sensitivity))


def _settling(metric: str, paper: float, ours: float | None) -> str:
    if ours is None:
        return "|e_p| never stays within 0.02 m of its steady mean; the paper's rule for settling is not published"
    if metric == "settling_time_upper_bound":
        return "" if ours <= paper else "the paper gives an upper bound; |e_p| leaves the band later"
    if abs(ours - paper) <= AGREEMENT * paper:
        return ""
    return "the paper's rule is not published; its 10 s is where the steady window begins"


def _supported(paper: float, ours: float, slack: float, tried: list[tuple[Variation, float]]) -> str:
    """The variation that comes nearest, if it explains the difference or a good part of it."""
    if not tried:
        return "no variation was flown"
    nearest, value = min(tried, key=lambda pair: abs(pair[1] - paper))
    if agrees(paper, value, slack):
        return f"{nearest.label} gives {value:.3g}"
    removed = 1.0 - abs(value - paper) / abs(ours - paper)
    if removed >= WORTH_NAMING:
        return f"{nearest.label} gives {value:.3g}, {100.0 * removed:.0f} % of the difference; the rest is open"
    low, high = min(value for _, value in tried), max(value for _, value in tried)
    return f"open: {low:.3g} ... {high:.3g} over the {len(tried)} variations measured"


def _tried(case: str, controller: str, metric: str, sensitivity: Sensitivity) -> list[tuple[Variation, float]]:
    pairs = []
    for each in variations():
        measured = sensitivity.get(each.group, {}).get(each.value, {}).get(case, {}).get(controller, {})
        value = measured.get(metric)
        if value is not None:
            pairs.append((each, value))
    return pairs
