"""What files of other programs cannot hold of a vehicle: the lines that begin an exported file.

A format of export is a registered function (kind ``vehicle_format``): vehicle and options in, text of the file out. It
names each feature it loses, or keeps in another form; the line of a feature stands only where a vehicle has it.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping

from skyarm.vehicle.linkage import Joint
from skyarm.vehicle.vehicle_records import Rotor, Vehicle

Feature = Callable[[Vehicle], Iterator[str]]
"""Function that yields the names of the parts of a vehicle that have a feature."""


def _rotors(has: Callable[[Rotor], object]) -> Feature:
    return lambda vehicle: (each.name for each in vehicle.rotors if has(each))


def _joints(has: Callable[[Joint], object]) -> Feature:
    return lambda vehicle: (each.name for each in vehicle.joints if has(each))


def _names(vehicle: Vehicle) -> list[str]:
    return [each.name for each in (*vehicle.moving, *vehicle.rotors, *vehicle.frames)]


FEATURES: Mapping[str, Feature] = {
    "rotors": _rotors(lambda each: True),
    "lags": _rotors(lambda each: float(each.time_constant_up) != float(each.time_constant_down)),
    "tilts": _rotors(lambda each: each.tilt),
    "tables": _rotors(lambda each: each.table),
    "air": _rotors(lambda each: float(each.drag_coefficient) or float(each.rolling_moment_coefficient)),
    "spin": _rotors(lambda each: float(each.inertia)),
    "signed": _rotors(lambda each: each.rolling == "signed" and float(each.rolling_moment_coefficient)),
    "max_speed": _rotors(lambda each: math.isinf(float(each.max_speed))),
    "effort": _joints(lambda each: math.isinf(float(each.effort_limit))),
    "one_limit": _joints(lambda each: math.isinf(float(each.lower)) != math.isinf(float(each.upper))),
    "slides": _joints(lambda each: not each.turns and math.isinf(float(each.lower))),
    "armature": _joints(lambda each: float(each.armature)),
    "coulomb": _joints(lambda each: float(each.coulomb)),
    "stops": _joints(lambda each: float(each.stop_stiffness)),
    "followers": lambda vehicle: (each.link.joint.name for each in vehicle.followers),
    "drives": lambda vehicle: (each.name for each in vehicle.drives),
    "drag": lambda vehicle: iter(["base"] if any(map(float, vehicle.drag.area)) else []),
    "battery": lambda vehicle: iter(["base"] if vehicle.battery is not None else []),
    "names": lambda vehicle: (name for name, times in Counter(_names(vehicle)).items() if times > 1),
    "tip": lambda vehicle: iter([vehicle.end_effector] if vehicle.end_effector not in ("", "tip") else []),
    "looks": lambda vehicle: (each.name for each in vehicle.looks),
}
"""Feature of a vehicle that files of other programs may lack -> names of the parts that have it."""

ALWAYS_LOST: Mapping[str, str] = {
    "battery": "battery, which is left out",
    "drives": "drives of joints, which are left out; [drives] states them",
    "tip": "end effector, which stays as a frame; end_effector names it",
    "looks": "meshes, which are left out",
}
"""Feature that no format of other programs holds -> its line."""


def loss_lines(vehicle: Vehicle, losses: Mapping[str, str]) -> list[str]:
    """Lines on what an exported file holds otherwise or not at all, each with the parts concerned.

    Args:
        vehicle: vehicle with concrete numbers.
        losses: key of ``FEATURES`` -> what becomes of the feature.
    """
    found = {text: ", ".join(FEATURES[feature](vehicle)) for feature, text in losses.items()}
    return [f"{text}: {names}" for text, names in found.items() if names]


def head_of(vehicle: Vehicle, first: str, losses: Mapping[str, str]) -> str:
    """XML comment that begins an exported file: what it is, then what it holds otherwise or not at all."""
    lines = [first, *(f"lost or changed: {line}" for line in loss_lines(vehicle, losses))]
    return "<!-- " + "\n     ".join(line.replace("--", "- -") for line in lines) + " -->\n"


def actuator_names(vehicle: Vehicle) -> list[str]:
    """Unique names of a vehicle's actuators in an exported file: rotors, driven joints, then servos of tilts."""
    driven = [link.joint.name for link in vehicle.links if float(link.joint.effort_limit) != 0.0]
    tilts = [f"{each.name}_tilt" for each in vehicle.rotors if each.tilt is not None]
    names: list[str] = []
    for name in (*(each.name for each in vehicle.rotors), *driven, *tilts):
        names.append(unused_name(name, names))
    return names


def unused_name(name: str, taken: list[str]) -> str:
    """Unique name: the given one, with underscores appended if it is taken."""
    while name in taken:
        name += "_"
    return name
