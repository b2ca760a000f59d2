"""How much dead time a made controller bears in hover, beside the delay that it believes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from skyarm.scenario.scenario_record import Scenario
from skyarm.stability.along import frozen_instants, hovering
from skyarm.stability.frozen_scenario import LAGS, nominal, without_adaptation
from skyarm.stability.margins import delay_margin

ENOUGH = 1.5
"""Margin over the believed delay below which it is warned of; the belief may be wrong by as much as it is large."""


@dataclass(frozen=True, kw_only=True, slots=True)
class HoverDelay:
    """What a loop bears of delay in hover.

    Attributes:
        margin: s of further dead time with the worse of the rotors' two time constants; inf beyond 0.1 s, 0 where the
            loop is unstable as it is.
        swings: s of further dead time from which on flights really swing.
        believed: s of delay that the law is told of, or the scenario has.
    """

    margin: float
    swings: float
    believed: float

    @property
    def enough(self) -> bool:
        """Whether the margin is at least ``ENOUGH`` times the believed delay; an unstable loop's never is."""
        return self.margin > 0.0 and self.margin >= ENOUGH * self.believed


def hover_delay(scenario: Scenario) -> HoverDelay:
    """The delay margin of a scenario's loop in a settled hover; zero where the hover is lost.

    Raises:
        ScenarioError: the loop has a memory that its linearisation does not know.
    """
    still = without_adaptation(scenario)
    found = next(frozen_instants(hovering(nominal(still)), 1), None)
    believed = believed_delay(scenario)
    if found is None:
        return HoverDelay(margin=0.0, swings=0.0, believed=believed)
    margin = min(delay_margin(found.opened(lag)) for lag in LAGS)
    return HoverDelay(margin=margin, swings=delay_margin(found.opened("between")), believed=believed)


def believed_delay(scenario: Scenario) -> float:
    """Delay of the loop, s, that is known before flight: what the law is told of, and what the scenario states."""
    par: Any = scenario.controller.par
    par = getattr(par, "inner", par)
    told = float(getattr(par, "delay_periods", 0)) / scenario.rates.control
    stated = float(scenario.delays.measurement) + float(scenario.delays.command)
    return max(told, stated) if math.isfinite(told) else stated
