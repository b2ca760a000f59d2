"""Digests of all records that ship: scenarios, vehicles, studies, suites, laws, and
scenarios with parts replaced.

``python tests/scenario/pinned_records.py --write`` writes ``pins/records.json`` anew.

``flight_digests`` keeps what flies; here is what is read. The first digest of a record
is its identity, by which stored flights are matched with it; the second is of all its
plain data, titles, sources and notes included; the third is the second of numbers of
nine digits, for processors whose linear algebra rounds otherwise: some vehicles'
numbers are fitted, some references planned. Paths of files begin at the repository.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from shipped_files import NAMES, PINS, RICH, ROOT, only_shipped, scenario

import skyarm
from skyarm.control.catalogue import AUTOPILOTS, LAWS, PRESETS, tuned_factors
from skyarm.paper import flights
from skyarm.records.identity import identity
from skyarm.records.plain import digest, plain
from skyarm.scenario.in_flight import with_part
from skyarm.studies.compare.contact_tasks import TASKS
from skyarm.studies.compare.entrants import ENTRANTS
from skyarm.studies.compare.suite import CASES, conditions
from skyarm.studies.sweep import Study, list_studies, load_study
from skyarm.studies.trial.facts import setting_of
from support import flight_digests

FILE = PINS / "records.json"

VEHICLES = (
    *skyarm.list_vehicles(),
    "examples/servo_quad.toml",
    "examples/carrier.toml",
    "tests/data/servo_arm.toml",
)
STUDIES = (
    *list_studies(),
    "examples/arm_length.toml",
    "examples/press_in_four_worlds.toml",
)

NUMBERS: Mapping[str, Mapping[str, float]] = {
    "case3": {
        "plant.gravity": 9.7,
        "plant.vehicle.base.mass": 0.8,
        "plant.joints.damping": 0.01,
        "plant.payload.mass": 0.03,
        "model.payload.tip.mass": 0.02,
        "model.vehicle.rotors.0.thrust_coefficient": 9e-6,
        "model.vehicle.rotors.front.position.x": 0.2,
        "controller.gains.position.x": 4.2,
        "controller.joint_gains.stiffness.1": 120.0,
        "reference.base.radius": 0.4,
        "reference.base.start": 5.0,
        "reference.base.center.2": 1.2,
        "reference.tracking_start": 0.5,
        "reference.joints.0.amplitude": 0.1,
        "initial.position.x": 0.2,
        "initial.roll": 0.1,
        "initial.quaternion_wxyz.1": 0.2,
        "initial.joints.0": 0.1,
        "initial.velocity.0": 0.3,
    },
    "examples/servo_swing": {
        "model.vehicle.drives.shoulder.drive.latency": 0.008,
        "plant.vehicle.battery.capacity": 3.0,
        "plant.vehicle.drives.shoulder.drive.voltage": 11.0,
    },
    RICH: {
        "delays.command": 0.004,
        "delays.rotors": 0.003,
        "changes.0.value": 0.4,
        "controller.limits.tilt": 0.5,
        "environment.wind.velocity.0": 2.0,
        "environment.wind.gusts.1.start": 3.5,
        "environment.air.air_signals.velocity_W.x.amplitude": 0.4,
        "environment.faults.left.effectiveness": 0.8,
        "estimator.gate": 3.0,
        "initial.yaw": 0.5,
        "payloads.parcel.mass": 0.04,
        "plant.drives.joint1.time_constant": 0.03,
        "sensors.gps.position.sigma": 0.03,
        "sensors.position": 0.003,
        "world.surfaces.wall.material.friction": 0.5,
        "world.mechanisms.door.lower": -0.1,
    },
}
"""Scenario -> numbers, each of which is replaced by itself."""

GUST = {"force": [1.0, 0.0, 0.0], "start": 1.0, "duration": 1.0}
STRAIGHT = {"base": {"kind": "hover", "position": [0.0, 0.0, 1.5]}, "yaw": 0.1}

PARTS: Mapping[str, Any] = {
    "controller.law": "hybrid_computed_torque",
    "controller": {"preset": "paper_ct", "safety": True},
    "reference": {**STRAIGHT, "push": {"force": 0.2, "normal": [-1.0, 0.0, 0.0]}},
    "reference.base": {
        "kind": "circle",
        "radius": 0.2,
        "frequency_hz": 0.1,
        "center": [0.0, 0.0, 1.5],
    },
    "reference.yaw": {"kind": "sine", "amplitude": 0.1, "frequency_hz": 0.1},
    "reference.joints": [
        0.1,
        {"kind": "ramp", "start": 1.0, "duration": 1.0, "height": 0.2},
    ],
    "environment.wind": {"mode": "force_wind", "force": [1.0, 0.0, 0.0], "gust": GUST},
    "environment.faults": [{"rotor": "right", "effectiveness": 0.8, "start": 1.0}],
    "environment.air": [{"kind": "moving_air", "velocity_W": [1.0, 0.0, 0.0]}],
    "environment.forces": [{"kind": "rotor_drag", "lift": 0.01}],
    "environment.ground": False,
    "estimator": "pass_through",
    "endings": [{"kind": "ground"}],
}
"""Parts of a scenario, each of which is replaced by itself in the one that has every
table."""


def records() -> dict[str, Callable[[], Any]]:
    """Name of every record with what makes it."""
    found: dict[str, Callable[[], Any]] = {
        f"scenario {name}": partial(scenario, name) for name in NAMES
    }
    found |= {f"vehicle {name}": partial(_vehicle, name) for name in VEHICLES}
    found |= {f"study {name}": partial(_study, name) for name in STUDIES}
    found |= {f"suite {name}": partial(tuple, each) for name, each in SUITES.items()}
    found["envelope"] = setting_of
    found |= {
        f"paper {each.case} {each.controller} {each.plant}": partial(
            flights.scenario, each
        )
        for each in PAPER
    }
    found |= {
        f"law {name}": partial(skyarm.load_scenario, "case1", controller=name)
        for name in laws()
    }
    for name, numbers in NUMBERS.items():
        found |= {
            f"{name} {path} = {value}": partial(_replaced, name, path, value)
            for path, value in numbers.items()
        }
    return found | {
        f"{RICH} {path} as a whole": partial(_with_part, path, value)
        for path, value in PARTS.items()
    }


SUITES: Mapping[str, Any] = {
    "conditions": conditions().values(),
    "cases": CASES.values(),
    "contact tasks": TASKS.values(),
    "entrants": ENTRANTS.values(),
}
PAPER = flights.flights()


def laws() -> tuple[str, ...]:
    """Every name of a controller that ships."""
    with only_shipped():
        return (
            *PRESETS,
            *LAWS,
            *(f"{law}_tuned" for law in tuned_factors()),
            *AUTOPILOTS,
        )


def _study(name: str) -> Study:
    """A study, in whose record stands the path that it was read from."""
    before = Path.cwd()
    os.chdir(ROOT)
    try:
        return load_study(name)
    finally:
        os.chdir(before)


def _vehicle(name: str) -> skyarm.Vehicle:
    return skyarm.load_vehicle(ROOT / name if name.endswith(".toml") else name)


def _replaced(name: str, path: str, value: float) -> skyarm.Scenario:
    return skyarm.with_numbers(scenario(name), {path: value})


def _with_part(path: str, value: Any) -> skyarm.Scenario:
    return with_part(scenario(RICH), path, value)


def digests(record: Any) -> list[str]:
    """Identity of a record and digest of all its data; the first sixteen of their
    digits.
    """
    with only_shipped():
        return [identity(record)[:16], digest(_map(plain(record), _from_root))[:16]]


def rounded_digest(record: Any) -> str:
    """Digest of all data of a record with numbers of nine digits; the first sixteen of
    its digits.
    """
    return digest(_map(plain(record), _short))[:16]


def _map(data: Any, change: Callable[[Any], Any]) -> Any:
    if isinstance(data, dict):
        return {name: _map(each, change) for name, each in data.items()}
    return (
        [_map(each, change) for each in data]
        if isinstance(data, list)
        else change(data)
    )


def _from_root(value: Any) -> Any:
    return value.replace(str(ROOT), "") if isinstance(value, str) else value


def _short(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.9g}") if abs(value) > TINY else 0.0
    return _from_root(value)


TINY = 1e-12
"""What rounding leaves of a number that is none."""


def machinery() -> str:
    """Digest of what linear algebra and functions give: BLAS and NumPy choose their
    code by the processor.
    """
    generator = np.random.default_rng(0)
    found = {"linear_algebra": flight_digests.linear_algebra()}
    for n in (2, 3, 4, 7):
        a, b = generator.normal(size=(4 * n, n)), generator.normal(size=4 * n)
        pieces = (
            *np.linalg.svd(a),
            np.linalg.lstsq(a, b)[0],
            np.linalg.inv(a[:n]),
            a @ a.T,
            np.polyfit(a[:, 0], b, 2),
        )
        found[str(n)] = hashlib.sha256(
            b"".join(np.ascontiguousarray(each).tobytes() for each in pieces)
        ).hexdigest()
    x = generator.uniform(0.1, 3.0, size=100)
    several = [
        f(x) for f in (np.sin, np.cos, np.exp, np.log, np.sqrt, np.arctan, np.cbrt)
    ]
    single = [
        [f(float(each)) for each in x]
        for f in (math.sin, math.cos, math.exp, math.log, math.atan, math.tan)
    ]
    found["functions"] = hashlib.sha256(
        np.array(several).tobytes() + np.array(single).tobytes()
    ).hexdigest()
    return digest(found)


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit("usage: python tests/scenario/pinned_records.py --write")
    told = {
        name: [*digests(made := make()), rounded_digest(made)]
        for name, make in records().items()
    }
    lines = ",\n".join(
        f"  {json.dumps(name)}: {json.dumps(each)}" for name, each in told.items()
    )
    FILE.write_text(
        f'{{\n "machinery": "{machinery()}",\n "records": {{\n{lines}\n }}\n}}\n',
        "utf-8",
    )
    print(len(told), "records")
