"""Logs whose errors are known constants, for figures and the report."""

from __future__ import annotations

from functools import cache

import numpy as np

from skyarm.simulate import Log, Window

STEADY = Window(10.0, 20.0)
WINDOWS = {"case1": STEADY, "case2": STEADY, "case3": STEADY, "case2_gust": Window(5.0, 20.0), "case3_wind": STEADY}
CASES = tuple(WINDOWS)
"""As the paper states them, apart from the source."""
ROLL, PITCH = 0.05, 0.10


def synthetic_log(case: str, plant: str, controller: str, seconds: float = 30.0) -> Log:
    """200 Hz; base off by (0.03, 0, -0.04) m, joint 1 by -0.02 rad (PD twice that), tool by 0.01 m along y."""
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
    cr, sr, cp, sp = np.cos(ROLL / 2), np.sin(ROLL / 2), np.cos(PITCH / 2), np.sin(PITCH / 2)
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
        plant: {case: {c: synthetic_log(case, plant, c) for c in ("CT", "PD")} for case in CASES}
        for plant in ("rigid_body", "mujoco")
    }
