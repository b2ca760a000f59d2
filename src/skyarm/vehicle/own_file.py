"""Vehicle files that ``skyarm new vehicle`` writes: of other programs' files, or of
a few numbers.
"""

from __future__ import annotations

import cmath
import math
import re
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from skyarm.records.files import must_be_one_of, shown
from skyarm.records.files.toml import toml_value
from skyarm.vehicle.attach import RigidBodies, bodies_of, place_in
from skyarm.vehicle.check import refuse
from skyarm.vehicle.imported_shapes import IMPORTS
from skyarm.vehicle.rotor_tables import RotorTables, joints_below_rotors, mount_rotors
from skyarm.vehicle.stated_rotors import MAX_THRUST, gaps_of
from skyarm.vehicle.vehicle_files import (
    is_robot,
    load_with_bodies,
    naming_file,
    robot_file,
)
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.vehicle.vehicle_tables import SOURCES
from skyarm.vehicle.vehicle_text import vehicle_text
from skyarm.view.pages.markup import render_template

ROTORS = (4, 6, 8, 10, 12)
"""Numbers of fixed rotors that balance each other when every second one turns the other
way; three of them cannot hold the yaw."""

ARM_LENGTHS, MASSES = (0.01, 10.0), (0.001, 10_000.0)
"""Bounds of arm lengths (m) and masses (kg): from a multirotor on a fingertip to one
that carries a car."""

OF_TILTS = {"lower": -1, "upper": 1, "time_constant": 1}
"""Numbers in place of those that a file lacks of the servo of a tilting rotor."""

NO_ROTORS = """
# The file states no rotors. One such table for each, without the #:
# [[rotors]]
# name = "front"
# position = ...            # [x, y, z], m: hub, base axes
# direction = ...           # "ccw" or "cw", seen against the thrust
# thrust_coefficient = ...  # N s^2/rad^2: thrust per squared speed
# moment_coefficient = ...  # m: drag torque per thrust
# max_speed = ...           # rad/s
# time_constant_up = ...    # s: lag of a rising speed
# time_constant_down = ...  # s: lag of a falling speed
"""


def own_vehicle_file(
    file: str, name: str, tip: str = "", collisions: str = "none"
) -> tuple[str, bool]:
    """Text of a vehicle file, and whether the vehicle in it is whole or has gaps,
    written as comments to be filled in.

    Args:
        file: name or path that :func:`skyarm.load_vehicle` takes.
        name: name of the vehicle in the text.
        tip: link or frame that becomes the end effector; that of the file if empty.
        collisions: shapes of the file that touch, as ``import_collisions``.

    Raises:
        VehicleError: one line: the file cannot be read, has no such tip, or lacks
            numbers in a file of this library.
    """
    if collisions not in IMPORTS:
        refuse("--collisions", collisions, must_be_one_of(IMPORTS, collisions))
    loaded, bodies = load_with_bodies(file, collisions)
    if bodies is None and collisions != "none":
        refuse("--collisions", collisions, "must be left out: FILE has its own")
    if collisions != "none" and not loaded.collisions:
        warnings.warn(
            f"--collisions {collisions}: no shape of FILE touches", stacklevel=2
        )
    if loaded.gaps and bodies is None:
        refuse("--from", file, f"must be whole: {loaded.gaps[0]}")
    with naming_file(file):
        return _text(file, replace(loaded, name=name), bodies, tip, collisions)


def bare_multirotor(name: str, rotors: int, arm_length: float, mass: float) -> str:
    """Text of a vehicle file of a multirotor without an arm, with typical numbers of
    its size.

    Args:
        name: name of the vehicle.
        rotors: number of rotors, which turn one way and the other by turns.
        arm_length: distance of the hubs from the middle, m.
        mass: kg.

    Raises:
        ValueError: one line: a number that is out of bounds.
    """
    if rotors not in ROTORS:
        raise ValueError(f"--rotors = {rotors}: {must_be_one_of(map(str, ROTORS), '')}")
    for value, option, (low, high), unit in (
        (arm_length, "--arm-length", ARM_LENGTHS, "m"),
        (mass, "--mass", MASSES, "kg"),
    ):
        if not low <= value <= high:
            raise ValueError(
                f"{option} = {shown(value)}: must be within {low:g} to {high:g} {unit}"
            )
    return render_template(
        "vehicle/exported/multirotor.jinja",
        name=name,
        arm_length=arm_length,
        mass=mass,
        # the nose lies between the first rotor and the last
        places=[
            cmath.rect(arm_length, math.tau * (k + 0.5) / rotors) for k in range(rotors)
        ],
    )


