"""Detection of an external force: bias, threshold, patience."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.control.blocks.prediction import Disturbance, no_disturbance
from skyarm.control.laws.centroidal.contact.admittance import (
    AdmittanceMemory,
    Detection,
    detect,
)

DT, GAINS, ZERO = 0.005, Detection(), Vec3(0.0, 0.0, 0.0)
FIRST = AdmittanceMemory(bias=no_disturbance(1))
CALM = dataclasses.replace(FIRST, age=5.0)


def step(memory, told, observed=(0.0, 0.0, 0.0), felt=None, gains=GAINS):
    d = Disturbance(
        force=Vec3(*observed), torque=Vec3(*observed) * 0.1, efforts=(observed[0],)
    )
    memory = dataclasses.replace(
        memory, force=Vec3(*told), sensed=() if felt is None else felt
    )
    memory = detect(gains, memory, d, Vec3(*told), DT)
    return memory, memory.force * memory.detected


def test_a_force_counts_in_full_above_the_threshold_and_while_patience_lasts():
    quiet, none = step(CALM, (0.0, 0.29, 0.0))
    assert (quiet.detected, [*none]) == (0.0, [0.0] * 3)
    memory, outside = step(CALM, (0.2, 0.0, -0.25))
    assert (memory.detected, [*outside]) == (1.0, [0.2, 0.0, -0.25])
    for _ in range(59):
        memory, outside = step(memory, (0.1, 0.0, 0.0))
    assert [*outside] == [0.1, 0.0, 0.0]
    memory, outside = step(step(memory, (0.1, 0.0, 0.0))[0], (0.1, 0.0, 0.0))
    assert (memory.detected, [*outside]) == (0.0, [0.0] * 3)
    assert (
        step(CALM, (0.1, 0.0, 0.0), gains=Detection(threshold=0.05))[0].detected == 1.0
    )


def test_nothing_counts_before_the_bias_has_settled():
    memory, found = FIRST, []
    for _ in range(402):
        memory, outside = step(memory, (1.0, 0.0, 0.0), (1.0, 0.0, -2.0))
        found.append(outside.x)
    assert found.index(1.0) in (399, 400, 401)  # 2 s
    assert memory.bias.force.z == pytest.approx(
        -2.0 * (1.0 - np.exp(-3.0 * 2.0)), rel=0.01
    )


def test_the_bias_is_that_of_free_flight_and_wind_beside_a_force():
    calm = step(CALM, (0.0, 0.0, 0.0), (0.2, 0.0, 0.1))[0].bias
    share = 1.0 - np.exp(-0.5 * DT)
    assert [*calm.force, calm.torque.z, calm.efforts[0]] == pytest.approx(
        [0.2 * share, 0.0, 0.1 * share, 0.01 * share, 0.2 * share]
    )
    held = step(CALM, (1.0, 0.0, 0.0), (1.5, 0.0, 0.1))[0].bias
    wind = 1.0 - np.exp(-1.0 * DT)
    assert [*held.force] == pytest.approx([0.5 * wind, 0.0, 0.1 * wind])
    assert (*held.torque, *held.efforts) == (0.0,) * 4


def test_the_bias_of_a_sensor_is_learned_in_its_own_axes_while_nothing_is_heard():
    memory = dataclasses.replace(CALM, sensor_bias=ZERO)
    share = 1.0 - np.exp(-0.5 * DT)
    assert [
        *step(memory, (0.0, 0.0, 0.0), felt=Vec3(0.3, 0.0, 0.1))[0].sensor_bias
    ] == pytest.approx([0.3 * share, 0.0, 0.1 * share])
    assert [
        *step(memory, (1.0, 0.0, 0.0), felt=Vec3(1.3, 0.0, 0.1))[0].sensor_bias
    ] == [0.0] * 3
    assert step(CALM, (0.0, 0.0, 0.0))[0].sensor_bias == ()
