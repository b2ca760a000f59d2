"""The claims the reproduction stands or falls with, and whether each plant meets them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from skyarm.paper.agreement import known
from skyarm.paper.published import CASES, printed
from skyarm.paper.report.report_markup import DASH, shown, text, typographic
from skyarm.paper.report.report_metrics import metric
from skyarm.scenario.scenario_record import PLANTS

Experiments = Mapping[str, Mapping[str, Mapping[str, Mapping[str, Any]]]]


@dataclass(frozen=True, slots=True)
class Claim:
    """A metric that must lie in [low, high] for every (case, controller) named."""

    title: str
    name: str
    cells: tuple[tuple[str, str], ...]
    low: float
    high: float


def _within(title: str, name: str, case: str, controller: str, low: float, high: float) -> Claim:
    return Claim(title, name, ((case, controller),), low, high)


def _around(title: str, name: str, case: str, controller: str, middle: float, share: float) -> Claim:
    return _within(title, name, case, controller, middle * (1.0 - share), middle * (1.0 + share))


_CALM = tuple((case, controller) for case in CASES[:4] for controller in ("CT", "PD"))
_WINDY = (("case3_wind", "CT"), ("case3_wind", "PD"))

# Ranges are this project's own: an earlier, independent prototype reached them with the same assumptions.
CLAIMS = (
    Claim("Hover offset, all cases without constant wind", "hover_offset", _CALM, 0.0338, 0.0358),
    _within("Case 1, PD: position error, arm held", "held_position_error", "case1", "PD", 0.125, 0.140),
    _within("Case 2, CT: position error, mean", "position_error_mean", "case2", "CT", 0.031, 0.036),
    _within("Case 2, PD: position error, mean", "position_error_mean", "case2", "PD", 0.065, 0.078),
    _within("Case 2, PD: pitch RMS", "pitch_rms", "case2", "PD", 0.056, 0.071),
    _within("Case 3, CT: position error, mean", "position_error_mean", "case3", "CT", 0.033, 0.037),
    _within("Case 3, CT: tip error, mean", "ee_error_mean", "case3", "CT", 0.033, 0.039),
    _within("Case 3, CT: roll RMS", "roll_rms", "case3", "CT", 0.005, 0.007),
    _within("Case 3, CT: pitch RMS", "pitch_rms", "case3", "CT", 0.008, 0.012),
    _within("Case 3, PD: position error, mean", "position_error_mean", "case3", "PD", 0.053, 0.060),
    _within("Case 3, PD: tip error, mean", "ee_error_mean", "case3", "PD", 0.061, 0.071),
    _within("Case 3, PD: pitch RMS", "pitch_rms", "case3", "PD", 0.039, 0.050),
    _around("Gust, CT: peak along x", "peak_x", "case2_gust", "CT", 0.55, 0.07),
    _around("Gust, CT: position error, mean", "position_error_mean", "case2_gust", "CT", 0.13, 0.07),
    _around("Gust, CT: integral of position error", "iae_position", "case2_gust", "CT", 2.04, 0.07),
    _around("Gust, PD: peak along x", "peak_x", "case2_gust", "PD", 0.71, 0.07),
    Claim("Constant wind, both: mean pitch", "pitch_mean", _WINDY, -0.29, -0.27),
    _around("Constant wind, CT: position error, mean", "position_error_mean", "case3_wind", "CT", 0.577, 0.03),
    _around("Constant wind, CT: tip error, mean", "ee_error_mean", "case3_wind", "CT", 0.661, 0.03),
    _around("Constant wind, PD: position error, mean", "position_error_mean", "case3_wind", "PD", 0.671, 0.04),
    _around("Constant wind, PD: tip error, mean", "ee_error_mean", "case3_wind", "PD", 0.741, 0.04),
    _around("Constant wind, PD: tip error, largest", "ee_error_max", "case3_wind", "PD", 0.829, 0.04),
)

ORDERED = (
    *((case, "position_error_mean") for case in CASES),
    *((case, "ee_error_mean") for case in CASES),
    ("case2", "pitch_rms"),
    ("case3", "pitch_rms"),
)
"""Where CT must lie below PD."""

VERDICTS = {
    True: '<span class="pass"><span aria-hidden="true">&#10003;</span> within</span>',
    False: '<span class="miss"><span aria-hidden="true">&#10007;</span> outside</span>',
    None: f'<span class="none">{DASH}</span>',
}


def _value(experiments: Experiments, case: str, controller: str, name: str, column: str) -> float | None:
    return known(experiments.get(case, {}).get(controller, {}).get(name, {}).get(column))


def meets(claim: Claim, experiments: Experiments, plant: str) -> bool | None:
    """Whether a plant meets a claim; None if one of its numbers is missing."""
    values = [_value(experiments, case, controller, claim.name, plant) for case, controller in claim.cells]
    found = [value for value in values if value is not None]
    return None if len(found) < len(values) else all(claim.low <= value <= claim.high for value in found)


def ordered(experiments: Experiments, plant: str) -> tuple[int, int]:
    """Count where CT lies below PD: (how often, of how many that were flown)."""
    pairs = [
        (_value(experiments, case, "CT", name, plant), _value(experiments, case, "PD", name, plant))
        for case, name in ORDERED
    ]
    flown = [(ct, pd) for ct, pd in pairs if ct is not None and pd is not None]
    return sum(ct < pd for ct, pd in flown), len(flown)


def claim_row(claim: Claim, experiments: Experiments) -> str:
    """Cells of one claim: title, unit, paper, accepted range, value and verdict of each plant."""
    paper = dict.fromkeys(printed(*cell, claim.name) for cell in claim.cells if printed(*cell, claim.name))
    cells = [f'<th scope="row">{text(claim.title)}</th><td>{text(metric(claim.name).unit)}</td>']
    cells.append(f'<td class="num">{" &hellip; ".join(map(typographic, paper)) or DASH}</td>')
    cells.append(f'<td class="num">{_span((claim.low, claim.high))}</td>')
    for plant in PLANTS:
        values = _span(_value(experiments, *cell, claim.name, plant) for cell in claim.cells)
        cells.append(f'<td class="num">{values}</td><td>{VERDICTS[meets(claim, experiments, plant)]}</td>')
    return "".join(cells)


def order_row(experiments: Experiments) -> str:
    """Cells of the claim that CT lies below PD."""
    cells = [
        '<th scope="row">CT below PD in every mean error of base and tip, and in Cases 2 and 3 in pitch</th><td></td>'
    ]
    cells += [f'<td class="num">{DASH}</td>', '<td class="num">all</td>']
    for plant in PLANTS:
        count, total = ordered(experiments, plant)
        verdict = VERDICTS[count == total if total else None]
        cells.append(f'<td class="num">{f"{count} of {total}" if total else DASH}</td><td>{verdict}</td>')
    return "".join(cells)


def tally(experiments: Experiments, plant: str) -> tuple[int, int]:
    """Count claims met: (met, judged)."""
    verdicts = [meets(claim, experiments, plant) for claim in CLAIMS]
    count, total = ordered(experiments, plant)
    verdicts.append(count == total if total else None)
    return sum(verdict is True for verdict in verdicts), sum(verdict is not None for verdict in verdicts)


def _span(values: Iterable[float | None]) -> str:
    """One number if all look alike, else smallest to largest."""
    found = sorted(value for value in values if value is not None)
    if not found:
        return DASH
    low, high = shown(found[0]), shown(found[-1])
    return low if low == high else f"{low} &hellip; {high}"
