"""Flights one by one, for laws that are not over scalars and for MuJoCo's plant; metrics from their logs."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.simulate import metrics as m
from skyarm.simulate.log import Log
from skyarm.simulate.loop import run
from skyarm.simulate.measures import Windows
from skyarm.simulate.paths import with_numbers
from skyarm.simulate.places import LATE
from skyarm.simulate.scenario import Delays, Scenario

Array = npt.NDArray[Any]


TRACKING = tuple(f"{what}_error_{how}_continuous" for what in ("position", "joint", "ee") for how in ("mean", "max"))
METRICS = (
    *TRACKING,
    *("gust_peak_x_continuous", "gust_ee_peak_x_continuous"),
    *("ee_error_last_mean_continuous", "ee_error_last_max_continuous"),
    *("rotor_jitter", "rate_rms", "tilt_max", "altitude_error_max_continuous"),
)
"""What the bench counts, under the names of :mod:`skyarm.simulate.measures`; and every joint's effort."""


def of_log(log: Log, windows: Windows) -> dict[str, float]:
    """The same metrics from a log; those of an episode that ended early are cut."""
    errors = m.Errors.continuous(log)
    found = m.tracking(log, errors, windows.steady)
    found |= {
        "gust_peak_x": m.gust(log, errors, windows.gust)["peak_x"],
        "gust_ee_peak_x": m.tool_peak(log, errors, windows.gust),
        **m.last(log, errors, windows.last),
    }
    calm = m.calmness(log, errors, windows.steady)
    found["altitude_error_max"] = calm.pop("altitude_error_max")
    motion = m.motion(log, windows.steady)
    efforts = {name: value for name, value in motion.items() if name.startswith("tau")}
    del calm["tilt_rms"]
    return {f"{name}_continuous": value for name, value in found.items()} | calm | efforts


def _single(scenario: Scenario, numbers: dict[str, float]) -> Scenario:
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
    scenario: Scenario, numbers: dict[str, float], episode: int, windows: Windows
) -> tuple[dict[str, float], str]:
    """Metrics and ending of one flight."""
    log = run(dataclasses.replace(_single(scenario, numbers), episode=episode))
    return of_log(log, windows), str(log.status)


def collected(flown: Sequence[tuple[dict[str, float], str]]) -> tuple[dict[str, Array], Array]:
    """Metrics by name and endings of flights, one entry per episode; NaN where a flight has none."""
    names = dict.fromkeys(name for row, _ in flown for name in row)
    found = {name: np.array([row.get(name, np.nan) for row, _ in flown]) for name in names}
    return found, np.array([status for _, status in flown])


def fly_one_by_one(
    scenario: Scenario, values: Mapping[str, Array], episodes: int, windows: Windows
) -> tuple[dict[str, Array], Array]:
    """Metrics by name and endings, one entry per episode."""
    return collected([fly_single(scenario, numbers_of(values, k), k, windows) for k in range(episodes)])
