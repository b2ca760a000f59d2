"""Episodes of a study that are saved as scenario files: each flies alone what its row
tells.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import skyarm
from skyarm.cli.commands import program
from skyarm.records.files.toml import toml_key, toml_value
from skyarm.studies.sweep import load_study
from skyarm.studies.sweep.design import values
from skyarm.studies.sweep.plan import at_episode, save_episode
from skyarm.studies.sweep.study import StudyError
from support.studies import MASS, WIND, document, read

pytest.importorskip("pyarrow")


def text_of(**fields: object) -> str:
    """File of a small study."""
    vary = {
        MASS: {"uniform": [0.5, 1.5]},
        WIND: {"normal": [1.0, 0.5]},
        "sensors.position": {"list": [0.0, 0.01]},
    }
    tables = document(
        precision="bit_exact",
        metrics=["position_error_mean"],
        success={"position_error_mean": 0.2},
        vary=vary,
    )
    stated = {
        name: each for name, each in (tables | fields).items() if each is not None
    }
    return "".join(
        f"{toml_key(name)} = {toml_value(each)}\n" for name, each in stated.items()
    )


def sweep(*words: str) -> str:
    result = CliRunner().invoke(
        program(["sweep"]), ["sweep", *words], catch_exceptions=False
    )
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a study and its rows."""
    folder = tmp_path_factory.mktemp("swept")
    (folder / "mine.toml").write_text(text_of())
    sweep(
        str(folder / "mine.toml"), "--out", str(folder / "rows_of_it"), "--workers", "1"
    )
    return folder


def saved(here: Path, *which: str) -> list[Path]:
    words = [word for each in which for word in ("--save", each)]
    found = json.loads(
        sweep(
            str(here / "mine.toml"), "--out", str(here / "rows_of_it"), *words, "--json"
        )
    )
    return [Path(file) for file in found["files"]]


@pytest.mark.filterwarnings("ignore:.*without effect")
def test_a_saved_episode_flies_what_its_row_tells(here: Path) -> None:
    rows, study = read(here / "rows_of_it"), load_study(here / "mine.toml")
    files = saved(here, "7")
    assert [file.name for file in files] == [
        "episode_7_paper_ct.toml",
        "episode_7_paper_pd.toml",
    ]
    for file, (label, row) in zip(files, rows.items(), strict=True):
        log = skyarm.run(skyarm.load_scenario(file))
        drawn = {path: float(column[0]) for path, column in values(study, [7]).items()}
        alone = skyarm.run(at_episode(study, label, drawn, 7))
        assert log.position.tobytes() == alone.position.tobytes()
        assert log.rotor_commands.tobytes() == alone.rotor_commands.tobytes()
        assert log.status == row["status"][7]
        assert skyarm.score(log)["position_error_mean"] == pytest.approx(
            row["position_error_mean"][7], rel=1e-12
        )
        assert (drawn[MASS], drawn[WIND]) == (row[MASS][7], row[WIND][7])


def test_the_first_failed_and_the_worst_episode_are_found_in_the_rows(
    here: Path,
) -> None:
    for label, row in read(here / "rows_of_it").items():
        error = row["position_error_mean"]
        failed = (row["status"] != "completed") | ~(error <= 0.2)
        assert failed.any()
        assert not failed.all()
        names = [
            f"episode_{int(failed.argmax())}_{label}.toml",
            f"episode_{int(np.nanargmax(error))}_{label}.toml",
        ]
        found = [file.name for file in saved(here, "failed", "position_error_mean")]
        assert [name for name in found if label in name] == names


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--save", "fialed"),
            (
                r"^--save = 'fialed': did you mean 'failed'\? must be one of .*, or a"
                r" number$"
            ),
        ),
        (("--save", "-1"), r"^--save = '-1': must be one of failed, .*, or a number$"),
        (("--save", "50"), r"^--save = '50': must be less than 50, the episodes of "),
        (
            ("--save", "2", "--save", "50"),
            r"^--save = '50': must be less than 50, the episodes of ",
        ),
        (
            ("--save", "9" * 5000),
            r"^--save = '999.*\.\.\.: must be less than 50, the episodes of ",
        ),
        (("--save", "1", "--part", "1/2"), r"--part.* with --save: nothing is flown"),
        (
            ("--laws", "paper_ct", "--save", "failed"),
            r"rows_of_it: holds rows of another study than .*mine\.toml",
        ),
    ],
)
def test_what_cannot_be_saved_is_one_line(
    here: Path, words: tuple[str, ...], said: str
) -> None:
    before = sorted(here.rglob("*"))
    with pytest.raises(ValueError, match=said) as caught:
        sweep(str(here / "mine.toml"), "--out", str(here / "rows_of_it"), *words)
    assert "\n" not in str(caught.value)
    assert sorted(here.rglob("*")) == before


