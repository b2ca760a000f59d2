"""Flights one by one, for laws that cannot be traced and for MuJoCo's plant; metrics from their logs."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.log.flight_log import Log
from skyarm.log.log_columns import names_of
from skyarm.metrics.score import score
from skyarm.metrics.windows import Windows
from skyarm.registry import names as registered
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.paths import LATE
from skyarm.scenario.scenario_record import Delays, Scenario
from skyarm.simulate.loop import run

Array = npt.NDArray[Any]


TRACKING = tuple(f"{what}_error_{how}_continuous" for what in ("position", "joint", "ee") for how in ("mean", "max"))
METRICS = (
    *TRACKING,
    *("gust_peak_x_continuous", "gust_ee_peak_x_continuous"),
    *("ee_error_last_mean_continuous", "ee_error_last_max_continuous"),
    *("rotor_jitter", "rate_rms", "tilt_max", "altitude_error_max_continuous"),
)
"""What the comparison counts, under the names of :mod:`skyarm.metrics.metric_catalogue`; and every joint's effort."""


def counted_metrics(told: Sequence[bool]) -> tuple[str, ...]:
    """What is counted of a vehicle, registered metrics of one's own included.

    Args:
        told: joint by joint, whether its command is a setpoint of its drive: its torque is then not counted.
    """
    return (*METRICS, *(f"tau{i + 1}_rms" for i, each in enumerate(told) if not each), *registered("metric"))


def of_log(log: Log, windows: Windows, more: Sequence[str] = ()) -> dict[str, float]:
    """The same metrics from a log, and ``more``; those of an episode that ended early are cut."""
    told = [unit is not None for unit in names_of(log).setpoints]
    return score(log, (*counted_metrics(told), *more), windows)


def one_episode(scenario: Scenario, numbers: dict[str, float]) -> Scenario:
    """One episode of a batch: a delay of its own becomes whole physics steps."""
    late, rate = numbers.pop(LATE, None), scenario.rates.physics
    changed = with_numbers(scenario, numbers)
    if late is None:
        return changed
    delays = Delays(measurement=scenario.delays.measurement, command=round(late * rate) / rate)
    return dataclasses.replace(changed, delays=delays)


def numbers_of(values: Mapping[str, Array], episode: int) -> dict[str, float]:
    """The numbers of one episode, by path."""
    return {path: float(column[episode]) for path, column in values.items()}


def fly_single(
    scenario: Scenario, numbers: dict[str, float], episode: int, windows: Windows, more: Sequence[str] = ()
) -> tuple[dict[str, float], str]:
    """Metrics and ending of one flight."""
    log = run(dataclasses.replace(one_episode(scenario, numbers), episode=episode))
    return of_log(log, windows, more), str(log.status)


def collected(flown: Sequence[tuple[dict[str, float], str]]) -> tuple[dict[str, Array], Array]:
    """Metrics by name and endings of flights, one entry per episode; NaN where a flight has none."""
    names = dict.fromkeys(name for row, _ in flown for name in row)
    found = {name: np.array([row.get(name, np.nan) for row, _ in flown]) for name in names}
    return found, np.array([status for _, status in flown])


def fly_one_by_one(
    scenario: Scenario,
    values: Mapping[str, Array],
    episodes: int,
    windows: Windows,
    *,
    keys: Sequence[int] | None = None,
    more: Sequence[str] = (),
) -> tuple[dict[str, Array], Array]:
    """Metrics by name and endings, one entry per episode.

    Args:
        scenario: that each starts from.
        values: numbers of each, by path.
        episodes: how many.
        windows: of the metrics.
        keys: of the noise, one per episode; its number if left out.
        more: metrics beside those that every comparison counts.
    """
    flown = []
    for k in range(episodes):
        key = k if keys is None else int(keys[k])
        flown.append(fly_single(scenario, numbers_of(values, k), key, windows, more))
    return collected(flown)
