"""Logs are written where ``--log`` says, in the format of the suffix, one's own formats
included.
"""

from __future__ import annotations

import contextlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import skyarm
from support.commands import Outcome
from support.commands import skyarm as typed
from support.components import registry_kept

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_log_format.py"


def run(folder: Path, *words: str) -> Outcome:
    with contextlib.chdir(folder), registry_kept():
        return typed(*words)


def test_a_log_is_written_in_the_format_of_each_suffix(tmp_path: Path) -> None:
    plugin = shutil.copy(EXAMPLE, tmp_path)
    words = [
        "--duration",
        "0.5",
        "--log",
        "flight.csv",
        "--log",
        "deep/flight.npz",
        "--log",
        "flight.tsv",
    ]
    done = run(tmp_path, "run", "case3", "--plugin", plugin, *words)
    assert done.code == 0, done.err
    log = skyarm.load_log(tmp_path / "deep" / "flight.npz")
    assert log.time.size == 100
    assert np.array_equal(np.loadtxt(tmp_path / "flight.tsv")[:, 1:4], log.position)
    assert (
        (tmp_path / "flight.csv")
        .read_text()
        .splitlines()[0]
        .startswith("time [s],position_x [m]")
    )
    assert not (tmp_path / "out").exists()
    assert "flight.tsv" in done.out


def test_the_peak_thrust_is_that_of_the_rotor_that_worked_hardest(
    tmp_path: Path,
) -> None:
    done = run(
        tmp_path,
        "run",
        "case3_wind",
        "--duration",
        "0.5",
        "--log",
        "flight.npz",
        "--json",
    )
    found = json.loads(done.out)
    speeds = skyarm.load_log(tmp_path / "flight.npz").rotor_speeds.max(axis=0)
    limit = skyarm.load_vehicle("hummingbird_arm2_rotors").rotors[0].max_speed
    assert speeds.max() > 1.01 * speeds.min()
    assert found["peak_thrust"] == pytest.approx((speeds.max() / limit) ** 2, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("flight.tsv", "--log = 'flight.tsv': suffix 'tsv': did you mean 'csv'? "),
        ("flight.npy", "--log = 'flight.npy': suffix 'npy': did you mean 'npz'? "),
        ("flight", "--log = 'flight': suffix '': "),
    ],
)
def test_a_suffix_that_nobody_writes_is_one_line_before_the_flight(
    tmp_path: Path, name: str, words: str
) -> None:
    done = run(tmp_path, "run", "case3", "--log", name)
    assert (done.code, done.err) == (
        2,
        f"skyarm: {words}must be one of npz, csv, mcap\n",
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("second", ["a.npz", "./a.npz", "b/../a.npz", "link.npz"])
def test_a_file_that_is_named_twice_is_one_line_before_the_flight(
    tmp_path: Path, second: str
) -> None:
    (tmp_path / "b").mkdir()
    (tmp_path / "a.npz").write_bytes(b"of before")
    (tmp_path / "link.npz").symlink_to("a.npz")
    done = run(
        tmp_path, "run", "case3", "--duration", "0.1", "--log", "a.npz", "--log", second
    )
    words = f"skyarm: --log = {second!r}: must be another file than --log = 'a.npz'"
    assert (done.code, done.err.strip()) == (2, words)
    assert (tmp_path / "a.npz").read_bytes() == b"of before"
    assert {file.name for file in tmp_path.iterdir()} == {"a.npz", "b", "link.npz"}


def test_without_a_name_it_is_where_it_was(tmp_path: Path) -> None:
    done = run(tmp_path, "run", "case3", "--duration", "0.1", "--out", "here")
    assert done.code == 0, done.err
    assert {file.name for file in (tmp_path / "here").iterdir()} == {
        "case3.npz",
        "case3.csv",
    }


def test_a_file_that_is_a_folder_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "flight.csv").mkdir()
    done = run(tmp_path, "run", "case3", "--log", "flight.csv")
    assert done.code == 2
    assert (
        done.err.strip()
        == "skyarm: file = 'flight.csv': must be writable (there is a folder of this"
        " name)"
    )
