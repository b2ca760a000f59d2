"""skyarm diff from the shell: two logs, or a log and its flight flown again."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import skyarm
from skyarm.records.identity import log_digest
from skyarm.records.plain import plain
from support.commands import Outcome
from support.commands import skyarm as typed

SCENARIO = dataclasses.replace(
    skyarm.load_scenario("case3_wind", duration=0.3),
    changes=(skyarm.Change(at=0.1, path="controller.gains.position.x", value=9.0),),
)


def run(folder: Path, *words: str) -> Outcome:
    with contextlib.chdir(folder):
        return typed(*words)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: Any) -> Path:
    made: Path = tmp_path_factory.mktemp("flights")
    log = skyarm.run(SCENARIO)
    log.save_npz(made / "flight.npz")
    position = log.position.copy()
    position[30:, 0] += 1e-3
    moved = dataclasses.replace(
        log, position=position, info={**log.info, "versions": {"skyarm": "0.1.9"}}
    )
    moved.save_npz(made / "moved.npz")
    # a log that says it flew something else than it did
    other = plain(dataclasses.replace(SCENARIO, seed=0, changes=()))
    info = {**log.info, "scenario_record": other, "digest": log_digest(other, {})}
    dataclasses.replace(log, info=info).save_npz(made / "other.npz")
    return made


def test_a_flight_is_flown_again_to_the_bit(folder: Path) -> None:
    """In another process."""
    words = [sys.executable, "-m", "skyarm", "diff", "flight.npz"]
    done = subprocess.run(
        words, cwd=folder, capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "every number is the same in 60 control periods" in done.stdout
    assert not (folder / "out").exists()


def test_a_flight_that_goes_on_where_its_log_has_ended_is_not_equal(
    folder: Path,
) -> None:
    """A command from outside that is no number ends an episode, and no scenario knows
    of it.
    """
    session = skyarm.Session(SCENARIO)
    for _ in range(30):
        session.step()
    whole = session.log
    whole.save_npz(folder / "cut.npz")
    rotors, joints = (len(each[0]) for each in (whole.rotor_commands, whole.efforts))
    session.step(
        skyarm.Command(rotor_speeds=(math.nan,) * rotors, efforts=(0.0,) * joints)
    )
    assert session.ended is not None
    session.log.save_npz(folder / "refused.npz")
    done = run(folder, "diff", "refused.npz")
    assert done.code == 1, done.out
    assert "control periods: 30 in log, 60 in again, 30 in both" in done.out
    cut = run(folder, "diff", "cut.npz")
    assert (cut.code, "every number is the same in 30 control periods" in cut.out) == (
        0,
        True,
    )


def test_a_flight_that_is_not_what_its_log_says_is_said_with_the_first_difference(
    folder: Path,
) -> None:
    done = run(folder, "diff", "other.npz")
    assert done.code == 1
    first = next(
        line for line in done.out.splitlines() if line.startswith("first difference")
    )
    # the change at 0.1 s is in the numbers of the log, and not in what it says
    assert first.startswith("first difference: at 0.1 s, joint_effort_1 = ")


def test_another_law_stands_beside_the_log(folder: Path) -> None:
    assert (
        run(folder, "run", "flight.npz", "--laws", "paper_pd", "--log", "pd.npz").code
        == 0
    )
    done = run(folder, "diff", "flight.npz", "pd.npz")
    assert (done.code, done.err) == (1, "")
    own, new = (skyarm.load_log(folder / name) for name in ("flight.npz", "pd.npz"))
    lines = done.out.splitlines()
    assert f"law {own.info['controller']} {new.info['controller']}" in [
        " ".join(line.split()) for line in lines
    ]
    (row,) = (line.split() for line in lines if line.startswith("ee_error_mean"))
    assert [float(each) for each in row[1:]] == pytest.approx(
        [skyarm.score(log)["ee_error_mean"] for log in (own, new)], rel=1e-3
    )


def test_a_difference_is_named_and_what_does_not_differ_is_not(folder: Path) -> None:
    done = run(folder, "diff", "flight.npz", "moved.npz")
    assert done.code == 1
    assert "first difference: at 0.15 s, position_x = " in done.out
    assert " m, 0.001 apart\n" in done.out
    assert "velocity_x" not in done.out
    assert "the scenarios differ" not in done.out
    assert done.err.startswith("skyarm: note: the logs are of other versions: ")
    assert f"skyarm {skyarm.__version__} and 0.1.9" in done.err
    assert (
        run(folder, "diff", "flight.npz", "moved.npz", "--tolerance", "0.002").code == 0
    )
    told = json.loads(run(folder, "diff", "flight.npz", "moved.npz", "--json").out)
    (one,) = told["differences"]
    assert (one["name"], one["unit"], one["time"]) == ("position_x", "m", 0.15)
    assert one["largest"] == pytest.approx(1e-3)
    assert (told["equal"], told["instants"]) == (
        False,
        {"both": 60, "first": 60, "second": 60},
    )


def test_equal_flights_of_other_scenarios_are_equal_and_say_what_differs(
    folder: Path,
) -> None:
    done = run(folder, "diff", "flight.npz", "other.npz")
    assert (done.code, done.err) == (0, "")
    assert "every number is the same in 60 control periods" in done.out
    assert "  changes.0.path: 'controller.gains.position.x' and '(none)'" in done.out


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("diff", "absent.npz"), "log = 'absent.npz': no such file"),
        (("diff", "no.npz"), "log = 'no.npz': must be a log that save_npz wrote"),
        (
            ("diff", "flight.npz", "no.npz"),
            "log = 'no.npz': must be a log that save_npz wrote",
        ),
        (("diff", "flight.npz", "flight.toml"), "log = 'flight.toml': no such file"),
        (
            ("diff", "flight.npz", "moved.npz", "--tolerance", "-1"),
            "--tolerance = -1.0: must be at least 0",
        ),
        (
            ("diff", "flight.npz", "moved.npz", "--tolerance", "nan"),
            "--tolerance = nan: must be a finite number",
        ),
    ],
)
def test_wrong_input_is_one_line_and_exit_code_2(
    folder: Path, words: tuple[str, ...], line: str
) -> None:
    (folder / "no.npz").write_bytes(b"\x00" * 100)
    before = sorted(folder.rglob("*"))
    done = run(folder, *words)
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith(f"skyarm: {line}")
    assert len(done.err.splitlines()) == 1
    assert sorted(folder.rglob("*")) == before
