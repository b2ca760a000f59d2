"""What a word of the command line names: a scenario, or else a vehicle."""

from __future__ import annotations

from pathlib import Path

from skyarm.files import read_toml, unreadable
from skyarm.files.kinds_of_files import kind_of
from skyarm.scenario.scenario_file import list_scenarios
from skyarm.vehicle.vehicle_files import list_vehicles


def is_scenario(name: str) -> bool:
    """Whether a name is that of a shipped scenario, of a log, or of a file that describes a scenario.

    All else is read as a vehicle, whose reader says what is wrong with a file that nobody can read.
    """
    if name in list_vehicles():
        return False
    if name in list_scenarios() or name.endswith(".npz"):
        return True
    if not name.endswith(".toml") or unreadable(Path(name)):
        return False
    try:
        return kind_of(read_toml(Path(name).read_bytes())) == "scenario"
    except (OSError, ValueError):
        return False
