"""What a check finds without flights is said before a flight; a lost contact force
after it; each fault once.
"""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from planted_faults import PLANTED, Planted

import skyarm
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import list_scenarios
from skyarm.scenario.scenario_record import first_state
from skyarm.studies.assess import pressing_flights as flights
from skyarm.studies.assess.assessment import (
    assess_scenario,
    assess_vehicle,
    warnings_of_scenario,
)
from skyarm.studies.assess.before_flight import warnings_before_flight
from skyarm.studies.assess.finding import FAULT, NOTE, OK, WARNING
from skyarm.studies.assess.push_limits import largest_push
from skyarm.world import MovingAir
from support import worlds

CASE = skyarm.load_scenario("case3")


def before_a_wall(name, joints, force, duration=5.0):
    gains = [0.3 * min(force, 1.0), 0.1 * min(force, 1.0)]
    return worlds.before_a_wall(name, joints, force, duration, interaction=gains)


@pytest.mark.parametrize(
    ("path", "value", "begins"),
    [
        ("reference.joints.0.amplitude", 17.0, "reference.joints[0] reaches -17 rad: "),
        (
            "reference.joints.1.phase",
            90.0,
            "reference.joints[1].signal.signal.phase = 90 rad: ",
        ),
        (
            "reference.joints.0.amplitude",
            5.0,
            "rotors[back].max_speed: saturates first at its lowest thrust at 6.07 s",
        ),
    ],
)
def test_a_reference_in_degrees_or_beyond_limits_is_one_line(path, value, begins):
    (line,) = warnings_before_flight(with_numbers(CASE, {path: value}))
    assert line.startswith(begins)
    assert "\n" not in line


def test_a_joint_beyond_its_limits_is_said():
    vehicle = CASE.plant.vehicle
    links = list(vehicle.links)
    links[0] = dataclasses.replace(
        links[0], joint=dataclasses.replace(links[0].joint, lower=-0.1, upper=0.1)
    )
    narrow = dataclasses.replace(vehicle, links=tuple(links))
    (line,) = warnings_before_flight(
        dataclasses.replace(CASE, plant=dataclasses.replace(CASE.plant, vehicle=narrow))
    )
    assert line.startswith(
        "reference.joints[0]: joints[joint1] is to reach 0.2, beyond -0.1 ... 0.1,"
        " first at"
    )
    assert warnings_before_flight(CASE) == []


@pytest.mark.thorough
@pytest.mark.parametrize("name", list_scenarios())
def test_no_shipped_scenario_is_warned_of(name):
    assert warnings_before_flight(skyarm.load_scenario(name)) == []


def test_what_all_vehicles_share_is_said_once_and_the_rest_by_name():
    team = with_numbers(
        skyarm.load_scenario("two_carry_a_bar"), {"world.objects.0.mass": 0.3}
    )
    (line,) = warnings_before_flight(team)
    assert line.startswith("world: the mass of 'bar' asks for integration steps of ")
    assert line.endswith("; is it so light, or its contact so stiff?")
    faulty = with_numbers(team, {"agents.left.plant.vehicle.base.mass": 90.0})
    shared, *own = warnings_before_flight(faulty)
    assert shared == line
    assert own
    assert {each.split(":")[0] for each in own} == {"left"}


def test_a_tip_too_light_for_the_contact_is_said_before_the_flight():
    (line,) = warnings_before_flight(before_a_wall("crazyflie_arm1", (-0.6,), 0.023))
    assert line.startswith(
        "world.surfaces: the tip, 1.2 g along the normal, is too light for the steps"
    )
    assert "; material.stiffness of at most " in line


