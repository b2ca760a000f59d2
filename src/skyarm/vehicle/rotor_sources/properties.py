"""Rotors of the URDF files of gym-pybullet-drones and its kin: ``<properties kf km
thrust2weight>``, ``propN`` links.

The coefficients are per squared rev/min; hubs are the inertial origins of massless
links. Which rotor turns which way stands in the programs' code. thrust2weight is of the
weight of the first link alone, without what is fixed to it.
Source: gym-pybullet-drones, envs/BaseAviary.py.
"""

from __future__ import annotations

import math
import re

from skyarm.vehicle.stated_rotors import MAX_THRUST, RotorFile, StatedRotor
from skyarm.vehicle.xml_elements import centre_of_mass, number

GRAVITY = 9.8
"""m/s^2, G of that program."""

PER_RPM = (30.0 / math.pi) ** 2
"""Coefficient per (rad/s)^2 over that per (rev/min)^2."""


def properties_rotors(file: RotorFile) -> tuple[StatedRotor, ...]:
    """Rotors of a URDF file with ``<properties>`` that state kf."""
    root = file.xml
    properties = root.find("properties[@kf]")
    if properties is None:
        return ()
    kf = number(properties, "kf", "properties", 0.0)
    links = [
        each
        for each in root.findall("link")
        if re.match(r"prop\D*\d", each.get("name", ""))
    ]
    # weight of the first link only, as the programs compute it
    mass = number(root.find("link[1]/inertial/mass"), "value", "mass", 0.0)
    scales = {
        "kf": ("thrust_coefficient", PER_RPM),
        # kf = 0 is refused as a thrust coefficient
        "km": ("moment_coefficient", 1.0 / (kf or 1.0)),
        "thrust2weight": (MAX_THRUST, mass * GRAVITY / max(len(links), 1)),
    }
    stated = {word: each for word, each in scales.items() if properties.get(word)}
    where = {ours: f"{word} of <properties>" for word, (ours, _) in stated.items()}
    if others := ", ".join(
        # arm is only the length that the places already have
        word
        for word in properties.attrib
        if word not in (*scales, "arm")
    ):
        where["properties"] = f"{others}: not read; [drag] states what the air takes"
    return tuple(
        StatedRotor(
            name=name,
            link=name,
            position=centre_of_mass(each),
            values={
                ours: number(properties, word, "properties", 0.0) * by
                for word, (ours, by) in stated.items()
            },
            where=where,
            absent={"direction": "it stands in the program's code"},
            elements=(properties,),
        )
        for each in links
        for name in [each.get("name", "")]
    )