def _text(
    file: str, vehicle: Vehicle, bodies: RigidBodies | None, tip: str, collisions: str
) -> tuple[str, bool]:
    """Text of a vehicle file, and whether the vehicle is whole.

    A vehicle without gaps is written whole. One with gaps is written with any values in
    their place, whose lines then become comments; if joints of another file carry its
    rotors, the text refers to that file.
    """
    path = robot_file(file) if is_robot(file) else Path(file)
    if tip:
        frames = {
            each.name: each
            # frames of the file come last, so that one of the tip's name replaces the
            # new one
            for each in (place_in(bodies_of(vehicle), tip, "--tip"), *vehicle.frames)
        }
        vehicle = replace(vehicle, frames=tuple(frames.values()), end_effector=tip)
    # sources of the file win over the words for the inertia of rotors
    notes = {
        "rotors.inertia": f"{path.name}: links of the rotors, about their axes",
        **dict(vehicle.sources),
        "base.mass": f"{path.name}: its root and what is fixed to it",
    }
    for link in vehicle.moving:
        notes |= {
            f"links.{link.name}.mass": path.name,
            f"links.{link.name}.joint.name": path.name,
        }
    head = [
        f"Written by: skyarm new vehicle {vehicle.name} --from {file}",
        *vehicle.notes,
    ]
    if vehicle.looks:
        head.append(f"{len(vehicle.looks)} meshes: left out; a vehicle file names none")
    if bodies is None or not vehicle.gaps:
        text = vehicle_text(vehicle, head, notes)
        return (text, True) if vehicle.rotors else (text + NO_ROTORS, False)
    own = {
        each.name: {gap.partition(" ")[0]: gap for gap in gaps_of(each, each.values)}
        for each in bodies.rotors
    }
    # own values of each rotor, so that one gap is written at each rotor that has it
    gaps = {field: gap for each in own.values() for field, gap in each.items()}
    if "axis" in gaps:  # a comment in its place would read as z
        refuse(
            "--from",
            file,
            f"must state the direction of each thrust; it lacks {gaps['axis']}",
        )
    if joints := joints_below_rotors(bodies):
        source = next(
            # the vehicle file refers to the robot's file, for joints below rotors can
            # be held only there
            name
            for name, suffixes in SOURCES.items()
            if path.suffix in suffixes
        )
        named = file if is_robot(file) else path.resolve().as_posix()
        text = render_template(
            "vehicle/exported/riding.jinja",
            toml=toml_value,
            source=source,
            file=named,
            collisions=collisions,
            vehicle=vehicle,
            head=head,
            joints=joints,
            rotors=own,
        )
        return text, False
    flying = mount_rotors(
        bodies, RotorTables(own={name: _any_values(each) for name, each in own.items()})
    )
    # blocks of the text are split at empty lines, one for each table
    blocks = vehicle_text(replace(vehicle, rotors=flying.rotors), head, notes).split(
        "\n\n"
    )
    # at a speed of 1, the thrust coefficient is the largest thrust
    most = {
        each.name
        for each in bodies.rotors
        if "max_speed" in own[each.name] and MAX_THRUST in each.values
    }
    for k, block in enumerate(blocks):
        rotor = re.match(r'\[\[rotors]]\nname = "(.*)"', block)
        lacking: Mapping[str, str] = {}
        if rotor:
            lacking = own.get(rotor[1], {})
        elif block.startswith("[rotor_d"):
            lacking = gaps
        for field, gap in lacking.items():
            line, comment = rf"^{field} = .*", f"# {field} = ...  # missing: {gap}"
            # an entry of tilt = {...} behind its axis: left out
            if inner := field.partition(".")[2]:
                line = rf"^(tilt = .*), {inner} = -?1\.0\b(.*)"
                comment = rf"\1\2  # missing: {gap}"
            blocks[k] = re.sub(line, comment, blocks[k], flags=re.MULTILINE)
        if rotor[1] in most if rotor else len(most) == len(own):
            blocks[k] = blocks[k].replace(
                "\nthrust_coefficient = ", f"\n{MAX_THRUST} = "
            )
    text = "\n\n".join(blocks).replace(
        "[rotor_defaults]",
        "[rotor_defaults]\nall_stated = true  # no default for a gap",
    )
    return text, False


def _any_values(gaps: Mapping[str, str]) -> dict[str, Any]:
    """Values in place of those that a rotor lacks, with which it can be mounted."""
    inner = {name: value for name, value in OF_TILTS.items() if f"tilt.{name}" in gaps}
    return dict.fromkeys((name for name in gaps if "." not in name), 1) | (
        {"tilt": inner} if inner else {}
    )
