"""Scenarios beyond the paper: every shipped vehicle, both integrators, moving air,
payload, noisy sensors.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.simulate import Rates, run
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle
from support.cases import sampled
from support.flights import FULL, document

FLYABLE = [name for name in list_vehicles() if not load_vehicle(name).planar]


def _hover(vehicle: str, plant: str, law: str) -> dict[str, Any]:
    joints = load_vehicle(vehicle).n
    moving = {"kind": "sine", "amplitude": 0.015, "frequency_hz": 0.5, "start": 0.5}
    return {
        "name": "hover",
        "duration": 4.0,
        # friction, which no law here compensates, would hold small wrists where they
        # are
        "plant": {
            "vehicle": vehicle,
            "kind": plant,
            "joints": {"coulomb": 0.0, "damping": 0.0},
        },
        "controller": {"law": law},
        "reference": {
            "base": {
                "kind": "circle",
                "radius": 0.1,
                "frequency_hz": 0.2,
                "center": [0.0, 0.0, 3.0],
                "start": 0.5,
            },
            "joints": [moving] * joints,
        },
    }


HEAVY = ("hexarotor12_arm5", "quadrotor_roll_arm2", "hummingbird_arm2_twin")
"""Whose flights are like those of others, or take seconds to make into code."""

LIGHT = ("hexacopter680_flying_arm_2", "hextilt_flying_arm_5")
"""Whose published base has less inertia about roll than the arm: the hybrid computed
torque is unstable in hover."""

STEADY = [name for name in FLYABLE if name not in LIGHT]

EAGLE = ("hexacopter370_flying_arm_3", *LIGHT)
"""Vehicles of eagle-mpc."""


def on_both_plants() -> list[Any]:
    """(vehicle, plant); of the heavy ones a plant in ``make test``, or none, and the
    other in ``make thorough``.
    """
    pairs = [
        (vehicle, plant) for vehicle in STEADY for plant in ("rigid_body", "mujoco")
    ]
    return sampled(
        pairs,
        len(pairs),
        keep=[(v, p) for v, p in pairs if v not in HEAVY] + [(HEAVY[1], "rigid_body")],
    )


@pytest.mark.parametrize(("vehicle", "plant"), on_both_plants())
def test_every_shipped_vehicle_flies_a_circle_with_moving_arms(
    vehicle: str, plant: str
) -> None:
    log = run(scenario_from(_hover(vehicle, plant, "hybrid_computed_torque")))
    assert log.status == "completed", log.info["cause"]
    last = log.time > 3.0
    error = np.linalg.norm(log.position - log.position_reference, axis=1)[last]
    # truth and belief are the same vehicle: what is left is rotor lag and the step onto
    # the circle
    assert error.max() < 0.05
    if log.joints.shape[1]:
        assert np.abs(log.joints - log.joints_reference)[last].max() < 0.01


RETURNING = [
    (v, plant, law)
    for v in EAGLE
    for plant in ("rigid_body", "mujoco")
    for law in ("centroidal_joint", "nmpc")
]


@pytest.mark.parametrize(
    ("vehicle", "plant", "law"), sampled(RETURNING, len(RETURNING))
)
def test_the_vehicles_of_eagle_mpc_return_to_hover(
    vehicle: str, plant: str, law: str
) -> None:
    joints = load_vehicle(vehicle).n
    table = {
        "name": "hover",
        "duration": 5.0,
        "plant": {"vehicle": vehicle, "kind": plant},
    }
    table["controller"] = {"law": law} if law == "nmpc" else {"preset": law}
    table["initial"] = {"position": [0.1, -0.1, 2.9], "joints": [0.1] * joints}
    table["reference"] = {
        "base": {"kind": "hover", "position": [0.0, 0.0, 3.0]},
        "joints": [0.0] * joints,
    }
    log = run(scenario_from(table))
    assert log.status == "completed", log.info["cause"]
    last = log.time > 4.0
    assert np.abs(log.position - [0.0, 0.0, 3.0])[last].max() < 1e-3
    assert np.abs(log.joints)[last].max() < 0.02


@pytest.mark.parametrize(
    "vehicle", sampled(FLYABLE, len(FLYABLE), keep=["crazyflie_arm1"])
)
def test_the_general_law_flies_every_shipped_vehicle_on_a_circle(vehicle: str) -> None:
    log = run(
        scenario_from(
            _hover(vehicle, "rigid_body", "centroidal"), replaced={"duration": 6.0}
        )
    )
    assert log.status == "completed", log.info["cause"]
    # at the law's default bandwidth the step onto the circle dies out in four to five
    # seconds
    last = log.time > 5.0
    assert (
        np.linalg.norm(log.position - log.position_reference, axis=1)[last].max()
        < 0.005
    )
    assert np.abs(log.joints - log.joints_reference)[last].max(initial=0.0) < 0.001


@pytest.mark.parametrize(
    "vehicle", sampled(STEADY, len(STEADY), keep=[v for v in STEADY if v not in HEAVY])
)
def test_hover_trim_is_an_equilibrium_of_the_closed_loop(vehicle: str) -> None:
    still = _hover(vehicle, "rigid_body", "hybrid_computed_torque")
    still["reference"] = {
        "base": {"kind": "hover", "position": [0.0, 0.0, 3.0]},
        "yaw": 0.4,
    }
    log = run(scenario_from(still, replaced={"duration": 1.0}))
    assert np.abs(log.position - [0.0, 0.0, 3.0]).max() < 1e-6
    assert np.abs(log.joints).max(initial=0.0) < 1e-6


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_a_truth_too_heavy_to_hover_starts_at_full_speed_and_sinks(plant: str) -> None:
    heavy = _hover("hummingbird_arm2_rotors", plant, "hybrid_computed_torque")
    heavy["plant"]["payload"] = {"mass": 5.0}
    log = run(scenario_from(heavy, replaced={"duration": 0.5}))
    top = load_vehicle("hummingbird_arm2_rotors").rotors[0].max_speed
    assert log.rotor_speeds[0].tolist() == [top] * 4
    assert log.rotor_speeds.max() <= top
    assert log.position[-1, 2] < 2.9


def test_semi_implicit_euler_at_1_khz_is_near_rk4_at_the_control_rate() -> None:
    fine = load_scenario("case3_wind", duration=5.0)
    coarse = dataclasses.replace(fine, integrator="euler")
    difference = np.abs(run(fine).position - run(coarse).position).max()
    # first order: 0.5 ms times the 0.3 m/s of the approach
    assert 1e-7 < difference < 1e-3


def test_the_plants_agree_over_five_seconds_of_wind_and_motion() -> None:
    quick = document("case3_wind", duration=5.0, reference__base__start=1.0)
    for joint in quick["reference"]["joints"]:
        joint["start"] = 1.0
    logs = [
        run(scenario_from(quick, replaced={"plant": plant}))
        for plant in ("rigid_body", "mujoco")
    ]
    # MuJoCo holds forces for its 1 ms step; the base moves by 0.8 m and the arm swings
    assert np.abs(logs[0].position - logs[1].position).max() < 1e-3
    assert np.abs(logs[0].euler - logs[1].euler).max() < 5e-3
    assert np.ptp(logs[0].position[:, 0]) > 0.3


def test_the_plants_are_one_with_the_same_integrator_and_step() -> None:
    quick = document(
        "case3_wind",
        duration=2.0,
        reference__base__start=0.2,
        plant__integrator="euler",
    )
    logs = [
        run(scenario_from(quick, replaced={"plant": plant}))
        for plant in ("rigid_body", "mujoco")
    ]
    for name in (
        "position",
        "quaternion",
        "velocity",
        "rate",
        "joints",
        "rotor_speeds",
    ):
        assert np.abs(logs[0].arrays()[name] - logs[1].arrays()[name]).max() < 1e-9, (
            name
        )


def test_every_table_at_once_flies() -> None:
    for plant in ("rigid_body", "mujoco"):
        log = run(scenario_from(FULL, replaced={"plant": plant, "duration": 2.0}))
        assert log.status == "completed"
        assert np.isfinite(log.position).all()


def test_turbulence_moves_the_vehicle_and_depends_on_the_seed_alone() -> None:
    wind = {
        "mode": "moving_air",
        "velocity": [4.0, 0.0, 0.0],
        "turbulence": {"altitude": 10.0, "wind_20ft": 7.7},
    }
    windy = document("case1", duration=5.0, environment={"wind": wind})
    first, again, other = (
        run(scenario_from(windy, replaced={"seed": seed})) for seed in (1, 1, 2)
    )
    assert first.status == other.status == "completed"
    assert np.array_equal(first.position, again.position)
    assert not np.array_equal(first.air_velocity, other.air_velocity)
    assert np.abs(first.position - other.position).max() > 1e-3
    # 7.7 m/s at 20 ft: sigma_w = 0.77 m/s; 5 s are two scales of 10 m at 4 m/s
    assert 0.2 < first.air_velocity[:, 2].std() < 1.6
    rotors = 8.06428e-05 * first.rotor_speeds.sum(axis=1)
    w, x, y, z = first.quaternion.T
    axis = np.stack(
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
        axis=1,
    )
    across = (
        first.air_velocity
        - np.sum(first.air_velocity * axis, axis=1, keepdims=True) * axis
    )
    np.testing.assert_allclose(
        first.wind_force,
        rotors[:, None] * across,
        atol=2e-6,
        err_msg="the rotors' drag",
    )
    assert first.position[-200:, 0].mean() > 0.005, "the wind blows towards +x"


def test_a_payload_the_controller_does_not_know_sags_by_its_weight() -> None:
    known = document("case1", duration=6.0, plant__payload={"mass": 0.05})
    sagging, plain = (
        run(scenario_from(known)),
        run(load_scenario("case1", duration=6.0)),
    )
    last = plain.time > 5.0
    sag = (plain.position - sagging.position)[last, 2].mean()
    assert sag == pytest.approx(0.05 * 9.8 / 4.0, rel=0.01)
    believed = document(
        "case1",
        duration=6.0,
        plant__payload={"mass": 0.05},
        model__payload={"mass": 0.05},
    )
    told = run(scenario_from(believed))
    # the controller's own weight estimate now carries the payload, with its g = 9.81
    left = (plain.position - told.position)[last, 2].mean()
    assert left == pytest.approx(0.05 * (9.8 - 9.81) / 4.0, abs=1e-4)


def test_without_a_model_the_controller_believes_the_plant_but_no_payload() -> None:
    own = document("case1", model=None, plant__payload={"mass": 0.05}, duration=1.0)
    scenario = scenario_from(own)
    model = scenario.controller.par.model
    assert model.vehicle.name == "hummingbird_arm2_rotors"
    assert model.gravity == 9.8
    assert float(scenario.plant.vehicle.mass - model.vehicle.mass) == pytest.approx(
        0.05
    )


def test_noisy_sensors_fly_and_are_worse_than_perfect_ones() -> None:
    noise = {
        "position": 0.005,
        "velocity": 0.02,
        "attitude": 0.005,
        "rate": 0.02,
        "joints": 0.002,
        "joint_rates": 0.02,
        "specific_force": 0.1,
        "rotor_speeds": 2.0,
    }
    noisy = run(scenario_from(document("case2", duration=10.0, sensors=noise, seed=5)))
    perfect = run(load_scenario("case2", duration=10.0))
    assert noisy.status == "completed"
    last = perfect.time > 7.0
    errors = [
        np.abs(log.position - log.position_reference)[last, :2].std()
        for log in (noisy, perfect)
    ]
    assert errors[0] > errors[1]


def test_a_vehicle_file_beside_the_scenario_is_found(tmp_path: Path) -> None:
    from skyarm.vehicle.vehicle_files import LIBRARY

    (tmp_path / "vehicles").mkdir()
    (tmp_path / "vehicles" / "mine.toml").write_bytes(
        (LIBRARY / "hummingbird.toml").read_bytes()
    )
    (tmp_path / "flight.toml").write_text(
        'name = "flight"\nduration = 0.1\n[plant]\nvehicle ='
        ' "vehicles/mine.toml"\n[controller]\nlaw ='
        ' "rotors_sim_position"\n[reference.base]\nkind = "hover"\nposition = [0, 0,'
        " 1]\n"
    )
    log = run(load_scenario(tmp_path / "flight.toml"))
    assert log.status == "completed"
    assert log.info["plant_vehicle"] == "hummingbird"


def test_other_rates_fly() -> None:
    base = load_scenario("case2", duration=1.0)
    for rates in (
        Rates(physics=500, control=500, reference=500),
        Rates(physics=2000, control=100, reference=20),
    ):
        for plant in ("rigid_body", "mujoco"):
            log = run(dataclasses.replace(base, rates=rates, kind=plant))
            assert log.status == "completed"
            assert log.time.size == rates.control
            assert log.time[1] == 1.0 / rates.control
