"""A long flight keeps its rows in a file: the same files and numbers as from memory,
and the rows so far at an end.
"""

from __future__ import annotations

import copy
import errno
import pickle
import re
import shutil
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.log import flight_log, formats, stored_arrays
from skyarm.log.flight_log import Log, rows_of
from skyarm.log.flight_summary import facts, summary
from skyarm.log.metrics import score
from skyarm.scenario.scenario_record import Change, Scenario
from skyarm.simulate import engine, loop
from support.cases import sampled, whole_text

WINDOW, PIECE = 37, 23
"""Rows in memory and rows written at a time: tiny, and no multiples of anything."""


def flight(
    name: str, duration: float, *changes: tuple[float, str, object]
) -> Callable[[], Scenario]:
    def scenario() -> Scenario:
        made = tuple(
            Change(at=at, path=path, value=value) for at, path, value in changes
        )
        return replace(skyarm.load_scenario(name, duration=duration), changes=made)

    return scenario


FLIGHTS = {
    "alone": flight("case3", 1.5),
    "noise": flight("hover_swing", 1.0),
    "contact": flight("press_and_hold", 3.0),
    "team": flight("two_hold_a_bar", 0.7),
    "phases": flight("pick_and_carry", 1.0),
    "early end": flight("case3", 3.0, (0.6, "plant.gravity", 60.0)),
    # another law logs arrays that the first has not; the change of the reference makes
    # its table anew
    "changes": flight(
        "case3",
        1.5,
        (0.5, "controller.law", "centroidal"),
        (0.903, "plant.gravity", 9.7),
        (1.2, "reference.base.radius", 0.25),
    ),
}


@pytest.fixture(autouse=True, scope="module")
def _programs() -> Iterator[None]:
    """Trace a scenario once, however many of its flight's rows are in memory."""
    programs: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "program_name", lambda *given: whole_text(given))
        patch.setattr(
            engine, "load_program", lambda name: programs.get(name) if name else None
        )
        patch.setattr(engine, "store_program", programs.__setitem__)
        patch.setattr(engine, "note_repeat", lambda *_: None)
        yield


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loop, "WINDOW", WINDOW)
    for module in (flight_log, formats, score):
        monkeypatch.setattr(module, "PIECE", PIECE)


def reads_a_file(log: Log) -> bool:
    return all("position" not in vars(each) for each in log.agents.values())


@pytest.mark.parametrize("name", sampled([*FLIGHTS], 4))
def test_files_and_facts_are_those_of_a_flight_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    scenario = FLIGHTS[name]()
    memory, file = skyarm.run(scenario), skyarm.run(scenario, to=tmp_path / "file.npz")
    assert reads_a_file(file)
    assert not reads_a_file(memory)
    with monkeypatch.context() as patched:  # in one piece
        patched.setattr(score, "PIECE", memory.time.size)
        expected = facts(memory)
    for suffix in ("npz", "csv", "mcap"):
        for log, stem in ((memory, "memory"), (file, "file")):
            skyarm.save_log(log, tmp_path / f"{stem}.{suffix}")
        assert (tmp_path / f"file.{suffix}").read_bytes() == (
            tmp_path / f"memory.{suffix}"
        ).read_bytes(), suffix
    assert str(facts(file)) == str(expected)
    assert str(summary(file, expected)) == str(summary(memory, expected))
    assert {path.name for path in tmp_path.iterdir()} == {
        f"{a}.{b}" for a in ("file", "memory") for b in ("npz", "csv", "mcap")
    }