def test_no_episode_that_is_meant_and_a_folder_of_rows_are_one_line(
    here: Path, tmp_path: Path
) -> None:
    (tmp_path / "easy.toml").write_text(
        text_of(name="easy", episodes=3, success={}, vary={})
    )
    sweep(
        str(tmp_path / "easy.toml"), "--out", str(tmp_path / "easy"), "--workers", "1"
    )
    with pytest.raises(
        ValueError,
        match=r"^--save = 'failed': is true of no episode of paper_ct in .*easy",
    ):
        sweep(
            str(tmp_path / "easy.toml"),
            "--out",
            str(tmp_path / "easy"),
            "--save",
            "failed",
        )
    with pytest.raises(ValueError, match=re.escape("--save")):
        sweep(str(here / "rows_of_it"), "--save", "failed")


def test_a_controller_without_such_an_episode_leaves_those_of_the_others(
    tmp_path: Path,
) -> None:
    """By a limit between the errors of the two laws, at which the better one never
    fails.
    """
    study, first, out = tmp_path / "apart.toml", tmp_path / "first", tmp_path / "second"
    vary = {MASS: {"uniform": [0.99, 1.01]}}
    study.write_text(text_of(episodes=3, success={}, vary=vary))
    sweep(str(study), "--out", str(first), "--workers", "1")
    better, worse = sorted(
        row["position_error_mean"].max() for row in read(first).values()
    )
    study.write_text(
        text_of(
            episodes=3,
            success={"position_error_mean": 0.5 * (better + worse)},
            vary=vary,
        )
    )
    sweep(str(study), "--out", str(out), "--workers", "1")
    words = ["sweep", str(study), "--out", str(out), "--save", "failed"]
    result = CliRunner().invoke(program(["sweep"]), words, catch_exceptions=False)
    assert [path.name.removeprefix("episode_0_") for path in out.glob("episode_*")] == [
        "paper_pd.toml"
    ]
    assert (
        "note: --save = 'failed': is true of no episode of paper_ct in" in result.stderr
    )


def test_a_number_needs_no_rows(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(text_of())
    sweep(
        str(tmp_path / "mine.toml"),
        "--out",
        str(tmp_path / "new"),
        "--save",
        "3",
        "--laws",
        "indi",
    )
    scenario = skyarm.load_scenario(tmp_path / "new/episode_3_indi.toml")
    assert (scenario.controller.name, scenario.seed, scenario.episode) == ("indi", 3, 3)
    assert [path.name for path in (tmp_path / "new").iterdir()] == [
        "episode_3_indi.toml"
    ]


def test_a_scenario_beside_the_study_is_found_from_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own").mkdir()
    skyarm.save_scenario(
        tmp_path / "own/flight.toml", skyarm.load_scenario("case3_wind"), "case3_wind"
    )
    (tmp_path / "own/mine.toml").write_text(
        text_of(scenario="flight.toml", controllers=None)
    )
    monkeypatch.chdir(tmp_path)
    sweep("own/mine.toml", "--out", "new", "--save", "3")
    scenario = skyarm.load_scenario("new/episode_3_hybrid_computed_torque.toml")
    assert (scenario.controller.name, scenario.episode) == ("hybrid_computed_torque", 3)


@pytest.mark.parametrize(
    ("label", "episode", "said"),
    [
        (
            "paper_cd",
            1,
            (
                r"^label = 'paper_cd': did you mean 'paper_pd'\? must be one of"
                r" paper_ct, paper_pd$"
            ),
        ),
        ("paper_ct", 50, r"^episode = 50: must be a whole number from 0 to 49$"),
        ("paper_ct", -1, r"^episode = -1: must be a whole number from 0 to 49$"),
        ("paper_ct", "x", r"^episode = 'x': must be a whole number from 0 to 49$"),
    ],
)
def test_an_episode_that_the_study_does_not_have_is_one_line(
    here: Path, tmp_path: Path, label: str, episode: int, said: str
) -> None:
    with pytest.raises(StudyError, match=said):
        save_episode(
            tmp_path / "one.toml", load_study(here / "mine.toml"), label, episode
        )
    assert list(tmp_path.iterdir()) == []
