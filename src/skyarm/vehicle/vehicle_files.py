"""Read vehicles from TOML (see :mod:`skyarm.vehicle.vehicle_tables`), URDF, SDF and
MJCF files and from the library.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from functools import cache, partial
from importlib import resources
from pathlib import Path

from skyarm.records.files import (
    PathLike,
    did_you_mean,
    errors_as,
    file_name,
    must_be_one_of,
    needs_extra,
    one_line,
    read_toml,
    shown,
    unreadable,
)
from skyarm.records.files.names import names_in, require_kind
from skyarm.vehicle.attach import RigidBodies
from skyarm.vehicle.check import VehicleError, refuse
from skyarm.vehicle.stated_rotors import RotorFile, rotors_in
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.vehicle.vehicle_tables import OTHERS, RIGID, vehicle_from

LIBRARY = resources.files("skyarm.vehicle") / "library"


def list_vehicles() -> tuple[str, ...]:
    """Return the names of the shipped vehicles."""
    return names_in(LIBRARY)


def load_vehicle(name_or_path: PathLike) -> Vehicle:
    """Load a vehicle from the library by name, or from a .toml, .urdf, .xacro, .sdf or
    .xml (MJCF) file.

    Args:
        name_or_path: a name of :func:`list_vehicles`, a path with one of these
            suffixes, or ``robot:NAME`` for a robot of a package that is installed
            (:mod:`skyarm.vehicle.vehicle_files`).

    Raises:
        VehicleError: one line, ``file: field = value: what is allowed``.
    """
    return load_with_bodies(name_or_path)[0]


def load_with_bodies(
    name_or_path: PathLike, collisions: str = "none"
) -> tuple[Vehicle, RigidBodies | None]:
    """Vehicle as of :func:`load_vehicle`, and the bodies of its file if that is one of
    another program.

    ``collisions`` is the word of ``import_collisions`` for such a file.
    """
    with errors_as(VehicleError):
        text = file_name(name_or_path, "vehicle")
    path = Path(text)
    alone = False
    if text in list_vehicles():
        return _library_vehicle(text), None
    if is_robot(text):
        with naming_file(text):
            return _plain_vehicle(robot_file(text), collisions)
    # rotors without bodies get a message of their own, so the file is opened
    if path.suffix in ROTORS_ALONE and path.is_file():
        with naming_file(text):
            alone = bool(rotors_in(RotorFile(path)))
    if alone:
        beside = (
            'its rotors stand beside bodies in a vehicle file: urdf = "BODIES.urdf",'
            f' [rotor_file] file = "{text}"'
        )
        raise VehicleError(f"vehicle = {shown(text)}: has no bodies; {beside}")
    if path.suffix in FOREIGN:
        made = FOREIGN[path.suffix].format(
            shlex.quote(text), shlex.quote(text.removesuffix(path.suffix))
        )
        raise VehicleError(f"vehicle = {shown(text)}: {made}")
    if path.suffix not in (".toml", *RIGID):
        allowed = (
            f"{must_be_one_of(list_vehicles(), text)}, or the path of a .toml, .urdf,"
            " .sdf or .xml (MJCF) file"
        )
        # a name without a suffix is more likely a mistyped name of the library
        missing = "there is no such file; " if path.suffix and not path.exists() else ""
        raise VehicleError(f"vehicle = {shown(text)}: {missing}{allowed}")
    if reason := unreadable(path):
        raise VehicleError(
            f"vehicle = {shown(text)}: {reason}; shipped vehicles are"
            f" {', '.join(list_vehicles())}"
        )
    with naming_file(text):
        return (
            _plain_vehicle(path, collisions)
            if path.suffix in RIGID
            else (_from_toml(path.read_bytes(), path), None)
        )


@cache
def _library_vehicle(name: str) -> Vehicle:
    """Vehicle of the library by name, read once per process and shared by plant, model
    and all scenarios.
    """
    with naming_file(name):
        return _from_toml((LIBRARY / f"{name}.toml").read_bytes(), None)


@contextmanager
def naming_file(file: str) -> Iterator[None]:
    """Context manager that turns an error into one line that begins with the file's
    name.
    """
    try:
        yield
    except VehicleError as error:
        raise VehicleError(f"{file}: {one_line(str(error))}") from None
    except OSError as error:
        raise VehicleError(
            f"{file}: file = {error.strerror!r}: must be readable"
        ) from None


def _from_toml(
    content: bytes, file: Path | None, above: tuple[Path, ...] = ()
) -> Vehicle:
    """Read a vehicle from the bytes of a TOML file; ``above`` are files that refer to
    it, to detect cycles.
    """
    chain = above if file is None else (*above, file.resolve())
    # paths in a file count from its folder
    refer = partial(_read, folder=Path() if file is None else file.parent, chain=chain)
    with errors_as(VehicleError):
        document = read_toml(content)
        require_kind(document, "vehicle")
        return vehicle_from(document, refer, Path() if file is None else file.parent)


ROTORS_ALONE = (".yaml", ".yml", ".params")
"""Suffixes of files that may state rotors without bodies."""

USD = (
    "has no rotors' numbers; make a URDF file of it (pip install"
    " nvidia-srl-usd-to-urdf), and state [[rotors]]"
)

FOREIGN = {
    ".jinja": "must be made a file first: pip install jinja2-cli; jinja2 {0} -o {1}",
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), USD),
}
"""Suffix of a file that is not read -> what makes one that is; file names in braces."""


def read_rigid(
    path: Path, mimic: str, base: str = "", xacro: Mapping[str, str] | None = None
) -> RigidBodies:
    """Read the bodies of a URDF, xacro, SDF or MJCF file.

    Args:
        path: path of the file.
        mimic: one of ``attach.MIMIC``.
        base: name of the body that is the base; "" for the file's only one.
        xacro: arguments of a xacro file.

    Raises:
        VehicleError: without the file's name, which the caller adds.
    """
    # readers are imported where they are needed, because MuJoCo is slow to load
    if path.suffix in OTHERS["urdf"]:
        from skyarm.vehicle.urdf import read_urdf

        bodies = read_urdf(path, mimic, xacro or {})
        if base not in ("", bodies.root):
            # a URDF file has one root, so another name is a mistake
            refuse("base", base, f"must be {bodies.root}, the root of the file")
        return bodies
    if path.suffix in OTHERS["sdf"]:
        from skyarm.vehicle.sdf import read_sdf

        return read_sdf(path, mimic, base)
    from skyarm.vehicle.mjcf import read_mjcf

    return read_mjcf(path, mimic, base)


def _plain_vehicle(path: Path, collisions: str) -> tuple[Vehicle, RigidBodies]:
    """Vehicle of a URDF, SDF or MJCF file alone, with the rotors that it states whole,
    and the file's bodies.
    """
    from skyarm.vehicle.urdf import urdf_vehicle

    bodies = read_rigid(path, "lock")
    return urdf_vehicle(bodies, collisions), bodies


def _read(
    field: str,
    name: str,
    suffixes: Collection[str],
    mimic: str,
    base: str,
    xacro: Mapping[str, str],
    folder: Path,
    chain: tuple[Path, ...],
) -> RigidBodies | Vehicle:
    """Read the file that a vehicle file refers to: a vehicle from TOML or the library,
    or bodies from another file.
    """
    named = "a name of the library, or " if ".toml" in suffixes else ""
    allowed = f"must be {named}the path of a file that ends in {' or '.join(suffixes)}"
    try:
        if is_robot(name):
            return read_rigid(robot_file(name), mimic, base)
        path = folder / name
        if base and path.suffix not in RIGID:
            refuse(
                field.replace("arm", "base"),
                base,
                f"must be left out: the file that {name} names says it",
            )
        # a name of the library wins over a file of that name without a suffix
        if named and name in list_vehicles():
            return _library_vehicle(name)
        if path.suffix not in suffixes:
            refuse(field, name, allowed)
        if reason := unreadable(path):
            refuse(field, name, f"{reason} ({shown(path)[1:-1]})")
        # resolved paths, so that a ring through links or .. is found
        if path.resolve() in chain:
            refuse(field, name, "must not lead back to a file that refers to it")
    except OSError as error:
        refuse(field, name, error.strerror or "must be readable")
    with errors_as(VehicleError, f"{field} = {name!r}: ", VehicleError):
        if path.suffix == ".toml":
            return _from_toml(path.read_bytes(), path, chain)
        return read_rigid(path, mimic, base, xacro)


PREFIX = "robot:"

CARRIED = Path("share") / "example-robot-data" / "robots"
"""Folder of example-robot-data below the prefix where its package installs its
files."""


def is_robot(name: str) -> bool:
    """True if a vehicle name begins with the prefix of robots of the package
    example-robot-data.
    """
    return name.startswith(PREFIX)


def robot_file(name: str) -> Path:
    """Path of the URDF file of a robot of the package example-robot-data.

    Args:
        name: ``robot:NAME``; NAME is the stem of the file (``ur5_robot``).

    Raises:
        VehicleError: one line: the package is not installed, or has no such robot.
    """
    robots = carried_robots()
    stem = name.removeprefix(PREFIX)
    if not robots:
        refuse("robot", name, needs_extra("robots"))
    if stem not in robots:
        near = did_you_mean(stem, robots)
        refuse(
            "robot",
            name,
            f"{near}must be one of the {len(robots)} robots of example-robot-data",
        )
    return robots[stem]


def carried_robots() -> dict[str, Path]:
    """URDF files of the package example-robot-data by robot name; empty if the package
    is not installed.
    """
    # cmeel installs below its own prefix, conda and apt below the environment's
    for folder in dict.fromkeys((*sys.path, sys.prefix)):
        for prefix in (Path(folder) / "cmeel.prefix", Path(folder)):
            if (prefix / CARRIED).is_dir():
                return {
                    each.stem: each
                    for each in sorted((prefix / CARRIED).rglob("*.urdf"))
                }
    return {}
