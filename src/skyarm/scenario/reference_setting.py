"""What a scenario tells its reference: whose vehicle flies it, how strong it is, how long it flies, where files lie."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from skyarm.actuation.hover import highest_thrust
from skyarm.plant.interface import Truth
from skyarm.reference.feasibility import Feasibility, feasibility
from skyarm.reference.task_records import Setting
from skyarm.scenario.scenario_record import Scenario


def setting_of(world: Truth, duration: float) -> Setting:
    """Facts of the flight that a reference's tables may need."""
    weight = float(world.vehicle.mass) * float(world.gravity)
    most = float(highest_thrust(world.vehicle)) / weight if weight > 0.0 else math.inf
    return Setting(vehicle=world.vehicle, gravity=float(world.gravity), duration=duration, thrust_to_weight=most)


def in_folder(table: Any, folder: Path) -> Any:
    """A reference's table whose files of samples stand below a folder."""
    if isinstance(table, list):
        return [in_folder(item, folder) for item in table]
    if not isinstance(table, dict):
        return table
    found = {name: in_folder(item, folder) for name, item in table.items()}
    if found.get("kind") == "samples" and isinstance(found.get("file"), str):
        found["file"] = str(folder / found["file"])
    return found


def feasibility_of(scenario: Scenario) -> Feasibility | None:
    """What the plan of a scenario's tip lacks and asks for; None where the tip has no reference of its own."""
    return feasibility(scenario.trajectory, setting_of(scenario.world, scenario.duration))
