"""The paper's vehicle presses on a wall, slides along it and leaves."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Mat3
from skyarm.control.onboard.export_c import export_c
from skyarm.dynamics import mass_matrix
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import scenario_from

FROM, UNTIL, SPEED, WANTED = 2.0, 9.0, 0.1, 1.0
"""s after the touch from which the force counts, s at which it ends, m/s of the
approach, N."""


@pytest.fixture(scope="module")
def scenario():
    return skyarm.load_scenario("examples/press_and_slide.toml")


@pytest.fixture(scope="module")
def log(scenario):
    return skyarm.run(scenario)


def touch(log):
    return log.time[np.argmax(log.contact_force[:, 0] > 0.0)]


def losses(log, until):
    """How often the contact is lost from 0.3 s after the first touch on."""
    on = log.contact_force[(log.time >= touch(log) + 0.3) & (log.time < until), 0] > 0.0
    return int(np.sum(on[:-1] & ~on[1:]))


def held(log, until):
    return log.contact_force[(log.time >= touch(log) + FROM) & (log.time < until), 0]


def tip_mass(vehicle, joints):
    """What the tip weighs along x, kg: 1 / (n J M^-1 J n)."""
    M = np.array(mass_matrix(vehicle, Mat3.identity(), joints), dtype=float)
    r = np.array([*frame_pose(vehicle, vehicle.frame(), joints).p])
    columns = [
        column.linear.x for column in jacobian_columns(vehicle, vehicle.frame(), joints)
    ]
    row = np.array([1.0, 0.0, 0.0, *np.cross(r, [1.0, 0.0, 0.0]), *columns])
    return 1.0 / (row @ np.linalg.solve(M, row))


def test_the_wanted_force_is_held_while_the_tip_slides_and_the_tip_returns(log):
    assert log.status == "completed"
    assert losses(log, UNTIL) == 0
    force = held(log, UNTIL)
    assert force.mean() == pytest.approx(WANTED, abs=0.03)
    assert force.std() < 0.02
    assert log.contact_force[log.time > UNTIL + 0.3].max() == 0.0
    assert np.linalg.norm(log.tip[-1] - log.tip_reference[-1]) < 1e-3
    slid = np.linalg.norm(
        (log.tip - log.tip_reference)[(log.time > 3.9) & (log.time < UNTIL), 1:], axis=1
    )
    assert slid.mean() < 5e-3


def test_the_impact_is_that_of_the_tips_mass(scenario, log):
    mass = tip_mass(scenario.plant.vehicle, (-0.45, -0.9))
    assert log.contact_force[log.time < UNTIL].max() < 1.3 * max(
        WANTED, SPEED * np.sqrt(5000.0 * mass)
    )


def test_the_wanted_contact_and_the_thresholds_are_numbers_of_the_scenario(scenario):
    assert number_at(scenario, "reference.push.force.value") == WANTED
    changed = with_numbers(
        scenario,
        {"reference.push.normal.2": 0.2, "controller.parts.interaction.touch": 0.4},
    )
    assert changed.reference.at(2.0).push[4] == pytest.approx(0.2 / np.sqrt(1.04))
    assert changed.controller.par.parts.interaction.touch == 0.4


def test_a_push_is_kept_with_the_scenario(scenario):
    assert restore(plain(scenario.reference)) == scenario.reference


def test_exported_c_is_told_of_the_push(scenario):
    found = export_c(scenario.controller, name="law", period=0.005)
    assert "double push[12];" in found.text
    assert any(name.startswith("parts_interaction_") for name in found.parameters)


def hexarotor(force, **entries):
    """The hexarotor before a wall with a hand bent up, under noise and a known delay of
    5 ms.
    """
    document = {
        "schema": 1,
        "name": "hexarotor_presses",
        "duration": 10.0,
        "plant": {"vehicle": "hexarotor_arm6"},
        "controller": {
            "law": "centroidal",
            "mode": "tip",
            "interaction": [0.5, 0.15],
            "reach": 0.24,
            "damping": 0.06,
            "observer": [27.0, 31.0, 60.0, 60.0],
        },
        "sensors": {
            "position": 1e-3,
            "velocity": 1e-2,
            "attitude": 2e-3,
            "rate": 1e-2,
            "joints": 1e-3,
            "joint_rates": 1e-2,
        },
        "delays": {"measurement": 0.005},
        "reference": {
            "base": {"kind": "signals", "z": 1.5},
            "joints": [0.0, -0.6, -0.97, 0.0, -0.8, 0.0],
            "push": {
                "force": {"kind": "constant", "value": force, "start": 1.0},
                "normal": [-1.0, 0.0, 0.0],
            },
        },
        "world": {
            "surfaces": [
                {
                    "name": "wall",
                    "shape": "box",
                    "size": [0.4, 6.0, 3.0],
                    "position": [0.73, 0.0, 1.5],
                    "material": {"friction": 0.6},
                }
            ]
        },
    }
    document["reference"]["base"] |= entries.pop("base", {})
    return scenario_from(document | entries)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
@pytest.mark.parametrize("way", [0.5, -0.5])
def test_a_hexarotor_slides_on_a_rough_wall_by_its_joints_alone(seed, plant, way):
    """Friction that was compensated in full before the slide gave 0.11 N up, and 0.25 N
    down.
    """
    ramp = {
        "kind": "ramp",
        "start": 5.0,
        "duration": 5.0,
        "height": way,
        "shape": "linear",
    }
    log = skyarm.run(
        dataclasses.replace(
            hexarotor(5.0, base={"z": [1.8, ramp]}, seed=seed), kind=plant
        )
    )
    force = held(log, 10.0)
    assert (log.status, losses(log, 10.0)) == ("completed", 0)
    assert force.mean() == pytest.approx(5.0, abs=0.05)
    assert force.std() < 0.24
    across = np.linalg.norm((log.tip - log.tip_reference)[log.time > 4.0, 1:], axis=1)
    assert across.mean() < 2e-3


@pytest.mark.thorough
@pytest.mark.parametrize("force", [2.0, 10.0])
def test_a_hexarotor_with_weak_rotors_holds_the_force(force):
    for seed in range(3):
        scenario = hexarotor(force, seed=seed)
        weak = with_numbers(
            scenario,
            {
                f"plant.vehicle.rotors.{i}.thrust_coefficient": (
                    0.9 * float(rotor.thrust_coefficient)
                )
                for i, rotor in enumerate(scenario.plant.vehicle.rotors)
            },
        )
        log = skyarm.run(weak)
        assert (log.status, losses(log, 10.0)) == ("completed", 0)
        assert held(log, 10.0).mean() == pytest.approx(force, abs=0.05)
        assert held(log, 10.0).std() < 0.2
