"""Explanations of cells that differ from the paper, given only if a simulated variation supports them.

Reasons are alternatives: each variation was flown alone, and no two of them are claimed to be true at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from skyarm.paper.campaign import Sensitivity
from skyarm.paper.flights import first_plant
from skyarm.paper.published import Record, digits, relative, rounding
from skyarm.paper.variations import ALIGNMENTS, Variation, variations

AGREEMENT = 0.05
"""Relative difference that counts as agreement, beside the rounding of the published number."""

WORTH_NAMING = 0.3
"""A variation is named when it removes at least this share of the difference."""

HEADING = "nearest variation (alternatives, not jointly true)"
"""Title of the column that holds these lines."""

Reasons = dict[str, dict[str, dict[str, str]]]
Compared = list[tuple[float, float, float]]
"""(paper, ours, varied) of each cell."""


def agrees(paper: float, ours: float, rounding: float) -> bool:
    """True if a value is within 5 % or the rounding of the published number."""
    return abs(ours - paper) <= max(AGREEMENT * abs(paper), rounding)


def reasons(results: Record, sensitivity: Sensitivity) -> Reasons:
    """Explanation of every cell that differs from its published number, one line each."""
    plant = first_plant(results)
    flown = [each for each in variations() if not each.is_assumption]
    found: Reasons = {}
    for case, controllers in results["experiments"].items():
        for controller, cells in controllers.items():
            lines = found.setdefault(case, {}).setdefault(controller, {})
            measured = {(each.group, each.value): _cells(each, case, controller, sensitivity) for each in flown}
            named = _nameable(flown, cells, plant, measured)
            for metric, cell in cells.items():
                tried = _values_of(flown, metric, measured)
                line = _line(case, controller, metric, cell, plant, tried, _values_of(named, metric, measured))
                if line:
                    lines[metric] = line
    return found


Measured = Mapping[tuple[str, str], Mapping[str, float | None]]
Tried = list[tuple[Variation, float]]


def _cells(varied: Variation, case: str, controller: str, sensitivity: Sensitivity) -> Mapping[str, float | None]:
    return sensitivity.get(varied.group, {}).get(varied.value, {}).get(case, {}).get(controller, {})


def _values_of(among: Sequence[Variation], metric: str, measured: Measured) -> Tried:
    pairs = ((each, measured[each.group, each.value].get(metric)) for each in among)
    return [(each, value) for each, value in pairs if value is not None]


def _nameable(flown: Sequence[Variation], cells: Record, plant: str, measured: Measured) -> list[Variation]:
    """Variations allowed as explanation: credible ones, and of the time shifts of the recording only the best."""
    compared = {each: _comparison(cells, plant, measured[each.group, each.value]) for each in flown}
    aligned = [each for each in flown if each.group in ALIGNMENTS and compared[each]]
    best = max(aligned, key=lambda each: score(compared[each]), default=None)
    return [each for each in flown if (each.group not in ALIGNMENTS or each is best) and _credible(compared[each])]


def _comparison(cells: Record, plant: str, varied: Mapping[str, float | None]) -> Compared:
    """(paper, ours, varied) of every cell with all three numbers, without settling times."""
    found = []
    for metric, cell in cells.items():
        paper, ours, value = cell["paper"], cell[plant], varied.get(metric)
        if paper is not None and ours is not None and value is not None and not metric.startswith("settling_time"):
            found.append((paper, ours, value))
    return found


def score(compared: Compared) -> float:
    """Share of the summed relative distance from the published numbers by which a variation reduces it.

    Each cell's distance is clipped to [0, 1], so that one cell of nearly zero does not outweigh the flight.
    """
    before = sum(_distance(ours, paper) for paper, ours, _ in compared)
    after = sum(_distance(value, paper) for paper, _, value in compared)
    return 1.0 - after / before if before > 0.0 else 0.0


def _distance(value: float, paper: float) -> float:
    return min(1.0, abs(relative(value, paper) or 0.0))


def _credible(compared: Compared) -> bool:
    """True if a variation moves at least as many cells of its flight towards the paper as away from it.

    The best of a dozen variations for each cell by itself would find coincidences.
    """
    nearer = further = 0
    for paper, ours, value in compared:
        moved, noticed = abs(value - paper) - abs(ours - paper), 0.01 * abs(paper)
        nearer, further = nearer + (moved < -noticed), further + (moved > noticed)
    return nearer > 0 and nearer >= further


def _line(case: str, controller: str, metric: str, cell: Record, plant: str, tried: Tried, named: Tried) -> str:
    paper, ours = cell["paper"], cell[plant]
    if paper is None:
        return ""
    if metric.startswith("settling_time"):
        return _settling(metric, paper, ours)
    if ours is None:
        return "our flight ended before the window"
    slack = rounding(case, controller, metric)
    if not agrees(paper, ours, slack):
        return _support(paper, ours, slack, tried, named)
    return "" if agrees(paper, ours, 0.0) else "equal within the published rounding"


def _settling(metric: str, paper: float, ours: float | None) -> str:
    if ours is None:
        return "|e_p| never stays within 0.02 m of its steady mean; the paper's rule for settling is not published"
    if metric == "settling_time_upper_bound":
        return "" if ours <= paper else "the paper gives an upper bound; |e_p| leaves the band later"
    if abs(ours - paper) <= AGREEMENT * paper:
        return ""
    return "the paper's rule is not published; its 10 s is where the steady window begins"


def _support(paper: float, ours: float, slack: float, tried: Tried, named: Tried) -> str:
    """Text that names the closest variation, if it explains the cell or much of the difference."""
    if not tried:
        return "no variation was flown"
    low, high = min(value for _, value in tried), max(value for _, value in tried)
    unsupported = f"open: {digits(low)} ... {digits(high)} over the {len(tried)} variations measured"
    if not named:
        return unsupported
    nearest, value = min(named, key=lambda pair: abs(pair[1] - paper))
    if agrees(paper, value, slack):
        return f"consistent with {nearest.label}: {digits(value)}"
    removed = 1.0 - abs(value - paper) / abs(ours - paper)
    if removed >= WORTH_NAMING:
        return f"{nearest.label}: {digits(value)}, {100.0 * removed:.0f} % of the difference; the rest is open"
    return unsupported
