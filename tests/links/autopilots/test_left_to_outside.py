"""An autopilot that is left to a program outside: it holds the start, in real time, and
its ports are free for that.
"""

from __future__ import annotations

import dataclasses
import socket
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from px4_flights import free_instance

from links.autopilots.test_px4 import begun
from skyarm import load_scenario
from skyarm.links.autopilots import px4
from skyarm.links.autopilots.flight import planned_scenario
from skyarm.links.joint_port import UdpJoints
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from support.commands import skyarm


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(px4, "SETTLED", 1)
    monkeypatch.setattr(px4, "STALL", 0.3)


def outside(name: str, **options: object) -> Scenario:
    """Case 3 under an autopilot that is left to a program outside."""
    scenario = load_scenario("case3", controller=name)
    par = scenario.controller.par
    record = dataclasses.replace(par.autopilot, outside=True, **options)
    controller = dataclasses.replace(
        scenario.controller, par=dataclasses.replace(par, autopilot=record)
    )
    return dataclasses.replace(scenario, controller=controller)


def test_it_flies_in_real_time_with_a_free_onboard_port_and_set_points_move_its_arm(
    tmp_path: Path,
) -> None:
    """Commands of 20 mN m for half a second, then silence: the arm's own law brings the
    joint back.
    """
    number = free_instance()
    with begun(tmp_path, instance=number, duration=2.0, outside=True) as session:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 14540 + number))  # until the hand-over it is ours
        arm, stop, seen = (
            UdpJoints("127.0.0.1", 14640 + number, 2),
            threading.Event(),
            [],
        )

        def command() -> None:
            begin = time.monotonic()
            while time.monotonic() - begin < 0.5 and not stop.is_set():
                arm.send((0.02, 0.0), 0.0)
                seen.append(arm.read())
                time.sleep(0.005)

        thread = threading.Thread(target=command)
        thread.start()
        begin = time.monotonic()
        log = session.run()
        assert time.monotonic() - begin > 1.95
        stop.set()
        thread.join()
        arm.close()
        assert log.status == "completed"
        assert np.linalg.norm(log.position - log.position_reference, axis=1).max() < 0.2
        assert 20 < log.info["autopilot"]["joints"]["commands"] <= len(seen)
        commanded = np.flatnonzero(log.efforts[:, 0] == 0.02)
        assert 0.3 < len(commanded) / 250.0 < 1.2
        assert abs(log.joints[commanded[-1], 0]) > 0.05
        assert abs(log.joints[-1, 0]) < 0.5 * np.abs(log.joints[:, 0]).max()
        readings = [each for each in seen if each is not None]
        assert readings[-1].time > readings[0].time > 1.0


@pytest.mark.thorough
def test_motors_that_another_program_commands_are_answered_seldom(
    tmp_path: Path,
) -> None:
    """PX4 then answers new commands only: time goes on without it, after one halt."""
    with begun(
        tmp_path,
        fault="seldom:12",
        instance=free_instance(),
        duration=3.0,
        outside=True,
    ) as session:
        begin = time.monotonic()
        log = session.run()
        assert log.status == "completed"
        facts = log.info["autopilot"]
        assert facts["steps"] - facts["answered"] > 300
        assert 1 <= facts["lockstep_missed"] < 20
        assert time.monotonic() - begin < 20.0
        assert np.linalg.norm(log.position - log.position_reference, axis=1).max() < 0.3


@pytest.mark.parametrize("name", ["betaflight"])
def test_other_autopilots_refuse_in_one_line(name: str) -> None:
    with pytest.raises(
        ScenarioError, match=r"controller.outside: must be left out for"
    ):
        planned_scenario(outside(name))
    ended = skyarm("run", "case3", "--autopilot", f"{name}:outside")
    assert ended.code == 2
    assert "controller.outside: must be left out for" in ended.err
    assert ended.err.count("\n") == 1


def test_a_transcript_of_it_is_refused() -> None:
    with pytest.raises(
        ScenarioError,
        match=r"controller.transcript: must be left out where a program outside",
    ):
        planned_scenario(outside("px4", transcript="flight.tape"))


def test_it_hovers_at_the_start_whatever_the_reference() -> None:
    found = planned_scenario(outside("px4")).reference
    first = load_scenario("case3").reference.at(0.0)
    for time_s in (0.0, 12.0, 29.0):
        assert [*found.at(time_s).position] == pytest.approx([*first.position])
        assert [*found.at(time_s).joint_rates] == [0.0, 0.0]
