"""A name of the library that is of another kind than a command takes: what it is, and which command reads it."""

from __future__ import annotations

from pathlib import Path

from skyarm.files import shown
from skyarm.files.kinds_of_files import READS

MODELS = (".urdf", ".xacro")
"""Suffixes of files that only describe a vehicle."""


def require_not_another(name: str, wanted: str) -> None:
    """Refuse the name of a shipped thing of another kind, or a vehicle's model where something else is wanted.

    Args:
        name: as it was given; of files other than models nothing is said here.
        wanted: "vehicle", "scenario" or "study".

    Raises:
        ValueError: one line.
    """
    found = _kind(name, wanted)
    if found:
        read = f"'{READS[found]} {name}'"
        raise ValueError(f"{wanted} = {shown(name)}: must be a {wanted}, and this is a {found}, for {read}")


def _kind(name: str, wanted: str) -> str:
    from skyarm.scenario.scenario_file import list_scenarios
    from skyarm.sweep.study_file import list_studies
    from skyarm.vehicle.vehicle_files import list_vehicles

    if wanted != "vehicle" and Path(name).suffix in MODELS:
        return "vehicle"
    if "." in name or "/" in name:
        return ""
    kinds = {"vehicle": list_vehicles, "scenario": list_scenarios, "study": list_studies}
    if name in kinds[wanted]():
        return ""
    return next((kind for kind, there in kinds.items() if name in there()), "")
