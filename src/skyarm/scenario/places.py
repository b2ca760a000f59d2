"""Where in a scenario's records the number of a dotted path stands (:mod:`skyarm.scenario.numbers`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.files import did_you_mean
from skyarm.records.leaves import Place
from skyarm.records.replace_parts import part
from skyarm.reference import Constant
from skyarm.scenario.names_of_fields import names
from skyarm.scenario.scenario_record import Scenario, ScenarioError

ROOTS: Mapping[str, Place] = {
    "plant": ("world",),
    "model": ("controller", "par", "model"),
    "controller": ("controller", "par"),
    "environment.wind": ("wind",),
    "environment.air": ("air",),
    "environment.forces": ("forces",),
    "endings": ("endings",),
    "estimator": ("estimator",),
    "environment.faults": ("faults",),
    "sensors": ("sensors",),
    "initial": ("initial",),
    "reference": ("trajectory",),
    "changes": ("changes",),
    "payloads": ("payloads",),
    "world": ("contact",),
}

STRUCTURE = ("duration", "rates", "delays", "seed", "episode", "environment.ground", "plant.integrator", "plant.kind")
"""Fields of the file that shape an episode or key its noise; they are the same for all episodes of a batch."""

LATE = "delays.command"
LATER = (LATE, "delays.rotors", "delays.joints")
"""They vary where the scenario says how long they get (:class:`skyarm.scenario.scenario_record.Delays`)."""

JOINED = "reference.joined"
"""When the law joins the reference: of the scenario, not of the trajectory."""


def places_of(scenario: Scenario, path: str) -> tuple[Place, ...]:
    """Places of the scenario record at which the number of a path stands; all hold the same.

    Raises:
        ScenarioError: a field that does not exist (with those that do), or one that is structure.
    """
    if path in LATER and scenario.delays.longest_command is not None:
        return (("delays", path.removeprefix("delays.")),)
    if path == JOINED:
        return (("joined",),)
    for field in STRUCTURE:
        if path == field or path.startswith(f"{field}."):
            raise ScenarioError(f"path = {path!r}: {field} is structure, the same for all episodes; fly two studies")
    if path.startswith("reference.") and scenario.path_time is not None:
        allowed = "must stay as it is where the reference has a governor, which has planned for it"
        raise ScenarioError(f"path = {path!r}: {allowed}; make a scenario of each (skyarm.govern)")
    if path.startswith("changes.") and not path.endswith(".value"):
        raise ScenarioError(f"path = {path!r}: must be changes.NUMBER.value; when a change comes is structure")
    for root, start in roots(scenario).items():
        if path.startswith(f"{root}."):
            return _follow(scenario, path, start, path[len(root) + 1 :].split("."))
    near = did_you_mean(".".join(path.split(".")[:2]), ROOTS) or did_you_mean(path.split(".", maxsplit=1)[0], ROOTS)
    raise ScenarioError(f"path = {path!r}: {near}must start with one of {', '.join(ROOTS)}")


def roots(scenario: Scenario) -> dict[str, Place]:
    """Beginnings of paths, the longest first where one begins another."""
    named: dict[str, Place] = {
        f"sensors.{each.name}": ("instruments", str(i), "sensor") for i, each in enumerate(scenario.instruments)
    }
    carried = ("world", "vehicle", "drives")
    mounted = enumerate(scenario.world.vehicle.drives)
    named |= {f"plant.drives.{each.name}": (*carried, str(i), "drive") for i, each in mounted}
    named |= {f"plant.drives.{each.joint}": ("drives", str(i), "drive") for i, each in enumerate(scenario.drives)}
    return {**named, **ROOTS}


def _follow(scenario: Scenario, path: str, start: Place, words: list[str]) -> tuple[Place, ...]:
    places: Any = (start,)
    for word in words:
        if isinstance(places, tuple):
            options = names(part(scenario, places[0]))
            heads = places
        else:
            options, heads = places, (start,)
        if word not in options:
            known = [*options, *(_further(scenario, path) if start in ROOTS.values() else ())]
            there = f"{did_you_mean(word, known)}there are {', '.join(known) or 'no fields'}"
            raise ScenarioError(f"path = {path!r}: no {word!r} here; {there}")
        places = _joined(heads, options[word])
        start = heads[0]
    if not isinstance(places, tuple):
        raise ScenarioError(f"path = {path!r}: must lead to a number; there are {', '.join(places)}")
    # a number of the file that is held as a signal
    return tuple((*at, "value") if isinstance(part(scenario, at), Constant) else at for at in places)


def _further(scenario: Scenario, path: str) -> list[str]:
    """Named parts of the scenario that a path might have led to: sensors, drives."""
    head = path[: path.index(".") + 1]
    return [name.removeprefix(head) for name in roots(scenario) if name not in ROOTS and name.startswith(head)]


def _joined(heads: tuple[Place, ...], found: Any) -> Any:
    """Places seen from the scenario; a tree of more words is seen from the first head."""
    if isinstance(found, tuple):
        return tuple((*head, *tail) for head in heads for tail in found)
    return found
