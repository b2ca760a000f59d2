"""The closed loop: scenario in, log out, metrics from the log."""

from skyarm.simulate.log import Log
from skyarm.simulate.loop import run
from skyarm.simulate.metrics import Window
from skyarm.simulate.scenario import Delays, Rates, Scenario, ScenarioError

__all__ = ["Delays", "Log", "Rates", "Scenario", "ScenarioError", "Window", "run"]
