"""Verdict on the reproduction of Barakou et al. 2026 in three sentences, computed from
its results.
"""

from __future__ import annotations

from functools import partial

from skyarm.paper.counted_cells import Column, counts, inferred_value, stated_value
from skyarm.paper.flights import first_plant
from skyarm.paper.inferred_settings import unstated_study
from skyarm.paper.published import (
    METRICS,
    Record,
    metric,
    phrase,
    reversed_orders,
    short_title,
)
from skyarm.paper.unstated_study import PublishedNumber, table_by_name
from skyarm.records.immutable import positional

NEAR = "within_25%"
"""Name of the count of numbers that agree."""

LAWS = {"CT": "the paper's law CT", "PD": "its baseline PD"}


@positional
class _Group:
    """Numbers of one quantity, such as joint errors, and how many of them agree."""

    quantity: str
    near: int
    cells: int

    @property
    def count(self) -> str:
        """Count in words, such as "2 of 20"."""
        return (
            f"all {self.cells}"
            if self.near == self.cells
            else f"{self.near} of {self.cells}"
        )


def verdict(results: Record) -> tuple[str, str, str]:
    """Three sentences on the first plant of results: what agrees, what differs, and
    why.
    """
    experiments = results["experiments"]
    plant = first_plant(results)
    stated, inferred = (
        counts(experiments, column(plant)) for column in (stated_value, inferred_value)
    )
    if not stated:
        return (
            "No number of the paper was computed.",
            "Nothing is compared.",
            "Run the command to its end.",
        )
    groups = _groups(experiments, stated_value(plant))
    worst, best = groups[0], groups[-1]
    near = int(stated[NEAR])
    cells = int(stated["cells"])
    agrees = (
        f"{near} of the paper's {cells} numbers agree within 25 %, among them"
        f" {best.count} {best.quantity}."
    )
    if near == cells:
        return (
            agrees,
            "No number differs more.",
            "The settings that the paper states are enough.",
        )
    differs = (
        f"{worst.quantity.capitalize()} agree least,"
        f" {worst.count}{_example(experiments, plant, worst.quantity)}."
    )
    if not inferred:
        return (
            agrees,
            differs,
            (
                "The cause is open: settings that the paper does not state were not"
                " varied."
            ),
        )
    return agrees, differs, _reason(near, cells, int(inferred[NEAR]), results)


def _groups(experiments: Record, column: Column) -> list[_Group]:
    """Numbers by quantity, that of the least agreement first; of equal ones the larger
    group is last.
    """
    found = []
    for quantity in dict.fromkeys(each.quantity for each in METRICS.values()):
        near = counts(experiments, column, partial(_is_of, quantity))
        if near:
            found.append(_Group(quantity, int(near[NEAR]), int(near["cells"])))
    # by share, and of equal shares by size: the largest is the strongest evidence
    return sorted(found, key=lambda group: (group.near / group.cells, group.cells))


def _is_of(quantity: str, cell: PublishedNumber) -> bool:
    """True if a published number is one of a quantity, such as joint errors."""
    return metric(cell.name).quantity == quantity


def _example(experiments: Record, plant: str, quantity: str) -> str:
    """Clause on the first metric of a quantity whose better law is another one than in
    the paper; "" without one.
    """
    for case, name in reversed_orders(experiments, plant):
        if metric(name).quantity == quantity:
            ct, pd = (abs(experiments[case][law][name]["paper"]) for law in LAWS)
            # magnitudes: of these metrics the smaller is the better
            theirs, ours = LAWS.values() if ct < pd else reversed(LAWS.values())
            where = f"by {phrase(name)} in {short_title(case)}"
            return (
                f": {where}, {theirs} is better in the paper, and {ours} is better here"
            )
    return ""


def _reason(near: int, cells: int, inferred: int, results: Record) -> str:
    """Sentence on the numbers that agree in addition with settings that the paper does
    not state.
    """
    if inferred <= near:
        return (
            "Settings that the paper does not state give no reason: with those of a"
            f" search, {inferred} agree."
        )
    found = results.get("settings", {}).get("inferred", {}).get("settings", {})
    study = unstated_study()
    named = [
        table_by_name(study["parameters"], name)["words"]
        for name in study["fit"]["free"]
        if name in found
    ]
    such = f", such as the {named[0]}" if named else ""
    # of the numbers that differ without these settings at least half agree with them
    much = "Most" if 2 * (inferred - near) >= cells - near else "Some"
    return (
        f"{much} differences come from unstated settings{such}: with those of a search,"
        f" {inferred} agree."
    )
