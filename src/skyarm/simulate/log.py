"""The record of one episode, and its files."""

from __future__ import annotations

import io
import json
import os
import zipfile
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Quaternion
from skyarm.algebra.euler import euler_angles
from skyarm.compile import leaves
from skyarm.environment import WindSample
from skyarm.files import versions, write_atomically
from skyarm.simulate.inputs import EpisodeInputs
from skyarm.simulate.kinematics import level_tool, tool
from skyarm.simulate.monitor import Ending
from skyarm.simulate.plain import digest, plain
from skyarm.simulate.scenario import Scenario

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Log:
    """Everything that happened at N control instants; SI units, radians, world axes unless said.

    Attributes:
        time: (N,).
        position, velocity: (N, 3). quaternion: (N, 4) wxyz. rate: (N, 3) body axes.
        joints, joint_rates, efforts: (N, n); efforts are the commanded joint torques.
        rotor_speeds, rotor_commands: (N, rotors).
        position_held, velocity_held, joints_held, joint_rates_held, yaw_held: the reference as published and held.
        position_reference, joints_reference, yaw_reference: the continuous reference.
        tool: (N, 3) end effector. tool_held, tool_reference: where a level base on reference would put it.
        wind_force, air_velocity: (N, 3).
        measured_position, measured_joints: what the sensors said at this instant; a delayed controller saw it later.
        info: scenario, seeds, versions, status ("completed", "diverged", "joint_limit", "ground",
            "controller_undefined"), cause, end time; ``scenario_record`` is all that was flown as plain data, and
            ``digest`` its SHA-256: logs of one digest, and of the same versions, are of the same flight.
    """

    time: Array
    position: Array
    quaternion: Array
    velocity: Array
    rate: Array
    joints: Array
    joint_rates: Array
    efforts: Array
    rotor_speeds: Array
    rotor_commands: Array
    position_held: Array
    velocity_held: Array
    joints_held: Array
    joint_rates_held: Array
    yaw_held: Array
    position_reference: Array
    joints_reference: Array
    yaw_reference: Array
    tool: Array
    tool_held: Array
    tool_reference: Array
    wind_force: Array
    air_velocity: Array
    measured_position: Array
    measured_joints: Array
    info: dict[str, Any]

    @property
    def status(self) -> str:
        """How the episode ended."""
        return str(self.info["status"])

    @property
    def euler(self) -> Array:
        """Roll, pitch, yaw (N, 3), ZYX, rad."""
        return np.stack(euler_angles(Quaternion(*self.quaternion.T).rotation()), axis=1)

    def arrays(self) -> dict[str, Array]:
        """Every array by name."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "info"}

    def save_npz(self, path: str | os.PathLike[str]) -> Path:
        """Write one compressed npz (arrays and ``info`` as JSON); the file appears whole or not at all."""
        buffer = io.BytesIO()
        arrays: dict[str, Any] = {**self.arrays(), "info": np.array(json.dumps(self.info))}
        np.savez_compressed(buffer, **arrays)
        return write_atomically(path, buffer.getvalue())

    def save_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write one CSV: a column per component, a row per control instant; numbers round-trip."""
        columns: dict[str, Array] = {}
        for name, array in self.arrays().items():
            if array.ndim == 1:
                columns[name] = array
            else:
                columns |= {f"{name}_{i}": array[:, i] for i in range(array.shape[1])}
        known: dict[bytes, list[str]] = {}
        rows = zip(*(_texts(column, known) for column in columns.values()), strict=True)
        lines = "".join(f"{','.join(row)}\n" for row in rows)
        return write_atomically(path, f"{','.join(columns)}\n{lines}".encode())

    @classmethod
    def load_npz(cls, path: str | os.PathLike[str]) -> Log:
        """Read a log written by :meth:`save_npz`.

        Raises:
            OSError: the file cannot be read.
            ValueError: it is not such a log.
        """
        wanted = [f.name for f in fields(cls)]
        content_of_file = Path(path).read_bytes()
        try:
            with np.load(io.BytesIO(content_of_file)) as data:
                content = {name: data[name] for name in data.files}
            info = json.loads(str(content["info"]))
        except (ValueError, KeyError, EOFError, TypeError, AttributeError, zipfile.BadZipFile):
            raise ValueError(f"log = {os.fspath(path)!r}: must be a log that save_npz wrote") from None
        if sorted(content) != sorted(wanted) or info.get("schema") != 1:
            raise ValueError(f"log = {os.fspath(path)!r}: must be a log of schema 1") from None
        return cls(**{**content, "info": info})


