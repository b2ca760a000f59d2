"""Adjustable numbers of a scenario in flight, found in its records, with their units and bounds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from skyarm.records.files import number
from skyarm.records.leaves import Place, is_record, part, parts
from skyarm.records.units import Unit, declared_fields, units
from skyarm.reference import Trajectory
from skyarm.reference.splines import Polynomials
from skyarm.scenario.numbers import number_at
from skyarm.scenario.paths import names, places_of
from skyarm.scenario.scenario_record import Scenario, ScenarioError

GROUPS: Mapping[str, tuple[str, ...]] = {
    "law": ("controller",),
    "reference": ("reference",),
    "wind and forces": ("environment.wind", "environment.air", "environment.forces"),
    "payload": ("plant.payload", "model.payload", "payloads"),
    "sensors": ("sensors",),
    "delay": ("delays",),
    "faults": ("environment.faults",),
}
"""Panels, and the beginnings of the paths that stand in them."""

DERIVED_PARTS = ("model", "mixer", "slow", "damping_limits")
"""Parts of a law's parameters that its maker took from the vehicle: they are no gains."""

SPANS: Mapping[str, float] = {
    "m": 1.5,
    "rad": 1.2,
    "rad or m": 1.2,
    "m/s": 10.0,
    "N": 5.0,
    "N m": 0.5,
    "kg": 0.3,
    "Hz": 1.0,
    "s": 30.0,
}
"""Unit -> how far a slider reaches from a number that is zero."""

SIGMAS: Mapping[str, float] = {"m": 0.05, "m/s": 0.3, "rad": 0.05, "rad or m": 0.05, "rad/s": 0.3, "rad/s or m/s": 0.3}
"""Unit -> the largest standard deviation of a slider of noise."""


@dataclass(frozen=True, slots=True)
class Knob:
    """One number that a hand may change.

    Attributes:
        path: of the number (:mod:`skyarm.scenario.numbers`). group: a key of GROUPS.
        label: the path without its beginning. unit: SI; empty for pure numbers. meaning: in words.
        low, high: ends of the slider. step: of it. value: of the scenario.
    """

    path: str
    group: str
    label: str
    unit: str
    meaning: str
    low: float
    high: float
    step: float
    value: float

    def clip(self, value: object) -> float:
        """A value within the slider.

        Raises:
            ValueError: no finite number.
        """
        return min(max(number(value, self.path), self.low), self.high)


def knobs_of(scenario: Scenario, without: str = "") -> tuple[Knob, ...]:
    """All adjustable numbers of a scenario, in the order of the panels.

    Times at which something starts or stops are left out, since they mean nothing once they have passed.

    Args:
        scenario: of the flight.
        without: beginning of the paths that have no slider.
    """
    found, seen = list[Knob](), set[Place]()
    hidden = places_of(scenario, f"{without}.point_B.x")[0][:-2] if without else ("",)
    for group, roots in GROUPS.items():
        for root in roots:
            for path in _paths(scenario, root):
                places = _places(scenario, path)
                # a number may have two names: the file's word comes first
                if not places or seen.intersection(places) or places[0][: len(hidden)] == hidden:
                    continue
                seen.update(places)
                knob = _knob(scenario, path, group, root)
                if knob.unit != "s" or group in ("delay", "law"):
                    found.append(knob)
    return tuple(found)


def _places(scenario: Scenario, path: str) -> tuple[Place, ...]:
    """Places of the number of a path; empty where none can vary."""
    try:
        number_at(scenario, path)
        return ((path,),) if ".payload." in path else places_of(scenario, path)
    except ScenarioError:
        return ()


