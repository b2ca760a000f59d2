"""The page on tip and tasks: its files fly, its tables are read."""

import re
import tomllib
from pathlib import Path

import pytest

import skyarm
from skyarm.records.files import Fields
from skyarm.reference.phases import phases_table
from skyarm.reference.task_records import Setting

PAGE = (Path(__file__).resolve().parents[1] / "docs" / "tip_and_tasks.md").read_text(
    "utf-8"
)
FLIGHT, *TABLES = re.findall(r"```toml[^\n]*\n(.*?)```", PAGE, re.DOTALL)


def test_the_flight_shown_is_planned_and_flies(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("around.toml").write_text(FLIGHT)
    log = skyarm.run(
        skyarm.load_scenario("around.toml", duration=0.5, controller="paper_pd")
    )
    assert log.status == "completed"


def test_the_paths_shown_are_those_of_a_tip(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("walk.csv").write_text("time,x,y,z\n0,0,0,1\n1,0.2,0,1\n2,0.2,0.3,1\n")
    flight = re.sub(r"path = .*\n", "", FLIGHT)
    ends = [
        skyarm.scenario_from(tomllib.loads(flight + text)).reference.at(60.0).tip
        for text in TABLES[:3]
    ]
    assert ends == [
        pytest.approx(end)
        for end in ([2.0, 0.0, 0.7], [0.2, 0.0, 0.7], [0.5, 0.3, 0.9])
    ]


def test_a_gripper_closes_in_the_first_half_of_its_dwell():
    pick = {"kind": "pick", "start": 8.0, "payload": "box", "position": [1.0, 0.2, 0.5]}
    pick["joints"] = {"finger": 0.01}
    path = {"kind": "phases", "position": [1.0, 0.2, 0.6], "phases": [pick]}
    setting = Setting()
    phases_table(Fields(path, "path"), setting)
    (event,), (move,) = setting.events, setting.joint_moves
    assert (move.joint, move.value, move.end) == ("finger", 0.01, event.time)
    assert event.time - move.start == 0.5
    assert move.start > 8.0  # it goes down first
