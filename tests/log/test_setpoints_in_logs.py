"""Commands that are setpoints of drives are never shown as torques: in messages, plots, layouts and metrics."""

from __future__ import annotations

import dataclasses
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import skyarm
from logged_flights import drawn
from skyarm.dynamics.actuators.servo import VelocityServo
from skyarm.log.log_columns import names_of
from skyarm.log.metrics.metric_catalogue import metric_names
from skyarm.log.ros.scene import Part
from skyarm.log.ros.topics import FlightTopics
from skyarm.log.viewer_layouts import plots
from skyarm.scenario.scenario_file import load_scenario
from skyarm.view.figures.flight_panels import panels_of

SERVOS = Path(__file__).resolve().parents[1] / "data" / "servo_arm.toml"


@cache
def log() -> skyarm.Log:
    """Numbers without meaning of an arm of two position servos."""
    return drawn(skyarm.load_vehicle(SERVOS))


def mixed() -> skyarm.Log:
    """The same, the first joint with a velocity servo; the second one takes its torque."""
    vehicle = skyarm.load_vehicle(SERVOS)
    rate = dataclasses.replace(vehicle.drives[0], drive=VelocityServo(gain=1.0, inertia=0.01))
    return drawn(dataclasses.replace(vehicle, drives=(rate,)))


def message(of: skyarm.Log, topic: str) -> dict:
    found = next(each for each in FlightTopics(of).topics if each.name == topic)
    return found.values(Part(of, slice(None)))


def test_messages_have_setpoints_in_the_field_of_their_kind():
    assert "effort" not in message(log(), "/joint_states")
    commands = message(log(), "/commands/joints")
    assert sorted(commands) == ["header", "name", "position"]
    assert np.array_equal(commands["position"], log().efforts)
    of = mixed()
    for topic in ("/joint_states", "/commands/joints"):
        assert np.array_equal(message(of, topic)["effort"], of.efforts * [np.nan, 1.0], equal_nan=True)
    assert np.array_equal(message(of, "/commands/joints")["velocity"], of.efforts * [1.0, np.nan], equal_nan=True)
    assert "position" not in message(of, "/commands/joints")


def test_a_torque_arm_beside_an_arm_of_servos_has_panels_of_its_own():
    torques = drawn(dataclasses.replace(skyarm.load_vehicle(SERVOS), drives=()))
    panels = panels_of("efforts", [log(), torques])
    assert [panel.unit for panel in panels] == ["rad", "N m", "rad", "N m"]
    assert [panel.label.split()[-1] for panel in panels] == ["setpoint", "torque"] * 2
    assert np.array_equal(panels[2].of(log()), log().efforts[:, 1])
    assert panels[2].of(torques) is None
    assert panels[3].of(log()) is None


def test_layouts_plot_setpoints_by_their_unit():
    titles = {title: len(curves) for title, curves in plots(mixed())}
    assert titles["joint setpoints, rad/s"] == titles["joint efforts, N m or N"] == 1
    assert "joint efforts, N m or N" not in dict(plots(log()))


def test_torques_that_are_not_known_are_no_metrics():
    scenario = load_scenario(Path(SERVOS).parent / "servo_flight.toml")
    assert scenario.commands_setpoints == (True, True)
    assert [unit is not None for unit in names_of(mixed()).setpoints] == [True, False]
    assert not [name for name in metric_names(["all"], 2, scenario.commands_setpoints) if name.startswith("tau")]
    assert [name for name in metric_names(["effort"], 2, (True, False)) if "tau" in name] == ["tau2_rms"]
    with pytest.raises(ValueError, match="'tau1_rms': must be left out: joint 1 is told setpoints"):
        metric_names(["tau1_rms"], 2, (True, False))
    assert not [name for name in skyarm.score(log()) if "tau" in name]
