"""Adjustable parameters of a scenario, with units and slider ranges."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping

from skyarm.records.files import number
from skyarm.records.immutable import positional
from skyarm.records.leaves import Place, is_record, part, parts
from skyarm.records.path_names import path_names, word_of
from skyarm.records.units import Unit, declared_fields
from skyarm.reference.splines import Polynomials
from skyarm.scenario.numbers import declared_at, number_at, words_of
from skyarm.scenario.paths import is_of_agent, places_of, prefix_of
from skyarm.scenario.scenario_record import Scenario, ScenarioError

DERIVED_PARTS = ("model", "mixer", "slow", "damping_limits", "autopilot")
"""Parts of a law's parameters that were computed from the vehicle and are no gains."""

SIGNALS = ("x", "y", "z", "yaw", "joints")
"""Keys of a reference that have sliders, after those of the base's motion."""

WIDEST = 1e3
"""Largest distance between a field's bounds that become the ends of its slider; wider
bounds only exclude absurd values."""

SPANS: Mapping[str, float] = {
    "m": 1.5,
    "rad": 1.2,
    "rad or m": 1.2,
    "m/s": 10.0,
    "N": 5.0,
    "N m": 0.5,
    "kg": 0.3,
}
"""Unit -> reach of a slider to both sides of its value."""

SIGMAS: Mapping[str, float] = {
    "m": 0.05,
    "m/s": 0.3,
    "rad": 0.05,
    "rad or m": 0.05,
    "rad/s": 0.3,
    "rad/s or m/s": 0.3,
}
"""Unit -> largest standard deviation on a slider of noise that is zero."""

LONGEST_DELAY = 0.03
"""Longest command delay (s) on its slider, unless the scenario states a longer one."""


@positional
class AdjustableNumber:
    """Adjustable parameter of a running simulation, with its slider's range.

    Attributes:
        path: path of the number (:mod:`skyarm.scenario.numbers`). group: title of its
            panel.
        declared: unit, meaning and bounds of its field.
        low, high: ends of the slider. value: number of the scenario.
    """

    path: str
    group: str
    declared: Unit
    low: float
    high: float
    value: float

    @property
    def label(self) -> str:
        """Label of a slider: its parameter path such as plant.gravity in words, and the
        unit.
        """
        words = words_of(word_of(self.path))
        return f"{words} ({self.declared.unit})" if self.declared.unit else words

    @property
    def step(self) -> float:
        """Step of the slider: 1, 2 or 5 times a power of ten, about 1/200 of its
        range.
        """
        least = (self.high - self.low) / 200.0
        power = 10.0 ** math.floor(math.log10(least))
        return next(
            # a little less, so that rounding does not take the next step up
            power * k
            for k in (1.0, 2.0, 5.0, 10.0)
            if power * k >= 0.999 * least
        )

    def clip(self, value: object) -> float:
        """Clip a value to the slider's range.

        Raises:
            ValueError: no finite number.
        """
        return min(max(number(value, self.path), self.low), self.high)


def knobs_of(
    scenario: Scenario, without: Collection[str] = ()
) -> tuple[AdjustableNumber, ...]:
    """List all adjustable parameters of a scenario, in the order of the slider panels
    and of its vehicles.

    Times at which something starts or stops are left out, since they mean nothing once
    they have passed.

    Args:
        scenario: scenario of the flight.
        without: paths of forces that have no sliders.
    """
    knobs = list[AdjustableNumber]()
    seen = set[Place]()
    for name in scenario.agents:
        one = scenario.of(name)
        of = prefix_of(scenario, name)
        # without its last two words it is the place of the force
        hidden = {places_of(one, f"{path}.point_B.x")[0][:-2] for path in without}
        for group, word in _paths(one):
            path = f"{of}{word}" if is_of_agent(word) else word
            places = _places(one, word)
            names = {(path.removesuffix(word), *place) for place in places}
            # a number may have two names: the file's word comes first
            if (
                not places
                or seen & names
                or any(places[0][: len(each)] == each for each in hidden)
            ):
                continue
            seen |= names
            value = number_at(one, word)
            declared = declared_at(one, word)
            if math.isfinite(value) and (
                declared.unit != "s" or group in ("delay", "law")
            ):
                span = (
                    _span_of_delay(one)
                    if group == "delay"
                    else _span(group, value, declared)
                )
                knobs.append(AdjustableNumber(path, group, declared, *span, value))
    return tuple(knobs)


def _places(scenario: Scenario, path: str) -> tuple[Place, ...]:
    """Field paths in the scenario record for a parameter path; empty if the parameter
    cannot vary.
    """
    try:
        number_at(scenario, path)
        return places_of(scenario, path)
    except ScenarioError:
        return ()


