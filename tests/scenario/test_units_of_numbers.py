"""Units of varied numbers are those of their fields, and their words are read by
people.
"""

from __future__ import annotations

import pytest

from skyarm.scenario.numbers import axis_label, number_at, unit_at, words_of
from skyarm.scenario.scenario_file import load_scenario
from skyarm.studies.sweep import load_study


@pytest.mark.parametrize(
    ("path", "label"),
    [
        ("plant.vehicle.base.mass", "base mass (plant) [kg]"),
        ("model.vehicle.base.mass", "base mass (model) [kg]"),
        (
            "plant.vehicle.links.0.joint.damping",
            "link 1 joint damping (plant) [N m s/rad]",
        ),
        (
            "plant.vehicle.links.0.joint.effort_limit",
            "link 1 joint effort limit (plant) [N m]",
        ),
        ("plant.vehicle.links.1.body.inertia.yy", "link 2 inertia yy (plant) [kg m^2]"),
        (
            "plant.vehicle.rotors.0.thrust_coefficient",
            "rotor 1 thrust coefficient (plant) [N s^2/rad^2]",
        ),
        ("controller.joint_gains.stiffness.0", "joint gains stiffness 1 (law) [1/s^2]"),
        ("plant.joints.damping", "joints damping (plant) [N m s/rad]"),
        ("plant.gravity", "gravity (plant) [m/s^2]"),
        ("plant.payload.mass", "payload mass (plant) [kg]"),
        ("environment.wind.force_W.x", "wind force x [N]"),
        ("environment.wind.air_velocity.0", "wind air velocity 1 [m/s]"),
        ("sensors.position", "noise of position [m]"),
        ("initial.position.z", "initial position z [m]"),
        ("initial.roll", "initial roll [rad]"),
        ("reference.base.radius", "reference base radius [m]"),
    ],
)
def test_a_number_is_named_with_its_unit(path: str, label: str) -> None:
    scenario = load_scenario("case3_wind")
    number_at(scenario, path)
    found = axis_label(words_of(path), unit_at(scenario, path))
    # a circle's sines may lie along any axis: their amplitude has the unit of what they
    # move
    assert (
        found in (label, label.partition(" [")[0])
        if path.startswith("reference")
        else found == label
    )


def test_a_joint_that_slides_has_the_other_unit() -> None:
    from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle

    units = {}
    for name in list_vehicles():
        for link in load_vehicle(name).links:
            units.setdefault(link.joint.kind, link)
    assert "revolute" in units
    from skyarm.scenario.numbers import _declaration

    for kind, link in units.items():
        found = _declaration(link, ("joint", "damping")).unit
        assert found == {"revolute": "N m s/rad", "prismatic": "N s/m"}[kind]


def test_every_number_of_the_shipped_study_has_a_unit() -> None:
    study = load_study("robustness")
    scenario = next(iter(study.scenarios.values()))
    assert {path: unit_at(scenario, path) for path in study.paths} == {
        "plant.vehicle.base.mass": "kg",
        "environment.wind.force_W.x": "N",
        "plant.vehicle.links.0.joint.damping": "N m s/rad",
        "sensors.position": "m",
        "sensors.rate": "rad/s",
    }
