"""What a vehicle file takes from other files: an airframe, arms, rigid bodies in URDF or MJCF."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from skyarm.files import shown, unreadable
from skyarm.vehicle.assemble import SOURCES, Referred
from skyarm.vehicle.attach import bodies_of
from skyarm.vehicle.bodies import RigidBodies
from skyarm.vehicle.check import VehicleError, refuse
from skyarm.vehicle.nearest_inertia import with_real_inertias
from skyarm.vehicle.robots_by_name import is_robot, robot_file
from skyarm.vehicle.schema import VehicleFile
from skyarm.vehicle.schema_tables import AttachTable
from skyarm.vehicle.vehicle_records import MountedDrive, Vehicle

RIGID = (".urdf", ".xml", ".mjcf")
"""Suffixes of files that hold rigid bodies and joints, and no rotors."""

Loaded = Callable[[str, Path, tuple[Path, ...]], Vehicle]
"""From a name, the path that it means and the files above it to a vehicle."""


def expand(path: Path) -> str:
    """What to do with a xacro file."""
    return f"must be expanded first: xacro {path.name} -o {path.with_suffix('').with_suffix('.urdf').name}"


def read_rigid(path: Path, mimic: str) -> RigidBodies:
    """Bodies of a URDF or an MJCF file.

    Raises:
        VehicleError: without the file's name, which the caller adds.
    """
    if path.suffix == ".urdf":
        from skyarm.vehicle.urdf import read_urdf

        return read_urdf(path, mimic)
    from skyarm.vehicle.mjcf import read_mjcf

    return read_mjcf(path, mimic)


def plain_vehicle(path: Path) -> Vehicle:
    """A URDF or MJCF file as a vehicle without rotors."""
    from skyarm.vehicle.urdf import urdf_vehicle

    return urdf_vehicle(with_real_inertias(read_rigid(path, "lock"), False))


def referred_by(file: VehicleFile, own: Path | None, above: tuple[Path, ...], load: Loaded) -> Referred:
    """What the fields of a vehicle file refer to.

    Args:
        file: its fields.
        own: its path, from whose folder others are named; None for the library's.
        above: the files that refer to it.
        load: reads a vehicle of TOML.

    Raises:
        VehicleError: a file that is not there, of no known kind, or wrong; or files that refer to each other.
    """
    chain = above if own is None else (*above, own.resolve())
    folder = Path() if own is None else own.parent
    given = [name for name in SOURCES if getattr(file, name) is not None]
    if len(given) > 1:
        refuse(given[1], getattr(file, given[1]), f"must not be given together with '{given[0]}'")
    bodies, airframe, settled = None, None, list[str]()
    if given:
        field, name = given[0], str(getattr(file, given[0]))
        suffixes = {"urdf": (".urdf",), "mjcf": RIGID[1:], "airframe": (".toml", *RIGID)}[field]
        found = _read(field, name, folder, chain, load, suffixes, file.mimic)
        bodies = found if isinstance(found, RigidBodies) else bodies_of(found)
        if isinstance(found, Vehicle):
            airframe, settled = found, [link.joint.name for link in found.links]
    arms, drives = [], list[MountedDrive]()
    for index, table in enumerate(file.attach):
        arm, carried = _arm(f"attach[{index}]", table, file, folder, chain, load)
        arms.append(arm)
        if carried is not None:
            settled += [table.prefix + link.joint.name for link in carried.links]
            drives += [replace(each, name=table.prefix + each.name) for each in carried.drives]
    return Referred(bodies, airframe, tuple(arms), tuple(settled), tuple(drives))


def _arm(
    field: str, table: AttachTable, file: VehicleFile, folder: Path, chain: tuple[Path, ...], load: Loaded
) -> tuple[RigidBodies, Vehicle | None]:
    """Bodies of an arm, and the vehicle that its own file describes it as, with drives and stops."""
    found = _read(f"{field}.arm", table.arm, folder, chain, load, (".toml", *RIGID), table.mimic or file.mimic)
    if isinstance(found, RigidBodies):
        return found, None
    if found.rotors:
        refuse(f"{field}.arm", table.arm, f"must have no rotors ({found.rotors[0].name}); those of the airframe fly")
    if found.battery is not None:
        refuse(f"{field}.arm", table.arm, "must have no battery; that of the airframe feeds the rotors")
    return bodies_of(found), found


def _read(
    field: str,
    name: str,
    folder: Path,
    chain: tuple[Path, ...],
    load: Loaded,
    suffixes: tuple[str, ...],
    mimic: str,
) -> RigidBodies | Vehicle:
    """Bodies of a URDF or MJCF file, or the vehicle of a TOML file or of the library."""
    try:
        if is_robot(name):
            return read_rigid(robot_file(name), mimic)
        path = folder / name
        if path.suffix == "" and ".toml" in suffixes:
            return load(name, path, chain) if _shipped(name) else refuse(field, name, _allowed(suffixes))
        if path.suffix == ".xacro":
            refuse(field, name, expand(path))
        if path.suffix not in suffixes:
            refuse(field, name, _allowed(suffixes))
        reason = unreadable(path)
        if reason:
            refuse(field, name, f"{reason} ({shown(str(path))[1:-1]})")
        if path.resolve() in chain:
            refuse(field, name, "must not lead back to a file that refers to it")
    except OSError as error:
        refuse(field, name, error.strerror or "must be readable")
    try:
        return load(name, path, chain) if path.suffix == ".toml" else read_rigid(path, mimic)
    except VehicleError as error:
        raise VehicleError(f"{field} = {name!r}: {error}") from None


def _shipped(name: str) -> bool:
    from skyarm.vehicle.vehicle_files import list_vehicles

    return name in list_vehicles()


def _allowed(suffixes: tuple[str, ...]) -> str:
    named = "a name of the library, or " if ".toml" in suffixes else ""
    return f"must be {named}the path of a file that ends in {' or '.join(suffixes)}"