def _paths(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Yield (slider panel, parameter path) of all parameters of a scenario that may be
    adjusted.
    """
    law = parts(scenario.agent.controller.par)
    # whole numbers, switches and names are structure of the compiled law
    gains = [
        word
        for word in law
        if word not in DERIVED_PARTS and not isinstance(law[word], (bool, int, str))
    ]
    yield from _all_below("law", {f"controller.{word}": law[word] for word in gains})
    if scenario.agent.path_time is None:  # one is planned for the reference as it is
        yield from (
            ("reference", path)
            for path in _of_tree(
                path_names(scenario.agent.reference)["base"], "reference.base"
            )
        )
        yield from _all_below(
            "reference",
            {
                f"reference.{word}": getattr(scenario.agent.reference, word)
                for word in SIGNALS
            },
        )
    blowing = {
        f"environment.{word}": getattr(scenario, word)
        for word in ("wind", "air", "forces")
    }
    yield from _all_below("wind and forces", blowing)
    if not scenario.agent.has_estimator:
        yield from _all_below("sensors", {"sensors": scenario.agent.noise})
    for name, sensor in scenario.agent.all_sensors[1:]:
        where = f"sensors.{name}"
        # an encoder that differences its positions reads no rates
        unread = (
            f"{where}.rate." if getattr(sensor, "rates", "") == "difference" else " "
        )
        errors = _all_below("sensors", {where: sensor})
        # what is structurally absent (an int) has no random numbers: to add it would
        # change those of all others
        yield from (
            row
            for row in errors
            if not row[1].startswith(unread)
            and isinstance(_exact(scenario, row[1]), float)
        )
    yield from _all_below("faults", {"environment.faults": scenario.agent.faults})
    loads = (f"payloads.{i}.mass" for i in range(len(scenario.agent.payloads)))
    yield from (
        ("payload", path)
        for path in ("plant.payload.mass", "model.payload.mass", *loads)
    )
    yield "delay", "delays.command"


def _exact(scenario: Scenario, path: str) -> object:
    """Stored value of the parameter at a path of a scenario; None if it cannot vary."""
    places = _places(scenario, path)
    return part(scenario, places[0]) if places else None


def _all_below(group: str, records: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    """Yield (slider panel, parameter path) of all parameters inside the given parts of
    a scenario.
    """
    for root, record in records.items():
        yield from ((group, path) for path in _below(record, root))


def _of_tree(tree: object, path: str) -> Iterator[str]:
    """Yield the parameter paths in a tree of field names; position components by
    letter, not by index.
    """
    if not isinstance(tree, Mapping):
        yield path
        return
    for word, inner in tree.items():
        if not word.isdigit() or "position" not in path:
            yield from _of_tree(inner, f"{path}.{word}")


def _below(value: object, path: str) -> Iterator[str]:
    """Yield the parameter paths inside one part of a scenario, by the keys of the
    scenario file.
    """
    # the coefficients of a planned curve are made together: a hand that moved one would
    # tear the curve
    if value is None or isinstance(value, (bool, str, Polynomials)):
        return
    if isinstance(value, (int, float)):
        yield path
        return
    if not is_record(value) and not isinstance(value, tuple):
        return
    words, fields = path_names(value), parts(value)
    # counts are structure, which machine code cannot vary
    declared = declared_fields(type(value)) if is_record(value) else {}
    counts = {(name,) for name, (kind, _) in declared.items() if kind is int}
    own = [word for word in words if word not in fields and not word.isdigit()]
    # items of a tuple that have names of their own go by them
    chosen = own if own and isinstance(value, tuple) else [*own, *fields]
    for word in chosen:
        places = words.get(word)
        if isinstance(places, tuple) and places[0] not in counts:
            yield from _below(part(value, places[0]), f"{path}.{word}")


def _span_of_delay(scenario: Scenario) -> tuple[float, float]:
    """Range of the command delay: what the queue of commands leaves beside further
    delays of rotors or joints.
    """
    delays = scenario.agent.delays
    return 0.0, delays.longest - max(float(delays.rotors), float(delays.joints))


def _span(group: str, value: float, unit: Unit) -> tuple[float, float]:
    """Compute the range of a slider around a parameter's value, within the parameter's
    bounds.
    """
    if unit.high - unit.low <= WIDEST:
        return unit.low, unit.high
    reach = SPANS.get(unit.unit, 1.0)
    low, high = value - reach, value + reach
    if group in ("law", "sensors"):
        usual = 1.0 if group == "law" else SIGMAS.get(unit.unit, 1.0)
        # to both sides of zero for gains and errors that are zero, up to four times
        # others
        low, high = (
            (min(0.0, 4.0 * value), max(0.0, 4.0 * value)) if value else (0.0, usual)
        )
    return max(low, unit.low), min(high, unit.high)
