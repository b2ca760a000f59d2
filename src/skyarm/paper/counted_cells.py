"""Agreement with the paper: how many of its numeric cells each column comes near, and what no settings explain."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from skyarm.identify.candidates import losses, tally
from skyarm.identify.study import Cell
from skyarm.paper.inferred_settings import unstated_study
from skyarm.paper.published import PAPER, digits, known, printed, rounding
from skyarm.scenario.scenario_record import PLANTS

SHARES = (0.05, 0.10, 0.25)

RULE = (
    "A cell is within x % if |ours - paper|, less half a unit of the paper's last printed digit, is at most x % of "
    "|paper|. Settling times are left out: the paper gives no rule for them."
)

Column = Callable[[Mapping[str, Any]], Any]


@lru_cache(maxsize=1)
def published_cells() -> tuple[Cell, ...]:
    """The paper's numeric cells but for the settling times."""
    return tuple(
        Cell(f"{case} {law}", name, name, value, rounding(case, law, name))
        for case, laws in PAPER.items()
        for law, cells in laws.items()
        for name, value in cells.items()
        if not name.startswith("settling_time")
    )


def stated(plant: str) -> Column:
    """What a plant gives as the paper states everything."""
    return lambda cell: cell.get(plant)


def inferred(plant: str) -> Column:
    """What a plant gives with the inferred settings."""
    return lambda cell: cell.get("inferred", {}).get(plant)


def column_values(experiments: Mapping[str, Any], column: Column, cells: Sequence[Cell]) -> Any:
    """(cells,) numbers of a column; NaN where there is none."""
    found = []
    for cell in cells:
        case, _, law = cell.flight.rpartition(" ")
        value = known(column(experiments.get(case, {}).get(law, {}).get(cell.name, {})))
        found.append(float("nan") if value is None else value)
    return np.array(found)


def counts(
    experiments: Mapping[str, Any], column: Column, fits: Callable[[Cell], bool] | None = None
) -> dict[str, Any]:
    """Loss and counts of a column over the cells that fit; all of them if left out. {} where none was flown."""
    cells = [cell for cell in published_cells() if fits is None or fits(cell)]
    values, study = column_values(experiments, column, cells), unstated_study()
    if np.isnan(values).all():
        return {}
    loss = float(losses(values[None, :], cells, study.width, study.knee).sum())
    return {"loss": loss} | tally(values, cells, SHARES)


def in_group(group: str) -> Callable[[Cell], bool]:
    """Whether a cell belongs to a group of the study."""
    names = {(cell.flight, cell.name) for cell in unstated_study().among(group)}
    return lambda cell: (cell.flight, cell.name) in names


def sentence(results: Mapping[str, Any]) -> str:
    """The counts of all columns, in words."""
    experiments = results.get("experiments", {})
    by_plant = {plant: counts(experiments, stated(plant)) for plant in PLANTS}
    found = {plant: counts(experiments, inferred(plant)) for plant in PLANTS}
    if not any(by_plant.values()):
        return "No numeric cell of the paper was flown."
    parts = [f"as stated {_several(by_plant)}"]
    if any(found.values()):
        free = results.get("settings", {}).get("inferred", {})
        many = f"{free['numbers']} numbers and {free['choices']} choices" if free else "settings"
        parts.append(f"with {many} inferred after seeing the numbers {_several(found)}")
    return f"Of the paper's {len(published_cells())} numeric cells, {'; '.join(parts)}."


def _several(by_plant: Mapping[str, Mapping[str, Any]]) -> str:
    """Counts on the first plant in words, on the second as numbers."""
    flown = [(plant, [each[f"within_{share}%"] for share in (25, 10, 5)]) for plant, each in by_plant.items() if each]
    if not flown:
        return "none were flown"
    (first, (far, near, nearest)), *others = flown
    also = "".join(f" (on {plant} {a}, {b} and {c})" for plant, (a, b, c) in others)
    return f"{far} lie within 25 %, {near} within 10 % and {nearest} within 5 % on {first}{also}"


def impossible(results: Mapping[str, Any], plant: str) -> list[str]:
    """One sentence for each thing that stays open, with the paper's numbers and ours under the inferred settings."""
    experiments = results.get("experiments", {})

    def ours(case: str, law: str, name: str) -> float | None:
        cell = experiments.get(case, {}).get(law, {}).get(name, {})
        return known(cell.get("inferred", {}).get(plant))

    def shown(case: str, law: str, name: str) -> str:
        return digits(ours(case, law, name))

    def both(case: str, law: str, name: str) -> str:
        return f"{printed(case, law, name)} (ours {shown(case, law, name)})"

    def ratio(name: str) -> str:
        pair = [ours(case, "CT", name) for case in ("case2", "case3")]
        paper = float(printed("case2", "CT", name)) / float(printed("case3", "CT", name))
        known_pair = [value for value in pair if value]
        found = f" (ours {known_pair[0] / known_pair[1]:.1f})" if len(known_pair) == 2 else ""
        return f"{paper:.1f} times{found}"

    return [
        "CT in Case 2 against CT in Case 3: the paper's joint errors are "
        f"{ratio('joint_error_mean')} in the mean and {ratio('joint_error_max')} at most as large, where reference, "
        "friction, latency and inertia scale by 1.33 to 1.5. No share of friction, latency or gain of the study gives "
        f"both; Case 2's peaks stay away too: pitch {both('case2', 'CT', 'peak_pitch')} rad, position "
        f"{both('case2', 'CT', 'peak_position')} m. They look like another build, or another run.",
        f"CT in Case 1: position {both('case1', 'CT', 'position_error_max')} and "
        f"{both('case1', 'CT', 'peak_position')} m. Torques of {both('case1', 'CT', 'tau1_rms')} N m speak for slow "
        f"ramps, pitch of {both('case1', 'CT', 'pitch_rms')} rad and joint errors up to "
        f"{both('case1', 'CT', 'joint_error_max')} rad for steps: one motion cannot be both.",
        f"The onset of the constant wind: CT pitches by {both('case3_wind', 'CT', 'peak_pitch')} rad, PD by "
        f"{both('case3_wind', 'PD', 'peak_pitch')} rad, in the same wind from the same hover.",
        f"PD's peak pitch of the first 8 s, {both('case2', 'PD', 'peak_pitch')} and "
        f"{both('case3', 'PD', 'peak_pitch')} rad, is that of a hover which it is about to leave: hundredths of a "
        f"second decide it. In Case 1, where PD joins later, {both('case1', 'PD', 'peak_pitch')} rad has no cause.",
        "Settling times: no rule for them is published. The paper's 10 s for CT is where the steady window begins, and "
        "in Case 3 it passes over the step back at 21 s that its own figure shows.",
    ]
