"""Check of a user-defined law along a scenario's references, as floats next to its traced program."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from skyarm.algebra import Vec3
from skyarm.compile.tracing.float_trial import PERIODS
from skyarm.control.controller import Controller
from skyarm.control.law_checks import check_controller, check_made, made_by
from skyarm.control.law_trial import try_law
from skyarm.control.model import Model
from skyarm.reference import Publisher
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.sensors.measurement import measurement_of


def check_law(law: Controller | Callable[[Model], Controller], scenario: Scenario | str = "case3") -> None:
    """Refuse a law that cannot be traced, is no function of its arguments, or gives no finite first command.

    The law steps over its first periods twice, as floats and as a traced program, and both must agree: a law that keeps
    something outside its memory, or freezes a number into the program, differs. A flight looks at the shape of each
    result only.

    Args:
        law: a controller, or its maker, which gets the scenario's model.
        scenario: gives model, references and initial state; or the name of a shipped one.

    Raises:
        LawError: one line with the law's file and line.
    """
    flown = load_scenario(scenario) if isinstance(scenario, str) else scenario
    if isinstance(law, Controller):
        controller = law
    else:
        name = getattr(law, "__name__", "law")
        controller = made_by(law, name, flown.controller.par.model, {})
        check_made(law, name, controller)
    check_controller(controller)
    rates = flown.rates
    weight = Vec3(0.0, 0.0, float(flown.world.gravity))
    seen = measurement_of(first_state(dataclasses.replace(flown, controller=controller)), weight)
    times = Publisher(control_rate=rates.control, reference_rate=rates.reference).held_time(np.arange(PERIODS))
    wanted = [flown.trajectory.at(float(time)) for time in times[: flown.steps]]
    try_law(controller, 1.0 / rates.control, seen, wanted)
