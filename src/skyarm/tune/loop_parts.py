"""Parts of a loop that may be short of margin: groups of a law's gains, and what the plant has otherwise than believed.

Groups of gains are told by the words of their paths and by nothing else, so that any law has them; a knob whose path
says nothing is a group of its own.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_record import Scenario
from skyarm.tune.gain_search import exponent
from skyarm.tune.law_knobs import Knob

WORDS: Sequence[tuple[str, str]] = (
    ("observer", r"observ|filter|predict|cutoff|estimat|adapt|trim|answer|switch"),
    ("arm", r"joint|arm|elbow|shoulder|stiffness|damping"),
    ("tip", r"\btip|tool|ee\b"),
    ("base attitude", r"attitude|rate|tilt|yaw|roll|pitch|angular"),
    ("base position", r"position|velocity|pull|base|linear|height|altitude"),
)
"""Group of gains -> words of its paths; the first that is found counts."""

MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")

TOLERANCE = 0.05
"""Relative difference of plant and belief that is not worth a word."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Difference:
    """Numbers in which the plant is not what the law believes.

    Attributes:
        name: of the part. words: what differs, with both numbers.
        believed: path of the plant -> the believed number.
    """

    name: str
    words: str
    believed: Mapping[str, float]


def group_of(knob: Knob) -> str:
    """The part of the loop that a knob belongs to."""
    for group, words in WORDS:
        if re.search(words, knob.path.replace("_", " ") + " "):
            return group
    return knob.path.split(".")[0]


def groups(knobs: Sequence[Knob]) -> dict[str, list[Knob]]:
    """Knobs by part of the loop, in the order of :data:`WORDS`, then those that stand alone."""
    found: dict[str, list[Knob]] = {name: [] for name, _ in WORDS}
    for knob in knobs:
        found.setdefault(group_of(knob), []).append(knob)
    return {name: members for name, members in found.items() if members}


def slowed(members: Sequence[Knob], share: float) -> dict[str, float]:
    """Path of the controller -> number, with the group's bandwidth times a share: stiffness by its square."""
    return {
        f"controller.{'.'.join(place)}": number * share ** exponent(knob)
        for knob in members
        for place, number in knob.numbers
    }


def differences(scenario: Scenario) -> list[Difference]:
    """What of the plant differs from the belief, in numbers that a loop in hover knows."""
    plant, belief = scenario.world.vehicle, scenario.controller.par.model.vehicle
    found: list[Difference] = []
    if len(plant.rotors) == len(belief.rotors):
        lags = [f"rotors.{i}.{name}" for i in range(len(plant.rotors)) for name in LAGS]
        found += _difference(
            scenario, "motor lag", lags, "the motors' time constants are {ratio:.3g} of those believed"
        )
        thrust = [f"rotors.{i}.thrust_coefficient" for i in range(len(plant.rotors))]
        found += _difference(scenario, "thrust", thrust, "the rotors' thrust is {ratio:.3g} of that believed")
    if plant.n == belief.n:
        for name, bodies in (("arm", [f"links.{i}.body" for i in range(plant.n)]), ("base", ["base"])):
            paths = [f"{body}.mass" for body in bodies]
            more = [f"{body}.inertia.{moment}" for body in bodies for moment in MOMENTS]
            more += [f"{body}.com.{axis}" for body in bodies for axis in "xyz"]
            words = f"the {name} weighs {{ratio:.3g}} of what is believed"
            found += _difference(scenario, name, paths, words, more)
    return found


LAGS = ("time_constant_up", "time_constant_down")


def _difference(
    scenario: Scenario, name: str, paths: Sequence[str], words: str, more: Sequence[str] = ()
) -> list[Difference]:
    pairs = [tuple(number_at(scenario, f"{side}.vehicle.{path}") for side in ("plant", "model")) for path in paths]
    true, believed = (sum(column) for column in zip(*pairs, strict=True)) if pairs else (0.0, 0.0)
    if not pairs or believed <= 0.0 or abs(true / believed - 1.0) <= TOLERANCE:
        return []
    there = {f"plant.vehicle.{path}": number_at(scenario, f"model.vehicle.{path}") for path in (*paths, *more)}
    return [Difference(name=name, words=words.format(ratio=true / believed), believed=there)]
