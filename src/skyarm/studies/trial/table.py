"""Tables of results: columns as data, each a statistic of a metric in the unit of its
head.

``library/columns.toml`` has the columns of the shipped suites.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any, TypeVar

import numpy as np

from skyarm.log.team_log import WITHIN
from skyarm.records.arrays import Array, Mask, doubles
from skyarm.records.files import versions
from skyarm.records.immutable import immutable
from skyarm.records.text_tables import shown_number
from skyarm.studies.sweep.intervals import mean_interval, quantiles, wilson
from skyarm.view.pages import Report, Section, number

Spread = Mapping[str, Any]
"""Statistics of a metric: :func:`spread`."""

V = TypeVar("V")


@immutable
class TableColumn:
    """Column of a results table.

    Attributes:
        head: heading. metric: name in the catalogue. factor: from SI to the heading's
            unit.
        statistic: "mean", "p95" or "max" of :func:`spread`.
        percentile: percentile of sizes, in % (:meth:`percentile_of`).
        case: case of the flights, where a row has several. name: key in the results.
        fine: number below which three digits are shown instead of two decimals.
    """

    head: str
    metric: str
    factor: float = 1.0
    statistic: str = "mean"
    percentile: float = 50.0
    case: str = ""
    name: str = ""
    fine: float = 0.0

    def statistic_of(self, spreads: Mapping[str, Spread | None]) -> float | None:
        """Statistic of a row, SI, of several vehicles the largest; None if no flight
        was completed.

        Args:
            spreads: metric -> its :func:`spread`.
        """
        return max(
            (each[self.statistic] for each in values_of(spreads, self.metric) if each),
            default=None,
        )

    def text(self, spreads: Mapping[str, Spread | None]) -> str:
        """Cell of the column in a row with these spreads."""
        return self.cell(self.statistic_of(spreads))

    def cell(self, quantity: float | None) -> str:
        """Cell of the column for a number, SI; a dash for None."""
        # two decimals of a small number may have no digit of it
        if quantity is None or abs(quantity * self.factor) >= self.fine:
            return number(quantity, self.factor)
        return shown_number(quantity * self.factor)

    def percentile_of(self, values: Array) -> float | None:
        """Percentile of the sizes of all finite values, SI; None if there are none."""
        sizes = np.abs(values[np.isfinite(values)])
        return float(np.percentile(sizes, self.percentile)) if sizes.size else None


COLUMNS: Mapping[str, Sequence[TableColumn]] = {
    name: [TableColumn(**row) for row in rows]
    for name, rows in tomllib.loads(
        (
            resources.files("skyarm.studies.trial") / "library" / "columns.toml"
        ).read_text("utf-8")
    ).items()
}
"""Columns of the shipped suites by the name of their table."""


def values_of(metrics: Mapping[str, V], name: str) -> list[V]:
    """Values of a metric, of several vehicles one for each, or that of the one that the
    name begins with.
    """
    return [
        each
        for full, each in metrics.items()
        if name in (full, full.rpartition(WITHIN)[2])
    ]


def spread(values: Array) -> dict[str, Any] | None:
    """Mean with its interval, order statistic at 95 % and largest of all finite values;
    None if there are none.
    """
    finite = doubles(values)
    # a flight that never met the metric's window has NaN there
    finite = finite[np.isfinite(finite)]
    if not finite.size:
        return None
    interval = mean_interval(finite)
    return {
        "mean": float(finite.mean()),
        "mean_interval": interval and list(interval),
        "p95": quantiles(finite, [0.95])[0],
        "max": float(finite.max()),
    }


def success_share(good: Mask) -> dict[str, Any]:
    """Share of successful flights, None for no flight, and its 95 % Wilson interval."""
    count = int(good.size)
    return {
        "success_rate": float(good.mean()) if count else None,
        "success_interval": list(wilson(int(good.sum()), count)),
    }


def refusals(found: Mapping[str, Any]) -> list[str]:
    """Sentences on laws that do not fly, of results with the reasons under
    "not_flown".
    """
    return [
        f"{law} does not fly: {why}" for law, why in found.get("not_flown", {}).items()
    ]


def report_of(
    title: str, facts: str, sections: Sequence[Section], **others: Any
) -> Report:
    """Report whose first line of facts ends with the version of skyarm."""
    return Report(
        title=title,
        facts=f"{facts}; skyarm {versions()['skyarm']}",
        sections=sections,
        **others,
    )
