"""The closed loop on an emulated ARM processor: NEON code gives the bits of Python
floats.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_loop import NAME, assembly
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.records.leaves import leaves
from skyarm.scenario.scenario_file import load_scenario
from skyarm.sensing.measurement import SensorNoise
from skyarm.simulate.engine import EpisodeCode
from skyarm.simulate.inputs import episode_inputs
from support.cases import sampled
from support.flights import fly

pytest.importorskip("unicorn", reason="unicorn emulates the ARM processor")
from arm64_machine import Arm64, compiled

NOISE = SensorNoise(position=0.003, attitude=0.004, rate=0.03, joint_rates=0.02)


def short(**changes):
    scenario = load_scenario("case3")
    return dataclasses.replace(scenario, duration=0.3, noise=NOISE, seed=7, **changes)


def on_arm(scenario, lanes):
    """Log of the scenario's first lanes: (steps, entries, lanes)."""
    inputs = episode_inputs(scenario)
    traced = EpisodeCode(scenario, commands=False, effort=0)
    content, listing = compiled(assembly(traced.loop, lanes, logging=True))
    width, dtype = lanes.width, np.float32 if lanes.single else np.float64
    rows = np.column_stack(
        [
            inputs.times,
            np.array(inputs.held_leaves, dtype=float).reshape(scenario.steps, -1),
        ]
    )
    carry = np.repeat(
        np.array(leaves(traced.carry), dtype=dtype)[:, None], width, axis=1
    )
    log = np.zeros((scenario.steps, traced.loop.logged, width), dtype)
    keys = np.array([scenario.seed, *range(width)], dtype=np.uint64)
    arrays = [
        carry,
        np.zeros((1, width), dtype),
        np.ascontiguousarray(rows, dtype),
        log,
        keys,
    ]
    Arm64(content).call(NAME, arrays, [0, 1, 0, scenario.steps, 0, width, 1])
    return log, listing, traced, rows


@pytest.mark.parametrize("integrator", sampled(["rk4", "euler"], 2))
def test_two_lanes_of_a_neon_register_are_the_flights_of_python_floats(integrator):
    scenario = short(integrator=integrator)
    log, listing, _, _ = on_arm(scenario, Lanes(2))
    assert ".2d" in listing  # vector instructions on two doubles
    for lane in (0, 1):
        flown = fly(dataclasses.replace(scenario, episode=lane), python=True)
        assert np.array_equal(flown.rows, log[:, :, lane])


@pytest.mark.thorough
def test_single_precision_has_the_bits_of_this_processor():
    scenario = short()
    log, listing, traced, rows = on_arm(scenario, Lanes(4, single=True))
    assert ".4s" in listing  # vector instructions on four floats
    here = Kernel(traced.loop, Lanes(4, single=True), logging=True)
    carry = np.repeat(np.array(leaves(traced.carry))[:, None], 4, axis=1)
    _, expected = here.run(carry, np.zeros((0, 4)), rows, seed=scenario.seed)
    assert np.array_equal(log, expected)
