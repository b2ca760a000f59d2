"""Tunable gains of a controller, and known gain sets of its law: default, tuned and
preset.

A knob is one factor on all numbers below a path of the law's constants, which keep
their ratios. For a law with tuned gains
(:func:`skyarm.control.catalogue.tuned_factors`) they are the paths there. For any other
law, a user-defined one among them, they are found: every positive number of its
constants whose field states no unit, or the unit of a gain (per second, per metre, per
radian) and not that it is a bound. A vector and a tuple of any length are one knob;
each item of a tuple of fixed length, as ``tuple[float, float]``, is one.

A search goes about the gains of the catalogue: gains that are off by three or by ten
lead to the same candidates. The given ones are flown next to them, so that good ones
are not lost either.
"""

from __future__ import annotations

import math
import re
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from skyarm.algebra import Vec3
from skyarm.control.actuator_layer import plain_model
from skyarm.control.catalogue import LAWS, PRESETS, TUNED, make_named, tuned_factors
from skyarm.control.controller import Controller, ControllerError
from skyarm.dynamics.actuators import AllocationError
from skyarm.records.arrays import Array
from skyarm.records.files import did_you_mean, shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Place, Tree, is_record, part, parts, replace_at, walk
from skyarm.records.units import NUMBER, Unit, declared_fields
from skyarm.scenario.controller_table import loop_facts
from skyarm.scenario.scenario_record import Scenario

NOT_GAINS = ("model", "mixer", "network", "limits", "terms")
"""Fields of constants without gains of a law: model, allocation, network, limits."""

GAIN = re.compile(r"/(s|rad|m)\b|rad/s|\bHz\b")
"""Units of gains and bandwidths."""

LARGEST_FACTOR = 30.0
"""Largest factor on a knob, and its reciprocal; good gains stay in reach of gains
detuned tenfold."""


class KnobError(ValueError):
    """Error of an unknown tunable gain, or of a controller without any."""


@immutable
class GainKnob:
    """Tunable gain: one common factor on several parameter values of a controller.

    Attributes:
        path: path of the constants. unit: unit of the numbers, or nothing. numbers:
            place among the constants -> value.
        least, most: bounds of the numbers.
    """

    path: str
    unit: str
    numbers: tuple[tuple[Place, float], ...]
    least: float = 0.0
    most: float = math.inf

    @property
    def values(self) -> tuple[float, ...]:
        """Present values of the controller parameters that one gain scales."""
        return tuple(number for _, number in self.numbers)


Knobs = tuple[GainKnob, ...]
"""Tunable gains of a law, in order."""


def numbers_at(knobs: Sequence[GainKnob], logs: Sequence[float]) -> dict[Place, float]:
    """Numbers of tunable gains by place, multiplied by each gain's factor, whose
    logarithm is given.
    """
    pairs = zip(knobs, logs, strict=True)
    return {
        place: value * math.exp(log)
        for knob, log in pairs
        for place, value in knob.numbers
    }


def inner_place(controller: Controller) -> Place:
    """Parameter path of the innermost controller, inside wrappers such as the safety
    layer and the actuator layer.
    """
    place: Place = ()
    par = controller.par
    while is_record(inner := getattr(par, "inner", None)):
        place = (*place, "inner")
        par = inner
    return place


def find_knobs(
    controller: Controller, law: str = "", chosen: Sequence[str] | None = None
) -> Knobs:
    """Find the tunable gains of a controller.

    Args:
        controller: controller whose parameters are searched, below its layers.
        law: name of the law in the catalogue, if it has one.
        chosen: paths of the knobs to take, or beginnings of them; all if left out.

    Raises:
        KnobError: the law has none, or not the chosen one.
    """
    layers = inner_place(controller)
    par = part(controller.par, layers)
    listed = tuned_factors().get(law)
    candidates = (
        [_knob_at(par, path) for path in listed]
        if listed
        else [*_gains_within(par, (), NUMBER, False)]
    )
    knobs = tuple(
        replace(
            each, numbers=tuple(((*layers, *at), value) for at, value in each.numbers)
        )
        for each in candidates
        if each is not None
    )
    if not knobs:
        raise KnobError(
            f"controller = {shown(controller.name)}: has no gains: no positive number"
            " of its constants"
        )
    return chosen_knobs(knobs, chosen)


