"""Dotted paths lead to the numbers they name, and a change reaches everything that is derived from them."""

from __future__ import annotations

import pytest
from simulate_flights import document

from skyarm.simulate.paths import number_at, require_apart, with_numbers
from skyarm.simulate.places import ROOTS
from skyarm.simulate.scenario import ScenarioError
from skyarm.simulate.scenario_file import load_scenario, scenario_from


@pytest.fixture(scope="module")
def scenario():
    return scenario_from(document("everything"), "test")


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
    assert {path.split(".")[0] for path in EXAMPLES} >= {root.split(".")[0] for root in ROOTS} - {"reference"}
    assert number_at(scenario, "reference.z.value") == 1.0


def test_a_link_by_name_is_the_link_by_number(scenario):
    by_name = number_at(scenario, "plant.vehicle.links.link2.body.mass")
    assert by_name == number_at(scenario, "plant.vehicle.links.1.body.mass")
    assert by_name != number_at(scenario, "plant.vehicle.links.0.body.mass")


def test_the_mixer_follows_the_rotors_that_the_model_believes_in(scenario):
    path = "model.vehicle.rotors.0.thrust_coefficient"
    stronger = with_numbers(scenario, {path: 2.0 * number_at(scenario, path)})
    assert stronger.controller.par.mixer != scenario.controller.par.mixer
    assert with_numbers(scenario, {"plant.gravity": 9.0}).controller.par.mixer == scenario.controller.par.mixer


REFUSED = {
    "gravity": r"path = 'gravity': must start with one of plant, model, controller",
    "plants.gravity": r"must start with one of",
    "plant": r"must start with one of",
    "plant.vehicle.base.weight": r"no 'weight' here; there are mass, com, inertia, planar",
    "plant.vehicle.links.link3.body.mass": r"no 'link3' here; there are 0, 1, link1, link2",
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
    with pytest.raises(ScenarioError, match=r"is the same number as|must not vary together"):
        require_apart(load_scenario("case3_wind"), (one, other))


def test_the_mixer_follows_the_believed_rotors_by_any_name():
    scenario = load_scenario("case3_wind")
    names = ("model.vehicle.rotors.0.thrust_coefficient", "controller.model.vehicle.rotors.0.thrust_coefficient")
    first, second = (with_numbers(scenario, {name: 1e-5}).controller.par.mixer for name in names)
    assert first == second != scenario.controller.par.mixer
