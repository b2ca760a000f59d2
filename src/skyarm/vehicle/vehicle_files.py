"""Vehicles from files: the shipped library, TOML (see :mod:`skyarm.vehicle.schema`), URDF and MJCF."""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from skyarm.files import file_name, must_be_one_of, one_line, read_toml, shown, unreadable
from skyarm.files.names import require_kind
from skyarm.vehicle import sources
from skyarm.vehicle.assemble import assemble
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.referred_files import RIGID, expand, plain_vehicle, referred_by
from skyarm.vehicle.robots_by_name import is_robot, robot_file
from skyarm.vehicle.schema import parse
from skyarm.vehicle.vehicle_records import Vehicle

LIBRARY = resources.files("skyarm.vehicle") / "library"


def list_vehicles() -> tuple[str, ...]:
    """Return the names of the shipped vehicles."""
    return tuple(sorted(Path(entry.name).stem for entry in LIBRARY.iterdir() if entry.name.endswith(".toml")))


def load_vehicle(name_or_path: str | os.PathLike[str]) -> Vehicle:
    """Load a vehicle from the library by name, or from a .toml, .urdf or .xml (MJCF) file.

    Args:
        name_or_path: a name of :func:`list_vehicles`, a path with one of these suffixes, or ``robot:NAME`` for a robot
            of a package that is installed (:mod:`skyarm.vehicle.robots_by_name`).

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
    if is_robot(text):
        return _located(text, lambda: plain_vehicle(robot_file(text)))
    if path.suffix == ".xacro":
        raise VehicleError(f"vehicle = {shown(text)}: {expand(path)}")
    if path.suffix not in (".toml", *RIGID):
        allowed = f"{must_be_one_of(list_vehicles(), text)}, or the path of a .toml, .urdf or .xml (MJCF) file"
        raise VehicleError(f"vehicle = {shown(text)}: {allowed}")
    reason = unreadable(path)
    if reason:
        raise VehicleError(f"vehicle = {shown(text)}: {reason}; shipped vehicles are {known}")
    if path.suffix in RIGID:
        return _located(text, lambda: plain_vehicle(path))
    return _located(text, lambda: _from_toml(path.read_bytes(), path))


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


def vehicle_of_text(text: str, file: Path) -> Vehicle:
    """Vehicle of the text of a TOML file that is not written yet.

    Args:
        text: of the file.
        file: its path to come, from whose folder others are named.

    Raises:
        VehicleError: one line, as :func:`load_vehicle` says it.
    """
    return _located(str(file), lambda: _from_toml(text.encode(), file))


def _from_toml(content: bytes, file: Path | None, above: tuple[Path, ...] = ()) -> Vehicle:
    """Vehicle of a TOML file; ``above`` are the files that refer to it."""
    document: Mapping[str, Any] = read_document(content)
    try:
        require_kind(document, "vehicle")
    except ValueError as error:
        raise VehicleError(str(error)) from None
    tables = parse(document)
    vehicle = assemble(tables, referred_by(tables, file, above, _loaded))
    sources.check_keys(document, tables.sources)
    return vehicle


def _loaded(name: str, path: Path, above: tuple[Path, ...]) -> Vehicle:
    """Vehicle of the library, or of a TOML file that another one refers to."""
    if name in list_vehicles():
        return _from_toml((LIBRARY / f"{name}.toml").read_bytes(), None)
    return _from_toml(path.read_bytes(), path, above)
