"""Rotors of eagle-mpc's platform files (YAML).

A spin direction of -1 is counter-clockwise: the torque on the base along the thrust is
spin cm / cf times the thrust.
Source: eagle-mpc, src/multicopter-base-params.cpp.
"""

from __future__ import annotations

import re
from typing import Any

from skyarm.algebra import E_Z, Quaternion
from skyarm.records.files import Fields, errors_as, needs_extra, one_line
from skyarm.vehicle import description
from skyarm.vehicle.check import VehicleError, refuse
from skyarm.vehicle.stated_rotors import LAGS, MAX_THRUST, RotorFile, StatedRotor

EXPONENT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$")
"""Numbers such as 1e-6, which YAML 1.1 takes for texts."""

NO_LAG = dict.fromkeys(LAGS, "eagle-mpc's rotors have no lag")

WORDS = {
    "thrust_coefficient": "cf",
    "moment_coefficient": "cm / cf",
    "max_speed": "max_thrust and cf",
    "direction": "spin_direction, -1 for ccw,",
}
"""Field of a rotor -> the file's words."""


def eagle_mpc_rotors(file: RotorFile) -> tuple[StatedRotor, ...]:
    """Rotors of the ``platform`` of a YAML file, in their order."""
    name = file.path.name
    # a file of another suffix is not opened, because YAML takes almost any text
    if file.path.suffix not in (".yaml", ".yml"):
        return ()
    try:
        import yaml

        # a class of its own, because a resolver added to SafeLoader would change it for
        # all programs
        loader: Any = type("Loader", (yaml.SafeLoader,), {})
        loader.add_implicit_resolver(
            "tag:yaml.org,2002:float", EXPONENT, [*"+-.0123456789"]
        )
        top = yaml.load(file.path.read_bytes(), loader)
    except ImportError:
        refuse("file", name, needs_extra("yaml"))
    except Exception as error:  # yaml's own, encodings, depth
        refuse("YAML", one_line(str(error)), "must be well-formed")
    # a YAML file of something else is no error: other sources may know it
    if not isinstance(top, dict) or "platform" not in top:
        return ()
    with errors_as(VehicleError):
        platform = Fields(top["platform"], "platform")
        cf, thrust = (
            platform.number(word, low=0.0, strict=True) for word in ("cf", MAX_THRUST)
        )
        values = {
            "thrust_coefficient": cf,
            "moment_coefficient": platform.number("cm", low=0.0) / cf,
            MAX_THRUST: thrust,
        }
        where = {field: f"{word} of {name}" for field, word in WORDS.items()}
        if least := platform.take("min_thrust", 0.0):
            where["min_thrust"] = (
                f"{least} N in {name}; not read: a rotor may stand still here"
            )
        # eagle-mpc's own files write $rotors
        tables = platform.tables("$rotors" if "$rotors" in platform.table else "rotors")
        if (count := platform.take("n_rotors", len(tables))) != len(tables):
            refuse(
                "platform.n_rotors",
                count,
                f"must be the number of rotors, {len(tables)}",
            )
        link = platform.text("base_link_name", "base")
        return tuple(
            _rotor(table, f"rotor_{k}", link, values, where)
            for k, table in enumerate(tables)
        )


def _rotor(
    table: Fields, name: str, link: str, values: dict[str, float], where: dict[str, str]
) -> StatedRotor:
    """Rotor of one table of the platform, with the platform's coefficients."""
    turn, four = table.numbers("spin_direction"), table.numbers("orientation")
    # the field is a list of one number in their files
    if turn not in ((1.0,), (-1.0,)):
        refuse(table.at("spin_direction"), list(turn), "must be [1] (cw) or [-1] (ccw)")
    if len(four) != 4 or not any(four):
        refuse(
            table.at("orientation"),
            list(four),
            "must be the four numbers x, y, z, w of a quaternion",
        )
    # their quaternions have the scalar last
    axis = Quaternion(four[3], *four[:3]).normalized().rotation().apply(E_Z)
    return StatedRotor(
        name,
        link,
        description.vector(table.vector("translation")),
        description.unit_axis(name, axis),
        # their spin direction has the opposite sign of this library's
        {**values, "direction": -int(turn[0])},
        where,
        absent=NO_LAG,
    )
