"""What margins a scenario's gains must have in hover, and the scenario as its margins are looked at."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from skyarm.control.controller import Controller
from skyarm.records.leaves import replaced
from skyarm.scenario.scenario_record import Scenario
from skyarm.tune.front import Required
from skyarm.tune.law_knobs import Knob

Array = npt.NDArray[np.float64]

DELAY_SHARE, PERIODS = 1.5, 2
"""Required delay margin: this share of the delay that the law knows, and at least so many control periods."""

GAIN = 1.5
"""Required gain margin of all rotors, and of all joints, up and down: 3.5 dB."""


def required(scenario: Scenario) -> Required:
    """Margins that a scenario's gains must have."""
    told = float(scenario.delays.measurement) + float(scenario.delays.command)
    return Required(delay=max(DELAY_SHARE * told, PERIODS / scenario.rates.control), gain=GAIN)


def with_gains(controller: Controller, knobs: Sequence[Knob], logs: Sequence[float]) -> Controller:
    """The controller with every knob's numbers times its factor."""
    numbers = {
        place: value * math.exp(log) for knob, log in zip(knobs, logs, strict=True) for place, value in knob.numbers
    }
    return dataclasses.replace(controller, par=replaced(controller.par, numbers))


def calm(flight: Scenario) -> Scenario:
    """The flight of candidates without the wind that is drawn, and with no delay but those that are known."""
    delays = dataclasses.replace(flight.delays, longest_command=None)
    return dataclasses.replace(flight, forces=flight.forces[:-1], delays=delays)
