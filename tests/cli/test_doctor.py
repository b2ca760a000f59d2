"""``skyarm doctor``: what works, what is missing, what to do; never a traceback."""

from __future__ import annotations

import json
import re
import subprocess

import pytest

from skyarm.cli import doctor_command as doctor
from skyarm.records.files.packages import FLOORS
from support.commands import skyarm

FINE = {"machine code": ("print('LLVM')", "", True)}


@pytest.fixture
def quick(monkeypatch):
    """Trials that take no time."""
    monkeypatch.setattr(doctor, "TRIALS", FINE)
    return monkeypatch


def states(parts):
    return {part.name: part.state for part in parts}


def test_all_that_flights_need_works_here(monkeypatch):
    needed = {name: trial for name, trial in doctor.TRIALS.items() if trial[2]}
    monkeypatch.setattr(doctor, "TRIALS", needed)
    parts = doctor.examine()
    found = states(parts)
    assert doctor.works(parts)
    assert found["machine code"] == found["MuJoCo"] == "works"
    assert set(FLOORS) <= set(found)


def test_a_folder_that_is_gone_or_holds_a_namesake_is_not_the_installation_s_fault(
    quick, tmp_path
):
    quick.setattr(doctor, "TRIALS", {"MuJoCo": (doctor.MUJOCO, "", True)})
    (tmp_path / "mujoco.py").write_text(
        "raise ValueError('not the library')\n", "utf-8"
    )
    quick.chdir(tmp_path)
    assert states(doctor.examine())["MuJoCo"] == "works"
    gone = tmp_path / "gone"
    gone.mkdir()
    quick.chdir(gone)
    gone.rmdir()
    assert states(doctor.examine())["MuJoCo"] == "works"


def test_extras_are_those_of_the_package():
    found = doctor.extras()
    assert {"jax", "sweep", "film", "studio", "logs"} <= set(found)
    assert found["sweep"] == ["pyarrow"]
    assert "test" not in found


def test_a_missing_extra_names_the_command_that_adds_it(quick):
    quick.setattr(
        doctor,
        "installed_versions",
        lambda names, path=None: {n: "99" for n in names if n != "pyarrow"},
    )
    done = skyarm("doctor", columns=80)
    assert done.code == 0
    lines = done.out.splitlines()
    at = lines.index("missing: extra sweep, pyarrow is missing")
    assert [each[:27] for each in lines[at + 1 : at + 3]] == [
        "  python -m pip install -e ",
        '  python -m pip install "sk',
    ]
    assert all("[sweep]" in each for each in lines[at + 1 : at + 3])
    assert max(map(len, lines)) <= 80


def test_an_old_library_and_a_missing_one_are_faults(quick):
    there = {name: floor for name, floor in FLOORS.items() if name != "matplotlib"} | {
        "numpy": "1.0"
    }
    quick.setattr(
        doctor,
        "installed_versions",
        lambda names, path=None: {n: there[n] for n in names if n in there},
    )
    parts = doctor.examine()
    assert states(parts)["numpy"] == "broken"
    assert states(parts)["matplotlib"] == "missing"
    assert not doctor.works(parts)
    assert skyarm("doctor").code == 1


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("import os; os.abort()", "signal 6"),
        ("raise ValueError('no driver here')", "no driver here"),
        ("import nothing_of_this_name", "nothing_of_this_name"),
        ("import time; time.sleep(60)", "no answer"),
        ("import sys; sys.stderr.buffer.write(bytes([255, 254])); sys.exit(3)", ""),
        ("import sys; sys.exit(4)", "no words"),
    ],
)
def test_a_trial_that_breaks_is_a_line(quick, program, said):
    quick.setattr(doctor, "TRIALS", {"machine code": (program, "do this", True)})
    quick.setattr(doctor, "PATIENCE", 3.0 if "sleep" not in program else 0.3)
    done = skyarm("doctor", columns=200)
    assert (done.code, done.err) == (1, "")
    assert "Traceback" not in done.out
    assert said in done.out
    assert re.search("^broken: machine code, .*\\n  do this$", done.out, re.M)


def test_no_process_can_be_started(quick):
    def refuse(*_words, **_more):
        raise OSError(12, "Cannot allocate memory")

    quick.setattr(subprocess, "Popen", refuse)
    parts = {part.name: part for part in doctor.examine()}
    assert parts["machine code"].state == "broken"
    assert "Cannot allocate memory" in parts["machine code"].found
    assert "Cannot allocate memory" not in parts["machine code"].remedy


def test_a_document(quick):
    done = skyarm("doctor", "--json")
    found = json.loads(done.out)
    assert found["works"] is True
    assert {"name", "state", "found", "remedy", "needed"} == set(found["parts"][0])
    assert {"folder", "entries", "bytes", "most_bytes"} == set(found["cache"])
