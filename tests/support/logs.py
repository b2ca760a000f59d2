"""Logs: flown, drawn and made up, and their metrics written a second time.

- Logs of the tests of log files: one that was flown, and drawn ones of any vehicle at
  any rate.
- Logs whose errors are known constants, for figures and the report.
- The metrics of a log written a second time, with NumPy over the whole flight: an
  oracle for those that are counted.

Windows are half-open. Position and joint errors are norms. Each metric that needs a
reference exists twice: against the held samples, as a recorded bag would see it, and
with the suffix ``_continuous`` against the continuous reference.
Source: Barakou et al. 2026, Table 2 and section 5.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

import skyarm
from skyarm.log.log_columns import COLUMNS
from skyarm.records.plain import plain
from skyarm.records.units import units
from skyarm.simulate import Log, Window, run
from skyarm.vehicle.vehicle_records import Vehicle

SCALARS = {
    "time",
    "yaw_held",
    "yaw_reference",
    "load_mass_found",
    "push_deviation",
    "path_time",
    "phase",
}
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
        width = (
            (vehicle.n,)
            if name in JOINTS
            else (len(vehicle.rotors),)
            if name in ROTORS
            else (3,)
        )
        width = (
            (2,)
            if name == "lag_found"
            else (
                (len(vehicle.tilts),)
                if COLUMNS.get(name, ("", ""))[1] == "tilting"
                else width
            )
        )
        arrays[name] = rng.normal(size=(count,) if name in SCALARS else (count, *width))
    q = rng.normal(size=(count, 4))
    arrays["quaternion"], arrays["time"] = (
        q / np.linalg.norm(q, axis=1, keepdims=True),
        np.arange(count) / rate,
    )
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
    return a.info == b.info and all(
        x.tobytes() == y.tobytes() and x.shape == y.shape for x, y in pairs
    )


def with_components(log: Log, **arrays: np.ndarray) -> Log:
    """A log with other arrays of its components."""
    return dataclasses.replace(
        log,
        received={**log.received, **{f"components.{k}": v for k, v in arrays.items()}},
    )


STEADY = Window(10.0, 20.0)
WINDOWS = {
    "case1": STEADY,
    "case2": STEADY,
    "case3": STEADY,
    "case2_gust": Window(5.0, 20.0),
    "case3_wind": STEADY,
}
CASES = tuple(WINDOWS)
"""As the paper states them, apart from the source."""
ROLL, PITCH = 0.05, 0.10


def synthetic_log(case: str, plant: str, controller: str, seconds: float = 30.0) -> Log:
    """200 Hz; base off by (0.03, 0, -0.04) m, joint 1 by -0.02 rad (PD twice that),
    tool by 0.01 m along y.
    """
    n = round(seconds * 200)
    time = np.arange(n) / 200.0
    hold = np.floor(np.arange(n) / 4) * 0.02
    share = 1.0 if controller == "CT" else 2.0
    base = np.stack([0.3 * np.cos(hold), 0.3 * np.sin(hold), np.ones(n)], axis=1)
    joints = np.stack([0.3 * np.sin(hold), np.zeros(n)], axis=1)
    tool = base - np.array([0.0, 0.0, 0.3])
    force = np.zeros((n, 3))
    if case == "case2_gust":
        force[(time >= 7.5) & (time < 10.5), 0] = 2.0
    if case == "case3_wind":
        force[:, 0] = 2.0
    cr, sr, cp, sp = (
        np.cos(ROLL / 2),
        np.sin(ROLL / 2),
        np.cos(PITCH / 2),
        np.sin(PITCH / 2),
    )
    attitude = [cr * cp, sr * cp, cr * sp, -sr * sp]
    zero3, zero2, zero1 = np.zeros((n, 3)), np.zeros((n, 2)), np.zeros(n)
    position = base + np.array([0.03, 0.0, -0.04])
    measured = joints + np.array([-0.02 * share, 0.0])
    return Log(
        time=time,
        position=position,
        quaternion=np.tile(attitude, (n, 1)).reshape(n, 4),
        velocity=zero3,
        rate=zero3,
        joints=measured,
        joint_rates=zero2,
        efforts=zero2,
        rotor_speeds=np.zeros((n, 4)),
        rotor_commands=np.zeros((n, 4)),
        position_held=base,
        velocity_held=zero3,
        joints_held=joints,
        joint_rates_held=zero2,
        yaw_held=zero1,
        position_reference=base,
        joints_reference=joints,
        yaw_reference=zero1,
        tool=tool + np.array([0.0, 0.01, 0.0]),
        tool_held=tool,
        tool_reference=tool,
        wind_force=force,
        air_velocity=zero3,
        measured_position=position,
        measured_joints=measured,
        info={
            "scenario": case,
            "plant": plant,
            "controller": controller,
            "status": "completed",
            "cause": "",
            "end_time": seconds,
            "duration": seconds,
            "rates_hz": {"physics": 1000, "control": 200, "reference": 50},
        },
    )


@cache
def all_logs() -> dict[str, dict[str, dict[str, Log]]]:
    """Plant -> experiment -> controller -> log."""
    return {
        plant: {
            case: {c: synthetic_log(case, plant, c) for c in ("CT", "PD")}
            for case in CASES
        }
        for plant in ("rigid_body", "mujoco")
    }


Array = npt.NDArray[np.float64]

SETTLING_BAND = 0.02
"""m: |e_p| has settled when it stays this near its steady mean."""


@dataclass(frozen=True, slots=True)
class Errors:
    """Tracking errors of a log against one form of the reference."""

    position: Array
    joints: Array
    tool: Array
    vector: Array
    tool_vector: Array

    @classmethod
    def held(cls, log: Log) -> Errors:
        """Against the published, held samples."""
        return cls._of(log, log.position_held, log.joints_held, log.tool_held)

    @classmethod
    def continuous(cls, log: Log) -> Errors:
        """Against the continuous reference."""
        return cls._of(
            log, log.position_reference, log.joints_reference, log.tool_reference
        )

    @classmethod
    def _of(cls, log: Log, position: Array, joints: Array, tool: Array) -> Errors:
        e, e_tool = log.position - position, log.tool - tool
        return cls(_norm(e), _norm(log.joints - joints), _norm(e_tool), e, e_tool)


def _norm(e: Array) -> Array:
    return np.asarray(np.linalg.norm(e, axis=1))


def _mean(values: Array) -> float:
    return float(values.mean()) if values.size else float("nan")


def _max(values: Array) -> float:
    return float(values.max()) if values.size else float("nan")


def _min(values: Array) -> float:
    return float(values.min()) if values.size else float("nan")


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def _peak(values: Array) -> float:
    """The value of largest magnitude, with its sign."""
    return float(values[np.argmax(np.abs(values))]) if values.size else float("nan")


def _integral(log: Log, values: Array) -> float:
    period = 1.0 / log.info["rates_hz"]["control"]
    return float(values.sum() * period)


def tracking(log: Log, errors: Errors, window: Window) -> dict[str, float]:
    """Means and maxima of position, joint and end-effector error over a window."""
    at = window.of(log)
    found: dict[str, float] = {}
    for name, values in (
        ("joint", errors.joints),
        ("position", errors.position),
        ("ee", errors.tool),
    ):
        found |= {
            f"{name}_error_mean": _mean(values[at]),
            f"{name}_error_max": _max(values[at]),
        }
    return found


def motion(log: Log, window: Window) -> dict[str, float]:
    """RMS of attitude and joint torques over a window."""
    at = window.of(log)
    roll, pitch, _ = log.euler.T
    found = {"pitch_rms": _rms(pitch[at]), "roll_rms": _rms(roll[at])}
    return found | {
        f"tau{i + 1}_rms": _rms(log.efforts[at, i]) for i in range(log.efforts.shape[1])
    }


def settling_time(log: Log, errors: Errors, steady: Window) -> float:
    """First time after which |e_p| stays within 0.02 m of its steady mean to the end;
    NaN if it never does.
    """
    values = errors.position[steady.of(log)]
    if not values.size:
        return float("nan")
    outside = np.flatnonzero(np.abs(errors.position - values.mean()) > SETTLING_BAND)
    if not outside.size:
        return float(log.time[0])
    after = int(outside[-1]) + 1
    return float(log.time[after]) if after < log.time.size else float("nan")


def hover_offset(log: Log, window: Window) -> float:
    """Mean of z_d - z before the motion starts, m."""
    at = window.of(log)
    return _mean((log.position_reference - log.position)[at, 2])


def steady_and_transient(
    log: Log, errors: Errors, steady: Window, transient: Window
) -> dict[str, float]:
    """Rows of Table 2 that depend on a reference."""
    early = transient.of(log)
    pitch = log.euler[:, 1]
    return tracking(log, errors, steady) | {
        "peak_pitch": _max(np.abs(pitch[early])),
        "peak_position": _max(errors.position[early]),
        "settling_time": settling_time(log, errors, steady),
        "iae_position": _integral(log, errors.position),
        "iae_joint": _integral(log, errors.joints),
    }


def gust(log: Log, errors: Errors, window: Window) -> dict[str, float]:
    """Rows of the gust experiment: everything over one window, peaks with their
    sign.
    """
    at = window.of(log)
    pitch = log.euler[:, 1]
    return tracking(log, errors, window) | {
        "peak_x": _peak(errors.vector[at, 0]),
        "pitch_rms": _rms(pitch[at]),
        "iae_position": _integral(log, errors.position[at]),
        "iae_joint": _integral(log, errors.joints[at]),
        "peak_pitch": _peak(pitch[at]),
    }


def constant_wind(
    log: Log, errors: Errors, window: Window, transient: Window
) -> dict[str, float]:
    """Rows of the constant wind experiment."""
    at = window.of(log)
    pitch, e = log.euler[:, 1], errors.position[at]
    return tracking(log, errors, window) | {
        "position_min": _min(e),
        "position_max": _max(e),
        "position_ripple": 0.5 * (_max(e) - _min(e)),
        "pitch_mean": _mean(pitch[at]),
        "pitch_ripple": 0.5 * (_max(pitch[at]) - _min(pitch[at])),
        "peak_pitch": _max(np.abs(pitch[transient.of(log)])),
        "iae_position": _integral(log, errors.position),
        "iae_joint": _integral(log, errors.joints),
    }


def held_position_error(log: Log, errors: Errors, holds: tuple[Window, ...]) -> float:
    """Mean |e_p| over the windows in which the arm is held away from the middle."""
    at = np.zeros(log.time.size, dtype=bool)
    for window in holds:
        at |= window.of(log)
    return _mean(errors.position[at])


def calmness(log: Log, errors: Errors, window: Window) -> dict[str, float]:
    """How hard the vehicle works, over a window; the largest tilt and altitude error
    are of the whole run.

    ``rotor_jitter`` is the RMS over instants and rotors of the change of commanded
    speed since a control period ago (rad/s; none at the first instant), ``rate_rms``
    that of the norm of the body rate (rad/s), ``tilt_rms`` that of the angle between
    body z and world z (rad).
    """
    at = window.of(log)
    change = np.diff(log.rotor_commands, axis=0, prepend=log.rotor_commands[:1])
    tilt = 2.0 * np.arcsin(
        np.minimum(np.linalg.norm(log.quaternion[:, 1:3], axis=1), 1.0)
    )
    return {
        "rotor_jitter": _rms(change[at]),
        "rate_rms": _rms(_norm(log.rate[at])),
        "tilt_rms": _rms(tilt[at]),
        "tilt_max": _max(tilt),
        "altitude_error_max": _max(np.abs(errors.vector[:, 2])),
    }


def rotor_jitter_mean(log: Log, window: Window) -> float:
    """Mean over instants and rotors of the size of the change of commanded speed since
    a control period ago, rad/s.
    """
    change = np.diff(log.rotor_commands, axis=0, prepend=log.rotor_commands[:1])
    return _mean(np.abs(change[window.of(log)]))


def saturation(
    log: Log, window: Window, speeds: Array, efforts: Array
) -> dict[str, float]:
    """Shares of the periods with a rotor (rad/s) at 0 or its largest speed, and with a
    joint (N m) at its limit.
    """
    at = window.of(log)
    rotors = (log.rotor_commands <= 0.0) | (log.rotor_commands > speeds - 1e-6)
    joints = np.abs(log.efforts) > efforts - 1e-6
    return {
        "rotor_saturation": _mean(rotors.any(axis=1)[at].astype(float)),
        "joint_saturation": _mean(joints.any(axis=1)[at].astype(float)),
    }


def tool_peak(log: Log, errors: Errors, window: Window) -> float:
    """End-effector error of largest magnitude along x, with its sign, m."""
    return _peak(errors.tool_vector[window.of(log), 0])


def last(log: Log, errors: Errors, seconds: float = 5.0) -> dict[str, float]:
    """End-effector error over the last seconds of the planned flight."""
    at = log.time >= log.info["duration"] - seconds
    return {
        "ee_error_last_mean": _mean(errors.tool[at]),
        "ee_error_last_max": _max(errors.tool[at]),
    }
