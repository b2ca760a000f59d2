"""Rotors of skyarm's own MJCF files: numbers that MuJoCo has no word for, in the file's ``custom`` numbers.

``<numeric name="rotor:SITE">`` holds the numbers of ``ROTOR`` in this order, of the rotor at that site, whose z axis is
the thrust; ``<numeric name="tilt:JOINT:SITE">`` those of ``TILT``, the servo at that joint.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from skyarm.vehicle import description
from skyarm.vehicle.stated_rotors import RotorFile, StatedRotor
from skyarm.vehicle.vehicle_records import Rotor

ROTOR = (
    "thrust_coefficient",
    "moment_coefficient",
    "max_speed",
    "time_constant_up",
    "time_constant_down",
    "drag_coefficient",
    "rolling_moment_coefficient",
    "inertia",
    "direction",
    "reversible",
)
"""Numbers of a rotor, SI units; behind them 1 for a rolling moment by the sense of rotation, else 0."""

TILT = ("lower", "upper", "time_constant", "max_rate")

ENDLESS = 0.0
"""Number in place of a largest speed or rate that is infinite, which MuJoCo does not read."""


def numbers_of_rotor(rotor: Rotor, site: str, joint: str) -> Iterator[tuple[str, list[float]]]:
    """Names and numbers of the custom numbers that a rotor gets, and its tilt if it has one."""
    yield f"rotor:{site}", [*_finite(rotor, ROTOR), float(rotor.rolling == "signed")]
    if rotor.tilt is not None:
        yield f"tilt:{joint}:{site}", [*_finite(rotor.tilt, TILT), *map(float, rotor.tilt.axis)]


def _finite(record: object, names: tuple[str, ...]) -> list[float]:
    numbers = [float(getattr(record, name)) for name in names]
    return [each if math.isfinite(each) else ENDLESS for each in numbers]


def own_rotors(file: RotorFile) -> tuple[StatedRotor, ...]:
    """Rotors of an MJCF file that skyarm wrote."""
    model = getattr(file.content, "model", file.content)
    custom = _custom(model) if hasattr(model, "numeric_adr") else {}
    tilts = {name.split(":")[2]: (name.split(":")[1], each) for name, each in custom.items() if name[:5] == "tilt:"}
    return tuple(
        _rotor(name.removeprefix("rotor:"), each, tilts)
        for name, each in custom.items()
        if name.startswith("rotor:") and len(each) == len(ROTOR) + 1
    )


def _custom(model: Any) -> dict[str, list[float]]:
    """Custom numbers of a MuJoCo model by name."""
    return {model.numeric(each).name: model.numeric(each).data.tolist() for each in range(int(model.nnumeric))}


def _rotor(site: str, numbers: list[float], tilts: Mapping[str, tuple[str, list[float]]]) -> StatedRotor:
    values: dict[str, Any] = dict(zip(ROTOR, numbers, strict=False))
    for name in ("max_speed",) if values["max_speed"] == ENDLESS else ():
        del values[name]
    for name in ("drag_coefficient", "rolling_moment_coefficient", "inertia"):
        values[name] = description.zero_is_structure(values[name])
    values["direction"], values["reversible"] = int(values["direction"]), bool(values["reversible"])
    values["rolling"] = "signed" if numbers[-1] else "rotors_sim"
    joint = ""
    if site in tilts:
        joint, servo = tilts[site]
        axis = description.unit_axis(f"numeric[tilt:{joint}:{site}]", servo[len(TILT) :])
        values["tilt"] = {**dict(zip(TILT, servo, strict=False)), "axis": axis}
        values["tilt"]["max_rate"] = values["tilt"]["max_rate"] or math.inf
    where = dict.fromkeys(values, "custom numbers of skyarm's file")
    return StatedRotor(name=site, link=site, values=values, where=where, joint=joint)
