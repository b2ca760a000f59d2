"""Closed-loop simulation: flies a scenario and returns its log, whose metrics are
evaluated afterwards.
"""

from skyarm.log.flight_log import Log
from skyarm.log.metrics.windows import Window
from skyarm.scenario.scenario_record import Delays, Rates, Scenario, ScenarioError
from skyarm.simulate.loop import run

__all__ = ["Delays", "Log", "Rates", "Scenario", "ScenarioError", "Window", "run"]
