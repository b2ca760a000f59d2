"""Gains of a law that the catalogue knows: the place about which a search goes, and what its result must be as good as.

A search whose place is the catalogue's does not depend on the gains that it was given: gains that are off by three or
by ten lead to the same candidates. The given ones are flown beside them, so that good ones are not lost either.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.actuation import AllocationError
from skyarm.control.actuator_layer import plain_model
from skyarm.control.catalogue import LAWS, PRESETS, TUNED, full_name, make_named, tuned_factors
from skyarm.control.controller import Controller, ControllerError
from skyarm.control.laws.centroidal.presets import without_preset
from skyarm.records.leaves import Place
from skyarm.records.replace_parts import replaced
from skyarm.scenario.law_by_name import loop_facts
from skyarm.scenario.scenario_record import Scenario
from skyarm.tune.law_knobs import Knob, KnobError, find_knobs

Array = npt.NDArray[np.float64]

Numbers = list[tuple[float, ...]]
"""Of every knob."""

GIVEN = "before"
"""Name of the gains that a search was given."""


@dataclass(frozen=True, kw_only=True)
class Centred:
    """A flight whose law has the gains about which a search goes.

    Attributes:
        flight: with them. knobs: their factors are 1 there.
        starts: name -> (knobs,) logarithms of factors: the given gains first, then those of the catalogue.
    """

    flight: Scenario
    knobs: tuple[Knob, ...]
    starts: Mapping[str, tuple[float, ...]]

    @property
    def rows(self) -> Array:
        """The starts (starts, knobs)."""
        return np.array(list(self.starts.values()))


def centred(flight: Scenario, knobs: tuple[Knob, ...], label: str) -> Centred:
    """The flight with the catalogue's gains where there are any, those of its label first; else as it is.

    Args:
        flight: with the given gains.
        knobs: of its law.
        label: of the law, as it was asked for.
    """
    known = _known(flight, knobs)
    names = [name for name in (full_name(label), *known) if name in known]
    if not names or not all(_same_shares(knob, at) for knob, at in zip(knobs, known[names[0]], strict=True)):
        middle = [values(knob) for knob in knobs]
        numbers: dict[Place, float] = {}
    else:
        middle = known[names[0]]
        numbers = {
            place: number
            for knob, at in zip(knobs, middle, strict=True)
            for (place, _), number in zip(knob.numbers, at, strict=True)
        }
    moved = tuple(
        dataclasses.replace(knob, numbers=tuple((place, numbers.get(place, value)) for place, value in knob.numbers))
        for knob in knobs
    )
    law = flight.controller
    place = dataclasses.replace(flight, controller=dataclasses.replace(law, par=replaced(law.par, numbers)))
    starts = {GIVEN: _row([values(knob) for knob in knobs], middle)}
    for name in dict.fromkeys(names):
        row = _row(known[name], middle)
        # the given gains do not count: with good ones and with bad ones a search asks for as many others
        if not any(np.allclose(row, other, atol=1e-9) for key, other in starts.items() if key != GIVEN):
            starts[name] = row
    return Centred(flight=place, knobs=moved, starts=starts)


def values(knob: Knob) -> tuple[float, ...]:
    """A knob's numbers."""
    return knob.values(1.0)


def _known(scenario: Scenario, knobs: tuple[Knob, ...]) -> dict[str, Numbers]:
    """Numbers of every knob by name of the catalogue: a law's own, its tuned ones, those of its presets.

    None for a law that the catalogue does not know; no numbers of a knob that a preset does not have.
    """
    law = scenario.controller.name
    names = [f"{law}{TUNED}"] if law in tuned_factors() else []
    names += [law] if law in LAWS else []
    model = plain_model(scenario.controller.par.model)
    facts = loop_facts(scenario.rates, scenario.delays)
    found: dict[str, Numbers] = {}
    for name in [*names, *PRESETS]:
        made = _made(name, model, facts)
        if made is None or without_preset(made.name) != without_preset(law):
            continue
        try:
            theirs = {knob.path: knob for knob in find_knobs(made, law)}
        except KnobError:
            continue
        found[name] = [
            values(theirs[knob.path])
            if knob.path in theirs and len(theirs[knob.path].numbers) == len(knob.numbers)
            else ()
            for knob in knobs
        ]
    return found


def _made(name: str, model: object, facts: Mapping[str, object]) -> Controller | None:
    """A law of the catalogue; None where it does not fit this vehicle."""
    try:
        return make_named(name, model, facts)  # type: ignore[arg-type]
    except (ControllerError, AllocationError):
        return None


def _same_shares(knob: Knob, numbers: tuple[float, ...]) -> bool:
    """Whether one factor leads from a knob's numbers to others."""
    if not numbers:
        return False
    factors = np.array(numbers) / np.array(values(knob))
    return bool(np.allclose(factors, factors[0], rtol=1e-6))


def _row(numbers: Numbers, middle: Numbers) -> tuple[float, ...]:
    """Logarithms of factors; where the numbers of a knob differ among themselves, their geometric mean counts."""
    return tuple(_mean(at) - _mean(base) if at else 0.0 for at, base in zip(numbers, middle, strict=True))


def _mean(numbers: tuple[float, ...]) -> float:
    return sum(math.log(number) for number in numbers) / len(numbers)
