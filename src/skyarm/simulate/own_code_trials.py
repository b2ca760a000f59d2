"""Everything of a scenario that is not the library's, tried before anything of it is compiled."""

from __future__ import annotations

import numpy as np

from skyarm.algebra import Vec3
from skyarm.compile.tracing.float_trial import PERIODS
from skyarm.control.law_checks import is_own
from skyarm.control.law_trial import try_law
from skyarm.reference import Publisher
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.sensors.measurement import measurement_of
from skyarm.simulate.component_trials import try_components


def try_own_code(scenario: Scenario, *, law: bool = True) -> None:
    """Try law, air, forces, drives, sensors, estimator and endings over their first periods.

    Args:
        scenario: as it is to fly.
        law: try its law too.

    Raises:
        ScenarioError, LawError: one line with file and line.
    """
    try_components(scenario)
    if law and is_own(scenario.controller):
        _try_law(scenario)


def _try_law(scenario: Scenario) -> None:
    """The law along the scenario's references, from its first state on."""
    rates = scenario.rates
    seen = measurement_of(first_state(scenario), Vec3(0.0, 0.0, float(scenario.world.gravity)))
    times = Publisher(control_rate=rates.control, reference_rate=rates.reference).held_time(np.arange(PERIODS))
    wanted = [scenario.trajectory.at(float(time)) for time in times[: scenario.steps]]
    try_law(scenario.controller, 1.0 / rates.control, seen, wanted)
