"""Rotors of JSK's aerial robots: URDF files with ``<thrust_link>`` and ``<m_f_rate>``.

A continuous joint carries each thrust link; thrust acts along the link's z. The joint's
limits are its thrust in N, and m_f_rate times the z of its axis is the torque on the
body per thrust. Source: jsk_aerial_robot, robot_model.cpp.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

from skyarm.vehicle.stated_rotors import MAX_THRUST, RotorFile, StatedRotor
from skyarm.vehicle.xml_elements import number, numbers

WHERE = (
    "m_f_rate, and axes and upper limits (N) of the rotors' joints; their lower limits"
    " are not read"
)


def jsk_rotors(file: RotorFile) -> tuple[StatedRotor, ...]:
    """Rotors of a URDF file with ``<thrust_link>``, in the order of the file."""
    mark = file.xml.find("thrust_link[@name]")
    if mark is None:
        return ()
    return tuple(
        _rotor(joint, link, file.xml)
        for joint, link in file.endless()
        if mark.get("name", "") in link
    )


def _rotor(joint: ET.Element, link: str, root: ET.Element) -> StatedRotor:
    """Rotor of a continuous joint and the thrust link that it moves."""
    name = joint.get("name", "")
    rate = root.find("m_f_rate[@value]")
    # a limit of zero is one that the file leaves out
    values: dict[str, float] = {}
    if most := number(joint.find("limit"), "upper", f"joint[{name}].limit", 0.0):
        values[MAX_THRUST] = most
    if rate is not None:
        per_thrust = number(rate, "value", "m_f_rate", 0.0)
        values["moment_coefficient"] = abs(per_thrust)
        # only z counts, as in their program, which takes the thrust along it
        turn = (
            per_thrust
            * numbers(
                joint.find("axis"), "xyz", f"joint[{name}].axis", (1.0, 0.0, 0.0)
            )[2]
        )
        if turn:
            # a positive torque on the body belongs to a rotor that turns clockwise
            values["direction"] = -1 if turn > 0.0 else 1
    elements = tuple(
        each
        for word in ("thrust_link", "m_f_rate", "baselink")
        for each in root.findall(word)
    )
    where = dict.fromkeys(values, WHERE)
    return StatedRotor(
        name=name, link=link, values=values, where=where, joint=name, elements=elements
    )