def chosen_knobs(knobs: Knobs, chosen: Sequence[str] | None) -> Knobs:
    """Tunable gains at the chosen paths or below them; all for None.

    Raises:
        KnobError: one line: a path of none.
    """
    if chosen is None:
        return knobs
    for path in chosen:
        if not any(_is_meant(path, knob.path) for knob in knobs):
            there = [knob.path for knob in knobs]
            raise KnobError(
                f"--knobs: {shown(path)}: {did_you_mean(path, there)}must be one of"
                f" {', '.join(there)}"
            )
    return tuple(
        knob for knob in knobs if any(_is_meant(path, knob.path) for path in chosen)
    )


def _is_meant(word: str, path: str) -> bool:
    return f"{path}.".startswith(f"{word}.")


def _knob_at(par: Tree, path: str) -> GainKnob | None:
    place = tuple(path.split("."))
    record, unit = par, NUMBER
    for name in place:
        below = parts(record)
        if name not in below:
            return None
        unit = (
            declared_fields(type(record)).get(name, (None, unit))[1]
            if is_record(record)
            else unit
        )
        record = below[name]
    return _knob(place, record, unit)


def _gains_within(
    record: Tree, place: Place, unit: Unit, fixed: bool
) -> Iterator[GainKnob]:
    """Tunable gains in a nested dataclass of a controller's parameters, by the units of
    its fields.
    """
    # a vector is one gain, whose numbers keep their ratios
    if is_record(record) and not isinstance(record, Vec3):
        declared = declared_fields(type(record))
        for name, value in parts(record).items():
            if not place and name in NOT_GAINS:
                continue
            kind, own = declared.get(name, (None, NUMBER))
            yield from _gains_within(
                value,
                (*place, name),
                # a part without a unit has that of what it is a part of
                own if own is not NUMBER else unit,
                _fixed_length(kind),
            )
        return
    if not _is_gain(unit):
        return
    if isinstance(record, tuple) and fixed:
        for name, value in parts(record).items():
            yield from _gains_within(value, (*place, name), unit, False)
        return
    knob = _knob(place, record, unit)
    if knob is not None:
        yield knob


def _fixed_length(kind: object) -> bool:
    """True if a field's annotation is a tuple of fixed length."""
    return typing.get_origin(kind) is tuple and Ellipsis not in typing.get_args(kind)


def _is_gain(unit: Unit) -> bool:
    if unit is NUMBER:
        return True
    return bool(GAIN.search(unit.unit)) and not unit.bound


def _knob(place: Place, record: Tree, unit: Unit) -> GainKnob | None:
    """Tunable gain made of all positive numbers in a parameter dataclass; None if all
    are zero.
    """
    numbers = tuple(
        (at, value)
        for at, value in walk(record, place)
        # whole numbers and flags are counts and choices, and no gains
        if type(value) is float and value > 0.0
    )
    return (
        GainKnob(path=".".join(place), unit=unit.unit, numbers=numbers)
        if numbers
        else None
    )


Numbers = list[tuple[float, ...]]
"""Values of every knob."""

GIVEN = "before"
"""Name of the gains before the search."""


@immutable
class Centred:
    """Tuning flight whose controller has the gains at the centre of the search.

    Attributes:
        flight: flight with these gains. knobs: gains whose factors are 1 there.
        starts: name -> (knobs,) logarithms of factors: the given gains first, then
            those of the catalogue.
    """

    flight: Scenario
    knobs: Knobs
    starts: Mapping[str, tuple[float, ...]]

    @property
    def rows(self) -> Array:
        """Initial gain vectors (starts, knobs), logarithms of factors."""
        return np.array(list(self.starts.values()))


