"""One way to write a number and one way to compare two, for every table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

Number = float | int | None


def known(value: Number) -> float | None:
    """Return the value as a float; None if it is missing or not finite."""
    return float(value) if value is not None and math.isfinite(value) else None


def digits(value: float) -> str:
    """Three significant digits, trailing zeros included."""
    return "0" if value == 0.0 else f"{value:#.3g}".removesuffix(".")


def difference(ours: Number, paper: Number) -> float | None:
    """Relative difference from the paper, measured along the paper's sign.

    A magnitude that is too large is positive, for negative numbers too; another sign than the paper's is below -1.
    None where either is missing or the paper's is zero.
    """
    a, b = known(ours), known(paper)
    return None if a is None or not b else (a - b) / b


def reversed_orders(experiments: Mapping[str, Any], plant: str) -> list[tuple[str, str]]:
    """(case, metric) pairs in which the controller that is better in the paper is the worse one here.

    Only metrics that are better when smaller in magnitude and that the paper gives for both controllers; numbers within
    1 % of each other have no order.
    """
    found = []
    for case, controllers in experiments.items():
        for name, cell in controllers.get("CT", {}).items():
            other = controllers.get("PD", {}).get(name, {})
            values = [known(c.get(column)) for column in ("paper", plant) for c in (cell, other)]
            if None in values:
                continue
            theirs, ours = (_order(abs(ct or 0.0), abs(pd or 0.0)) for ct, pd in (values[:2], values[2:]))
            if theirs * ours < 0:
                found.append((case, name))
    return found


def _order(a: float, b: float) -> int:
    """-1 if a is the smaller, 1 if b is, 0 within 1 % of the larger."""
    return 0 if abs(a - b) <= 0.01 * max(a, b) else 1 if a > b else -1


def percent(relative: float) -> str:
    """Whole percent with its sign; a rounded zero has none."""
    rounded = round(100.0 * relative)
    return f"{rounded:+d} %" if rounded else "0 %"
