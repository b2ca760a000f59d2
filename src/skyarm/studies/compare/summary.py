"""Statistics of repeated flights: means, tail quantiles and success rates, with confidence intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from skyarm.records.arrays import AnyArray as Array
from skyarm.records.arrays import Mask
from skyarm.studies.compare.cells import Cell
from skyarm.studies.compare.run_suite import Document, F, Refused, Suite
from skyarm.studies.sweep.intervals import bootstrap_mean, quantiles, wilson

SUCCESS_METRIC, SUCCESS_LIMIT = "ee_error_last_max_continuous", 0.020
"""A success flew to its end with the tip within 20 mm of its reference all through the last 5 s."""


def summary(cell: Cell) -> Document:
    """Statistics of repeated flights: success rate, and mean, tail and confidence interval of each metric.

    Metrics are those of the episodes that flew to their end; null where none did. Peaks along an axis count by their
    size: of two flights that swing either way the mean is no small peak.
    """
    whole = cell.completed
    good = successes(cell)
    count = int(whole.size)
    return {
        "episodes": count,
        "completed": int(whole.sum()),
        "success": int(good.sum()),
        "success_rate": float(good.mean()) if count else None,
        "success_interval": list(wilson(int(good.sum()), count)),
        "endings": {str(name): int((cell.status == name).sum()) for name in np.unique(cell.status)},
        "metrics": {name: _spread(magnitudes(name, values[whole])) for name, values in cell.metrics.items()},
    }


def magnitudes(name: str, values: Array) -> Array:
    """Values of a metric, absolute for signed peaks along an axis."""
    return np.abs(values) if "peak" in name else values


def successes(cell: Cell) -> Mask:
    """True for each flight that ended with the tip within 20 mm of its reference."""
    with np.errstate(invalid="ignore"):
        return cell.completed & (cell.metrics[SUCCESS_METRIC] < SUCCESS_LIMIT)


def _spread(values: Array) -> Document | None:
    finite = np.asarray(values, dtype=float)
    finite = finite[np.isfinite(finite)]
    if not finite.size:
        return None
    low, high = bootstrap_mean(finite) if finite.size > 1 else (float(finite[0]),) * 2
    return {
        "mean": float(finite.mean()),
        "mean_interval": [low, high],
        "p95": quantiles(finite, [0.95])[0],
        "max": float(finite.max()),
    }


def table(cells: Mapping[tuple[str, str, str], Cell]) -> Document:
    """Nested dictionary of flight statistics by condition, case and controller."""
    found: Document = {}
    for (condition, case, entrant), cell in cells.items():
        found.setdefault(condition, {}).setdefault(case, {})[entrant] = summary(cell)
    return found


class SummarySuite(Suite[F]):
    """Base of benchmarks whose results are the statistics of each controller, case and condition."""

    def judge(self, todo: Sequence[F], cells: Sequence[Cell], refused: Refused) -> Document:
        """Statistics of the metrics for every controller, case and condition, as plain data."""
        named = {flights.name: cell for flights, cell in zip(todo, cells, strict=True)}
        return {"summaries": table(named)}
