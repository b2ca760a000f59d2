"""Case 3 flown on estimates: its scenario in words of the tests' short flight, and
errors of the tip.
"""

from __future__ import annotations

import numpy as np

import skyarm

CASE3 = {
    "duration": 20.0,
    "windows": {"steady": [10.0, 20.0]},
    "model": {"vehicle": "hummingbird_arm2", "gravity": 9.81},
    "reference__base__start": 6.0,
    "reference__base__stop": 21.0,
    "reference__joints": [
        {
            "kind": "sine",
            "amplitude": 0.2,
            "frequency_hz": 0.5,
            "start": 6.0,
            "stop": 21.0,
        },
        {
            "kind": "sine",
            "amplitude": 0.15,
            "frequency_hz": 0.5,
            "phase": np.pi / 2,
            "start": 6.0,
            "stop": 21.0,
        },
    ],
}
"""What makes the short flight of the tests the paper's Case 3; its gyroscope and
accelerometer are the issue's."""

SLOW = {
    "sensors__mocap__frequency": 10.0,
    "sensors__mocap__dropouts": {"share": 0.2, "duration": 0.2},
}
"""Pose at 10 Hz, a fifth of it lost in runs of 200 ms on average."""


def tip_errors(scenario, seeds: int, seed: int) -> np.ndarray:
    batch = skyarm.Batch(scenario, ["estimator.gyro"], metrics=["ee_error_mean"])
    outcome = batch.fly({"estimator.gyro": np.full(seeds, 0.005)}, seed=seed)
    assert set(outcome.status) == {"completed"}
    return np.asarray(outcome.metrics["ee_error_mean"])
