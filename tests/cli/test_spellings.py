"""One spelling of each option in every command: laws by ``--laws A,B``, older spellings
with a note.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_files import FALLS
from every_command import CHOOSES

from skyarm.cli.arguments import names_of
from skyarm.cli.run_command import _files_by_law
from skyarm.log.formats import load_log
from skyarm.scenario.scenario_file import load_scenario
from support.commands import refused, skyarm
from support.components import registry_kept

BOTH = {
    "run": ("case3",),
    "compare": ("case3",),
    "sweep": ("robustness", "-o", "rows"),
    "film": ("case3", "-o", "film.viser"),
    "studio": ("case3", "--port", "0", "--no-browser"),
}
"""Command that flies several laws -> its other words."""

ONE = {
    "margins": ("case3",),
    "tune": ("hummingbird",),
    "fly": ("case3", "--link", "mavlink://127.0.0.1:9"),
}


@pytest.fixture(autouse=True)
def _in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_run_flies_each_law_into_a_log_of_its_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Here each ends early, which is the command's exit code."""
    drawn: list[object] = []
    monkeypatch.setattr(
        "skyarm.view.figures.flight_plot.plot", lambda logs, _file: drawn.append(logs)
    )
    Path("falls.toml").write_text(FALLS)
    words = ("run", "falls.toml", "--plot", "a.png", "--json", "--laws")
    ended = [skyarm(*words, laws) for laws in ("paper_pd", "paper_ct,paper_pd")]
    assert [(each.code, each.err) for each in ended] == [(3, ""), (3, "")]
    one, both = (json.loads(each.out) for each in ended)
    assert set(both) == {"schema", "command", "skyarm", "flights"}
    assert [each["controller"] for each in both["flights"]] == [
        "hybrid_computed_torque",
        "decoupled_pd",
    ]
    assert both["flights"][1] == {
        name: value for name, value in one.items() if name not in both
    } | {
        "logs": [
            str(Path("out", "run", f"short_paper_pd{suffix}"))
            for suffix in (".npz", ".csv")
        ]
    }
    logs = [
        load_log(f"out/run/{name}.npz")
        for name in ("short", "short_paper_ct", "short_paper_pd")
    ]
    assert logs[0].tool.tobytes() == logs[2].tool.tobytes()
    assert [
        log.info["scenario_record"] == logs[0].info["scenario_record"] for log in logs
    ] == [True, False, True]
    assert [isinstance(each, list) and len(each) for each in drawn] == [
        False,
        2,
    ], "one picture of both"


def test_files_of_gains_may_have_commas_in_their_path_and_one_name() -> None:
    Path("b,c").mkdir()
    Path("b,c/tuned.toml").touch()
    names = names_of(
        "--laws", ["a/tuned.toml , indi", "b,c/tuned.toml", "my law.py:make"]
    )
    assert names == ["a/tuned.toml", "indi", "b,c/tuned.toml", "my law.py:make"]
    stems = [
        files[0].stem
        for files in _files_by_law(Path(), [load_scenario("case3")] * 4, names)
    ]
    assert stems == [
        "case3_tuned_0",
        "case3_indi",
        "case3_tuned_2",
        "case3_make_of_my_law_py",
    ]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("run", "case3", "--laws", "paper_ct,indi", "--log", "a.npz"),
            "--log: must be left out with several laws",
        ),
        (
            ("run", "case3", "--laws", "paper_ct,indi", "--ros", "2"),
            "--ros: must be left out with several laws",
        ),
        (
            ("run", "case3", "--laws", "paper_ct,paper_ct"),
            "'paper_ct' and 'paper_ct' are one",
        ),
        (
            ("run", "case3", "--laws", "paper_ct", "--autopilot", "px4"),
            "--laws = 'paper_ct': must be left out beside",
        ),
        (("run", "case3", "--out", ""), "must be"),
        (("film", "case3"), "FILE: is missing"),
        *(
            (
                (name, *words, "--laws", "indi,lqr"),
                "--laws = 'indi,lqr': must be one law",
            )
            for name, words in ONE.items()
        ),
    ],
)
def test_what_cannot_be_is_one_line_and_nothing_is_left(
    words: tuple[str, ...], said: str, tmp_path: Path
) -> None:
    refused(skyarm(*words), said)
    assert list(tmp_path.iterdir()) == []


def test_every_command_of_laws_is_tried_here() -> None:
    assert {*BOTH, *ONE} == set(CHOOSES)


@pytest.mark.parametrize("command", CHOOSES)
def test_an_unknown_law_is_refused_by_its_name(command: str) -> None:
    laws = "lqr,paper_ct" if command in BOTH else "lqr"
    ended = skyarm(command, *(BOTH | ONE)[command], f"--laws={laws}")
    assert ended.code == 2
    assert "'lqr': " in ended.err.splitlines()[-1]


def test_a_drawing_goes_where_out_says() -> None:
    refused(skyarm("show", "hummingbird", "-o", "a.bmp"), "--out = 'a.bmp'")


def test_new_files_go_into_the_folder_of_out_and_fly_as_is_said() -> None:
    done = skyarm("new", "scenario", "mine", "-o", "a NAME")
    assert (done.code, done.err) == (0, "")
    assert done.out.splitlines()[-1] == "fly it: skyarm run 'a NAME/mine.toml'"
    assert {path.name for path in Path("a NAME").iterdir()} == {
        "mine.toml",
        "test_mine.py",
    }
    refused(skyarm("new", "law", "os", "-o", "c"), "must not be that of a module")
    assert not Path("c").exists()


def test_a_film_is_written_to_out_as_to_the_last_word(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found: list[tuple[list[str], list[str]]] = []

    def stop(flights: list[str], names: list[str]) -> None:
        found.append((flights, names))
        raise ValueError("nothing is flown here")

    monkeypatch.setattr("skyarm.cli.film_command._flights_of", stop)
    monkeypatch.setattr("skyarm.cli.film_command._require_renderer", lambda **_: None)
    for words in (("case3", "case2", "-o", "x.viser"), ("case3", "case2", "x.viser")):
        refused(
            skyarm("film", *words, "--laws", "paper_ct", "--laws", "paper_pd,indi"),
            "nothing is flown here",
        )
    assert found == [(["case3", "case2"], ["paper_ct", "paper_pd", "indi"])] * 2


def test_a_command_of_a_plugin_keeps_its_own_option_of_an_older_name() -> None:
    Path("say.py").write_text(
        "from typing import Annotated\nimport typer\nimport"
        ' skyarm\n\n\n@skyarm.register.command("draw_here")\ndef draw_here(drawing:'
        ' Annotated[str, typer.Option("--drawing")] = "b") -> None:\n    """Draw."""\n '
        "   print(drawing)\n"
    )
    with registry_kept():
        assert "--drawing" in skyarm("--plugin", "say.py", "draw_here", "--help").out
    with registry_kept():
        ended = skyarm("--plugin", "say.py", "draw_here", "--drawing", "pen")
    assert (ended.out, ended.err) == ("pen\n", "")
