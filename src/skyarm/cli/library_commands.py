"""``skyarm list``: what comes with the package, by name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from skyarm.cli.terminal_tables import add, table_of
from skyarm.control.catalogue import LAWS, PRESETS, tuned_factors
from skyarm.files import read_toml, write_atomically
from skyarm.scenario.scenario_file import list_scenarios, load_scenario
from skyarm.sweep.study_file import LIBRARY as STUDIES
from skyarm.sweep.study_file import list_studies
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle


def contents() -> dict[str, Any]:
    """Vehicles, scenarios, studies and controllers there are, as plain data."""
    vehicles = []
    for name in list_vehicles():
        v = load_vehicle(name)
        one = {"name": name, "mass_kg": float(v.mass), "rotors": len(v.rotors), "joints": v.n, "flies": not v.planar}
        vehicles.append(one)
    return {
        "schema": 1,
        "vehicles": vehicles,
        "scenarios": [{"name": name, "title": load_scenario(name).title} for name in list_scenarios()],
        # a study's title alone: reading the study would read its scenario, too
        "studies": [
            {"name": name, "title": str(read_toml((STUDIES / f"{name}.toml").read_bytes()).get("title", ""))}
            for name in list_studies()
        ],
        "presets": [{"name": name, "title": each.title, "law": each.law} for name, each in PRESETS.items()],
        "laws": [
            {
                "name": name,
                "title": each.title,
                "options": list(each.options()),
                "tuned": name in tuned_factors(),
            }
            for name, each in LAWS.items()
        ],
    }


def library(found: dict[str, Any]) -> RenderableType:
    """The same as tables."""
    vehicles = table_of("vehicle", "mass, kg", "rotors", "joints")
    for each in found["vehicles"]:
        kind = "" if each["flies"] else " (model only)"
        add(vehicles, each["name"] + kind, f"{each['mass_kg']:.3f}", str(each["rotors"]), str(each["joints"]))
    parts: list[RenderableType] = [vehicles]
    for heads, rows in (
        (("scenario", "what"), found["scenarios"]),
        (("study (skyarm sweep NAME)", "what"), found["studies"]),
        (("controller preset", "what"), found["presets"]),
        (("control law (+: LAW_tuned, too)", "what"), found["laws"]),
    ):
        table = table_of(*heads, left=2)
        for each in rows:
            add(table, each["name"] + (" +" if each.get("tuned") else ""), each["title"])
        parts += [Text(""), table]
    return Group(*parts)


def write(found: dict[str, Any], file: Path) -> Path:
    """The same as JSON."""
    return write_atomically(file, (json.dumps(found, indent=1) + "\n").encode())