def with_catalogue_gains(flight: Scenario, knobs: Knobs, label: str) -> Centred:
    """Tuning flight with the search centred at known gains of its law if there are any,
    else at the present gains.

    Args:
        flight: flight with the given gains.
        knobs: gains of its law.
        label: name of the law as requested.
    """
    catalogue = _catalogue_gains(flight, knobs)
    names = [name for name in (label, *catalogue) if name in catalogue]
    known = {name: catalogue[name] for name in names}
    return centre(knobs, known, partial(with_constants, flight))


def with_constants(scenario: Scenario, numbers: Mapping[Place, float]) -> Scenario:
    """Scenario with other numbers of its law, by their places among its constants."""
    law = scenario.agent.controller
    return scenario.with_controller(replace(law, par=replace_at(law.par, numbers)))


def centre(
    knobs: Knobs,
    catalogue: Mapping[str, Numbers],
    moved: Callable[[Mapping[Place, float]], Scenario],
) -> Centred:
    """Flight with the search centred at the first of known gains if there are any, else
    at the present ones.

    Args:
        knobs: gains of the law.
        catalogue: known gains by name.
        moved: returns the flight with other numbers of the law.
    """
    # a knob is one factor: gains in other ratios cannot be its centre
    names = list(catalogue)
    if not names or not all(
        _same_shares(knob, at)
        for knob, at in zip(knobs, catalogue[names[0]], strict=True)
    ):
        middle = [knob.values for knob in knobs]
    else:
        middle = catalogue[names[0]]
    centred = tuple(
        replace(
            knob,
            numbers=tuple((place, at[i]) for i, (place, _) in enumerate(knob.numbers)),
        )
        for knob, at in zip(knobs, middle, strict=True)
    )
    place = moved({place: number for knob in centred for place, number in knob.numbers})
    starts = {GIVEN: _log_factors([knob.values for knob in knobs], middle)}
    for name in names:
        row = _log_factors(catalogue[name], middle)
        # the given gains do not count: with good ones and with bad ones a search asks
        # for as many others
        if not any(
            np.allclose(row, other, atol=1e-9)
            for key, other in starts.items()
            if key != GIVEN
        ):
            starts[name] = row
    return Centred(flight=place, knobs=centred, starts=starts)


def _catalogue_gains(scenario: Scenario, knobs: Knobs) -> dict[str, Numbers]:
    """Known gains of a control law: name of default, tuned or preset gains -> their
    values.

    None for a law that the catalogue does not know; no numbers of a knob that a preset
    does not have.
    """
    law = scenario.agent.controller.name
    names = [f"{law}{TUNED}"] if law in tuned_factors() else []
    names += [law] if law in LAWS else []
    model = plain_model(scenario.agent.model)
    facts = loop_facts(scenario.rates, scenario.agent.delays, scenario.agent.estimator)
    gains: dict[str, Numbers] = {}
    for name in [*names, *PRESETS]:
        # a law may not fit the vehicle, or have no gains
        try:
            made = make_named(name, model, facts)
            if made.name != law:
                continue
            theirs = {knob.path: knob for knob in find_knobs(made, law)}
        except (ControllerError, AllocationError, KnobError):
            continue
        gains[name] = [
            (
                theirs[knob.path].values
                if knob.path in theirs
                and len(theirs[knob.path].numbers) == len(knob.numbers)
                else ()
            )
            for knob in knobs
        ]
    return gains


def _same_shares(knob: GainKnob, numbers: tuple[float, ...]) -> bool:
    """True if given values of a gain are its current values times one common factor."""
    if not numbers:
        return False
    factors = np.array(numbers) / np.array(knob.values)
    # one factor but for rounding
    return bool(np.allclose(factors, factors[0], rtol=1e-6))


def _log_factors(numbers: Numbers, middle: Numbers) -> tuple[float, ...]:
    """Logarithms of the factors between two sets of gains, by the geometric means of
    their values.
    """
    return tuple(
        _mean(at) - _mean(base) if at else 0.0
        for at, base in zip(numbers, middle, strict=True)
    )


def _mean(numbers: tuple[float, ...]) -> float:
    return sum(map(math.log, numbers)) / len(numbers)
