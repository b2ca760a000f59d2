"""A short flight on the error-state filter, as a file describes it, for tests of sensors and filter."""

from __future__ import annotations

import copy
import tomllib
from typing import Any

import skyarm

TEXT = """
schema = 1
name = "estimated"
duration = 1.0
seed = 3
estimator = { kind = "ekf", delay_periods = 2, gravity = 9.8 }
[plant]
vehicle = "hummingbird_arm2_rotors"
gravity = 9.8
[model]
vehicle = "hummingbird_arm2"
[controller]
preset = "centroidal_tip"
[reference.base]
kind = "circle"
radius = 0.3
frequency_hz = 0.08
center = [0.0, 0.0, 1.0]
[[reference.joints]]
kind = "sine"
amplitude = 0.2
frequency_hz = 0.5
[[reference.joints]]
kind = "constant"
value = 0.0
[sensors.imu]
kind = "imu"
gyro = { density = 0.005, walk = 1e-4, turn_on = 0.01 }
accelerometer = { density = 0.02, walk = 1e-3, turn_on = 0.1 }
[sensors.mocap]
kind = "pose"
latency = 0.01
[sensors.encoders]
kind = "encoders"
"""

GPS = {"kind": "position", "frequency": 20.0, "latency": 0.05, "position": {"sigma": 0.01}}
COMPASS = {"kind": "heading", "frequency": 20.0, "heading": {"sigma": 0.02}}


def document() -> dict[str, Any]:
    """The file as plain tables."""
    return tomllib.loads(TEXT)


def estimated(**changes: Any) -> skyarm.Scenario:
    """The flight; ``estimator__gate=3.0`` puts a value in a table, None takes it out."""
    made = copy.deepcopy(document())
    for place, value in changes.items():
        *tables, last = place.split("__")
        table = made
        for name in tables:
            table = table.setdefault(name, {})
        table[last] = value
        if value is None:
            del table[last]
    return skyarm.scenario_from(made)


def with_satellites(aiding: str, **changes: Any) -> skyarm.Scenario:
    """The flight on position, with a compass or without, in place of motion capture."""
    given: dict[str, Any] = {"sensors__mocap": None, "sensors__gps": GPS}
    given |= {"estimator__aiding": aiding, "estimator__delay_periods": 10, "estimator__position": 0.01}
    if aiding == "position_heading":
        given["sensors__compass"] = COMPASS
    return estimated(**(given | changes))
