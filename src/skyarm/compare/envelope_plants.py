"""Wrong plants as an axis of the envelope: the README's spread so many times as wide, every value flown by many."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.compare import envelope_motions as motions
from skyarm.compare.envelope_setting import PAPER, Setting
from skyarm.compare.perturbed_plants import Spread, draw
from skyarm.compare.vehicle_spread import fitted_damping, spread_of
from skyarm.environment import ForceWind
from skyarm.records.leaves import walk
from skyarm.scenario.scenario_record import Delays, Scenario

Array = npt.NDArray[Any]

PLANTS = 24
"""Of every value. The same ones at every value and for every law, further from the belief as the value grows."""

WIDEST = 2.0
"""Times the README's spread: the last value."""

NEAR = 0.020
"""m: a plant whose tip stays within this all through its window counts as held; the README's success."""


def swinging(setting: Setting, times: float) -> Scenario:
    """All joints swing by 0.5 rad at 1 Hz in hover; the plant is drawn, its commands late by what no law knows."""
    flown = motions.arm_swing(setting, 0.5, 1.0)
    return dataclasses.replace(flown, wind=ForceWind(), delays=Delays(longest_command=WIDEST * Spread().delay))


def plants_at(setting: Setting, scenario: Scenario, times: float, count: int, *, seed: int) -> dict[str, Array]:
    """Numbers of the plants of a value, by path; the first ones do not depend on how many there are.

    Args:
        setting: vehicle.
        scenario: of :func:`swinging`; its truth is the middle of the spread.
        times: width of the spread over that of the README.
        count: plants.
        seed: key.
    """
    if setting.vehicle == PAPER:
        return draw(scenario, widened(Spread(), times), count, seed=seed)
    spread, _ = spread_of(setting.truth, float(scenario.world.gravity), Spread().delay)
    return fitted_damping(scenario, spread, draw(scenario, widened(spread, times), count, seed=seed))


def widened(spread: Spread, times: float) -> Spread:
    """A spread so many times as wide."""
    low, high = spread.thrust
    shares = {place[0]: value * times for place, value in walk(spread) if place[0] != "thrust"}
    return Spread(**shares, thrust=(low * times, high * times))


def point_of_plants(flights: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """One point from those of a value's plants.

    It is judged by the largest mean error of the plants that fly to their end, and lost where one plant is. Its mean
    is the median of the plants' means, all else the largest of theirs. ``plants`` has them one by one.
    """
    kept = [each for each in flights if not each["lost"]]
    found: dict[str, Any] = {key: _over(kept, key, max) for key in ("judged", "tip_max", "outside")}
    found |= {"tip_mean": _over(kept, "tip_mean", np.median), "tilt": _over(flights, "tilt", max)}
    gone = [each["status"] for each in flights if each["lost"]]
    held = sum(each["tip_max"] <= NEAR for each in kept)
    counts = {"of": len(flights), "held": held, "lost": len(gone)}
    each = [{"judged": one["judged"], "lost": one["lost"]} for one in flights]
    return {**found, "status": gone[0] if gone else "completed", "lost": bool(gone), "plants": {**counts, "each": each}}


def _over(flights: Sequence[Mapping[str, Any]], key: str, how: Any) -> float | None:
    numbers = [each[key] for each in flights if each[key] is not None]
    found = float(how(numbers)) if numbers else math.nan
    return found if math.isfinite(found) else None
