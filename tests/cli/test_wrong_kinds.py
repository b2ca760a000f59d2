"""A thing of another kind, a word that is nearly right, a name of any letters: one line
that helps.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from command_files import CASE1, VEHICLE

from skyarm.log.flight_log import Log
from skyarm.planning.task import LIBRARY as TASKS
from skyarm.records.files import how_to_install, must_be_one_of, needs_extra
from skyarm.records.files.names import is_result_name
from skyarm.studies.sweep.study_file import LIBRARY as STUDIES
from skyarm.studies.sweep.study_file import study_from
from support.commands import refused, skyarm

TASK = (TASKS / "eagle_catch.toml").read_text("utf-8")
STUDY = (STUDIES / "robustness.toml").read_text("utf-8")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, text in (
        ("t.toml", TASK),
        ("v.toml", VEHICLE),
        ("s.toml", CASE1),
        ("y.toml", STUDY),
    ):
        (tmp_path / name).write_text(text, "utf-8")
    return tmp_path


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("run", "t.toml"),
            "must be a scenario file, and this is a task file, for 'skyarm plan'",
        ),
        (
            ("run", "eagle_catch"),
            "must be a scenario, and this is a task, for 'skyarm plan eagle_catch'",
        ),
        (
            ("plan", "case3"),
            "must be a task, and this is a scenario, for 'skyarm run case3'",
        ),
        (
            ("plan", "s.toml"),
            "must be a task file, and this is a scenario file, for 'skyarm run'",
        ),
        (
            ("run", "v.toml"),
            "must be a scenario file, and this is a vehicle file, for 'skyarm show'",
        ),
        (
            ("run", "y.toml"),
            "must be a scenario file, and this is a study file, for 'skyarm sweep'",
        ),
        (
            ("show", "s.toml"),
            "must be a vehicle file, and this is a scenario file, for 'skyarm run'",
        ),
        (
            ("sweep", "s.toml"),
            "must be a study file, and this is a scenario file, for 'skyarm run'",
        ),
        (
            ("sweep", "v.toml"),
            "must be a study file, and this is a vehicle file, for 'skyarm show'",
        ),
        (
            ("margins", "v.toml"),
            "must be a scenario file, and this is a vehicle file, for 'skyarm show'",
        ),
        (("run", "hummingbird"), "this is a vehicle, for 'skyarm show hummingbird'"),
        (("run", "robustness"), "this is a study, for 'skyarm sweep robustness'"),
        (("show", "case3"), "this is a scenario, for 'skyarm run case3'"),
        (("sweep", "case3"), "this is a scenario, for 'skyarm run case3'"),
        (
            ("run", "arm.urdf.xacro"),
            "this is a vehicle, for 'skyarm show arm.urdf.xacro'",
        ),
        (("show", "arms/arm.urdf.xacro"), "no such file"),
        (("show", "arm.xacro"), "no such file"),
    ],
)
def test_a_thing_of_another_kind_is_called_by_its_kind(
    folder: Path, words: tuple[str, ...], said: str
) -> None:
    assert folder.exists()
    refused(skyarm(*words), said)


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (("run", "case4"), "case3"),
        (("run", "CASE3"), "case3"),
        (("show", "humingbird"), "hummingbird"),
        (("sweep", "robust"), "robustness"),
        (("run", "case1", "--laws", "centroidaltip"), "centroidal_tip"),
        (("run", "case1", "--laws", "nmpc_tune"), "nmpc_tuned"),
        (("margins", "case1", "--laws", "pape_ct"), "paper_ct"),
        (("export", "--to", "c", "indy", "-o", "x.c"), "indi"),
        (("compare", "--laws", "paperct"), "paper_ct"),
        (("compare", "--only", "nois"), "noisy"),
    ],
)
def test_what_was_meant_stands_before_the_list(
    folder: Path, words: tuple[str, ...], meant: str
) -> None:
    assert folder.exists()
    ended = skyarm(*words)
    refused(ended, f": did you mean {meant!r}? must be ")


def test_what_was_meant_is_said_of_fields_metrics_and_paths(folder: Path) -> None:
    (folder / "f.toml").write_text(CASE1.replace("duration", "duraton", 1))
    refused(
        skyarm("run", "f.toml"),
        "f.toml: duration: is missing; is 'duraton' a misspelling of it? there are ",
    )
    (folder / "f.toml").write_text(CASE1 + "\n[sensors]\npositon = 0.1\n")
    refused(skyarm("run", "f.toml"), "positon", "did you mean 'position'? allowed")
    (folder / "y.toml").write_text(
        STUDY.replace("position_error_mean = 1.0", "position_error_men = 1.0")
    )
    refused(skyarm("sweep", "y.toml"), "did you mean 'position_error_mean'? there are")
    (folder / "y.toml").write_text(
        STUDY.replace("seed = 1", 'seed = 1\nmetrics = ["pich_rms"]')
    )
    refused(skyarm("sweep", "y.toml"), "did you mean 'pitch_rms'? must be one of")
    (folder / "y.toml").write_text(
        STUDY.replace("vehicle.base.mass", "vehicle.bas.mass")
    )
    refused(skyarm("sweep", "y.toml"), "did you mean 'base'? there are")


def test_words_that_are_like_nothing_are_not_guessed_at() -> None:
    assert must_be_one_of(("alpha", "beta"), "zzz") == "must be one of alpha, beta"
    assert must_be_one_of(("alpha", "beta"), 3) == "must be one of alpha, beta"
    assert (
        must_be_one_of(("alpha", "beta"), "ALPHA")
        == "did you mean 'alpha'? must be one of alpha, beta"
    )
    assert must_be_one_of((), "x") == "must be left out: there is none"


NAME = "Flug ü 試験"


@pytest.mark.thorough
def test_a_name_of_any_letters_works_wherever_it_becomes_a_file_name(
    folder: Path,
) -> None:
    (folder / "f.toml").write_text(
        CASE1.replace('name = "case1"', f'name = "{NAME}"'), "utf-8"
    )
    study = STUDY.replace('"robustness"', f'"{NAME}"').replace(
        '"case3_wind"', '"f.toml"'
    )
    study = study.replace("4000", "400").replace(
        'design = "grid"', 'duration = 0.1\ndesign = "grid"'
    )
    study = study.replace("steady = [10.0, 20.0]", "steady = [0.0, 0.1]").replace(
        "[0.0, 8.0]", "[0.0, 0.1]"
    )
    study = "\n".join(
        line for line in study.split("\n") if "environment.wind" not in line
    )
    study = study.replace("episodes = 400", "episodes = 20")
    (folder / "y.toml").write_text(study, "utf-8")
    for words in (
        ("run", "f.toml", "--duration", "0.1"),
        ("run", "f.toml", "--duration", "0.1"),
        ("export", "--to", "c", "f.toml", "-o", f"{NAME}.c"),
        ("sweep", "y.toml", "--workers", "1"),
        ("sweep", f"out/{NAME}"),
    ):
        ended = skyarm(*words)
        assert ended.code == 0, (words, ended.err)
    assert Log.load_npz(folder / "out" / "run" / f"{NAME}.npz").info["scenario"] == NAME
    assert (folder / "out" / "run" / f"{NAME}_1.csv").exists()


@pytest.mark.thorough
def test_margins_are_told_of_a_name_of_any_letters(folder: Path) -> None:
    (folder / "f.toml").write_text(
        CASE1.replace('name = "case1"', f'name = "{NAME}"'), "utf-8"
    )
    ended = skyarm("margins", "f.toml", "--instants", "0", "--out", f"{NAME}.json")
    assert ended.code == 0, ended.err
    assert (folder / f"{NAME}.json").exists()


def test_a_terminal_that_lacks_a_letter_gets_it_written_out(folder: Path) -> None:
    (folder / "f.toml").write_text(
        CASE1.replace('name = "case1"', f'name = "{NAME}"'), "utf-8"
    )
    words = [sys.executable, "-m", "skyarm", "run", "f.toml", "--duration", "0.1"]
    done = subprocess.run(
        words,
        capture_output=True,
        check=False,
        cwd=folder,
        env={"PYTHONIOENCODING": "latin-1"},
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("Flug ü \\u8a66\\u9a13: completed".encode("latin-1"))


NO_NAMES = [
    "",
    "a/b",
    "a\\b",
    "..",
    ".hidden",
    "-o",
    " a",
    "a ",
    "a.",
    "a:b",
    "a*",
    "a\nb",
    "a\u202eb",
    "con",
    "NUL.x",
]


@pytest.mark.parametrize("name", [*NO_NAMES, "x" * 101, "試" * 70, "\ud800", 3, None])
def test_what_no_file_system_takes_is_refused(name: object) -> None:
    assert not is_result_name(name)


@pytest.mark.parametrize(
    "name",
    ["a", "Flug ü", "7", "_x", "a.b-c d", "x" * 100, "console", "試験", "e\u0301"],
)
def test_what_every_file_system_takes_is_taken(name: str, tmp_path: Path) -> None:
    assert is_result_name(name)
    (tmp_path / f"{name}.npz").write_text("x")
    shutil.rmtree(tmp_path)


def test_a_grid_without_its_design_is_told_of_it(folder: Path) -> None:
    bare = STUDY.replace('design = "grid"\n', "")
    (folder / "y.toml").write_text(bare.replace("episodes = 4000\n", ""))
    refused(
        skyarm("sweep", "y.toml"),
        "grid",
        'must come with design = "grid", or with a number of episodes',
    )
    assert study_from(tomllib.loads(bare)).design == "random"
    stated = bare.replace("episodes = 4000", 'episodes = 4000\ndesign = "random"')
    assert study_from(tomllib.loads(stated)).design == "random", (
        "and without a word where it is stated"
    )


def test_an_extra_is_named_with_what_installs_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(Path(__file__).parents[2])
    checkout = 'python -m pip install -e ".[sweep,logs]" in a checkout'
    assert (
        how_to_install("sweep", "logs")
        == f'{checkout}, python -m pip install "skyarm[sweep,logs]" from an index'
    )
    assert needs_extra("sweep") == f"needs the extra 'sweep': {how_to_install('sweep')}"


@pytest.mark.parametrize(
    ("words", "command"),
    [
        (("run",), "skyarm run"),
        (("-q", "run", "--nope"), "skyarm run"),
        (("runn",), "skyarm"),
        (("-x",), "skyarm"),
    ],
)
def test_a_wrong_word_leads_to_the_help_of_its_command(
    words: tuple[str, ...], command: str
) -> None:
    refused(skyarm(*words), f"; see '{command} --help'")


@pytest.mark.parametrize("words", [("-h",), ("run", "-h"), ("margins", "-h")])
def test_help_has_a_short_name(words: tuple[str, ...]) -> None:
    ended = skyarm(*words)
    assert (ended.code, ended.err) == (0, "")
    assert ended.out.startswith("Usage:")


def test_the_old_order_of_words_is_not_in_the_help() -> None:
    for command in ("margins", "tune"):
        assert "second" not in skyarm(command, "--help").out


@pytest.mark.parametrize("command", ["reproduce", "compare"])
def test_a_plant_that_is_nearly_right_is_meant(command: str) -> None:
    refused(
        skyarm(command, "--plant", "rigidbody"),
        "--plant = 'rigidbody': did you mean 'rigid_body'? must be one of",
    )
