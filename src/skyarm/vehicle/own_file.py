"""Vehicles of other programs' files as vehicle files of this library: ``skyarm new vehicle NAME --from FILE``."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from skyarm.vehicle.attach import bodies_of, place_in
from skyarm.vehicle.check import refuse
from skyarm.vehicle.rotor_tables import RotorTables, mount_rotors
from skyarm.vehicle.stated_rotors import MAX_THRUST, gaps_of
from skyarm.vehicle.vehicle_files import is_robot, load_vehicle, read_rigid, robot_file
from skyarm.vehicle.vehicle_text import vehicle_text

OF_TILTS = {"lower": -1, "upper": 1, "time_constant": 1}
"""Numbers in place of those that a file lacks of the servo of a tilting rotor."""


def own_vehicle_file(file: str, name: str, tip: str = "") -> tuple[str, bool]:
    """Text of a vehicle file, and whether the vehicle in it is whole or has gaps, written as comments to be filled in.

    Args:
        file: name or path that :func:`skyarm.load_vehicle` takes.
        name: name of the vehicle in the text.
        tip: link or frame that becomes the end effector; that of the file if empty.

    Raises:
        VehicleError: one line: the file cannot be read, has no such tip, or lacks numbers in a file of this library.
    """
    loaded = load_vehicle(file)
    vehicle, path = replace(loaded, name=name), robot_file(file) if is_robot(file) else Path(file)
    if tip:
        frames = {each.name: each for each in (place_in(bodies_of(vehicle), tip, "--tip"), *vehicle.frames)}
        vehicle = replace(vehicle, frames=tuple(frames.values()), end_effector=tip)
    notes = {"rotors.inertia": f"{path.name}: links of the rotors, about their axes", **dict(vehicle.sources)}
    notes |= {"base.mass": f"{path.name}: its root and what is fixed to it"}
    for link in vehicle.moving:
        notes |= {f"links.{link.name}.mass": path.name, f"links.{link.name}.joint.name": path.name}
    head = [f"Written by: skyarm new vehicle {name} --from {file}", *vehicle.notes]
    if vehicle.looks:
        head.append(f"{len(vehicle.looks)} meshes: left out; a vehicle file names none")
    if not vehicle.gaps:
        return vehicle_text(vehicle, head, notes), bool(vehicle.rotors)
    if path.suffix == ".toml":
        refuse("--from", file, f"must be whole: {vehicle.gaps[0]}")
    bodies = read_rigid(path, "lock")
    own = {each.name: {gap.partition(" ")[0]: gap for gap in gaps_of(each, each.values)} for each in bodies.rotors}
    gaps = {field: gap for each in own.values() for field, gap in each.items()}
    tilt = {name: value for name, value in OF_TILTS.items() if f"tilt.{name}" in gaps}
    usual = dict.fromkeys(gaps.keys() - {f"tilt.{name}" for name in tilt}, 1) | ({"tilt": tilt} if tilt else {})
    flying = mount_rotors(bodies, RotorTables(usual=usual))
    blocks = vehicle_text(replace(vehicle, rotors=flying.rotors), head, notes).split("\n\n")
    for k, block in enumerate(blocks):
        rotor = re.match(r'\[\[rotors]]\nname = "(.*)"', block)
        for field, gap in (own.get(rotor[1], {}) if rotor else gaps if block.startswith("[rotor_d") else {}).items():
            line, comment = rf"^{field} = .*", f"# {field} = ...  # missing: {gap}"
            if inner := field.partition(".")[2]:  # an entry of tilt = {...} behind its axis: left out
                line, comment = rf"^(tilt = .*), {inner} = -?1\.0\b(.*)", rf"\1\2  # missing: {gap}"
            blocks[k] = re.sub(line, comment, blocks[k], flags=re.MULTILINE)
    text = "\n\n".join(blocks).replace(
        "[rotor_defaults]", "[rotor_defaults]\nall_stated = true  # no default for a gap"
    )
    if "max_speed" in gaps and MAX_THRUST in bodies.rotors[0].values:  # at a speed of 1, k_f is the largest thrust
        text = text.replace("\nthrust_coefficient = ", f"\n{MAX_THRUST} = ")
    return text, False
