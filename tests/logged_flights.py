"""Logs of the tests of log files: one that was flown, and drawn ones of any vehicle at any rate."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import numpy as np

import skyarm
from skyarm.log.log_columns import COLUMNS
from skyarm.records.plain import plain
from skyarm.records.units import units
from skyarm.simulate import Log, run
from skyarm.vehicle.vehicle_records import Vehicle

SCALARS = {"time", "yaw_held", "yaw_reference", "load_mass_found", "push_deviation", "path_time", "phase"}
JOINTS = {name for name in units(Log) if "joint" in name or name == "efforts"}
ROTORS = {"rotor_speeds", "rotor_commands"}


@cache
def flown() -> Log:
    """Three seconds and three periods of the paper's Case 3 in the wind, with noise."""
    return run(skyarm.load_scenario("case3_wind", duration=3.015))


def drawn(vehicle: Vehicle, count: int = 37, rate: float = 200, seed: int = 1) -> Log:
    """Numbers without meaning, but for times and unit quaternions."""
    rng = np.random.default_rng(seed)
    arrays: dict[str, Any] = {}
    for name in units(Log):
        width = (vehicle.n,) if name in JOINTS else (len(vehicle.rotors),) if name in ROTORS else (3,)
        width = (
            (2,)
            if name == "lag_found"
            else (len(vehicle.tilts),)
            if COLUMNS.get(name, ("", ""))[1] == "tilting"
            else width
        )
        arrays[name] = rng.normal(size=(count,) if name in SCALARS else (count, *width))
    q = rng.normal(size=(count, 4))
    arrays["quaternion"], arrays["time"] = q / np.linalg.norm(q, axis=1, keepdims=True), np.arange(count) / rate
    info = {
        "schema": 1,
        "scenario": "drawn",
        "status": "completed",
        "cause": "",
        "duration": count / rate,
        "end_time": count / rate,
        "rates_hz": {"physics": 1000, "control": rate, "reference": 50},
        "scenario_record": {"agent": {"plant": {"vehicle": plain(vehicle)}}},
    }
    return Log(**arrays, info=info)


def same(a: Log, b: Log) -> bool:
    """Whether two logs have the same bits and say the same."""
    pairs = ((array, b.arrays()[name]) for name, array in a.arrays().items())
    return a.info == b.info and all(x.tobytes() == y.tobytes() and x.shape == y.shape for x, y in pairs)


def with_components(log: Log, **arrays: np.ndarray) -> Log:
    """A log with other arrays of its components."""
    return dataclasses.replace(log, received={**log.received, **{f"components.{k}": v for k, v in arrays.items()}})
