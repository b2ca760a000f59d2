"""Noise that a scenario has not cannot vary in a batch: it would fly without and say
nothing.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.sensing.measurement import SensorNoise

CASE = dataclasses.replace(skyarm.load_scenario("case2"), duration=0.2)


def test_noise_of_perfect_sensors_cannot_vary():
    with pytest.raises(
        ScenarioError, match=r"paths: sensors\.position: is 0 in this scenario"
    ) as raised:
        skyarm.Batch(CASE, ["sensors.position"])
    assert "\n" not in str(raised.value)


def test_noise_that_is_there_varies():
    noisy = dataclasses.replace(CASE, noise=SensorNoise(position=1e-6))
    batch = skyarm.Batch(
        noisy, ["sensors.position"], metrics=["rotor_jitter"], effort=0
    )
    found = batch.fly({"sensors.position": np.array([1e-6, 0.01])}).metrics[
        "rotor_jitter"
    ]
    assert found[1] > 10.0 * found[0]
