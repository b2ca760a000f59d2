"""Vehicles of other programs' files as vehicle files of this library: ``skyarm new vehicle NAME --from FILE``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from skyarm.records.files import errors_as
from skyarm.vehicle.attach import bodies_of, place_in
from skyarm.vehicle.check import VehicleError, refuse
from skyarm.vehicle.rotor_tables import unfinished_rotors
from skyarm.vehicle.vehicle_files import is_robot, load_vehicle, read_rigid, robot_file
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.vehicle.vehicle_text import unfinished_text, vehicle_text


def own_vehicle_file(file: str, name: str, tip: str = "") -> tuple[str, Vehicle]:
    """Text of a vehicle file that holds all of a vehicle, and the vehicle; numbers that it lacks are comments to fill.

    Args:
        file: name or path that :func:`skyarm.load_vehicle` takes.
        name: name of the vehicle in the text.
        tip: link or frame that becomes the end effector; that of the file if empty.

    Raises:
        VehicleError: one line: the file cannot be read, has no such tip, or lacks numbers in a file of this library.
    """
    vehicle = _with_tip(replace(load_vehicle(file), name=name), tip)
    notes, more = dict(vehicle.sources), ""
    path = robot_file(file) if is_robot(file) else Path(file)
    if vehicle.gaps:
        if path.suffix == ".toml":
            refuse("--from", file, f"must be whole: {vehicle.gaps[0]}")
        with errors_as(VehicleError, f"{file}: "):
            more = unfinished_text(unfinished_rotors(read_rigid(path, "lock")), notes)
    notes |= {"base.mass": f"{path.name}: its root and what is fixed to it"}
    notes |= {f"links.{each.name}.mass": f"{path.name}: link {each.name}" for each in vehicle.moving}
    notes |= {f"links.{each.name}.joint.name": f"{path.name}: joint {each.joint.name}" for each in vehicle.moving}
    return vehicle_text(vehicle, _head(vehicle, file, name), notes) + more, vehicle


def _with_tip(vehicle: Vehicle, tip: str) -> Vehicle:
    """Vehicle whose end effector is a frame, or the origin of a link, which becomes a frame."""
    if not tip:
        return vehicle
    at = place_in(bodies_of(vehicle), tip, "--tip")
    frames = vehicle.frames if tip in [each.name for each in vehicle.frames] else (*vehicle.frames, at)
    return replace(vehicle, frames=frames, end_effector=tip)


def _head(vehicle: Vehicle, file: str, name: str) -> Sequence[str]:
    meshes = [f"not here: {len(vehicle.looks)} meshes, which a vehicle file does not name"] if vehicle.looks else []
    notes = [f"{Path(file).name}: {note}" for note in vehicle.notes]
    return [f"Written by: skyarm new vehicle {name} --from {file}", *notes, *meshes]
