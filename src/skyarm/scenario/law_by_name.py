"""A scenario under another law by name: the controller for its belief and its clocks, under the safety layer it had."""

from __future__ import annotations

import dataclasses
from typing import Any

from skyarm.control.actuator_layer import ActuatorParameters, has_tables, inner_parameters, plain_model, with_actuators
from skyarm.control.controller import Controller
from skyarm.control.model import Model
from skyarm.control.safety.safety_layer import SafetyParameters
from skyarm.control.vectored_layer import VectoredParameters, own_parameters
from skyarm.records.leaves import parts
from skyarm.scenario.changes import without_law
from skyarm.scenario.gains_file import make_named_or_tuned
from skyarm.scenario.scenario_record import Delays, Rates, Scenario

MEASURED = ("stiffness", "damping")
"""Limits of the safety layer that are measured on the law it is around."""


def loop_facts(rates: Rates, delays: Delays) -> dict[str, float]:
    """What a law may know of its loop: its clocks and the age of its measurements, s."""
    return {
        "control_period": 1.0 / rates.control,
        "reference_period": 1.0 / rates.reference,
        "delay": delays.measurement,
        "delay_periods": round(delays.measurement * rates.control),
    }


def controller_by_name(scenario: Scenario, name: str) -> Controller:
    """A preset, a law or LAW_tuned for the scenario's belief and clocks, under the layers of the law before it.

    The safety layer stays, and so does that of the actuators: a law of torques takes the place of a law of torques.

    Raises:
        ControllerError: unknown name, or a controller that does not fit the model.
        AllocationError: the model's rotors do not span torque and thrust.
    """
    before = scenario.controller.par
    made = make_named_or_tuned(name, plain_model(before.model), loop_facts(scenario.rates, scenario.delays))
    if not isinstance(before, ActuatorParameters):
        return _with_safety_of(before, made, scenario)
    inner, servos = inner_parameters(before), bool(scenario.controller.memory.drives)
    return on_actuators(_with_safety_of(inner, made, scenario), before.model, 1.0 / scenario.rates.control, servos)


def on_actuators(made: Controller, model: Model, control_period: float, servos: bool) -> Controller:
    """The controller on the servos and thrust tables of the belief; as it is where the belief has none."""
    return with_actuators(made, model, control_period, servos=servos) if servos or has_tables(model) else made


def _with_safety_of(before: Any, made: Controller, scenario: Scenario) -> Controller:
    """The controller with the safety layer whose constants are these; as it is if they are a law's."""
    if isinstance(before, VectoredParameters):
        before = own_parameters(before)
    if not isinstance(before, SafetyParameters):
        return made
    from skyarm.control.safety import with_safety_layer
    from skyarm.control.safety.limits import ERRORS, TIP_ERRORS

    limits = {field: value for field, value in parts(before.limits).items() if field not in MEASURED}
    errors = TIP_ERRORS if scenario.controller.keeps_tip else ERRORS
    if limits["trusted_joint_error"] == tuple(errors[link.joint.kind] for link in before.model.vehicle.links):
        # usual for the law before; one that keeps the tip loses its joints by more, and one that tracks them by less
        del limits["trusted_joint_error"]
    stow: Any = before.recovery.stow
    return with_safety_layer(made, limits, stow=stow)


def under_law(scenario: Scenario, name: str) -> Scenario:
    """The scenario as another law flies it, without what it changes of its own controller in flight.

    Raises:
        ControllerError, AllocationError: as :func:`controller_by_name`.
    """
    changes = without_law(scenario.changes)
    return dataclasses.replace(scenario, controller=controller_by_name(scenario, name), changes=changes)