def test_pieces_of_any_length_give_the_same_text(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, texts = skyarm.run(FLIGHTS["noise"]()), []
    holes = replace(
        log,
        wind_force=np.where(
            np.arange(log.time.size)[:, None] == 77, np.nan, log.wind_force
        ),
    )
    # numbers that JSON lacks are written by Python, in all rows
    for each in (log, holes):
        for piece in (1, 50, log.time.size, 5000):
            monkeypatch.setattr(formats, "PIECE", piece)
            texts.append(skyarm.save_log(each, tmp_path / "log.csv").read_bytes())
    assert texts == [texts[0]] * 4 + [texts[4]] * 4
    rows = np.genfromtxt(tmp_path / "log.csv", delimiter=",", skip_header=1)
    assert np.array_equal(rows[:, 1:4], log.position)
    assert np.isnan(rows).any(axis=1).nonzero()[0].tolist() == [77]


def test_a_log_in_a_file_is_used_as_any_other(tmp_path: Path) -> None:
    scenario = FLIGHTS["contact"]()
    memory, file = skyarm.run(scenario), skyarm.run(scenario, to=tmp_path / "log.npz")
    for log in (
        file,
        copy.deepcopy(file),
        pickle.loads(pickle.dumps(file)),
        skyarm.load_log(tmp_path / "log.npz"),
    ):
        assert list(log.arrays()) == list(memory.arrays())
        for name, array in memory.arrays().items():
            assert np.array_equal(log[name], array, equal_nan=True), name
        for name in ("contact_force", "tilts", "euler", "tip"):
            assert np.array_equal(getattr(log, name), getattr(memory, name)), name
    for begin, end in (
        (0, 1),
        (30, 75),
        (0, None),
        (36, 37),
        (37, 38),
        (590, None),
        (600, None),
        (-5, None),
    ):
        assert np.array_equal(
            rows_of(file, slice(begin, end)).position, memory.position[begin:end]
        )
    with pytest.raises(AttributeError, match="must be an array of a log"):
        _ = file.object_position
    assert file.contact_periods == memory.contact_periods
    assert file.units == memory.units
    assert np.array_equal(skyarm.replay(file).position, memory.position)


def test_arrays_that_a_part_lacks_are_nan_of_what_is_read_and_zero_of_what_acts() -> (
    None
):
    later = {
        "path_time": np.array([0.5, 0.6]),
        "readings.imu.rate": np.ones((2, 3)),
        "measured_joints": np.ones((2, 1)),
        "components.wind": np.ones((2, 2)),
    }
    whole = stored_arrays.join(
        [{"time": np.arange(3.0)}, {"time": np.array([3.0, 4.0]), **later}]
    )
    assert [*whole] == ["time", *later]
    assert whole["path_time"].tolist() == [0.0, 1.0, 2.0, 0.5, 0.6]
    assert np.array_equal(
        whole["readings.imu.rate"][:, 0], [np.nan] * 3 + [1.0] * 2, equal_nan=True
    )
    assert np.array_equal(
        whole["measured_joints"][:, 0], [np.nan] * 3 + [1.0] * 2, equal_nan=True
    )
    assert whole["components.wind"].tolist() == [[0.0, 0.0]] * 3 + [[1.0, 1.0]] * 2
    assert "position" not in whole


def test_a_short_flight_stays_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loop, "WINDOW", 300)
    assert not reads_a_file(skyarm.run(FLIGHTS["alone"](), to=tmp_path / "log.npz"))


def interrupt(done: int, _total: int) -> None:
    if done >= 201:
        raise KeyboardInterrupt


@pytest.mark.parametrize("name", ["alone", "changes"])
def test_an_interruption_leaves_the_rows_so_far_in_the_file(
    tmp_path: Path, name: str
) -> None:
    scenario = FLIGHTS[name]()
    with pytest.raises(KeyboardInterrupt):
        skyarm.run(scenario, interrupt, to=tmp_path / "log.npz")
    log, whole = skyarm.load_log(tmp_path / "log.npz"), skyarm.run(scenario)
    assert (log.status, log.info["end_time"], log.time.size) == ("running", 1.005, 201)
    for array in ("position", "rotor_commands", "tool_reference"):
        assert np.array_equal(log[array], whole[array][:201]), array


def fail(monkeypatch: pytest.MonkeyPatch, free: float) -> None:
    """A disk with some bytes free, of which nothing that is written here takes any."""
    monkeypatch.setattr(
        stored_arrays.shutil, "disk_usage", lambda _: SimpleNamespace(free=free)
    )


