"""A log is flown again to its bits, and under another law in the same wind, noise,
pushes and changes.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.control.safety import with_safety_layer
from skyarm.records.plain import plain
from skyarm.scenario.scenario_record import Change
from skyarm.sensing.measurement import SensorNoise
from support.components import same_logs

SCENARIO = dataclasses.replace(
    skyarm.load_scenario("case2_gust", duration=0.3),
    noise=SensorNoise(position=0.002, rate=0.01),
    seed=5,
    changes=(
        Change(at=0.1, path="plant.payload.mass", value=0.05),
        Change(at=0.2, path="controller.gains.position.x", value=9.0),
    ),
)


@pytest.fixture(scope="module")
def log() -> Any:
    return skyarm.run(SCENARIO)


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_a_log_is_flown_again_to_its_bits_from_its_file(
    plant: str, log: Any, tmp_path: Path
) -> None:
    if plant == "mujoco":
        pytest.importorskip("mujoco")
        log = skyarm.run(dataclasses.replace(SCENARIO, kind=plant))
    again = skyarm.replay(log.save_npz(tmp_path / "flight.npz"))
    assert same_logs(again, log)
    assert again.info == log.info
    assert same_logs(skyarm.replay(log), log)


@pytest.mark.thorough
def test_another_law_meets_the_same_noise_and_changes_except_those_of_the_former_law(
    log: Any,
) -> None:
    other = skyarm.replay(log, "centroidal_tip")
    assert other.info["controller"] == "centroidal_tip"
    assert [each.path for each in other.scenario.changes] == ["plant.payload.mass"]
    noise = (
        log.measured_position - log.position,
        other.measured_position - other.position,
    )
    assert noise[0] == pytest.approx(noise[1], abs=1e-15)
    assert np.abs(noise[0]).max() > 1e-3
    # as if it had been the scenario's own
    wanted = dataclasses.replace(
        SCENARIO, controller=other.scenario.controller, changes=SCENARIO.changes[:1]
    )
    assert same_logs(other, skyarm.run(wanted))
    made = skyarm.replay(log, other.scenario.controller)
    assert same_logs(made, other)


def test_a_guarded_flight_is_guarded_under_another_law_too(tmp_path: Path) -> None:
    guarded = dataclasses.replace(
        SCENARIO,
        controller=with_safety_layer(
            SCENARIO.controller, {"tilt": 0.4}, stow=(0.1, 0.0)
        ),
        changes=(),
        duration=0.1,
    )
    log = skyarm.run(guarded)
    other = skyarm.replay(log, "indi")
    par = other.scenario.controller.par
    assert (other.info["controller"], par.limits.tilt, par.recovery.stow) == (
        "guarded_indi",
        0.4,
        (0.1, 0.0),
    )
    # by the other way of saying it, too
    again = skyarm.load_scenario(
        log.save_npz(tmp_path / "flight.npz"), controller="indi"
    )
    assert plain(again) == plain(other.scenario)


def test_what_is_no_log_or_no_law_is_one_line(log: Any, tmp_path: Path) -> None:
    (tmp_path / "no.npz").write_bytes(b"PK nothing")
    for wrong, words in (
        (3, r"^log = 3: must be a Log or the path of one's file$"),
        (tmp_path / "absent.npz", "no such file"),
        (tmp_path / "no.npz", "must be a log that save_npz wrote"),
        (
            dataclasses.replace(log, info={**log.info, "scenario_record": None}),
            "must hold the scenario as this vers",
        ),
    ):
        with pytest.raises(skyarm.ScenarioError, match=words) as caught:
            skyarm.replay(wrong)  # type: ignore[arg-type]
        assert "\n" not in str(caught.value)
    with pytest.raises(skyarm.ScenarioError, match="did you mean 'indi'"):
        skyarm.replay(log, "ind")


@pytest.mark.parametrize("changed", [False, True])
def test_a_flight_by_commands_from_outside_is_not_replayed_in_silence(
    changed: bool, tmp_path: Path
) -> None:
    session = skyarm.Session(
        dataclasses.replace(SCENARIO, changes=SCENARIO.changes[:1] if changed else ())
    )
    session.step(rotors=[450.0] * 4)
    while session.running:
        session.step()
    assert session.log.info["commanded"] is True
    file = session.log.save_npz(tmp_path / "flight.npz")
    for again in (skyarm.replay, skyarm.load_scenario):
        with pytest.warns(
            UserWarning, match="was flown by commands from outside, which no log keeps"
        ):
            again(file)


def test_a_flight_of_its_law_has_no_such_mark(log: Any) -> None:
    assert "commanded" not in log.info


def test_the_mark_is_that_of_what_was_flown_wherever_a_session_goes_back_to() -> None:
    session = skyarm.Session(dataclasses.replace(SCENARIO, changes=()))
    first = session.snapshot()
    for _ in range(5):
        session.step(rotors=[450.0] * 4)
    outside = session.snapshot()
    session.restore(first)
    for _ in range(8):
        session.step()
    own = session.snapshot()
    for at, mark in ((outside, True), (own, False), (outside, True), (first, False)):
        session.restore(at)
        assert session.log.info.get("commanded", False) is mark


def test_each_vehicle_of_a_team_has_the_mark() -> None:
    session = skyarm.Session(skyarm.load_scenario("two_hold_a_bar", duration=0.1))
    session.step(rotors={"left": [300.0] * 4})
    assert all(
        log.info["commanded"] for log in (session.log, *session.log.agents.values())
    )
