"""Dead times against a timeline computed by hand: the rotor lag tells when a command
arrived.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import where
from skyarm.dynamics.actuators import Command
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import first_state, trimmed_state
from skyarm.simulate import Delays, Log, Scenario, run
from skyarm.simulate.command_delay import command_delay

LOW, HIGH, STEP, TAU_UP = 400.0, 500.0, 0.05, 0.0125


def stepping(
    memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any
) -> tuple[Any, Command]:
    """500 rad/s once the measurement is from 0.05 s or later, 400 rad/s before; the arm
    is left alone.
    """
    del reference, dt, par
    speed = where(measurement.time > STEP - 1e-4, HIGH, LOW)
    return memory, Command(rotor_speeds=(speed,) * 4, efforts=(0.0, 0.0))


def falling(
    plant: str, measurement: float, command: float, integrator: str = "rk4"
) -> Scenario:
    base = load_scenario("case1", plant=plant, duration=0.15)
    start = first_state(base)
    return dataclasses.replace(
        base,
        controller=dataclasses.replace(base.controller, law=stepping),
        delays=Delays(measurement=measurement, command=command),
        initial=dataclasses.replace(
            start, position=Vec3(0.0, 0.0, 50.0), rotor_speeds=(LOW,) * 4
        ),
        integrator=integrator,
    )


def arrival(log: Log) -> float:
    """When the step reached the rotors: from speed = 500 - 100 exp(-(t - T)/tau) once
    it has moved.
    """
    k = int(np.argmax(log.rotor_speeds[:, 0] > LOW + 1e-9))
    return float(log.time[k]) + TAU_UP * math.log(
        (HIGH - log.rotor_speeds[k, 0]) / (HIGH - LOW)
    )


@pytest.mark.parametrize(
    ("plant", "integrator"),
    [("rigid_body", "rk4"), ("rigid_body", "euler"), ("mujoco", "rk4")],
)
@pytest.mark.parametrize(
    ("measurement", "command", "expected"),
    [
        (0.0, 0.0, 0.05),
        (0.0, 0.003, 0.053),
        (0.0, 0.005, 0.055),
        (0.0, 0.012, 0.062),
        (0.005, 0.0, 0.055),
        (0.015, 0.0, 0.065),
        (0.010, 0.007, 0.067),
    ],
)
def test_a_step_arrives_exactly_as_late_as_its_delays_say(
    plant: str, integrator: str, measurement: float, command: float, expected: float
) -> None:
    log = run(falling(plant, measurement, command, integrator))
    # the lag is solved exactly, so the time is good to rounding
    assert arrival(log) == pytest.approx(expected, abs=1e-9)
    settled = log.time >= expected + 1e-9
    wanted = HIGH - (HIGH - LOW) * np.exp(-(log.time[settled] - expected) / TAU_UP)
    assert np.abs(log.rotor_speeds[settled, 2] - wanted).max() < 1e-8


def test_before_the_first_command_the_vehicle_hovers_with_its_arm_held() -> None:
    base = load_scenario("case1", duration=0.1)
    start = trimmed_state(base.plant, Vec3(0.0, 0.0, 50.0), 0.0, (0.5, 0.3))
    log = run(dataclasses.replace(base, initial=start, delays=Delays(command=0.02)))
    # an equilibrium: 20 ms without torque on the joints would move them by 1e-2 rad
    assert np.abs(log.joints[:5] - start.joints).max() < 1e-12
    assert np.abs(log.position[:5] - [0.0, 0.0, 50.0]).max() < 1e-12
    assert np.abs(log.joints[8] - start.joints).max() > 1e-6, (
        "then the controller moves it to its reference"
    )


@pytest.mark.parametrize("short", [0.0, 1e-15, 1e-13, -1e-13])
def test_a_delay_of_whole_periods_up_to_rounding_leaves_no_negative_rest(
    short: float,
) -> None:
    scenario = dataclasses.replace(
        load_scenario("case1"),
        delays=Delays(command=0.015 - short, longest_command=0.05),
    )
    whole, rest = command_delay(scenario)
    assert whole == 3.0
    assert 0.0 <= float(rest) <= 2e-13
