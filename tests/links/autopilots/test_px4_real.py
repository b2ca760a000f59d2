"""PX4 itself, where its program is: hover with the arm swinging on six vehicles, Case
3, repeatability, its end.
"""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest
from px4_flights import scenario_of

from skyarm import load_vehicle
from skyarm.links.autopilots.flight import PilotedSession
from skyarm.log.flight_log import Log
from skyarm.reference import circle
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate.session import open_session

pytestmark = [
    pytest.mark.thorough,
    pytest.mark.skipif(
        not os.environ.get("SKYARM_PX4"),
        reason="SKYARM_PX4 does not name PX4's program",
    ),
]


def require_calm(log: Log) -> None:
    """Require a flight to its end in which PX4 answered every step, in its mode,
    without a failsafe.
    """
    facts = log.info["autopilot"]
    assert log.status == "completed", log.info["cause"]
    assert facts["steps"] - facts["answered"] < 40  # its start script's
    assert facts["lockstep_missed"] == facts["left_offboard"] == facts["failsafes"] == 0


HOVER_ERROR = {
    "hummingbird_arm2_rotors": 0.2,
    "pelican_arm2": 0.15,
    "hexarotor_arm6": 0.35,
    "hexarotor12_arm5": 0.35,
    "quadrotor_roll_arm2": 0.2,
    # the arm's weight over so small an inertia turns it by 18 degrees
    "crazyflie_arm1": 0.5,
}
"""Largest distance from the set point with the arm swinging, m: half as much again as
was measured."""


@pytest.mark.parametrize("frequency", [0.5, 1.0])
@pytest.mark.parametrize("vehicle", HOVER_ERROR)
def test_px4_hovers_for_a_minute_while_the_arm_swings(
    tmp_path: Path, vehicle: str, frequency: float
) -> None:
    log = open_session(scenario_of(tmp_path, vehicle, 60.0, swing=frequency)).run()
    require_calm(log)
    error = np.linalg.norm(log.position - log.position_reference, axis=1)[
        log.time > 5.0
    ]
    assert error.max() < HOVER_ERROR[vehicle]


def test_flights_of_case_3_differ_by_centimetres() -> None:
    flights = []
    for _ in range(3):
        log = open_session(load_scenario("case3", controller="px4")).run()
        require_calm(log)
        flights.append(log.position)
    apart = [np.linalg.norm(one - flights[0], axis=1).max() for one in flights[1:]]
    assert max(apart) < 0.1  # 4.6 cm at most of three flights on a busy machine


@pytest.mark.parametrize("vehicle", ["hexarotor_arm6", "octo_coaxial_two_arms"])
def test_px4_flies_a_circle_of_a_metre_at_a_metre_a_second(
    tmp_path: Path, vehicle: str
) -> None:
    joints = (0.0,) * load_vehicle(vehicle).n
    path = circle(
        radius=1.0, frequency_hz=0.5 / np.pi, center=(0.0, 0.0, 2.0), joints=joints
    )
    log = open_session(
        dataclasses.replace(scenario_of(tmp_path, vehicle, 25.0), reference=path)
    ).run()
    require_calm(log)
    error = np.linalg.norm(log.position - log.position_reference, axis=1)[
        log.time > 10.0
    ]
    assert error.mean() < 0.11


def test_another_instance_takes_commands_too(tmp_path: Path) -> None:
    require_calm(open_session(scenario_of(tmp_path, duration=2.0, instance=4)).run())


def test_a_recorded_flight_is_flown_again_to_the_bit_without_px4(
    tmp_path: Path,
) -> None:
    file = str(tmp_path / "flight.gz")
    live = open_session(scenario_of(tmp_path, duration=5.0, transcript=file)).run()
    again = open_session(scenario_of(tmp_path, duration=5.0, replayed=file)).run()
    require_calm(live)
    for name in ("position", "quaternion", "joints", "rotor_commands"):
        np.testing.assert_array_equal(getattr(live, name), getattr(again, name))


def test_a_parameter_that_px4_does_not_have_ends_the_flight(tmp_path: Path) -> None:
    session = open_session(scenario_of(tmp_path, parameters={"NO_SUCH_PARAM": 1.0}))
    assert (
        session.log.info["cause"]
        == "controller.parameters.NO_SUCH_PARAM = 1: must be a parameter that PX4 knows"
    )


def test_closing_the_session_ends_px4(tmp_path: Path) -> None:
    session = open_session(scenario_of(tmp_path, duration=2.0))
    assert isinstance(session, PilotedSession)
    child = session._link._child  # type: ignore[union-attr]
    session.close()
    assert not child.running
    assert not child.folder.exists()
