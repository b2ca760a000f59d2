"""Whether candidates meet the margins in hover, tested where they are asked for; of a few they are measured.

A test is cheap: the loop with the required extra delay, and with all rotors or all joints
that much stronger or weaker, must have its eigenvalues inside the unit circle, with the rotors' time constant upward
and with that downward.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.scenario.scenario_record import Scenario
from skyarm.stability.closed_loop import radius
from skyarm.stability.frozen_scenario import LAGS
from skyarm.stability.loop_derivatives import OpenLoop
from skyarm.stability.settled_hover import SettledHover
from skyarm.tune.front import LoopMargins, Required
from skyarm.tune.hover_margins import calm
from skyarm.tune.law_knobs import Knob
from skyarm.tune.loop_edges import edges

Array = npt.NDArray[np.float64]

FAILED = 2.0
"""Cost of a test that a candidate does not pass, beside what it is beyond: as much as an error seven times as large."""

STEEP, MOST = 100.0, 2.0
"""Cost per spectral radius above 1, and its largest."""

DIVERGED = 20.0
"""Cost of a hover that did not settle."""

RESERVE = 1.04
"""Factor on what is required, so that a candidate that just passes keeps passing where it is measured."""


class MarginTests:
    """Costs of falling short of the margins.

    Args:
        scenario: flight of the candidates. knobs: what they change. required: margins.
        threads: results do not depend on it.
    """

    def __init__(self, scenario: Scenario, knobs: Sequence[Knob], required: Required, threads: int = 1) -> None:
        numbers = [(place, value) for knob in knobs for place, value in knob.numbers]
        self._values = np.array([value for _, value in numbers])
        self._knob = np.array([i for i, knob in enumerate(knobs) for _ in knob.numbers])
        self._loops = SettledHover(calm(scenario), [f"controller.{'.'.join(place)}" for place, _ in numbers])
        step = 1.0 / scenario.rates.physics
        self._delay = math.ceil(RESERVE * required.delay / step - 1e-9) * step
        self._gain, self._threads = RESERVE * required.gain, threads

    def costs(self, logs: Array) -> Array:
        """Cost of each candidate (candidates,): 0 where all tests pass."""
        numbers = self._values[:, None] * np.exp(logs.T[self._knob])
        settled = self._loops.settle(dict(zip(self._loops.paths, numbers, strict=True)), self._threads)
        lanes = list(zip(settled, numbers.T.tolist(), strict=True))
        if self._threads == 1:
            return np.array([self._cost(*lane) for lane in lanes])
        with ThreadPoolExecutor(self._threads) as pool:
            return np.array(list(pool.map(lambda lane: self._cost(*lane), lanes)))

    def measured(self, logs: Array) -> list[LoopMargins]:
        """Margins of each candidate, the worse of both linearisations."""
        numbers = self._values[:, None] * np.exp(logs.T[self._knob])
        settled = self._loops.settle(dict(zip(self._loops.paths, numbers, strict=True)), self._threads)
        return [self._measured(*lane) for lane in zip(settled, numbers.T.tolist(), strict=True)]

    def _measured(self, settled: Any, numbers: Sequence[float]) -> LoopMargins:
        if settled is None:
            return LoopMargins(delay=0.0, rotors=(1.0, 1.0), joints=(1.0, 1.0))
        return edges([self._loops.opened(settled, numbers, lag) for lag in LAGS]).margins

    def _cost(self, settled: Any, numbers: Sequence[float]) -> float:
        if settled is None:
            return DIVERGED
        found = [test(self._loops.opened(settled, numbers, lag), self._delay, self._gain) for lag in LAGS]
        return max(found)

    def close(self) -> None:
        """End the threads."""
        self._loops.close()


def test(loop: OpenLoop, delay: float, gain: float) -> float:
    """Cost of the tests that a loop does not pass."""
    changes = [{"extra_delay": delay}]
    changes += [{name: k} for name in ("rotor_gain", "joint_gain") for k in (gain, 1.0 / gain)]
    total = 0.0
    for change in changes:
        beyond = radius(loop, **change) - 1.0
        if not beyond <= 0.0:
            # rounded: the last bits of an eigenvalue are the linear algebra's
            total += FAILED + round(min(STEEP * beyond, MOST), 6)
    return total


class NoMargins:
    """Stands for the tests of a loop that cannot be linearised: none is asked for.

    Args:
        why: in words.
    """

    def __init__(self, why: str) -> None:
        self._why = why

    def costs(self, logs: Array) -> Array:
        """Nothing."""
        return np.zeros(len(logs))

    def measured(self, logs: Array) -> list[LoopMargins]:
        """Why there are none, for each candidate."""
        none = LoopMargins(delay=0.0, rotors=(1.0, 1.0), joints=(1.0, 1.0), why_none=self._why)
        return [none] * len(logs)

    def close(self) -> None:
        """Nothing is held."""
