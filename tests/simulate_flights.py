"""Scenario documents for tests: the shipped ones, shortened, and a small one of our own."""

from __future__ import annotations

import copy
import tomllib
from typing import Any

from skyarm.scenario.scenario_file import LIBRARY, list_scenarios

SHIPPED = {name: tomllib.loads((LIBRARY / f"{name}.toml").read_text("utf-8")) for name in list_scenarios()}

FULL: dict[str, Any] = {
    "schema": 1,
    "name": "everything",
    "title": "every table of a scenario file",
    "duration": 0.1,
    "seed": 3,
    "episode": 1,
    "rates": {"physics": 1000, "control": 200, "reference": 50},
    "plant": {
        "vehicle": "hummingbird_arm2_rotors",
        "gravity": 9.8,
        "kind": "rigid_body",
        "integrator": "rk4",
        "payload": {"mass": 0.02, "frame": "tip"},
        "joints": {"damping": 0.002, "coulomb": 0.001, "coulomb_rate": 0.02, "effort_limit": 0.4},
    },
    "model": {"vehicle": "hummingbird_arm2", "gravity": 9.81, "payload": {"mass": 0.01}},
    "controller": {
        "law": "hybrid_computed_torque",
        "gains": {
            "position": [4.0, 4.0, 4.0],
            "velocity": [2.2, 2.2, 2.2],
            "attitude": [0.7, 0.7, 0.035],
            "rate": [0.1, 0.1, 0.025],
        },
        "joint_gains": {"stiffness": [350.0, 150.0], "damping": [12.0, 10.0]},
        "mixer": "priority",
        "rate_error": "corrected",
        "without": ["coupling"],
    },
    "reference": {
        "base": {"kind": "hover", "position": [0.0, 0.0, 1.0]},
        "yaw": {"kind": "ramp", "start": 0.02, "duration": 0.05, "height": 0.1, "shape": "quintic"},
        "joints": [{"kind": "sine", "amplitude": 0.1, "frequency_hz": 1.0, "start": 0.0, "stop": 2.0}, 0.05],
    },
    "environment": {
        "ground": True,
        "wind": {
            "mode": "moving_air",
            "velocity": [1.0, 0.0, 0.0],
            "gust": {"velocity": [0.0, 1.0, 0.0], "start": 0.02, "duration": 0.03, "shape": "one_minus_cosine"},
            "turbulence": {"altitude": 6.0, "wind_20ft": 7.7},
        },
    },
    "sensors": {"position": 0.002, "attitude": 0.001, "rate": 0.01, "joint_rates": 0.02},
    "delays": {"measurement": 0.005, "command": 0.003},
    "initial": {"quaternion_wxyz": [1.0, 0.0, 0.0, 0.0], "velocity": [0.1, 0.0, 0.0], "joints": [0.1, 0.0]},
}
"""Every table there is, at least once."""


def circling(**changes: Any) -> dict[str, Any]:
    """Case 3 in wind, whose circle and sines begin after 0.3 s in place of 6 s."""
    made = document("case3_wind", reference__base__start=0.3, **changes)
    for joint in made["reference"]["joints"]:
        joint["start"] = 0.3
    return made


def document(name: str = "case1", **changes: Any) -> dict[str, Any]:
    """A shipped document with entries replaced; a key with double underscores reaches into tables, None deletes.

    Its windows, which end after 20 s, are left out: these flights are short.
    """
    made = copy.deepcopy(FULL if name == "everything" else SHIPPED[name])
    made.pop("windows", None)
    for path, value in changes.items():
        *tables, last = path.split("__")
        at = made
        for table in tables:
            at = at.setdefault(table, {})
        if value is None:
            at.pop(last)
        else:
            at[last] = value
    return made
