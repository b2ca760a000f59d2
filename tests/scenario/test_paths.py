"""Dotted paths lead to the numbers they name, and a change reaches everything that is
derived from them.
"""

from __future__ import annotations

import dataclasses

import pytest

from skyarm.algebra import Vec3
from skyarm.scenario.numbers import number_at, require_apart, with_numbers
from skyarm.scenario.paths import roots, variable_words
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.scenario.scenario_record import (
    Change,
    JointDrive,
    NamedSensor,
    ScenarioError,
)
from skyarm.world import Fault, TimedPayload
from skyarm.world.contact import Contact, Material, Surface
from skyarm.world.team import Team
from support.components import Blend, Ceiling, Fix, Lag, RandomPush, Shear, SteadyWrench
from support.flights import document


@pytest.fixture(scope="module")
def scenario():
    return dataclasses.replace(
        scenario_from(document("everything"), "test"),
        air=(Shear(rate=0.3),),
        forces=(RandomPush(sigma=0.25), SteadyWrench(force=Vec3(1.0, 2.0, 3.0))),
        estimator=Blend(gain=0.02),
        sensors=(NamedSensor(name="fix", sensor=Fix(sigma=0.01)),),
        drives=(JointDrive(joint="joint2", drive=Lag(lag=0.04)),),
        endings=(Ceiling(height=7.0),),
        faults=(Fault(rotor="front", effectiveness=0.9, start=2.0),),
        changes=(Change(at=0.02, path="environment.wind.gust.start", value=0.03),),
        payloads=(TimedPayload(mass=0.05, pick=0.01, name="parcel"),),
        world=Contact(
            surfaces=(
                Surface(
                    name="wall", position=Vec3(0.0, 0.0, -9.0), material=Material()
                ),
            )
        ),
        team=Team(object="bar", mass=1.6),
    )


EXAMPLES = {
    "plant.gravity": 9.8,
    "model.gravity": 9.81,
    "plant.vehicle.links.0.joint.damping": 0.002,
    "plant.vehicle.links.link2.joint.coulomb_rate": 0.02,
    "controller.gains.position.x": 4.0,
    "controller.gains.attitude.z": 0.035,
    "controller.joint_gains.stiffness.1": 150.0,
    "environment.wind.velocity_W.x": 1.0,
    "environment.wind.gust.start": 0.02,
    "sensors.joint_rates": 0.02,
    "initial.velocity.x": 0.1,
    "initial.joints.0": 0.1,
    "environment.air.0.rate": 0.3,
    "environment.forces.0.sigma": 0.25,
    "environment.forces.1.force.y": 2.0,
    "environment.faults.0.start": 2.0,
    "estimator.gain": 0.02,
    "endings.0.height": 7.0,
    "sensors.fix.sigma": 0.01,
    "plant.drives.joint2.lag": 0.04,
    "changes.0.value": 0.03,
    "payloads.parcel.pick": 0.01,
    "world.surfaces.wall.material.stiffness": 5000.0,
    "world.points.tip.radius": 0.0,
    "team.mass": 1.6,
}


@pytest.mark.parametrize("path", sorted(EXAMPLES))
def test_a_path_leads_to_the_number_of_the_file(scenario, path):
    assert number_at(scenario, path) == EXAMPLES[path]


@pytest.mark.parametrize("path", sorted(EXAMPLES))
def test_a_number_that_is_replaced_is_there_and_no_other_changed(scenario, path):
    changed = with_numbers(scenario, {path: 0.123})
    assert number_at(changed, path) == 0.123
    for other, value in EXAMPLES.items():
        if other != path:
            assert number_at(changed, other) == value
    assert number_at(scenario, path) == EXAMPLES[path]


def test_every_root_has_an_example(scenario):
    wanted = set(roots(scenario)) - {"reference"}
    assert (
        {
            root
            for root in wanted
            if any(path.startswith(f"{root}.") for path in EXAMPLES)
        }
        == wanted
        > set(variable_words()) - {"reference"}
    )
    assert number_at(scenario, "reference.z.value") == 1.0


def test_a_link_by_name_is_the_link_by_number(scenario):
    by_name = number_at(scenario, "plant.vehicle.links.link2.body.mass")
    assert by_name == number_at(scenario, "plant.vehicle.links.1.body.mass")
    assert by_name != number_at(scenario, "plant.vehicle.links.0.body.mass")


def test_the_mixer_follows_the_rotors_that_the_model_believes_in(scenario):
    path = "model.vehicle.rotors.0.thrust_coefficient"
    stronger = with_numbers(scenario, {path: 2.0 * number_at(scenario, path)})
    assert stronger.controller.par.mixer != scenario.controller.par.mixer
    assert (
        with_numbers(scenario, {"plant.gravity": 9.0}).controller.par.mixer
        == scenario.controller.par.mixer
    )


REFUSED = {
    "gravity": r"path = 'gravity': must start with one of plant, model, controller",
    "plants.gravity": r"must start with one of",
    "plant": r"must start with one of",
    "plant.vehicle.base.weight": (
        r"no 'weight' here; there are mass, com, inertia, planar"
    ),
    "plant.vehicle.links.link3.body.mass": (
        r"no 'link3' here; did you mean 'link2'\? there are 0, 1, link1, link2"
    ),
    "plant.vehicle.base": r"must lead to a number, not to Body",
    "plant.vehicle.name": r"must lead to a number, not to str",
    "plant.vehicle.base.planar": r"must lead to a number, not to bool",
    "plant.vehicle.base.mass.x": r"no 'x' here; there are no fields",
    "plant..gravity": r"no '' here",
}


@pytest.mark.parametrize("path", sorted(REFUSED))
def test_a_path_that_leads_nowhere_is_refused_with_what_there_is(scenario, path):
    with pytest.raises(ScenarioError, match=REFUSED[path]):
        number_at(scenario, path)
    with pytest.raises(ScenarioError):
        with_numbers(scenario, {path: 1.0})


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("environment.wind.force.0", "environment.wind.force_W.x"),
        ("plant.joints.damping", "plant.vehicle.links.0.joint.damping"),
        ("initial.roll", "initial.quaternion_wxyz.1"),
    ],
)
def test_two_names_of_one_number_do_not_vary_together(one, other):
    with pytest.raises(
        ScenarioError, match=r"is the same number as|must not vary together"
    ):
        require_apart(load_scenario("case3_wind"), (one, other))


@pytest.mark.parametrize(
    "paths",
    [
        ("initial.roll", "initial.pitch", "initial.position.x"),
        ("initial.quaternion.w", "initial.quaternion.x", "initial.position.x"),
    ],
)
def test_angles_vary_together_with_a_place_and_a_quaternion_without_angles(paths):
    require_apart(load_scenario("case3_wind"), paths)


def test_the_mixer_follows_the_believed_rotors_by_any_name():
    scenario = load_scenario("case3_wind")
    names = (
        "model.vehicle.rotors.0.thrust_coefficient",
        "controller.model.vehicle.rotors.0.thrust_coefficient",
    )
    first, second = (
        with_numbers(scenario, {name: 1e-5}).controller.par.mixer for name in names
    )
    assert first == second != scenario.controller.par.mixer
