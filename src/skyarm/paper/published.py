"""Published numbers of Barakou et al. 2026, and their comparison with simulated
ones.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from importlib import resources
from typing import Any

from skyarm.records.immutable import positional

Cells = Mapping[str, float]
Record = Mapping[str, Any]
"""Plain data of a results file."""

Number = float | int | None
Experiments = Mapping[str, Mapping[str, Mapping[str, Record]]]
"""Case -> law -> metric -> {"paper": number, plant: number, "inferred": {plant:
number}}."""

CONTROLLERS = {"CT": "paper_ct", "PD": "paper_pd"}
CONTINUOUS = "_continuous"
"""Suffix of a metric taken against the continuous reference in place of the held 50 Hz
samples."""

_TABLES = tomllib.loads(
    (resources.files("skyarm.paper") / "library" / "published.toml").read_text("utf-8")
)

TITLES: Mapping[str, str] = _TABLES["titles"]
CASES = tuple(TITLES)
"""Cases of the paper, in the order of its tables."""

PRINTED: Mapping[str, Mapping[str, Mapping[str, str]]] = _TABLES["printed"]
"""Printed numbers: case -> law -> metric -> digits."""

PAPER: Mapping[str, Mapping[str, Cells]] = {
    case: {
        name: {metric: float(text) for metric, text in cells.items()}
        for name, cells in controllers.items()
    }
    for case, controllers in PRINTED.items()
}


def rounding(case: str, controller: str, metric: str) -> float:
    """Rounding uncertainty of a printed number: half a unit of its last digit."""
    _, _, decimals = PRINTED[case][controller][metric].partition(".")
    return 0.5 * 10.0 ** -len(decimals)


def printed_number(case: str, controller: str, metric: str) -> str:
    """Published number as printed in the table; "" if there is none."""
    return PRINTED.get(case, {}).get(controller, {}).get(metric, "")


def published_number(case: str, controller: str, metric: str) -> str:
    """Published number as printed in the table or stated in the text; "" if there is
    none.
    """
    said = _TABLES["said"].get(case, {}).get(controller, {})
    return printed_number(case, controller, metric) or said.get(metric, "")


@positional
class PublishedMetric:
    """Metric of the published tables: label, unit and definition.

    Attributes:
        label: words. quantity: plural of the quantity that it measures, such as "joint
            errors". unit: SI.
        definition: one sentence. bound: the paper states an upper bound only.
    """

    label: str
    quantity: str = ""
    unit: str = ""
    definition: str = ""
    bound: bool = False


METRICS = {name: PublishedMetric(**row) for name, row in _TABLES["metrics"].items()}


def metric(name: str) -> PublishedMetric:
    """Published metric by name; an unlisted name becomes its own label."""
    base = name.removesuffix(CONTINUOUS)
    listed = METRICS.get(base, PublishedMetric(base.replace("_", " ")))
    return (
        listed
        if base == name
        else replace(listed, label=f"{listed.label}, continuous reference")
    )


def short_title(case: str) -> str:
    """Title of a published case without what happens in it, such as "Case 1"; other
    cases keep their name.
    """
    return TITLES.get(case, case).split(":")[0]


def phrase(name: str) -> str:
    """Label of a metric inside of a sentence, such as "mean joint error"."""
    label = metric(name).label
    # an abbreviation such as IAE keeps its capitals
    return label if label[:2].isupper() else label[:1].lower() + label[1:]


def finite_or_none(value: Number) -> float | None:
    """Convert a value to a float; None if it is missing or not finite."""
    return float(value) if value is not None and math.isfinite(value) else None


def digits(value: Number) -> str:
    """Text of a number with three significant digits; a dash for None."""
    if value is None:
        return "-"
    return "0" if value == 0.0 else f"{value:#.3g}".removesuffix(".")


def relative(ours: Number, paper: Number) -> float | None:
    """Relative difference from the published number, positive for a larger magnitude.

    A magnitude that is too large is positive, for negative numbers too; another sign
    than the paper's is below -1. None where either is missing or the paper's is zero.
    """
    a, b = finite_or_none(ours), finite_or_none(paper)
    # divided with its sign: a larger magnitude is positive for negative numbers, too
    return None if a is None or not b else (a - b) / b


def percent(ours: Number, paper: Number) -> str:
    """Text of a relative difference in whole percent with sign; "" if a number is
    missing.
    """
    difference = relative(ours, paper)
    # what rounds to 0 is written without a sign
    rounded = 0 if difference is None else round(100.0 * difference)
    return "" if difference is None else f"{rounded:+d} %" if rounded else "0 %"


def reversed_orders(experiments: Record, plant: str) -> list[tuple[str, str]]:
    """Cases and metrics in which the simulation reverses the published order of the two
    controllers.

    Only metrics that are better when smaller in magnitude and that the paper gives for
    both controllers; numbers within 1 % of each other have no order.
    """
    reversals = []
    for case, controllers in experiments.items():
        for name, cell in controllers.get("CT", {}).items():
            other = controllers.get("PD", {}).get(name, {})
            values = [
                finite_or_none(c.get(column))
                for column in ("paper", plant)
                for c in (cell, other)
            ]
            # a number that only one law has makes no order
            if None in values:
                continue
            # "or 0.0" is for type checkers: none of them is missing here
            theirs, ours = (
                _order(abs(ct or 0.0), abs(pd or 0.0))
                for ct, pd in (values[:2], values[2:])
            )
            if theirs * ours < 0:
                reversals.append((case, name))
    return reversals


def _order(a: float, b: float) -> int:
    """Compare two numbers: -1 if a is smaller, 1 if b is, 0 if within 1 % of each
    other.
    """
    return 0 if abs(a - b) <= 0.01 * max(a, b) else 1 if a > b else -1
