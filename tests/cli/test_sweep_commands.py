"""``skyarm sweep`` of a study and of the folder of a sweep, as a user types them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from support.commands import refused, skyarm
from support.studies import drop_chunk

pytest.importorskip("pyarrow")


STUDY = """
schema = 1
name = "quick"
scenario = "case3_wind"
controllers = ["paper_ct", "paper_pd"]
duration = 0.5
episodes = 24
chunk = 10
[windows]
steady = [0.2, 0.5]
[vary]
"plant.vehicle.base.mass" = { uniform = [0.6, 0.9] }
"environment.wind.force_W.x" = { normal = [1.0, 0.5] }
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


def test_a_study_is_flown_continued_and_summed_up(folder: Path) -> None:
    first = skyarm("sweep", "study.toml", "--workers", "1")
    assert first.code == 0, first.err
    assert (
        "48 flights in out/quick: 24 episodes under paper_ct, paper_pd; 48 flown in"
        in first.out.replace("\\", "/")
    )
    drop_chunk(folder / "out" / "quick", 1)
    second = skyarm("sweep", "study.toml")
    assert "20 flown in" in second.out
    assert ", 28 were there\n" in second.out
    summed = skyarm("sweep", "out/quick", "--success", "position_error_mean=0.5")
    assert summed.code == 0, summed.err
    assert "paper_ct - paper_pd: success" in summed.out
    made = {path.name for path in (folder / "out" / "quick" / "stats").iterdir()}
    assert made == {
        "report.html",
        "stats.json",
    }, "a map that is the same everywhere is a sentence"
    page = (folder / "out" / "quick" / "stats" / "report.html").read_text()
    assert page.count(": every episode succeeds, in every cell of the map.") == 2
    found = json.loads((folder / "out" / "quick" / "stats" / "stats.json").read_text())
    assert (found["schema"], found["episodes"], found["limits"]) == (
        1,
        24,
        {"position_error_mean": 0.5},
    )


def test_limits_are_those_of_the_file_that_is_named_and_an_option_adds_to_them(
    folder: Path,
) -> None:
    strict = STUDY + "[success]\nposition_error_mean = 1e-6\n"
    (folder / "study.toml").write_text(strict)
    first = skyarm("sweep", "study.toml", "--out", "my dir")
    assert "next: skyarm sweep 'my dir'" in first.out
    skyarm("sweep", "my dir", "--success", "position_error_max=100")
    found = json.loads((folder / "my dir" / "stats" / "stats.json").read_text())
    assert found["limits"] == {"position_error_mean": 1e-6, "position_error_max": 100.0}
    twice = ("--success", "position_error_mean=1", "--success", "position_error_mean=2")
    refused(
        skyarm("sweep", "my dir", *twice),
        "--success = 'position_error_mean=2': must name each metric once",
    )
    saved = skyarm("sweep", "study.toml", "--out", "my dir", "--save", "failed")
    assert "skyarm run 'my dir/episode_0_paper_ct.toml'" in saved.out
    (folder / "study.toml").write_text(strict.replace("1e-6", "100.0"))
    refused(
        skyarm("sweep", "study.toml", "--out", "my dir", "--save", "failed"),
        "--save = ",
    )


def test_a_folder_with_the_name_of_a_shipped_study_is_summed_up_by_its_path(
    folder: Path,
) -> None:
    done = skyarm("sweep", "study.toml", "--out", "robustness")
    assert "next: skyarm sweep ./robustness" in done.out


def test_wrong_input_is_one_line_and_flies_nothing(folder: Path) -> None:
    refused(
        skyarm("sweep", "nothing"),
        "study = 'nothing'",
        "shipped studies are carrying, robustness",
    )
    refused(
        skyarm("sweep", "study.toml", "--workers", "-1"),
        "--workers = -1",
        "from 0 to 10000",
    )
    refused(
        skyarm("sweep", "study.toml", "--out", ""),
        "output folder = ''",
        "must be the path of a folder",
    )
    (folder / "wrong.toml").write_text(STUDY.replace("base.mass", "base.weight"))
    refused(
        skyarm("sweep", "wrong.toml"),
        "wrong.toml",
        "base.weight",
        "there are mass, com",
    )
    (folder / "light.toml").write_text(STUDY.replace("[0.6, 0.9]", "[-0.6, 0.9]"))
    refused(
        skyarm("sweep", "light.toml"),
        "light.toml",
        "base.mass",
        "reaches -0.",
        "at least 0",
    )
    refused(
        skyarm("sweep", "study.toml", "--map", "a", "b"),
        "--map: must be left out; only the folder of a sweep",
    )
    refused(
        skyarm("sweep", "."), "folder = '.'", "must be one that 'skyarm sweep' wrote"
    )
    refused(
        skyarm("sweep", ".", "--workers", "2"),
        "--workers: must be left out with the folder of a sweep",
    )
    assert not (folder / "out").exists()


def test_a_changed_study_and_a_wrong_statistic_are_one_line(folder: Path) -> None:
    assert skyarm("sweep", "study.toml").code == 0
    (folder / "study.toml").write_text(STUDY.replace("episodes = 24", "episodes = 25"))
    refused(
        skyarm("sweep", "study.toml"),
        "study.toml: episodes = 25: must be 24",
        "choose another --out",
    )
    refused(
        skyarm("sweep", "out/quick", "--success", "speed=1"),
        "success.speed",
        "there are position_error_mean",
    )
    refused(
        skyarm("sweep", "out/quick", "--map", "plant.vehicle.base.mass", "x"),
        "--map = 'x'",
        "varied number",
    )
