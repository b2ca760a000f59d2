"""Gains of a law that the catalogue knows, as places where a search may begin beside the gains that it was given."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from skyarm.actuation import AllocationError
from skyarm.control.actuator_layer import plain_model
from skyarm.control.catalogue import LAWS, PRESETS, TUNED, make_named, tuned_factors
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.gain_presets import without_preset
from skyarm.scenario.law_by_name import loop_facts
from skyarm.scenario.scenario_record import Scenario
from skyarm.tune.law_knobs import Knob, KnobError, find_knobs

Array = npt.NDArray[np.float64]


def known_gains(scenario: Scenario, knobs: tuple[Knob, ...]) -> Array:
    """Logarithms of factors (starts, knobs) from a scenario's gains to those of the catalogue for the same law.

    Its maker's own, its tuned ones, and those of its presets; none for a law that the catalogue does not know. A knob
    has one factor: where its numbers differ among themselves, their geometric mean counts.
    """
    law = scenario.controller.name
    names = [law] if law in LAWS else []
    names += [f"{law}{TUNED}"] if law in tuned_factors() else []
    model = plain_model(scenario.controller.par.model)
    facts = loop_facts(scenario.rates, scenario.delays)
    found: list[list[float]] = []
    for name in [*names, *PRESETS]:
        try:
            made = make_named(name, model, facts)
            if without_preset(made.name) != without_preset(law):
                continue
            theirs = {knob.path: knob for knob in find_knobs(made, law)}
        except (ControllerError, AllocationError, KnobError):  # it does not fit this vehicle
            continue
        row = [_mean(theirs[knob.path]) - _mean(knob) if knob.path in theirs else 0.0 for knob in knobs]
        if not any(np.allclose(row, other) for other in ([0.0] * len(knobs), *found)):
            found.append(row)
    return np.array(found).reshape(len(found), len(knobs))


def _mean(knob: Knob) -> float:
    """Mean logarithm of a knob's numbers."""
    return sum(math.log(number) for _, number in knob.numbers) / len(knob.numbers)
