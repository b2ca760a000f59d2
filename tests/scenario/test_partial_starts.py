"""What [initial] leaves out is hover trim at the reference of the vehicle that flies,
whatever numbers replace.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.scenario.scenario_record import first_state
from skyarm.simulate.batch import Batch

LOAD = "plant.payload.mass"
DOCUMENT = {
    "name": "x",
    "duration": 0.1,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "controller": {"law": "hybrid_computed_torque"},
    "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
}


def begun(initial, **tables):
    return skyarm.scenario_from(
        DOCUMENT | tables | ({} if initial is None else {"initial": initial})
    )


def thrust_of(scenario):
    """Thrust (N) at the start, by hand."""
    rotors = scenario.plant.vehicle.rotors
    speeds = first_state(scenario).rotor_speeds
    return sum(
        float(rotor.thrust_coefficient) * w**2
        for rotor, w in zip(rotors, speeds, strict=True)
    )


def test_rotors_that_are_left_out_hold_the_vehicle_that_flies():
    moving = {"velocity": [0.3, 0.0, 0.0]}
    heavy = [
        begun(moving, numbers={LOAD: 0.3}),
        skyarm.with_numbers(begun(moving), {LOAD: 0.3}),
    ]
    heavy.append(
        skyarm.with_numbers(
            begun(None, numbers={"initial.velocity.x": 0.3}), {LOAD: 0.3}
        )
    )
    heavy.append(begun(moving, plant=DOCUMENT["plant"] | {"payload": {"mass": 0.3}}))
    for scenario in heavy:
        assert thrust_of(scenario) == pytest.approx(
            float(scenario.plant.vehicle.mass) * 9.81, rel=1e-12
        )
        assert first_state(scenario).velocity.x == 0.3
    light = begun({"rotor_speeds": [500.0] * 4}, numbers={LOAD: 0.3})
    assert first_state(light).rotor_speeds == (500.0,) * 4, "what is stated stays"
    assert (
        first_state(
            skyarm.with_numbers(begun(moving), {"initial.rotor_speeds.1": 480.0})
        ).rotor_speeds[1]
        == 480.0
    )


def test_a_place_that_is_left_out_is_that_of_the_reference():
    higher = {"reference.z.value": 1.5}
    assert (
        first_state(
            skyarm.with_numbers(begun({"velocity": [0.3, 0.0, 0.0]}), higher)
        ).position.z
        == 1.5
    )
    assert (
        first_state(
            skyarm.with_numbers(begun({"position": [0.0, 0.0, 1.0]}), higher)
        ).position.z
        == 1.0
    )


def test_a_batch_starts_as_its_flights():
    scenario, loads = begun({"velocity": [0.3, 0.0, 0.0]}), np.array([0.0, 0.3])
    flown = (
        Batch(scenario, [LOAD], bit_exact=True, log_every=1)
        .fly({LOAD: loads})
        .agents["main"]
        .log
    )
    for lane, load in enumerate(loads):
        log = skyarm.run(skyarm.with_numbers(scenario, {LOAD: float(load)}))
        np.testing.assert_array_equal(
            flown.state.rotor_speeds[0][lane], log.rotor_speeds[:, 0]
        )


def test_a_saved_start_has_the_words_that_are_stated(tmp_path):
    changed = skyarm.with_numbers(
        begun({"velocity": [0.3, 0.0, 0.0]}), {LOAD: 0.3, "initial.rate.z": 0.2}
    )
    for scenario in (changed, dataclasses.replace(changed, duration=0.05)):
        found = skyarm.load_scenario(
            skyarm.save_scenario(tmp_path / "found.toml", scenario, DOCUMENT)
        )
        assert first_state(found) == first_state(scenario)
        assert found.initial == scenario.initial
        assert "rotor_speeds" not in (tmp_path / "found.toml").read_text("utf-8")
