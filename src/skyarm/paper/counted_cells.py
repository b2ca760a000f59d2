"""Agreement with Barakou et al. 2026: how many of its published numbers a simulation
reproduces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache

import numpy as np

from skyarm.paper.inferred_settings import unstated_study
from skyarm.paper.published import PAPER, Number, Record, finite_or_none, rounding
from skyarm.paper.unstated_study import PublishedNumber, group_places, losses, tally
from skyarm.records.arrays import Array
from skyarm.scenario.scenario_record import PLANTS

RULE = (
    "A number agrees within x % if |simulated - paper|, less half a unit of the paper's"
    " last printed digit, is at most x % of |paper|. Settling times are left out: the"
    " paper gives no rule for them."
)

Column = Callable[[Record], Number]


@cache
def published_cells() -> tuple[PublishedNumber, ...]:
    """Published numbers of Barakou et al. 2026 by case, controller and metric, without
    settling times.
    """
    published = []
    for case, laws in PAPER.items():
        for law, cells in laws.items():
            published += [
                # tables and the catalogue have one name for it
                PublishedNumber(
                    f"{case} {law}", name, name, value, rounding(case, law, name)
                )
                for name, value in cells.items()
                if not name.startswith("settling_time")
            ]
    return tuple(published)


def stated_value(plant: str) -> Column:
    """Return a function that looks up the simulated value of a published number, under
    the stated settings.
    """
    return lambda cell: cell.get(plant)


def inferred_value(plant: str) -> Column:
    """Return a function that looks up the simulated value of a published number, under
    the inferred settings.
    """
    return lambda cell: cell.get("inferred", {}).get(plant)


def column_values(
    experiments: Record, column: Column, cells: Sequence[PublishedNumber]
) -> Array:
    """Simulated values (numbers,) that belong to given published numbers; NaN without a
    value.
    """
    values = []
    for cell in cells:
        case, _, law = cell.flight.rpartition(" ")
        value = finite_or_none(
            column(experiments.get(case, {}).get(law, {}).get(cell.name, {}))
        )
        values.append(float("nan") if value is None else value)
    return np.array(values)


def counts(
    experiments: Record,
    column: Column,
    fits: Callable[[PublishedNumber], bool] | None = None,
) -> dict[str, float]:
    """Counts of published numbers that simulated values agree with, within 5, 10 and 25
    %.
    """
    cells = [cell for cell in published_cells() if fits is None or fits(cell)]
    values = column_values(experiments, column, cells)
    shape = unstated_study()["loss"]
    # nothing was flown: zero of all would read as a result
    if np.isnan(values).all():
        return {}
    loss = float(losses(values[None, :], cells, shape["width"], shape["knee"]).sum())
    return {"loss": loss, **tally(values, cells)}


def in_group(group: str) -> Callable[[PublishedNumber], bool]:
    """Predicate on published numbers: true for those of a named group, such as gust
    cases.
    """
    cells = published_cells()
    chosen = {cells[i] for i in group_places(unstated_study()["groups"][group], cells)}
    return lambda cell: cell in chosen


def in_case(case: str) -> Callable[[PublishedNumber], bool]:
    """Predicate on published numbers: true for those of a given case."""
    return lambda cell: cell.flight.rpartition(" ")[0] == case


def sentence(results: Record) -> str:
    """Sentence on how many published numbers are reproduced within 5, 10 and 25 %."""
    experiments = results["experiments"]
    by_plant = {plant: counts(experiments, stated_value(plant)) for plant in PLANTS}
    inferred = {plant: counts(experiments, inferred_value(plant)) for plant in PLANTS}
    if not any(by_plant.values()):
        return "No number of the paper was computed."
    parts = [f"as stated {_counts_text(by_plant)}"]
    if any(inferred.values()):
        free = results.get("settings", {}).get("inferred", {})
        many = (
            f"{free['numbers']} numbers and {free['choices']} choices"
            if free
            else "settings"
        )
        parts.append(
            f"with {many} inferred after seeing the numbers {_counts_text(inferred)}"
        )
    return f"Of the paper's {len(published_cells())} numbers, {'; '.join(parts)}."


def _counts_text(by_plant: Mapping[str, Record]) -> str:
    """Text of how many published numbers agree within 25, 10 and 5 %: first plant, in
    brackets the others.
    """
    flown = [
        (plant, [each[f"within_{share}%"] for share in (25, 10, 5)])
        for plant, each in by_plant.items()
        if each
    ]
    if not flown:
        return "none were flown"
    (first, (far, near, nearest)), *others = flown
    also = "".join(f" (on {plant} {a}, {b} and {c})" for plant, (a, b, c) in others)
    return (
        f"{far} lie within 25 %, {near} within 10 % and {nearest} within 5 % on"
        f" {first}{also}"
    )