def test_a_disk_that_fills_ends_the_flight_with_the_rows_so_far(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = FLIGHTS["alone"]()
    whole = skyarm.run(scenario)
    size = WINDOW * sum(array[0].nbytes for array in whole.arrays().values())
    # of k windows that are there and the next, three times k + 2 windows must be free:
    # k = 3 is the first that has not
    fail(monkeypatch, 3.0 * 4.9 * size)
    log = skyarm.run(scenario, to=tmp_path / "log.npz")
    assert log.status == "running"
    assert log.info["cause"] == "log: must be writable (No space left on device)"
    assert log.info["end_time"] == log.time.size / 200.0 == 4 * WINDOW / 200.0
    again = skyarm.load_log(tmp_path / "log.npz")
    for name, array in whole.arrays().items():
        assert np.array_equal(again[name], array[: 4 * WINDOW]), name


def test_a_write_that_is_cut_short_is_no_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a quota, which no free space tells: what is in memory is in the log all the
    same.
    """
    file = stored_arrays.ArrayFile(tmp_path)
    first = file.store({"time": np.arange(3.0)})
    cut = SimpleNamespace(seek=file._file.seek, write=lambda content: len(content) - 1)
    with monkeypatch.context() as patched:
        patched.setattr(file, "_file", cut)
        with pytest.raises(OSError, match=re.escape("No space left")) as raised:
            file.store({"time": np.arange(4.0)})
    assert raised.value.errno == errno.ENOSPC
    assert first["time"].tolist() == [0.0, 1.0, 2.0]


def peak(scenario: Scenario, to: Path) -> float:
    """Largest size (MB) of all that Python and NumPy hold at a time in a flight, its
    files and its summary.
    """
    with suppress(KeyboardInterrupt):  # its program is made once
        skyarm.run(scenario, interrupt, to=to)
    tracemalloc.start()
    try:
        log = skyarm.run(scenario, to=to)
        skyarm.save_log(log, to.with_suffix(".csv"))
        summary(log, facts(log))
        return tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


def test_memory_hardly_grows_with_the_flight(tmp_path: Path) -> None:
    """The log has 0.13 MB a second; of arrays that are used whole there are a few at a
    time.
    """
    scenarios = [
        skyarm.load_scenario("case3", duration=duration) for duration in (3.0, 9.0)
    ]
    short, long = (peak(scenario, tmp_path / "log.npz") for scenario in scenarios)
    assert (long - short) / 6.0 < 0.06


COMMAND = """
import resource, subprocess, sys
command = [sys.executable, "-m", "skyarm", "run", "case3", *sys.argv[1:]]
subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
unit = 1024 if sys.platform == "linux" else 1024**2
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / unit)
"""


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="no getrusage")
def test_the_command_takes_little_memory_a_simulated_second(tmp_path: Path) -> None:
    """An hour in less than 300 MB: 0.63 MB a second were 2391."""
    durations, most = (30.0, 300.0, 1200.0), []
    for duration in durations:
        words = ["--duration", str(duration), "--out", str(tmp_path)]
        done = subprocess.run(
            [sys.executable, "-c", COMMAND, *words],
            capture_output=True,
            text=True,
            check=True,
        )
        most.append(float(done.stdout))
    # the first window of rows fills between the first two
    slopes = [
        (b - a) / (d - c)
        for (a, b), (c, d) in zip(pairwise(most), pairwise(durations), strict=True)
    ]
    assert slopes[0] < 0.2, most
    assert slopes[1] < 0.04, most
    assert most[1] + slopes[1] * 3300.0 < 300.0


LIMITED = """
import resource, runpy, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000_000, resource.RLIM_INFINITY))
sys.argv = ["skyarm", "run", "case3", "--duration", "600", "--log", sys.argv[1]]
runpy.run_module("skyarm", run_name="__main__")
"""


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="no limits of POSIX")
def test_a_file_that_may_not_grow_ends_the_command_with_the_rows_so_far(
    tmp_path: Path,
) -> None:
    file = tmp_path / "flight.npz"
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(file)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (3, "")
    assert re.match(
        r"case3: running, \d+ s of 600 s: log: must be writable \(.*\)\n", done.stdout
    )
    log = skyarm.load_log(file)
    assert log.time.size >= 20_000
    assert log.time.size == round(200 * log.info["end_time"])
    assert shutil.disk_usage(tmp_path).free > 0
