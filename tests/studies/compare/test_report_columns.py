"""Columns of tables as data: metrics of the catalogue, the largest of several vehicles,
digits of small numbers.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from skyarm.log.metrics.metric_catalogue import TEAMS, is_torque, measures
from skyarm.studies.trial.table import COLUMNS, TableColumn, spread, success_share


@pytest.mark.parametrize("name", COLUMNS)
def test_every_shipped_column_has_a_metric_of_the_catalogue(name: str) -> None:
    for column in COLUMNS[name]:
        assert column.metric in (*measures(0), *TEAMS) or is_torque(column.metric)
        assert column.statistic in ("mean", "p95", "max")


def test_a_cell_is_that_of_the_vehicle_with_the_largest_number() -> None:
    column = TableColumn(head="tip, mm", metric="ee_error_mean_continuous", factor=1e3)
    spreads = {
        f"{name}/{column.metric}": {"mean": mean}
        for name, mean in (("left", 0.02), ("right", 0.03))
    }
    assert column.text(spreads | {f"third/{column.metric}": None}) == "30.0"
    assert column.text({column.metric: None}) == column.text({}) == "-"


def test_numbers_below_the_fine_limit_have_three_digits() -> None:
    column = TableColumn(head="torque, N m", metric="tau1_rms", fine=0.1)
    assert (column.cell(0.001234), column.cell(0.1234), column.cell(None)) == (
        "0.00123",
        "0.12",
        "-",
    )


def test_statistics_leave_out_what_is_not_finite() -> None:
    values = np.array([1.0, -3.0, math.nan])
    found = spread(values)
    assert found is not None
    assert (found["mean"], found["max"]) == (-1.0, 1.0)
    assert spread(np.array([math.nan])) is None
    assert TableColumn(head="", metric="").percentile_of(values) == 2.0
    assert success_share(np.array([], dtype=bool)) == {
        "success_rate": None,
        "success_interval": [0.0, 1.0],
    }