POSE = (0.0, -0.8, 0.03, 0.0, 0.03)
LOST = {
    "recoil": (
        "voliro_like",
        (-0.5, -0.9),
        14.0,
        5.0,
        r"[5-9]\d % off, .* the arm is 38 mm from its full length",
    ),
    "yaw": (
        "octo_coaxial_two_arms",
        POSE,
        5.8,
        10.0,
        "with a rotor at its limit .* of yaw torque; a pose",
    ),
    "less yaw": (
        "octo_coaxial_two_arms",
        POSE,
        5.7,
        10.0,
        "with a rotor at its limit .* of yaw torque; a pose",
    ),
    "bounce": (
        "hexarotor12_arm5",
        (0.0, -1.0, -0.4, -0.2, 0.0),
        1.8,
        5.0,
        r"(?:[5-9]\d|[\d.]+e\+02) % off, .* 3.6 kg along the normal and bounces",
    ),
    "held": ("voliro_like", (-0.1, -1.4), 9.2, 5.0, ""),
    "held beside": ("octo_coaxial_two_arms", POSE, 4.5, 10.0, ""),
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", LOST)
def test_a_flight_that_loses_its_contact_force_names_the_cause(name):
    *scene, words = LOST[name]
    scenario = before_a_wall(*scene)
    lines = flights.lost_force(scenario, skyarm.run(scenario))
    assert len(lines) == bool(words)
    assert all(
        re.search(rf"^reference\.push\.force: .*{words}", line) for line in lines
    )


@pytest.mark.parametrize(
    ("error", "limited", "status", "begins"),
    [
        (0.09, 0.0, "completed", ""),
        (-0.11, 0.0, "completed", "reference.push.force: 2 N are 5.5 % off"),
        (
            0.0,
            0.06,
            "completed",
            (
                "reference.push.force: 2 N are 0 % off, with a rotor at its limit 6 %"
                " of the time"
            ),
        ),
        (np.nan, np.nan, "diverged", "reference.push.force: 2 N are not held"),
    ],
)
def test_the_bounds_of_a_lost_force_are_those_of_a_check(
    monkeypatch, error, limited, status, begins
):
    values = {"contact_error_mean": error, "rotor_saturation": limited}
    monkeypatch.setattr(
        flights, "score", lambda log, names: {name: values[name] for name in names}
    )
    log = type("Log", (), {"status": status})
    lines = flights.lost_force(before_a_wall("pelican_arm2", (-0.45, -0.9), 2.0), log)
    assert [
        line.partition(", with")[0] == begins.partition(", with")[0] for line in lines
    ] == [True] * bool(begins)


def test_a_press_that_touched_nothing_is_said_after_the_flight():
    """A wall 1 m away: the press phase ends by its timeout, and the flight
    completes.
    """
    scenario = skyarm.load_scenario("press_and_hold")
    guards = tuple(
        dataclasses.replace(each, fails=False, timeout=2.0)
        for each in scenario.reference.guards
    )
    scenario = dataclasses.replace(
        scenario, reference=dataclasses.replace(scenario.reference, guards=guards)
    )
    away = with_numbers(scenario, {"world.surfaces.0.position.x": 1.342})
    log = skyarm.run(away)
    assert log.status == "completed"
    (line,) = flights.missed_contact(away, log)
    assert re.match(
        r"reference: phase 1 'press': ended at [\d.]+ s without any contact; the tip"
        r" missed the surface",
        line,
    )
    assert flights.missed_contact(scenario, skyarm.run(scenario)) == []
    pushed = before_a_wall("pelican_arm2", (-0.45, -0.9), 2.0)
    away = with_numbers(pushed, {"world.surfaces.0.position.x": 9.0})
    (line,) = flights.missed_contact(away, skyarm.run(away))
    assert line.startswith(
        "reference.push.force: the flight ended without any contact; "
    )


@pytest.mark.thorough
def test_the_largest_push_is_that_of_its_instant():
    scenario = skyarm.load_scenario("push_button")
    times = np.linspace(0.0, scenario.duration, 500, endpoint=False)
    one_by_one = max(
        (scenario.reference.at(float(t)) for t in times),
        key=lambda at: float(at.push[0]),
    )
    assert largest_push(scenario) == one_by_one


HEAVY = {
    20.0: ["joints[joint1].effort_limit", "rotors.max_speed"],
    1000.0: ["links[link1].mass"],
}


@pytest.mark.parametrize("factor", HEAVY)
def test_an_arm_that_is_too_heavy_is_told_by_its_causes_alone(factor, tmp_path):
    def plant(file):
        file["links"][0]["mass"] *= factor

    vehicle = Planted("heavy", plant, ()).vehicle("hummingbird_arm2_rotors", tmp_path)
    found = assess_vehicle(vehicle, poses=8)
    assert [each.field for each in found.alarms()] == HEAVY[factor]
    assert not found.flies
    (yaw,) = [each for each in found.findings if each.question == "yaw authority"]
    assert (yaw.level, yaw.text.rpartition("; ")[2]) == (
        NOTE,
        f"follows from {found.alarms()[-1].field}",
    )


@pytest.mark.parametrize(
    "kind", ["base mass in g", "first rotor turned round", "thrust per (rev/min)^2"]
)
def test_a_planted_fault_is_one_alarm(kind, tmp_path):
    (planted,) = [each for each in PLANTED if each.kind == kind]
    (alarm,) = assess_vehicle(
        planted.vehicle("pelican_arm2", tmp_path), poses=8
    ).alarms()
    assert alarm.level == FAULT
    assert any(words in alarm.field for words in planted.fields)


def test_numbers_in_degrees_are_as_severe_as_what_follows_from_them():
    found = assess_scenario(
        with_numbers(CASE, {"reference.joints.0.amplitude": 17.0}), poses=8
    )
    (alarm,) = found.alarms()
    assert (alarm.question, alarm.level) == ("units", FAULT)
    rotors, joints = (
        each
        for each in found.findings
        if each.question.endswith(" along the reference")
    )
    assert rotors.level == joints.level == NOTE


WEAK = {"plant.vehicle.links.0.joint.effort_limit": 0.01}


@pytest.mark.parametrize("path", ["sensors.position", "initial.position.x"])
def test_a_sensor_or_a_start_causes_no_alarm_of_the_vehicle(path):
    base = dataclasses.replace(CASE, initial=first_state(CASE))
    weak, odd = with_numbers(base, WEAK), with_numbers(base, WEAK | {path: 5000.0})
    assert set(warnings_before_flight(weak)) < set(warnings_before_flight(odd))
    heavy = assess_scenario(with_numbers(base, {path: 5000.0}), payload=5.0, poses=8)
    alarms = {each.question: each for each in heavy.alarms()}
    assert alarms["units"].level == WARNING
    assert alarms["joints[joint1] static effort with 5 kg"].level == FAULT
    assert alarms["thrust margin with 5 kg"].text.startswith("cannot lift itself: ")
    assert not [each for each in alarms if each.startswith("balance")]


def test_parts_without_effect_are_findings():
    up = MovingAir(velocity_W=(0.0, 0.0, 1.0))
    (found,) = [
        each
        for each in warnings_of_scenario(dataclasses.replace(CASE, wind=up))
        if each.level == WARNING
    ]
    assert (found.question, found.field) == ("environment", "environment.wind")
    assert found.remedy.startswith("check it: drag.area[2]")


def test_a_weak_joint_and_a_lag_in_milliseconds_stay_two_alarms(tmp_path):
    def both(file):
        for each in PLANTED:
            if each.kind in ("weak drive", "lag in ms"):
                each.plant(file)

    found = assess_vehicle(
        Planted("both", both, ()).vehicle("pelican_arm2", tmp_path), poses=8
    )
    assert [each.question for each in found.alarms()] == [
        "units",
        "joints[shoulder] static effort",
    ]
    assert {each.level for each in found.findings} == {OK, NOTE, FAULT}
    assert WARNING not in {each.level for each in found.alarms()}


@pytest.mark.parametrize("rotor", range(4))
def test_a_rotor_that_is_turned_round_is_told(rotor: int) -> None:
    """With three rotors of one sense hover without a yaw torque takes nothing of the
    fourth.
    """
    vehicle = CASE.plant.vehicle
    rotors = [
        dataclasses.replace(r, direction=-r.direction if i == rotor else r.direction)
        for i, r in enumerate(vehicle.rotors)
    ]
    turned = dataclasses.replace(vehicle, rotors=tuple(rotors))
    lines = warnings_before_flight(
        dataclasses.replace(CASE, plant=dataclasses.replace(CASE.plant, vehicle=turned))
    )
    (line,) = (
        line
        for line in lines
        if "would be even with another sense of one rotor" in line
    )
    assert f"rotors[{vehicle.rotors[rotor].name}].direction" in line