def _paths(scenario: Scenario, root: str) -> Iterator[str]:
    """Paths of all numbers below a root."""
    if root.endswith("payload"):
        yield f"{root}.mass"
    elif root == "delays":
        yield "delays.command"
    elif root == "controller":
        for word, value in parts(scenario.controller.par).items():
            if word not in DERIVED_PARTS and not isinstance(value, (bool, int, str)):
                yield from _below(value, f"{root}.{word}")
    elif root == "payloads":
        yield from (f"{root}.{i}.mass" for i in range(len(scenario.payloads)))
    elif root == "reference":
        if scenario.path_time is None:  # one is planned for the reference as it is
            yield from _of_motion(scenario.reference)
    elif root == "sensors":
        yield from _below(scenario.noise, root)
        for each in scenario.sensors:
            yield from _below(each.sensor, f"{root}.{each.name}")
    else:
        held = {"wind": scenario.wind, "air": scenario.air, "forces": scenario.forces, "faults": scenario.faults}
        yield from _below(held[root.split(".")[1]], root)


def _of_motion(motion: Trajectory) -> Iterator[str]:
    """Words of the file for the base's motion, then its signals, the heading and the joints."""
    base = names(motion)["base"]
    yield from _of_tree(base, "reference.base")
    for axis in ("x", "y", "z", "yaw"):
        yield from _below(getattr(motion, axis), f"reference.{axis}")
    for i, signal in enumerate(motion.joints):
        yield from _below(signal, f"reference.joints.{i}")


def _of_tree(tree: Any, path: str) -> Iterator[str]:
    if isinstance(tree, tuple):
        yield path
        return
    for word, inner in tree.items():
        if not word.isdigit() or "position" not in path:
            yield from _of_tree(inner, f"{path}.{word}")


def _below(value: Any, path: str) -> Iterator[str]:
    """Paths of the numbers of a record by its words, the file's before the record's."""
    # the coefficients of a planned curve are made together: a hand that moved one would tear the curve
    if value is None or isinstance(value, (bool, str, Polynomials)):
        return
    if isinstance(value, (int, float)):
        yield path
        return
    if not is_record(value) and not isinstance(value, tuple):
        return
    words, fields = names(value), parts(value)
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


def _knob(scenario: Scenario, path: str, group: str, root: str) -> Knob:
    value, unit = number_at(scenario, path), _unit(scenario, path)
    low, high = _span(group, path, value, unit)
    label = path.removeprefix(root).strip(".").replace("_", " ").replace(".", " ")
    return Knob(path, group, label or "value", unit.unit, unit.meaning, low, high, _step(high - low), value)


def _unit(scenario: Scenario, path: str) -> Unit:
    """The unit that the records on the way to a number state; of a signal, that of what it is a signal of."""
    if ".payload." in path:
        return Unit("kg", "point mass at the tip", low=0.0)
    record: Any = scenario
    found = Unit()
    for word in places_of(scenario, path)[0]:
        said = units(type(record)).get(word) if is_record(record) else None
        if said is not None and said.meaning != "in the unit of the signal":
            found = said
        record = parts(record)[word]
    return found


def _span(group: str, path: str, value: float, unit: Unit) -> tuple[float, float]:
    """Ends of a slider around a value, within the bounds of its unit."""
    if math.isfinite(unit.low) and math.isfinite(unit.high):
        return unit.low, unit.high
    if not math.isfinite(value):
        return 0.0, 600.0
    if group == "sensors":
        low, high = 0.0, max(SIGMAS.get(unit.unit, 1.0), 4.0 * value)
    elif group == "delay":
        low, high = 0.0, 0.03
    elif group == "law":
        low, high = (min(0.0, 4.0 * value), max(0.0, 4.0 * value)) if value else (0.0, 1.0)
    elif unit.unit == "s":
        low, high = 0.0, max(SPANS["s"], 2.0 * value)
    else:
        reach = SPANS.get(unit.unit, 1.0)
        low, high = value - reach, value + reach
        if unit.unit == "Hz":
            low = min(0.0, 2.0 * value)
        if group == "wind and forces":
            reach = max(reach, 2.0 * abs(value))
            low, high = -reach, reach
    return max(low, unit.low), min(high, unit.high)


def _step(width: float) -> float:
    """A step of 1, 2 or 5 times a power of ten, about a two-hundredth of a slider."""
    if width <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(width / 200.0))
    return next(power * k for k in (1.0, 2.0, 5.0, 10.0) if power * k >= width / 200.0 * 0.999)
