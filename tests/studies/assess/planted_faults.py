"""Faults planted in vehicle files, each with the words by which a check must name
it.
"""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skyarm.vehicle.vehicle_files import LIBRARY, list_vehicles, load_vehicle
from skyarm.vehicle.vehicle_records import Vehicle
from support.cases import toml_text

Document = dict[str, Any]

HEALTHY = tuple(name for name in list_vehicles() if name != "hummingbird_arm2")
"""Those that fly; the paper's own model is not a body."""

ARMS = tuple(name for name in HEALTHY if load_vehicle(name).n)


def document(name: str) -> Document:
    """A shipped vehicle's file as tables."""
    return tomllib.loads((Path(str(LIBRARY)) / f"{name}.toml").read_text("utf-8"))


@dataclass(frozen=True)
class Planted:
    """A kind of fault: what it does to a file, the vehicles it can be planted in, and
    fields of which one is named.
    """

    kind: str
    plant: Callable[[Document], None]
    fields: tuple[str, ...]
    vehicles: tuple[str, ...] = HEALTHY
    first: tuple[str, str] = ("crazyflie_arm1", "pelican_arm2")

    def in_file(self, name: str) -> Document:
        """The file of a vehicle with the fault in it."""
        changed = copy.deepcopy(document(name))
        self.plant(changed)
        changed.pop("sources")
        return changed

    def vehicle(self, name: str, folder: Path) -> Vehicle:
        """That file, written and read."""
        file = folder / f"{name}.toml"
        file.write_text(toml_text(self.in_file(name)), "utf-8")
        return load_vehicle(file)


def _every_base_mass(d: Document, factor: float) -> None:
    for table in [d["base"], *d["base"].get("parts", [])]:
        if "mass" in table:
            table["mass"] *= factor


def _every_base_inertia(d: Document, factor: float) -> None:
    for table in [d["base"], *d["base"].get("parts", [])]:
        if "inertia" in table:
            table["inertia"] = [factor * v for v in table["inertia"]]


def _rotors(d: Document, field: str, factor: float) -> None:
    for table in [d["rotor_defaults"], *d["rotors"]]:
        if field in table:
            table[field] *= factor
    for column in (
        COLUMNS.get(field, ()) if "thrust_table" in d["rotor_defaults"] else ()
    ):
        d["rotor_defaults"]["thrust_table"][column] = [
            factor * v for v in d["rotor_defaults"]["thrust_table"][column]
        ]


COLUMNS = {
    "thrust_coefficient": ("thrust", "torque"),
    "moment_coefficient": ("torque",),
}
"""What a coefficient is where a rotor has a table."""


def _first_link(d: Document, field: str, value: Any) -> None:
    d["links"][0][field] = value(d["links"][0][field])


def _positions(tables: list[Document]) -> None:
    for table in tables:
        table["position"] = [1000.0 * v for v in table["position"]]


def _flip(d: Document, at: int) -> None:
    d["rotors"][at]["direction"] = {"cw": "ccw", "ccw": "cw"}[
        d["rotors"][at]["direction"]
    ]


def _shoulder(d: Document) -> Document:
    """The first joint that gravity loads: the pitch joint next to the base."""
    names = ("shoulder", "pitch", "swing", "joint1", "left_shoulder")
    return next(
        (k["joint"] for k in d["links"] if k["joint"]["name"] in names),
        d["links"][-1]["joint"],
    )


PLANTED = (
    Planted(
        "base mass in g", lambda d: _every_base_mass(d, 1e3), ("base.mass", "mass")
    ),
    Planted(
        "base mass in t",
        lambda d: _every_base_mass(d, 1e-3),
        ("base.mass", "base.inertia"),
    ),
    Planted(
        "link mass in g",
        lambda d: _first_link(d, "mass", lambda m: 1e3 * m),
        ("links",),
        ARMS,
    ),
    Planted(
        "base inertia in g cm^2",
        lambda d: _every_base_inertia(d, 1e7),
        ("base.inertia",),
    ),
    Planted(
        "base inertia in kg cm^2",
        lambda d: _every_base_inertia(d, 1e4),
        ("base.inertia",),
    ),
    Planted(
        "link inertia in g cm^2",
        lambda d: _first_link(d, "inertia", lambda i: [1e7 * v for v in i]),
        ("links",),
        ARMS,
    ),
    Planted("first rotor turned round", lambda d: _flip(d, 0), (".direction",)),
    Planted("last rotor turned round", lambda d: _flip(d, -1), (".direction",)),
    Planted(
        "thrust per (rev/min)^2",
        lambda d: _rotors(d, "thrust_coefficient", 0.010966),
        ("thrust_coefficient", "thrust_table"),
    ),
    Planted(
        "thrust of rev/s",
        lambda d: _rotors(d, "thrust_coefficient", 39.478),
        ("thrust_coefficient", "max_speed", "thrust_table"),
    ),
    Planted(
        "moment in mm",
        lambda d: _rotors(d, "moment_coefficient", 1e3),
        ("moment_coefficient", "thrust_table"),
    ),
    Planted(
        "speed in rev/min",
        lambda d: _rotors(d, "max_speed", 9.5493),
        ("max_speed", "thrust_table"),
    ),
    Planted(
        "speed in rev/s", lambda d: _rotors(d, "max_speed", 0.15915), ("max_speed",)
    ),
    Planted(
        "weak drive",
        lambda d: _shoulder(d).update(effort_limit=_shoulder(d)["effort_limit"] / 30.0),
        ("effort_limit",),
        ARMS,
    ),
    Planted(
        "effort in N mm",
        lambda d: _shoulder(d).update(effort_limit=5.0e4),
        ("effort_limit",),
        ARMS,
    ),
    Planted(
        "limits in degrees",
        lambda d: d["links"][-1]["joint"].update(lower=-90.0, upper=90.0),
        (".lower", ".upper"),
        ARMS,
    ),
    Planted(
        "base com ahead of the rotors",
        lambda d: _first_body(d).update(com=[1.5 * _reach(d), 0.0, 0.0]),
        ("base.com",),
    ),
    Planted(
        "base com in mm",
        lambda d: _first_body(d).update(com=[0.0, 12.0, 0.0]),
        ("base.com",),
    ),
    Planted(
        "lag in ms",
        lambda d: _rotors(d, "time_constant_up", 1e3),
        ("time_constant_up",),
    ),
    Planted("rotors in mm", lambda d: _positions(d["rotors"]), ("rotors[",)),
    Planted(
        "joints in mm",
        lambda d: _positions([d["links"][-1]["joint"]]),
        (".position",),
        ARMS,
    ),
)


def _first_body(d: Document) -> Document:
    base = d["base"]
    return base if "mass" in base else base["parts"][0]


def _reach(d: Document) -> float:
    """Distance of the farthest rotor, m."""
    return max(sum(c * c for c in rotor["position"]) ** 0.5 for rotor in d["rotors"])
