"""``skyarm attach``: an arm on an airframe, as a vehicle file."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any

import typer

from skyarm.cli.arguments import OutFile, Vehicle
from skyarm.cli.output import give, tell
from skyarm.records.files import must_be_one_of, output_file, printable, shown, write_atomically
from skyarm.records.files.toml import toml_text
from skyarm.vehicle.vehicle_files import is_robot, list_vehicles, load_vehicle, vehicle_of_text
from skyarm.vehicle.vehicle_records import Vehicle as Record

Three = tuple[float, float, float]

TIPS = ("tip", "tcp", "tool0", "ee_link", "ee", "end_effector", "flange")
"""Usual names, or ends of names, of a file's frame at the tip."""


def attach(
    airframe: Vehicle,
    arm: Annotated[str, typer.Argument(help="the arm's file, or robot:NAME")],
    file: OutFile,
    to: Annotated[str, typer.Option(help="base, a link or a frame of the airframe")] = "base",
    position: Annotated[
        Three, typer.Option(metavar="X Y Z", show_default=False, help="of the arm's root link there, m")
    ] = (0.0, 0.0, 0.0),
    rpy: Annotated[
        Three, typer.Option(metavar="ROLL PITCH YAW", show_default=False, help="of the arm's root link there, rad")
    ] = (
        0.0,
        0.0,
        0.0,
    ),
    prefix: Annotated[str, typer.Option(help="put before the arm's names")] = "",
    tip: Annotated[str | None, typer.Option(help="the arm's frame or link that tasks mean; its last one")] = None,
    mimic: Annotated[str, typer.Option(help="followers: lock or couple")] = "lock",
    armature: Annotated[float, typer.Option(help="kg m^2, of revolute joints' drives")] = 0.0,
) -> None:
    """Put an arm on an airframe: write a vehicle file.

    The file refers to both by their paths and replaces no other.
    """
    written = output_file(file, "--out")
    if written.suffix != ".toml":
        raise ValueError(f"--out = {shown(file)}: must end in .toml")
    document: dict[str, Any] = {"schema": 1, "name": written.stem, "airframe": _named_from(written, airframe)}
    document |= {"mimic": mimic} if mimic != "lock" else {}
    alone = vehicle_of_text(toml_text(document), written)
    mount = {"to": to, "position": [*position], "rpy": [*rpy], "prefix": prefix, "armature": armature}
    table = {name: value for name, value in mount.items() if value not in ("", "base", 0.0, [0.0, 0.0, 0.0])}
    document["attach"] = [{"arm": _named_from(written, arm), **table}]
    vehicle = vehicle_of_text(toml_text(document), written)
    found = _tip(alone, vehicle, prefix, tip, arm)
    if found in [frame.name for frame in vehicle.frames]:
        document = {**document, "end_effector": found}
    elif found:
        frame = {"name": _unique_name(f"{prefix}tip", vehicle), "link": found}
        document = {**document, "end_effector": frame["name"], "frames": [frame]}
    content = f"# {_word(arm)} on {_word(airframe)}, by skyarm attach; both stay as they are.\n{toml_text(document)}"
    vehicle = vehicle_of_text(content, written)
    if os.path.lexists(written):
        raise ValueError(f"--out = {shown(file)}: must not be there yet: no vehicle file is overwritten")
    write_atomically(written, content.encode())
    give(
        file=written,
        vehicle=vehicle.name,
        mass_kg=float(vehicle.mass),
        rotors=len(vehicle.rotors),
        joints=[link.joint.name for link in vehicle.links],
        followers=[each.link.joint.name for each in vehicle.followers],
        tip=vehicle.end_effector or None,
        notes=list(vehicle.notes),
    )
    told = f"{written}: {float(vehicle.mass):.4g} kg, {len(vehicle.rotors)} rotors, {vehicle.n} joints, "
    told += f"tip {vehicle.end_effector!r}" if vehicle.end_effector else "no tip (--tip)"
    tell(told + (f"; {len(vehicle.notes)} notes: skyarm show {written}" if vehicle.notes else ""))


def _tip(alone: Record, whole: Record, prefix: str, wanted: str | None, file: str) -> str:
    """Frame or link of the arm that becomes the tip; empty where the arm has no single end.

    Args:
        alone: the airframe.
        whole: with the arm.
        prefix: of the arm's names.
        wanted: the tip that was asked for.
        file: of the arm.
    """
    moving, carriers = whole.moving, ["base", *(link.name for link in whole.moving)]
    there = {*(link.name for link in alone.moving), *(frame.name for frame in alone.frames)}
    links = [link.name for link in moving if link.name not in there]
    frames = {frame.name: carriers[frame.link + 1] for frame in whole.frames if frame.name not in there}
    if wanted is not None:
        for name in (prefix + wanted, wanted):
            if name in (*frames, *links):
                return name
        plain = [name.removeprefix(prefix) for name in (*frames, *links)]
        raise ValueError(f"--tip = {shown(wanted)}: {must_be_one_of(plain, wanted)}")
    if file.endswith(".toml") and load_vehicle(file).end_effector:
        return prefix + load_vehicle(file).end_effector
    for ending in TIPS:
        usual = [name for name in frames if name.endswith(ending)]
        if usual:
            return usual[-1]
    carrying = {moving[link.parent].name for link in moving if link.parent >= 0}
    end, *others = [name for name in links if name not in carrying] or [""]
    held = [name for name, link in frames.items() if not end or link == end]
    return "" if others else held[-1] if held else end


def _named_from(written: Path, name: str) -> str:
    """A file as it is named from the folder of another one; names of the library and of robots stay."""
    if name in list_vehicles() or is_robot(name):
        return name
    try:
        return Path(os.path.relpath(os.path.realpath(name), os.path.realpath(written.parent))).as_posix()
    except ValueError:  # another drive, or a NUL
        return name


def _unique_name(name: str, vehicle: Record) -> str:
    """The name, with underscores until no frame has it."""
    while name in [frame.name for frame in vehicle.frames]:
        name += "_"
    return name


def _word(name: str) -> str:
    return printable(Path(name).name)
