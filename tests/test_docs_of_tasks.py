"""The page on tip and tasks: its files fly, its tables are read."""

import re
import tomllib
from pathlib import Path

import pytest

import skyarm
from skyarm.records.files import Fields
from skyarm.reference.phases import phases_table
from skyarm.reference.reference_tables import reference_from
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


def test_the_tables_shown_are_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("walk.csv").write_text("time,x,y,z\n0,0,0,1\n1,0.2,0,1\n2,0.2,0.3,1\n")
    waypoints, samples = (
        reference_from(tomllib.loads(text)["reference"], 0, "reference", Setting())
        for text in TABLES[:2]
    )
    assert [*waypoints.at(60.0).position] == pytest.approx([2.0, 0.0, 1.0])
    assert [*samples.at(2.0).position] == pytest.approx([0.2, 0.0, 1.0])


def test_the_gripper_shown_closes_in_the_first_half_of_its_dwell():
    path = tomllib.loads(TABLES[2])["reference"]["tip"]["path"] | {
        "position": [1.0, 0.2, 0.6]
    }
    setting = Setting()
    phases_table(Fields(path, "path"), setting)
    (event,), (move,) = setting.events, setting.joint_moves
    assert (move.joint, move.value, move.end) == ("finger", 0.01, event.time)
    assert event.time - move.start == 0.5
    assert move.start > 8.0  # it goes down first
