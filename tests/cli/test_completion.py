"""``skyarm completion``: scripts of shells, and what they are answered."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from commanded import refused, skyarm
from skyarm.cli.commands import app
from skyarm.cli.completion import ASKED, SHELLS, names, script
from skyarm.cli.completion_requests import VARIABLE


def answered(words: str, place: int, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What bash is given for a line of words, the cursor in the one at a place."""
    monkeypatch.setenv(VARIABLE, "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(place))
    done = skyarm()
    assert (done.code, done.err) == (0, "")
    return done.out.split()


@pytest.mark.parametrize(
    ("words", "place", "expected"),
    [
        ("skyarm chec", 1, {"check"}),
        ("skyarm show quad", 2, {"quadrotor_roll_arm2"}),
        ("skyarm check case3", 2, {"case3", "case3_wind"}),
        ("skyarm run case3 --controller paper", 4, {"paper_ct", "paper_pd"}),
        ("skyarm sweep rob", 2, {"robustness"}),
        ("skyarm new s", 2, {"scenario", "study"}),
        ("skyarm completion f", 2, {"fish"}),
        ("skyarm run --dur", 2, {"--duration"}),
        ("skyarm show zzz", 2, set()),
    ],
)
def test_names_commands_and_options_are_completed(words, place, expected, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert set(answered(words, place, monkeypatch)) == expected


def test_files_of_the_folder_are_completed(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name in ("mine.toml", "mine.urdf", "mine.txt"):
        (tmp_path / name).touch()
    assert answered("skyarm show mine", 2, monkeypatch) == ["mine.toml", "mine.urdf"]
    assert "mine.txt" not in names(("vehicle", "scenario"))


def test_every_parameter_that_is_completed_is_there():
    import typer

    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    for command, parameters in ASKED.items():
        known = {each.name for each in commands[command].params}
        assert set(parameters) <= known, command


@pytest.mark.parametrize("shell", SHELLS)
def test_a_script_asks_this_program(shell):
    done = skyarm("completion", shell)
    assert done.code == 0
    assert done.out.rstrip("\n") == script(shell)
    assert VARIABLE in done.out
    assert "skyarm" in done.out


def test_another_shell_and_another_question_are_refused(monkeypatch):
    refused(skyarm("completion", "tcsh"), "shell = 'tcsh'", "bash, zsh, fish")
    monkeypatch.setenv(VARIABLE, "nonsense")
    done = skyarm()
    assert "Traceback" not in done.err
    assert done.code != 0


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_bash_itself_completes_a_vehicle(tmp_path):
    (tmp_path / "completion.sh").write_text(script("bash"), "utf-8")
    program = tmp_path / "skyarm"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m skyarm "$@"\n', "utf-8")
    program.chmod(0o755)
    asked = (
        f"source completion.sh; COMP_WORDS=(skyarm show quad); COMP_CWORD=2; _skyarm_completion {program}; "
        'echo "${COMPREPLY[@]}"'
    )
    done = subprocess.run(["bash", "-c", asked], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.stdout.split() == ["quadrotor_roll_arm2"], done
    assert Path(program).exists()
