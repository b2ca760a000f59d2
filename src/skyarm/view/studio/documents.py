"""Scenario documents of the studio: what a file says, made ready for changes by hand, and cut to what was flown.

A scenario is made ready by parts that do nothing until a hand moves them: a wind of zero newtons, a push of zero
newtons, a fault of every actuator that leaves all of its force, a queue of commands that is longer than today's delay.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skyarm.control.catalogue import LAWS, PRESETS, TUNED
from skyarm.files import read_toml, shown
from skyarm.scenario.scenario_file import LIBRARY, list_scenarios, scenario_from
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.scenario.scenario_text import LAYERS
from skyarm.vehicle.vehicle_files import list_vehicles

LONGEST = 600.0
"""s that a flight of the studio lasts at most; a scenario that is longer keeps its own duration, as one does whose
reference is planned for it."""

LONGEST_DELAY = 0.03
"""s: the longest delay of the commands that a slider gives."""


@dataclass(frozen=True, slots=True)
class Prepared:
    """A scenario that is ready for changes by hand.

    Attributes:
        own: the file's tables. document: the same with what was added. folder: where its vehicle paths start.
        scenario: what the tables mean, under the file's own law.
        push: beginning of the paths of the push.
        planned: whether the reference depends on the duration of the file, which the flight and what is saved of it
            then keep.
    """

    own: Mapping[str, Any]
    document: Mapping[str, Any]
    folder: Path
    scenario: Scenario
    push: str
    planned: bool

    def under(self, law: str | None) -> Scenario:
        """The scenario under a law by name; None is the file's own.

        Raises:
            ScenarioError: no such law, or one that does not fit the vehicle.
        """
        return self.scenario if law is None else scenario_from(under_law(self.document, law), self.folder)


def read_document(name: str) -> tuple[dict[str, Any], Path]:
    """Tables of a scenario file or a shipped scenario, and its folder.

    Raises:
        ScenarioError: one line. OSError: no such file.
    """
    if name in list_scenarios():
        return read_toml((LIBRARY / f"{name}.toml").read_bytes()), Path()
    if Path(name).suffix != ".toml":
        raise ScenarioError(f"scenario = {shown(name)}: must be a .toml file or a name of a shipped scenario")
    return read_toml(Path(name).read_bytes()), Path(name).parent


def prepare(document: Mapping[str, Any], folder: str | os.PathLike[str] = "") -> Prepared:
    """Add what a hand may move, as far as the scenario's plant and law take it.

    Raises:
        ScenarioError: the document is no scenario.
    """
    plain = scenario_from(document, folder)
    planned = _is_planned(plain, document, folder)
    ready = copy.deepcopy(dict(document))
    if not planned:
        ready["duration"] = max(plain.duration, LONGEST)
    environment = ready.setdefault("environment", {})
    if environment.get("wind", {}).get("mode", "none") == "none":
        environment["wind"] = {"mode": "force_wind"}
    forces = environment.setdefault("forces", [])
    forces.append({"kind": "force_wind", "gust": {"peak": [0.0, 0.0, 0.0], "start": 0.0, "duration": 0.1}})
    environment["faults"] = [*environment.get("faults", []), *_faults(plain)]
    delays = ready.setdefault("delays", {})
    if plain.kind == "rigid_body" and plain.controller.compiled and "longest_command" not in delays:
        delays["longest_command"] = max(plain.delays.longest, LONGEST_DELAY)
    scenario, push = scenario_from(ready, folder), f"environment.forces.{len(forces) - 1}"
    return Prepared(document, ready, Path(folder), scenario, push, planned)


def _is_planned(plain: Scenario, document: Mapping[str, Any], folder: str | os.PathLike[str]) -> bool:
    """Whether a longer flight has another reference, as one of joints or a path time planned ahead has, or none."""
    try:
        longer = scenario_from({**document, "duration": plain.duration + 1.0}, folder)
        return bool((plain.reference, plain.path_time) != (longer.reference, longer.path_time))
    except ValueError:
        return True


def _faults(scenario: Scenario) -> list[dict[str, Any]]:
    """A fault that takes nothing, for every actuator that has none."""
    known = {fault.name for fault in scenario.faults}
    vehicle = scenario.plant.vehicle
    actuators = [("rotor", rotor.name) for rotor in vehicle.rotors]
    actuators += [("joint", link.joint.name) for link in vehicle.links]
    names = [name for _, name in actuators]
    return [
        {kind: name, "effectiveness": 1.0, "start": 0.0}
        for kind, name in actuators
        if name not in known and names.count(name) == 1
    ]


def flown_document(
    prepared: Prepared, law: str | None, duration: float, paths: Collection[str], folder: Path
) -> dict[str, Any]:
    """The tables of what was flown: parts that no hand touched are as the file has them.

    Args:
        prepared: what was flown.
        law: by name; None is the file's own.
        duration: s that were flown; a reference that is planned keeps the duration that it was planned for.
        paths: numbers that a hand changed; changes of the file need parts of the file alone.
        folder: where the tables are going to be written; paths of vehicles are made to start there.
    """
    document = copy.deepcopy(dict(prepared.document))
    if prepared.planned:
        duration = document["duration"]
    document["duration"] = duration
    for table, word, moved in (
        ("environment", "forces", prepared.push),
        ("environment", "faults", "environment.faults."),
        ("environment", "wind", "environment.wind."),
        ("delays", "longest_command", "delays."),
    ):
        own = prepared.own.get(table, {})
        if any(path.startswith(moved) for path in paths):
            continue
        document[table].pop(word, None)
        if word in own:
            document[table][word] = copy.deepcopy(own[word])
    for word in ("environment", "delays"):
        if not document[word]:
            del document[word]
    if any(stop > duration for stop in _ends(document.get("windows", {}))):
        del document["windows"]
    document = under_law(document, law)
    for table in ("plant", "model"):
        _move_vehicle(document.get(table, {}), prepared.folder, folder)
    return document


def under_law(document: Mapping[str, Any], law: str | None) -> dict[str, Any]:
    """The tables with a law by name in place of their own, if one is given; its layers stay, changes of it do not."""
    if law is None:
        return dict(document)
    changes = [each for each in document.get("changes", ()) if each["path"].split(".", maxsplit=1)[0] != "controller"]
    layers = {word: value for word, value in document["controller"].items() if word in LAYERS}
    chosen: dict[str, Any] = {"law": law}
    if law in PRESETS:
        chosen = {"preset": law}
    elif law not in LAWS and law.endswith(TUNED):
        chosen = {"law": law.removesuffix(TUNED), "tuned": True}
    kept = {word: value for word, value in document.items() if word != "changes"}
    return {**kept, "controller": {**chosen, **layers}, **({"changes": changes} if changes else {})}


def _ends(windows: Mapping[str, Any]) -> list[float]:
    """Ends of the metrics' windows, s."""
    found: list[float] = []
    for value in windows.values():
        for window in value if value and isinstance(value, list) and isinstance(value[0], list) else [value]:
            found += [window[1]] if isinstance(window, list) else []
    return found


def _move_vehicle(table: dict[str, Any], old: Path, new: Path) -> None:
    """Let the path of a vehicle's file start at another folder."""
    named = table.get("vehicle")
    if isinstance(named, str) and named not in list_vehicles():
        table["vehicle"] = os.path.relpath((old / named).resolve(), new.resolve())
