"""Commands that are setpoints of drives are never shown as torques: in messages, plots
and metrics.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.dynamics.actuators.servo import VelocityServo
from skyarm.log.log_columns import names_of
from skyarm.log.metrics.metric_catalogue import metric_names
from skyarm.log.ros.scene import LogSection
from skyarm.log.ros.topics import FlightTopics
from skyarm.scenario.scenario_file import load_scenario
from skyarm.view.figures.flight_panels import panels_of
from support.logs import drawn

SERVOS = Path(__file__).resolve().parents[1] / "data" / "servo_arm.toml"


@cache
def log() -> skyarm.Log:
    """Numbers without meaning of an arm of two position servos."""
    return drawn(skyarm.load_vehicle(SERVOS))


def mixed() -> skyarm.Log:
    """The same, the first joint with a velocity servo; the second one takes its
    torque.
    """
    vehicle = skyarm.load_vehicle(SERVOS)
    rate = dataclasses.replace(
        vehicle.drives[0], drive=VelocityServo(gain=1.0, inertia=0.01)
    )
    return drawn(dataclasses.replace(vehicle, drives=(rate,)))


def message(of: skyarm.Log, topic: str) -> dict:
    found = next(each for each in FlightTopics(of).topics if each.name == topic)
    return found.values(LogSection(of, slice(None)))


def test_joint_states_have_efforts_of_torques_alone():
    assert "effort" not in message(log(), "/joint_states")
    assert "effort" not in message(mixed(), "/joint_states")


def test_a_torque_arm_beside_an_arm_of_servos_has_panels_of_its_own():
    torques = drawn(dataclasses.replace(skyarm.load_vehicle(SERVOS), drives=()))
    panels = panels_of("efforts", [log(), torques])
    assert [panel.unit for panel in panels] == ["rad", "N m", "rad", "N m"]
    assert [panel.label.split()[-1] for panel in panels] == ["setpoint", "torque"] * 2
    assert np.array_equal(panels[2].of(log()), log().efforts[:, 1])
    assert panels[2].of(torques) is None
    assert panels[3].of(log()) is None


def test_torques_that_are_not_known_are_no_metrics():
    scenario = load_scenario(Path(SERVOS).parent / "servo_flight.toml")
    assert scenario.agent.commands_setpoints == (True, True)
    assert [unit is not None for unit in names_of(mixed()).setpoints] == [True, False]
    assert not [
        name
        for name in metric_names(["all"], 2, scenario.agent.commands_setpoints)
        if name.startswith("tau")
    ]
    assert [
        name for name in metric_names(["effort"], 2, (True, False)) if "tau" in name
    ] == ["tau2_rms"]
    assert metric_names(["efforts"], 2, (True, False)) == ("tau2_rms",)
    assert metric_names(["efforts"], 2) == ("tau1_rms", "tau2_rms")
    with pytest.raises(
        ValueError, match="'tau1_rms': must be left out: joint 1 is told setpoints"
    ):
        metric_names(["tau1_rms"], 2, (True, False))
    assert not [name for name in skyarm.score(log()) if "tau" in name]
