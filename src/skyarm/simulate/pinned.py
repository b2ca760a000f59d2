"""Guards of a reference: how long it waits for the flight, found by flying.

A guard holds the whole reference back until the tip's error has been small for a while. The flight up to there does
not depend on what comes after, and is the same each time it is flown: so it is flown up to each guard, with the
reference at rest for as long as the guard may last, and the wait that is found there is written into the reference.
What remains is a reference of time alone, which flies on every engine and from its log, with the numbers of a loop that
had waited.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.reference.pauses import paused
from skyarm.reference.setting import Guard
from skyarm.scenario.scenario_record import Scenario

Rests = list[tuple[float, float]]


def pinned(scenario: Scenario, fly: Callable[[Scenario], Log]) -> Scenario:
    """The scenario whose reference waits as long as its guards ask, and asks no more.

    Args:
        scenario: with or without guards.
        fly: flies a scenario without guards, as :func:`skyarm.run` does.
    """
    rests: Rests = []
    for guard in scenario.trajectory.guards:
        at = guard.at + sum(seconds for _, seconds in rests)
        if at >= scenario.duration:
            break
        longest = math.ceil(guard.timeout * scenario.rates.control - 1e-9) / scenario.rates.control
        trial = _resting(scenario, [*rests, (at, longest)])
        periods = min(math.ceil((at + longest) * scenario.rates.control - 1e-9), scenario.steps)
        log = fly(dataclasses.replace(trial, duration=periods / scenario.rates.control))
        waited = wait(log, guard, at)
        rests.append((at, longest if waited is None else waited))
    return _resting(scenario, rests)


def wait(log: Log, guard: Guard, at: float) -> float | None:
    """How long (s) after ``at`` the error has been small for as long as a guard asks; None where it never was.

    The error is that of the tip against its continuous reference, of the plant as it is, not as it is measured.
    """
    error = np.linalg.norm(log.tip - log.tip_reference, axis=1)
    since = None
    for time, small in zip(log.time, error <= guard.error, strict=True):
        if time < at - 1e-9:
            continue
        since = (time if since is None else since) if small else None
        if since is not None and time - since >= guard.hold - 1e-9:
            return float(time - at)
    return None


def _resting(scenario: Scenario, rests: Rests) -> Scenario:
    trajectory = dataclasses.replace(paused(scenario.trajectory, rests), guards=())
    loads = {name for guard in scenario.trajectory.guards for name in guard.loads}
    moved: dict[float, float] = {}

    def later(time: Any) -> float:
        moved[float(time)] = _after(float(time), rests)
        return moved[float(time)]

    payloads = tuple(
        dataclasses.replace(each, pick=later(each.pick), drop=later(each.drop)) if each.name in loads else each
        for each in scenario.payloads
    )
    told = tuple(
        dataclasses.replace(each, at=moved[each.at]) if each.at in moved and _is_load(each.path) else each
        for each in scenario.changes
    )
    return dataclasses.replace(scenario, trajectory=trajectory, payloads=payloads, changes=told)


def _after(time: float, rests: Rests) -> float:
    """When comes what was planned for a time (s) of a reference that has rested."""
    for start, seconds in rests:
        if time > start:
            time += seconds
    return time


def _is_load(path: str) -> bool:
    """Whether a change tells the law of a load that is held."""
    return path.startswith("model.payload.")
