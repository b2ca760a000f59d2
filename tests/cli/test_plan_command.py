"""``skyarm plan`` as a user types it."""

from __future__ import annotations

import base64
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import skyarm
from skyarm.planning.planner import PlanError
from skyarm.studies.assess.assessment import Assessment
from skyarm.studies.assess.finding import FAULT, Finding
from support.commands import refused
from support.commands import skyarm as command

UP = """schema = 1
vehicle = "hummingbird"
phases = [{ to = { base = [0.0, 0.0, 1.0], rest = true } }]
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "up.toml").write_text(UP)
    return tmp_path


def test_a_plan_of_free_length_flies_by_the_scenario_beside_it(folder: Path) -> None:
    """The length of a flight must be a whole number of control periods, which that of a
    plan is not.
    """
    ended = command("plan", "up.toml", "-o", "up.npz", "--scenario", "fly/up.toml")
    assert ended.code == 0, ended.err
    flight = skyarm.load_scenario("fly/up.toml")
    log = skyarm.run(flight)
    assert log.status == "completed"
    assert log.position[-1] == pytest.approx([0.0, 0.0, 1.0], abs=5e-3)


def test_a_task_without_a_plan_ends_with_3_and_its_cause(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def none(*_: object, **__: object) -> None:
        raise PlanError("up: phases[0] 'go': base is off by 2")

    monkeypatch.setattr("skyarm.planning.planner.plan", none)
    ended = command("plan", "up.toml")
    assert (ended.code, ended.out) == (3, "up: phases[0] 'go': base is off by 2\n")
    assert (
        command("plan", "up.toml", "-q").err
        == "skyarm: up: phases[0] 'go': base is off by 2\n"
    )
    assert not Path("plan.npz").exists()


def test_a_scenario_that_its_check_refuses_is_not_written(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fault = Finding("rotors along the reference", FAULT, "at most 1.2 of the limit")
    checked = []

    def refuse(scenario: skyarm.Scenario) -> Assessment:
        checked.append(scenario.agent.reference.planned)
        return Assessment("up", scenario.agent.plant.vehicle, 9.81, 0.0, 1, (fault,))

    monkeypatch.setattr("skyarm.studies.assess.assessment.check", refuse)
    ended = command(
        "plan",
        "up.toml",
        "-o",
        "made/p.npz",
        "--scenario",
        "fly/up.toml",
        "--report",
        "up.html",
    )
    assert ended.code == 1, ended.err
    assert checked[0].times[-1] > 1.5
    assert "fault: rotors along the reference: at most 1.2 of the limit\n" in ended.out
    assert ended.out.endswith(
        "no scenario: skyarm check finds what cannot be flown; fly/up.toml is not"
        " written\n"
    )
    assert sorted(each.name for each in folder.rglob("*.*")) == [
        "p.npz",
        "up.html",
        "up.toml",
    ]
    document = json.loads(
        command("plan", "up.toml", "--scenario", "fly/up.toml", "--json").out
    )
    assert document["faults"] == [
        "fault: rotors along the reference: at most 1.2 of the limit"
    ]
    assert command("plan", "up.toml").code == 0


@pytest.mark.thorough
def test_a_plan_that_hangs_from_no_world_has_no_scenario(folder: Path) -> None:
    ended = command("plan", "monkey_bar", "-o", "p.npz", "--scenario", "bar.toml")
    assert ended.code == 1
    assert "fault: contact along the reference: the plan counts on " in ended.out
    assert not Path("bar.toml").exists()


def test_a_search_that_takes_too_long_is_told_and_ends_with_3(folder: Path) -> None:
    ended = command("plan", "eagle_catch", "--seconds", "0.001", "-o", "new/p.npz")
    assert ended.code == 3
    assert ended.out.startswith(
        "eagle_catch: no plan within 0.001 s, seed 1: iteration 20"
    )
    assert sorted(each.name for each in folder.iterdir()) == ["up.toml"]


def drawn_row(film: Image.Image, frame: int) -> float:
    """Mean row of the black pixels of one frame's upper half without its clock."""
    film.seek(frame)
    grey = np.asarray(film.convert("L"))
    half = grey[: grey.shape[0] // 2, grey.shape[1] // 4 : 3 * grey.shape[1] // 4]
    return float(np.argwhere(half < 40)[:, 0].mean())


def test_a_plan_is_written_with_its_scenario_and_page_and_a_document_of_its_numbers(
    folder: Path,
) -> None:
    words = (
        "--out",
        "made/up.npz",
        "--scenario",
        "fly/up.toml",
        "--report",
        "page.html",
        "--json",
    )
    ended = command("plan", "up.toml", *words)
    assert ended.code == 0, ended.err
    document = json.loads(ended.out)
    assert document["solved"] is True
    assert Path(document["file"]).resolve() == (folder / "made" / "up.npz").resolve()
    keys = (
        "duration phases speed tilt rotor torque joint_rate clearance nearest violation"
        " cost seconds seeds iterations"
    )
    assert set(keys.split()) <= set(document)
    assert document["faults"] == []
    film = re.search(r"data:image/webp;base64,([^\"]+)", Path("page.html").read_text())
    assert film
    with Image.open(io.BytesIO(base64.b64decode(film[1]))) as moving:
        assert moving.n_frames > 5  # type: ignore[attr-defined]
        rows = [drawn_row(moving, k) for k in (0, moving.n_frames - 1)]  # type: ignore[attr-defined]
    # the vehicle climbs by 1 m in the picture from the side
    assert rows[1] < rows[0] - 20

    assert document["violation"] < 1e-6
    with np.load("made/up.npz", allow_pickle=False) as arrays:
        assert arrays["t"][-1] == pytest.approx(document["duration"], abs=1e-12)
        np.testing.assert_allclose(
            arrays["position"][[0, -1]], [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], atol=2e-6
        )
    assert Path("page.html").read_text("utf-8").rstrip().endswith("</html>")
    left = sorted(
        each.relative_to(folder).as_posix()
        for each in folder.rglob("*")
        if each.is_file()
    )
    assert left == ["fly/up.toml", "made/up.npz", "page.html", "up.toml"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("wrong.toml",),
            "wrong.toml: minimise = 'energy': must be one of effort, time",
        ),
        (("none.toml",), "none.toml"),
        (("nothing",), "task = 'nothing': must be a .toml file or one of "),
        (
            ("up.toml", "--seconds", "0"),
            "--seconds = 0: must be above 0 and at most 3600",
        ),
        (("up.toml", "--seconds", "nan"), "--seconds = nan"),
        (("up.toml", "--out", "new/p.txt"), "--out = 'new/p.txt': must end in .npz"),
        (
            ("up.toml", "--scenario", "new/p.npz"),
            "--scenario = 'new/p.npz': must end in .toml",
        ),
        (
            ("up.toml", "--report", "new/p.pdf"),
            "--report = 'new/p.pdf': must end in .html",
        ),
        (("up.toml", "--scenario", "up.toml"), "up.toml"),
        (
            ("grip.toml", "--scenario", "fly/up.toml"),
            "phases[0].gripper = 'claw': must be left out without [[world.grippers]]",
        ),
    ],
)
def test_wrong_words_are_refused_before_planning(
    folder: Path, words: tuple[str, ...], message: str
) -> None:
    Path("wrong.toml").write_text(UP.replace("vehicle", 'minimise = "energy"\nvehicle'))
    Path("grip.toml").write_text(UP.replace("[{", '[{ gripper = "claw",'))
    before = {each: each.read_bytes() for each in folder.iterdir()}
    refused(command("plan", *words), message)
    assert {each: each.read_bytes() for each in folder.iterdir()} == before


def test_an_impossible_task_leaves_no_file_and_no_folder(folder: Path) -> None:
    Path("heavy.toml").write_text(UP.replace("vehicle", "gravity = 50.0\nvehicle"))
    before = sorted(folder.iterdir())
    words = (
        "--out",
        "new/p.npz",
        "--scenario",
        "more/f.toml",
        "--report",
        "page/p.html",
        "--json",
    )
    ended = command("plan", "heavy.toml", *words)
    assert ended.code == 3
    document = json.loads(ended.out)
    assert document["solved"] is False
    assert document["cause"].startswith("task: phases[0] '': to.rest: hovering takes ")
    assert sorted(folder.iterdir()) == before


def test_a_full_disk_leaves_the_file_of_before(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("p.npz").write_bytes(b"of before")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    ended = command("plan", "up.toml", "--out", "p.npz")
    assert ended.code not in (0, 3)
    assert "No space left on device" in ended.err
    assert sorted(each.name for each in Path().iterdir()) == ["p.npz", "up.toml"]
    assert Path("p.npz").read_bytes() == b"of before"
