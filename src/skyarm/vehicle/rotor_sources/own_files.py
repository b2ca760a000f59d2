"""Rotors of skyarm's own exported files, whose element ``skyarm:rotors`` holds the
tables of a vehicle file.

MuJoCo, ROS and Gazebo have no word for tilts, thrust tables or two lags; they skip the
element.
"""

from __future__ import annotations

import math
import tomllib
import xml.etree.ElementTree as ET
from typing import Any

from skyarm.records.files import Fields, errors_as
from skyarm.vehicle.check import VehicleError, refuse
from skyarm.vehicle.rotor_tables import read_rotor_tables
from skyarm.vehicle.stated_rotors import UP, RotorFile, StatedRotor

OWN = "skyarm:rotors"
"""Tag of the element in XML files."""


TEXTS = ("name_textadr", "text_adr", "text_size")
"""Arrays of a MuJoCo model on its custom texts."""


def own_rotors(file: RotorFile) -> tuple[StatedRotor, ...]:
    """Rotors of a file that skyarm wrote.

    Raises:
        VehicleError: the element was changed to what is no table of a vehicle file, or
            has not as many as plugins.
    """
    content = getattr(file.content, "model", file.content)
    joints: list[str] = []
    if isinstance(content, ET.Element):
        text = next(content.iter(OWN), ET.Element("none")).text
        joints = [each.text or "" for each in content.iter("jointName")]
    else:
        text = _custom_text(content)
    if not text:
        return ()
    with errors_as(VehicleError, "skyarm:rotors: "):
        top = Fields(tomllib.loads(text), "")
        tables = read_rotor_tables(top)
        tilts = top.inner("tilts")
        every = [(name, {**tables.usual, **own}) for name, own in tables.own.items()]
        joints = joints or [
            tilts.text(name, f"{name}_tilt") if "tilt" in values else ""
            for name, values in every
        ]
        if len(joints) != len(every):
            refuse(
                "rotors",
                len(every),
                f"must be {len(joints)}, as many as motor-model plugins",
            )
        # taken, though unused: a rotor in this text without a position is refused
        for fields in tables.tables.values():
            fields.take("position")
        return tuple(
            _rotor(*each, joint) for each, joint in zip(every, joints, strict=True)
        )


def _custom_text(model: Any) -> str:
    """Custom text of a MuJoCo model that holds rotors; "" without."""
    for name, begin, size in zip(
        *(getattr(model, each, ()) for each in TEXTS), strict=True
    ):
        if model.names[name:].startswith(b"skyarm:rotors\0"):
            # size counts MuJoCo's closing zero byte
            return bytes(model.text_data[begin : begin + size - 1]).decode()
    return ""


def _rotor(name: str, values: dict[str, Any], joint: str) -> StatedRotor:
    """Rotor of a table in skyarm's own element."""
    position, axis = values.pop("position"), values.pop("axis", UP)
    # a file that states no largest speed means none, and that is no gap
    values.setdefault("max_speed", math.inf)
    where = dict.fromkeys(values, "skyarm's own element in the file")
    return StatedRotor(
        name=name, position=position, axis=axis, values=values, where=where, joint=joint
    )
