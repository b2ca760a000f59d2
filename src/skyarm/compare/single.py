"""Flights one by one, for laws that are not over scalars and for MuJoCo's plant; metrics from their logs."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.simulate.loop import run
from skyarm.simulate.metrics import of_log
from skyarm.simulate.paths import with_numbers
from skyarm.simulate.scenario import Scenario
from skyarm.simulate.totals import Windows

Array = npt.NDArray[Any]


def fly_one_by_one(
    scenario: Scenario, values: Mapping[str, Array], episodes: int, windows: Windows
) -> tuple[dict[str, Array], Array]:
    """Metrics by name and endings, one entry per episode."""
    rows, status = [], []
    for episode in range(episodes):
        numbers = {path: float(column[episode]) for path, column in values.items()}
        log = run(dataclasses.replace(with_numbers(scenario, numbers), episode=episode))
        rows.append(of_log(log, windows))
        status.append(log.status)
    names = dict.fromkeys(name for row in rows for name in row)
    found = {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}
    return found, np.array(status)
