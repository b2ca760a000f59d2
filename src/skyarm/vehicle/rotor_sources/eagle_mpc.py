"""Rotors of eagle-mpc's platform files (YAML).

A spin direction of -1 is counter-clockwise: the torque on the base along the thrust is spin cm / cf times the thrust.
Source: eagle-mpc, src/multicopter-base-params.cpp.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.records.files import Fields, errors_as, needs_extra, one_line
from skyarm.vehicle import description
from skyarm.vehicle.check import VehicleError, refuse
from skyarm.vehicle.stated_rotors import MAX_THRUST, RotorFile, StatedRotor

NO_LAG = "eagle-mpc's rotors have no lag"

WHERE = {
    "thrust_coefficient": "cf",
    "moment_coefficient": "cm / cf",
    "max_speed": "max_thrust and cf",
    "direction": "spin_direction (-1 is ccw)",
    "position": "translation",
    "axis": "orientation (x y z w)",
}


def eagle_mpc_rotors(file: RotorFile) -> tuple[StatedRotor, ...]:
    """Rotors of the ``platform`` of a YAML file, in their order."""
    if file.path.suffix not in (".yaml", ".yml"):
        return ()
    document = _document(file.path)
    if not isinstance(document, dict) or not isinstance(document.get("platform"), dict):
        return ()
    with errors_as(VehicleError):
        return _rotors(Fields(document["platform"], "platform"), file.path.name)


def _document(path: Path) -> Any:
    try:
        import yaml
    except ImportError:
        refuse("file", path.name, f"a YAML file {needs_extra('yaml')}")
    try:
        return yaml.safe_load(path.read_bytes())
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        refuse("YAML", one_line(str(error)), "must be well-formed")


def _rotors(platform: Fields, file: str) -> tuple[StatedRotor, ...]:
    cf, thrust = (platform.number(word, low=0.0, strict=True) for word in ("cf", MAX_THRUST))
    shared = {
        "thrust_coefficient": cf,
        "moment_coefficient": platform.number("cm", low=0.0) / cf,
        MAX_THRUST: thrust,
    }
    where = {field: f"{words} of {file}" for field, words in WHERE.items()}
    if least := platform.take("min_thrust", 0):
        where["min_thrust"] = f"{least} N in {file}: not read, a rotor may stand still here"
    tables = platform.tables("$rotors" if "$rotors" in platform.table else "rotors")
    if platform.take("n_rotors", len(tables)) != len(tables):
        refuse("platform.n_rotors", platform.take("n_rotors"), f"must be the number of rotors, {len(tables)}")
    return tuple(
        _rotor(each, f"rotor_{k}", platform.text("base_link_name", "base"), shared, where)
        for k, each in enumerate(tables)
    )


def _rotor(table: Fields, name: str, link: str, shared: dict[str, float], where: dict[str, str]) -> StatedRotor:
    turn, (x, y, z, w) = table.numbers("spin_direction"), _four(table, "orientation")
    if turn not in ((1.0,), (-1.0,)):
        refuse(table.at("spin_direction"), list(turn), "must be [1] (cw) or [-1] (ccw)")
    R = description.rotation(Quaternion(w, x, y, z).normalized().rotation())
    return StatedRotor(
        name=name,
        link=link,
        position=description.vector(table.vector("translation")),
        axis=description.unit_axis(table.at("orientation"), list(R.apply(Vec3(0, 0, 1)))),
        values={**shared, "direction": -int(turn[0])},
        where=where,
        absent={"time_constant_up": NO_LAG, "time_constant_down": NO_LAG},
    )


def _four(table: Fields, name: str) -> tuple[float, ...]:
    """Four numbers, not all zero."""
    four = table.numbers(name)
    if len(four) != 4 or not any(four):
        refuse(table.at(name), list(four), "must be the four numbers x, y, z, w of a quaternion")
    return four
