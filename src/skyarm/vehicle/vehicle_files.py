"""Vehicles from files: the shipped library, TOML (see :mod:`skyarm.vehicle.schema`) and URDF."""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from skyarm.files import file_name, must_be_one_of, one_line, read_toml, shown, unreadable
from skyarm.files.kinds_of_files import require_kind
from skyarm.vehicle import sources
from skyarm.vehicle.assemble import assemble
from skyarm.vehicle.bodies import RigidBodies
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.schema import parse
from skyarm.vehicle.vehicle_records import Vehicle

LIBRARY = resources.files("skyarm.vehicle") / "library"


def list_vehicles() -> tuple[str, ...]:
    """Return the names of the shipped vehicles."""
    return tuple(sorted(Path(entry.name).stem for entry in LIBRARY.iterdir() if entry.name.endswith(".toml")))


def load_vehicle(name_or_path: str | os.PathLike[str]) -> Vehicle:
    """Load a vehicle from the library by name, or from a .toml or .urdf file.

    Args:
        name_or_path: a name of :func:`list_vehicles`, or a path with the suffix .toml or .urdf.

    Raises:
        VehicleError: one line, ``file: field = value: what is allowed``.
    """
    try:
        text = file_name(name_or_path, "vehicle")
    except ValueError as error:
        raise VehicleError(str(error)) from None
    path, known = Path(text), ", ".join(list_vehicles())
    if text in list_vehicles():
        entry = LIBRARY / f"{text}.toml"
        return _located(text, lambda: _from_toml(entry.read_bytes(), None))
    if path.suffix == ".xacro":
        plain = path.with_suffix("").with_suffix(".urdf").name
        raise VehicleError(f"vehicle = {shown(text)}: must be expanded first: xacro {path.name} -o {plain}")
    if path.suffix not in (".toml", ".urdf"):
        allowed = f"{must_be_one_of(list_vehicles(), text)}, or the path of a .toml or .urdf file"
        raise VehicleError(f"vehicle = {shown(text)}: {allowed}")
    reason = unreadable(path)
    if reason:
        raise VehicleError(f"vehicle = {shown(text)}: {reason}; shipped vehicles are {known}")
    if path.suffix == ".urdf":
        from skyarm.vehicle.urdf import read_urdf, urdf_vehicle

        return _located(text, lambda: urdf_vehicle(read_urdf(path)))
    return _located(text, lambda: _from_toml(path.read_bytes(), path.parent))


def _located(file: str, read: Any) -> Vehicle:
    """What ``read`` returns; its errors as one line that begins with the file."""
    try:
        vehicle: Vehicle = read()
    except VehicleError as error:
        raise VehicleError(f"{file}: {one_line(str(error))}") from None
    except OSError as error:
        raise VehicleError(f"{file}: file = {error.strerror!r}: must be readable") from None
    return vehicle


def read_document(content: bytes) -> dict[str, Any]:
    """TOML text as tables.

    Raises:
        VehicleError: not UTF-8, or a syntax error with its line.
    """
    try:
        return read_toml(content)
    except ValueError as error:
        raise VehicleError(str(error)) from None


def _from_toml(content: bytes, folder: Path | None) -> Vehicle:
    document: Mapping[str, Any] = read_document(content)
    try:
        require_kind(document, "vehicle")
    except ValueError as error:
        raise VehicleError(str(error)) from None
    file = parse(document)
    vehicle = assemble(file, None if file.urdf is None else _named_urdf(file.urdf, folder or Path()))
    sources.check_keys(document, file.sources)
    return vehicle


def _named_urdf(name: str, folder: Path) -> RigidBodies:
    path = folder / name
    reason = unreadable(path)
    if reason:
        raise VehicleError(f"urdf = {shown(name)}: {reason} ({shown(str(path))[1:-1]})")
    from skyarm.vehicle.urdf import read_urdf

    try:
        return read_urdf(path)
    except VehicleError as error:
        raise VehicleError(f"urdf = {name!r}: {error}") from None
