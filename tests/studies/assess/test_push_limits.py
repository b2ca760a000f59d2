"""A check of a scenario says what its push asks of joints and yaw, and whether its law
presses at all.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.control.catalogue import preset
from skyarm.dynamics.actuators import make_mixer
from skyarm.dynamics.kinematics import frame_pose, link_poses
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.studies.assess.finding import FAULT, OK, WARNING
from skyarm.studies.assess.push_limits import push_limits
from support.worlds import beside_a_box

POSE = (-0.45, -0.9)


@pytest.fixture(scope="module")
def scenario():
    return skyarm.load_scenario("examples/press_and_slide.toml")


def found(scenario, **numbers):
    changed = with_numbers(
        scenario, {f"reference.push.{name}": value for name, value in numbers.items()}
    )
    return {each.question: each for each in push_limits(changed)}


def test_the_joint_bears_the_force_by_its_lever(scenario):
    vehicle = scenario.plant.vehicle
    height = (
        link_poses(vehicle, POSE)[0].p.z
        - frame_pose(vehicle, vehicle.frame(), POSE).p.z
    )
    question, limit = (
        "joints while pressing",
        float(vehicle.links[0].joint.effort_limit),
    )
    shares = {
        force: found(scenario, **{"force.value": force})[question].value
        for force in (1.0, 2.0, 3.0)
    }
    assert np.diff(list(shares.values())) * limit == pytest.approx([height, height])
    # what the joint of that flight gives at 2 N on a wall without friction: 0.425 N m
    assert shares[2.0] * limit == pytest.approx(0.425, abs=0.003)
    levels = [
        found(scenario, **{"force.value": force})[question].level
        for force in (1.0, 2.0, 3.0)
    ]
    assert levels == [OK, WARNING, FAULT]
    assert found(scenario, **{"force.value": 3.0})[question].joints == POSE
    assert (
        " of 0.5 N m at joint joint1"
        in found(scenario, **{"force.value": 3.0})[question].text
    )
    early = found(
        scenario, **{"force.value": 3.0, "force.start": 0.0, "force.stop": 0.5}
    )
    assert early[question].value == pytest.approx(shares[3.0])


def test_friction_sideways_turns_the_vehicle(scenario):
    vehicle = scenario.plant.vehicle
    question, ahead = (
        "yaw while pressing",
        frame_pose(vehicle, vehicle.frame(), POSE).p.x,
    )
    said = found(scenario)[question]
    assert said.value == pytest.approx(0.3 * 1.0 * ahead)
    assert said.level == WARNING
    # of several surfaces the roughest counts
    contact = scenario.world
    smooth = [
        dataclasses.replace(contact.surfaces[0].material, friction=mu)
        for mu in (0.1, 0.2)
    ]
    beside = [
        dataclasses.replace(contact.surfaces[0], name=f"{m.friction}", material=m)
        for m in smooth
    ]
    several = dataclasses.replace(
        contact, surfaces=(beside[0], *contact.surfaces, beside[1])
    )
    assert (
        found(dataclasses.replace(scenario, world=several))[question].value
        == said.value
    )
    assert found(scenario, **{"force.value": 0.5})[question].level == OK
    # on a ceiling or floor it is sideways, too; a wall beside the tip turns the vehicle
    # by the push itself; of one that leans, friction has the largest part that is
    # across the normal
    upward = {"normal.0": 0.0, "normal.2": 1.0}
    assert found(scenario, **upward)[question].value == pytest.approx(0.3 * ahead)
    beside = {"normal.0": 0.0, "normal.1": 1.0}
    assert found(scenario, **beside)[question].value == pytest.approx(ahead)
    assert found(scenario, **beside | {"normal.1": -1.0})[
        question
    ].value == pytest.approx(ahead)
    leaning = {"normal.0": 0.0, "normal.1": 0.6, "normal.2": 0.8}
    assert found(scenario, **leaning)[question].value == pytest.approx(
        (0.6 + 0.3 * 0.8) * ahead
    )
    assert found(scenario, **{"force.value": 0.0}) == {}
    # half of the yaw torque that rotors can add to hover: two rotors slow down to
    # nothing or two speed up
    inverse = np.array(make_mixer(vehicle).inverse, dtype=float)
    arm = zip(vehicle.links, link_poses(vehicle, POSE), strict=True)
    moment = 9.81 * sum(
        float(link.body.mass) * float(pose.apply(link.body.com).x) for link, pose in arm
    )
    hover = inverse[:, 3] * float(vehicle.mass) * 9.81 - inverse[:, 1] * moment
    assert said.limit == pytest.approx(
        0.5 * np.min(hover / np.abs(inverse[:, 2])), rel=0.02
    )


def test_a_turned_vehicle_has_the_same_levers(scenario):
    turned = dataclasses.replace(
        scenario,
        reference=dataclasses.replace(
            scenario.reference, yaw=skyarm.reference.Constant(np.pi / 2.0)
        ),
    )
    there, here = found(turned, **{"normal.0": 0.0, "normal.1": -1.0}), found(scenario)
    assert [there[name].value for name in here] == pytest.approx(
        [each.value for each in here.values()]
    )


def test_a_law_of_motions_alone_is_named_and_without_a_push_nothing_is_said(scenario):
    other = preset("centroidal_tip", scenario.controller.par.model, {})
    said, *_ = push_limits(dataclasses.replace(scenario, controller=other))
    assert (said.question, said.level) == ("pressing", WARNING)
    assert "pressing" not in found(scenario)
    still = dataclasses.replace(scenario.reference, push=None)
    assert push_limits(dataclasses.replace(scenario, reference=still)) == []


def test_a_guard_that_asks_a_box_for_more_than_it_bears_is_named(monkeypatch):
    """Held for T, the force F makes a box of mass m faster by (F / m - mu g) T."""
    monkeypatch.setattr("skyarm.studies.assess.push_limits.INSTANTS", 4)
    press = {
        "kind": "press",
        "force": 1.0,
        "normal": [-1.0, 0.0, 0.0],
        "until": {"force": 0.5},
    }
    scenario = scenario_from(beside_a_box([press], duration=1.0))

    def warned(friction=0.15, **numbers):
        changed = with_numbers(
            scenario, {"world.surfaces.table.material.friction": friction} | numbers
        )
        return [
            each for each in push_limits(changed) if each.question == "force of a guard"
        ]

    (warning,) = warned()
    assert (warning.level, warning.field) == (WARNING, "reference.guards.0.force")
    assert (
        f"would drive it at {(0.5 / 0.25 - 0.15 * 9.81) * 0.5:.2g} m/s, above the"
        " 0.1 m/s" in warning.text
    )
    # it bears more, for that time, or stands elsewhere
    elsewhere = (
        {"world.objects.box.position.1": 0.3},
        {"world.objects.box.position.0": 0.0},
    )
    assert not any(
        (
            warned(0.21),
            warned(**{"reference.guards.0.hold": 0.1}),
            *(warned(**each) for each in elsewhere),
        )
    )
