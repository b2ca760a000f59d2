"""The columns of the comparison's tables: which metric of which case, in which unit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Column:
    """A column: its head, the case and metric, and the factor from SI to the unit of the head."""

    head: str
    case: str
    metric: str
    factor: float = 1e3


BASE, JOINT, TOOL = (f"{what}_error_mean_continuous" for what in ("position", "joint", "ee"))

TRACKING = (
    Column("case 1 base, mm", "case1", BASE),
    Column("case 1 joints, mrad", "case1", JOINT),
    Column("case 2 base, mm", "case2", BASE),
    Column("case 2 joints, mrad", "case2", JOINT),
    Column("gust base x, mm", "case2_gust", "gust_peak_x_continuous"),
    Column("gust tip x, mm", "case2_gust", "gust_ee_peak_x_continuous"),
    Column("case 3 base, mm", "case3", BASE),
    Column("case 3 tip, mm", "case3", TOOL),
    Column("wind base, mm", "case3_wind", BASE),
    Column("wind tip, mm", "case3_wind", TOOL),
    Column("45 deg tip, mm", "case3_wind_45", TOOL),
    Column("side tip, mm", "case3_wind_side", TOOL),
    Column("50 g, wind tip, mm", "case3_wind_payload", TOOL),
)
"""Where the laws are on the truth."""

WHICH = "gust: of Case 2; wind, 45 deg, side, 50 g: of Case 3"
"""Which case a head means that names none."""

WRONG = (
    Column("wind base, mm", "case3_wind", BASE),
    Column("wind tip, mm", "case3_wind", TOOL),
    Column("gust base x, mm", "case2_gust", "gust_peak_x_continuous"),
    Column("gust tip x, mm", "case2_gust", "gust_ee_peak_x_continuous"),
)

COST = (
    Column("rotor jitter, rad/s", "case3_wind", "rotor_jitter", 1.0),
    Column("joint torque 1, mN m RMS", "case3_wind", "tau1_rms"),
    Column("attitude motion, rad/s", "case3_wind", "rate_rms", 1.0),
    Column("largest tilt, deg", "case3_wind", "tilt_max", 57.29577951308232),
)
"""What the errors were bought with, in :data:`COST_CASE`."""

COST_CASE = "Case 3 in wind"


def value(summaries: Mapping[str, Any], column: Column, entrant: str) -> float | None:
    """Mean of a column's metric for an entrant, in the unit of its head; None where no flight came to its end."""
    found = summaries.get(column.case, {}).get(entrant)
    spread = found["metrics"].get(column.metric) if found else None
    return None if spread is None else spread["mean"] * column.factor
