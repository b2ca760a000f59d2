"""A law on servos and rotors with tables, exported to C, gives the commands of the law
in Python.
"""

from __future__ import annotations

import dataclasses
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from skyarm.control.actuator_layer import plain_model, with_actuators
from skyarm.control.catalogue import make_controller
from skyarm.control.model import Model
from skyarm.control.onboard.export_c import export_c, first_estimated_memory, units_of
from skyarm.dynamics.actuators.drive import TORQUE_DRIVE, Drive
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.dynamics.actuators.servo import VelocityServo
from skyarm.scenario.scenario_file import load_scenario
from skyarm.sensing.estimate.error_state_filter import ErrorStateFilter
from skyarm.vehicle.thrust_table import ThrustTable
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import MountedDrive
from support.engines import CAREFUL, Loaded, needs_cc
from support.laws import cases

VEHICLE = Path(__file__).parents[2] / "data" / "servo_arm.toml"
FLIGHT = VEHICLE.with_name("servo_flight.toml")
TABLE = ThrustTable(
    speed=(300.0, 600.0, 1100.0), thrust=(0.75, 2.9, 9.0), torque=(0.012, 0.048, 0.15)
)


@needs_cc
def test_setpoints_and_speeds_are_those_of_python(tmp_path):
    """Also with an integral, whose belief remembers, and a latency, which has a
    queue.
    """
    vehicle = load_vehicle(VEHICLE)
    assert tomllib.loads(VEHICLE.read_text())["drives"]["elbow"]["latency"] > 0.0
    k_f, k_m = TABLE.thrust_coefficient, TABLE.moment_coefficient
    rotors = tuple(
        dataclasses.replace(
            each, table=TABLE, thrust_coefficient=k_f, moment_coefficient=k_m
        )
        for each in vehicle.rotors
    )
    drives = tuple(
        dataclasses.replace(each, drive=dataclasses.replace(each.drive, integral=3.0))
        for each in vehicle.drives
    )
    model = Model(vehicle=dataclasses.replace(vehicle, rotors=rotors, drives=drives))
    controller = with_actuators(
        make_controller("decoupled_pd", plain_model(model)), model, 0.005
    )
    text = export_c(controller, name="law", period=0.005).text
    in_c, memory = (
        Loaded(text, tmp_path, ("-O2", *CAREFUL, "-ffp-contract=off")),
        controller.memory,
    )
    for case in cases(6, 3, joints=2):
        measurement = dataclasses.replace(case.measurement(), rotor_speeds=(700.0,) * 6)
        memory, command = controller.law(
            memory, measurement, case.reference(), 0.005, par=controller.par
        )
        wanted = [float(each) for each in (*command.rotor_speeds, *command.efforts)]
        np.testing.assert_allclose(
            in_c(measurement, case.reference()), wanted, rtol=1e-12, atol=1e-12
        )
    members = re.findall(r"^    double \w+(?:\[\d+\])*;.*$", text, re.MULTILINE)
    assert [line for line in members if not re.search(r"/\* .*\S \*/$", line)] == []


def test_a_command_of_setpoints_is_said_to_be_one():
    """At the top for each joint, at the command, and where it is remembered; the law
    inside remembers torques.
    """
    scenario = load_scenario(FLIGHT)
    text = export_c(
        scenario.controller, name="law", period=0.005, estimator=ErrorStateFilter()
    ).text
    said = "command of each joint as in its line above, in that order"
    assert (
        "joint 0: shoulder of link 0 'upper', revolute, rad, setpoint of its"
        " PositionServo in rad" in text
    )
    assert f"double efforts[2]; /* {said} */" in text
    assert f"double sent_efforts[2]; /* {said} */" in text
    assert re.search(
        r"double law_inner_sent_efforts\[2\]; /\* N m or N, commanded joint efforts, in"
        r" the order",
        text,
    )
    slide = dataclasses.replace(
        scenario.controller.par.model.vehicle.links[0].joint, kind="prismatic"
    )
    servo = VelocityServo(gain=1.0, inertia=0.01)
    vehicle = scenario.controller.par.model.vehicle
    for drive, words in (
        (servo, "prismatic, m, setpoint of its VelocityServo in m/s"),
        (TORQUE_DRIVE, "prismatic, m, N"),
        (Drive(), "prismatic, m, setpoint of its Drive"),
    ):
        other = dataclasses.replace(
            vehicle, drives=(MountedDrive(name=slide.name, drive=drive),)
        )
        assert units_of(slide, other) == words


def test_a_filter_that_takes_setpoints_for_torques_is_not_exported():
    scenario = load_scenario(FLIGHT)
    with pytest.raises(
        ValueError,
        match=r"^estimator\.force = 'modelled': must be 'measured' for .*'shoulder'",
    ):
        export_c(
            scenario.controller,
            name="law",
            period=0.005,
            estimator=ErrorStateFilter(force="modelled"),
        )


def test_the_command_before_the_first_is_the_setpoint_that_holds_the_arm():
    """Of an arm that does not hang straight down at zero."""
    vehicle = load_vehicle("hexarotor12_arm5")
    bare = dataclasses.replace(vehicle, drives=())
    trim = hover_trim(vehicle, (0.0,) * 5, 9.81)
    assert trim.efforts[1] != 0.0
    law = make_controller("decoupled_pd", plain_model(Model(vehicle=vehicle)))
    found = first_estimated_memory(
        with_actuators(law, Model(vehicle=vehicle), 0.005), ErrorStateFilter()
    ).sent
    stiffness = [each.drive.stiffness for each in vehicle.drives]
    np.testing.assert_allclose(
        np.multiply(stiffness, found.efforts), trim.efforts, rtol=1e-12, atol=1e-15
    )
    plain = make_controller("decoupled_pd", plain_model(Model(vehicle=bare)))
    assert (
        first_estimated_memory(plain, ErrorStateFilter()).sent.efforts == trim.efforts
    )
