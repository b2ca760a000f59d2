"""Rotors as files of other programs state them: place, axis, sense and numbers, each
with where it stood.

A *rotor source* is a registered function (kind ``rotor_source``) that finds rotors in a
file. What the file does not hold is a gap, which the user's ``[[rotors]]`` or
``[rotor_defaults]`` fill; no default takes its place in silence.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.records.files import Fields
from skyarm.records.immutable import positional
from skyarm.records.registry.registrations import registrations
from skyarm.vehicle.check import refuse

UP = Vec3(0, 0, 1)

MAX_THRUST = "max_thrust"
"""Largest thrust (N): with one of the thrust coefficient and the largest speed it gives
the other one."""

LAGS = ("time_constant_up", "time_constant_down")

NEEDED = ("direction", "thrust_coefficient", "moment_coefficient", "max_speed", *LAGS)
"""Fields of a rotor without which a file's rotor is not whole, in the order of
messages."""


NEEDED_OF_TILTS = ("lower", "upper", "time_constant")
"""Fields of the servo of a rotor that tilts, without which it is not whole."""


@positional
class StatedRotor:
    """Rotor of another program's file, with what the file holds of it.

    Attributes:
        name: name of the rotor.
        link: link or frame of the file in whose axes the place is; "base" for the base.
        position, axis: hub (m) and direction of positive thrust in these axes.
        values: fields of :class:`skyarm.vehicle.Rotor` and ``max_thrust``, SI units ->
            number.
        where: field -> where the number stood in the file, in words that fit every
            rotor of it.
        joint, tilt_joint: joint that spins it, and one that tilts it, which are no
            joints of an arm; "" if the file has none.
        slower: ratio of its speed to that of the joint, as its simulator has it: the
            link's inertia counts by it.
        assumed: words that the file leaves out and its simulator has a default of,
            which flies, with a note.
        absent: field -> why this form of file does not state it. It is a gap, also if a
            rotor could do without.
        at_mass: true of a rotor that pushes at its link's centre of mass in place of
            ``position``.
        elements: elements of an XML file that it was read from, which no note calls
            unread.
    """

    name: str
    link: str = "base"
    position: Vec3 = ZERO3
    axis: Vec3 = UP
    values: Mapping[str, Any] = field(default_factory=dict)
    where: Mapping[str, str] = field(default_factory=dict)
    joint: str = ""
    tilt_joint: str = ""
    slower: float = 1.0
    assumed: tuple[str, ...] = ()
    absent: Mapping[str, str] = field(default_factory=dict)
    at_mass: bool = False
    elements: tuple[Any, ...] = ()


@positional
class RotorFile:
    """File in which rotor sources look for rotors.

    Attributes:
        path: path of the file.
        content: what its reader made of it: the root element of an XML file, a vehicle
            in MuJoCo's model, or None for other files.
        settings: ``[rotor_file]``, for numbers beside the file such as ``arm_length``
            (m); one that no source takes is refused.
    """

    path: Path
    content: Any = None
    settings: Fields = field(default_factory=lambda: Fields({}, "rotor_file"))

    @property
    def xml(self) -> ET.Element:
        """Root element of an XML file; an empty one of others."""
        return (
            self.content if isinstance(self.content, ET.Element) else ET.Element("none")
        )

    def endless(self) -> Iterator[tuple[ET.Element, str]]:
        """Joints of an XML file that turn without end, with the links that they
        move.
        """
        for joint in self.xml.findall("joint[@type='continuous']"):
            for end in joint.findall("child"):
                yield joint, end.get("link", "")


def rotors_in(file: RotorFile) -> tuple[StatedRotor, ...]:
    """Rotors that the first registered source finds in a file; () if none finds any.

    Raises:
        VehicleError: one line with element, value and what is allowed, or two rotors of
            one name or joint.
    """
    for row in registrations("rotor_source").values():
        if found := tuple(row.load()(file)):
            for word in ("name", "joint"):
                _require_once(word, [getattr(each, word) for each in found])
            return found
    return ()


def _require_once(word: str, names: list[str]) -> None:
    for name in filter(None, names):
        if names.count(name) > 1:
            refuse(f"rotors.{word}", name, "stands at two rotors; must be at one")


def whole_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values of a rotor with what follows from the largest thrust: max_thrust =
    thrust_coefficient max_speed^2.
    """
    known = dict(values)
    thrust = known.pop(MAX_THRUST, None)
    if thrust is None:
        return known
    speed, coefficient = known.get("max_speed"), known.get("thrust_coefficient")
    if coefficient is None and speed is not None:
        known["thrust_coefficient"] = thrust / speed**2
    elif speed is None and coefficient is not None:
        known["max_speed"] = math.sqrt(thrust / coefficient)
    return known


def gaps_of(rotor: StatedRotor, values: Mapping[str, Any]) -> Iterator[str]:
    """Names of the fields that a file's rotor and its user leave open."""
    known = whole_values(values)
    # a thrust table gives all three
    if "table" in values:
        known = {
            **known,
            "thrust_coefficient": 0,
            "moment_coefficient": 0,
            "max_speed": 0,
        }
    missing = [
        name for name in dict.fromkeys((*NEEDED, *rotor.absent)) if name not in known
    ]
    if MAX_THRUST in values and "max_speed" in missing:
        # the gap is then the largest speed alone
        missing.remove("thrust_coefficient")  # one of the two gives the other
    if "tilt" in values:
        missing += [
            f"tilt.{name}" for name in NEEDED_OF_TILTS if name not in values["tilt"]
        ]
    for name in missing:
        words = rotor.absent.get(name, "")
        yield f"{name} ({words})" if words else name
