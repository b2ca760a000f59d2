"""Unit and words of a scenario's number by its dotted path, for axes and heads of tables."""

from __future__ import annotations

import dataclasses
from typing import Any

from skyarm.records.leaves import Place
from skyarm.records.units import units
from skyarm.scenario.derived import ANGLES, payload_of
from skyarm.scenario.places import places_of
from skyarm.scenario.scenario_record import Scenario, first_state

OF_TURBULENCE = {"altitude": "m", "wind_20ft": "m/s", "minimum_airspeed": "m/s"}
"""Numbers from which the turbulence is made, which are no field of a record."""

LEFT_OUT = ("environment", "vehicle", "body", "value", "par")
"""Words of a path that say nothing to a reader."""

WHOSE = {"plant": "plant", "model": "model", "controller": "law"}
"""First words that say whose number it is."""


def unit_at(scenario: Scenario, path: str) -> str:
    """SI unit of the number that a path leads to, as its field declares it; empty for pure numbers and unknown ones.

    Of a joint, whose numbers have one unit if it turns and another if it slides, the one of its kind.

    Raises:
        ScenarioError: no number is there.
    """
    words = path.split(".")
    if payload_of(scenario, path):
        return "kg"
    if words[0] == "initial" and words[-1] in ANGLES:
        return "rad"
    if words[-2:-1] == ["turbulence"] and words[-1] in OF_TURBULENCE:
        return OF_TURBULENCE[words[-1]]
    if words[0] == "initial" and scenario.initial is None:
        scenario = dataclasses.replace(scenario, initial=first_state(scenario))
    return _unit(scenario, places_of(scenario, path)[0])


def _unit(record: Any, place: Place) -> str:
    """Unit of the last field on the way to a place that declares one."""
    found = ""
    for name in place:
        if isinstance(record, tuple):
            record = record[int(name)]
            continue
        said = units(type(record)).get(name)
        found = said.unit if said is not None else found
        slides = getattr(record, "kind", "revolute") == "prismatic"
        if " or " in found and hasattr(record, "kind"):
            found = found.split(" or ")[1 if slides else 0]
        record = getattr(record, name)
    return found


def words_of(path: str) -> str:
    """A path as words: ``plant.vehicle.links.0.joint.damping`` is "link 1 joint damping (plant)"."""
    words = [word for word in path.split(".") if word not in LEFT_OUT]
    whose = WHOSE.get(words[0], "") if len(words) > 1 else ""
    if whose:
        words = words[1:]
    if words[0] == "sensors" and len(words) == 2:
        return f"noise of {words[1].replace('_', ' ')}"
    found: list[str] = []
    for word in words:
        if word.isdecimal() and found:
            found[-1] = f"{found[-1].removesuffix('s')} {int(word) + 1}"
        else:
            found.append(word.removesuffix("_W").removesuffix("_B").replace("_", " "))
    return " ".join(found) + (f" ({whose})" if whose else "")


def labelled(words: str, unit: str) -> str:
    """Words with their unit in brackets, as axes have them."""
    return f"{words} [{unit}]" if unit else words