def _texts(column: Array, known: dict[bytes, list[str]]) -> list[str]:
    """Shortest texts that round-trip, made once for equal columns and once for a number that stays."""
    bits = column.tobytes()
    if bits not in known:
        same = bits == bits[:8] * column.size
        texts = list(map(repr, (column[:1] if same else column).tolist()))
        known[bits] = texts * column.size if same else texts
    return known[bits]


@dataclass(frozen=True, slots=True)
class Samples:
    """What a flight left, one row an instant: leaves of State, Command and Measurement, and the wind.

    Attributes:
        wind: its scalars (N,) or longer; numbers that stand for every instant.
    """

    states: Array
    commands: Array
    readings: Array
    wind: WindSample


def assemble(scenario: Scenario, inputs: EpisodeInputs, flown: Samples, ending: Ending | None) -> Log:
    """The log of a flight."""
    vehicle = scenario.world.vehicle
    n, rotors, count = vehicle.n, len(vehicle.rotors), len(flown.states)
    x, u, m = flown.states, flown.commands, flown.readings
    held, wind = inputs.held_reference, flown.wind

    def table(record: Any) -> Array:
        columns = [np.asarray(c, dtype=float) for c in record]
        columns = [c[:count] if c.ndim else np.broadcast_to(c, (count,)) for c in columns]
        return np.stack(columns, axis=1) if columns else np.zeros((count, 0))

    position, quaternion, joints = x[:, 0:3], x[:, 3:7], x[:, 13 : 13 + n]
    free = inputs.reference
    tables = {
        "position_held": table(held.position),
        "velocity_held": table(held.velocity),
        "joints_held": table(held.joints),
        "joint_rates_held": table(held.joint_rates),
        "yaw_held": table((held.yaw,))[:, 0],
        "position_reference": table(free.position),
        "joints_reference": table(free.joints),
        "yaw_reference": table((free.yaw,))[:, 0],
        "wind_force": table(wind.force_W),
        "air_velocity": table(wind.air_velocity_W),
    }
    del free  # its derivatives take more memory than the log of it
    for kind in ("held", "reference"):
        goals = (tables[f"{name}_{kind}"] for name in ("position", "yaw", "joints"))
        tables[f"tool_{kind}"] = level_tool(vehicle, *goals)
    return Log(
        time=inputs.times[:count],
        position=position,
        quaternion=quaternion,
        velocity=x[:, 7:10],
        rate=x[:, 10:13],
        joints=joints,
        joint_rates=x[:, 13 + n : 13 + 2 * n],
        rotor_speeds=x[:, 13 + 2 * n :],
        rotor_commands=u[:, :rotors],
        efforts=u[:, rotors:],
        tool=tool(vehicle, position, quaternion, joints),
        measured_position=m[:, 1:4],
        measured_joints=m[:, 17 : 17 + n],
        info=describe(scenario, ending),
        **tables,
    )


def describe(scenario: Scenario, ending: Ending | None) -> dict[str, Any]:
    """What a log says about itself."""
    rates, whole = scenario.rates, plain(scenario)
    return {
        "schema": 1,
        "scenario": scenario.name,
        "title": scenario.title,
        "plant": scenario.plant,
        "integrator": scenario.integrator,
        "plant_vehicle": scenario.world.vehicle.name,
        "plant_gravity": float(scenario.world.gravity),
        "model_vehicle": scenario.controller.par.model.vehicle.name,
        "model_gravity": float(scenario.controller.par.model.gravity),
        "controller": scenario.controller.name,
        "rates_hz": {"physics": rates.physics, "control": rates.control, "reference": rates.reference},
        "duration": scenario.duration,
        "seed": scenario.seed,
        "episode": scenario.episode,
        "sensor_noise_channels": len(leaves(scenario.sensors)),
        "status": ending.status if ending else "completed",
        "cause": ending.cause if ending else "",
        "end_time": ending.time if ending else scenario.duration,
        "versions": versions("numpy", "mujoco"),
        "scenario_record": whole,
        "digest": digest(whole),
    }
