"""What a flight leaves while it goes on: a log that can be read, of what was flown so far."""

from __future__ import annotations

import dataclasses
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import skyarm
from logged_flights import begins, drawn
from skyarm.log import journal
from skyarm.log.contents import CutLogWarning
from skyarm.log.flight_log import rows_of
from skyarm.log.journal import Journal, journal_beside, partial_file
from skyarm.simulate.loop import run_in_python
from thorough import sampled


@pytest.fixture
def at_once(monkeypatch):
    """Journals that write whenever they are called."""
    monkeypatch.setattr(journal, "PAUSE", 0.0)
    monkeypatch.setattr(journal, "SHARE", float("inf"))


def offered(log):
    """Between of a flight that has flown a log."""
    return lambda first, stop: rows_of(log, slice(first, stop))


TURN = {"kind": "hover", "position": [0.0, 0.0, 1.2]}


@pytest.mark.parametrize("engine", ["machine code", "python", "mujoco", "changes"])
@pytest.mark.usefixtures("at_once")
def test_parts_of_a_flight_are_those_of_its_log(engine):
    plant = "mujoco" if engine == "mujoco" else "rigid_body"
    scenario = skyarm.load_scenario("case3_wind", plant=plant, duration=0.8)
    if engine == "changes":
        turn = skyarm.Change(at=0.3, path="reference.base", value=TURN)
        scenario = dataclasses.replace(scenario, changes=(turn,))
    fly = run_in_python if engine == "python" else skyarm.run
    parts = []

    def keep(done, between):
        begun = sum(part.time.size for part in parts)
        parts.append(between(begun, done))
        assert parts[-1].status == "running"

    whole = fly(scenario, keep=keep)
    assert parts
    begun = 0
    for part in parts:
        stop = begun + part.time.size
        assert begins(part, rows_of(whole, slice(begun, stop)))
        assert part.scenario == scenario
        begun = stop
    assert begun > 0.4 * whole.time.size  # stretches of 1, 8, 64 periods, then the rest at once
    assert begins(whole, fly(scenario))


@pytest.mark.usefixtures("at_once")
def test_the_journal_grows_and_is_read_back_while_it_is_open(tmp_path):
    log = drawn(skyarm.load_vehicle("hummingbird_arm2"), count=1000)
    held = Journal(tmp_path / "flight.partial")
    for done in (150, 450, 460, 460, 900):
        held(done, offered(log))
        assert held.kept == done
        with pytest.warns(CutLogWarning):
            read = skyarm.load_log(held.file)
        assert read.time.size == done
        assert begins(read, log)
        assert held.until == read.time[-1]
    held.close()
    held(1000, offered(log))
    assert held.kept == 900
    held.remove()
    assert list(tmp_path.iterdir()) == []


def test_a_short_flight_writes_nothing_on_its_way(tmp_path, monkeypatch):
    monkeypatch.setattr(journal, "perf_counter", lambda: 7.0)
    with journal_beside(tmp_path / "flight.npz", pytest.fail) as held:
        held(1000, pytest.fail)
    assert list(tmp_path.iterdir()) == []


def end(held, log, error):
    """A flight of which something is kept, and that then ends."""
    held(500, offered(log))
    raise error


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize(("error", "stays"), [(KeyboardInterrupt, True), (OSError, True), (ValueError, False)])
def test_what_ends_a_flight_says_whether_its_journal_stays(error, stays, tmp_path):
    log, said = drawn(skyarm.load_vehicle("hummingbird_arm2"), count=500), []
    with pytest.raises(error), journal_beside(tmp_path / "flight.npz", said.append) as held:
        end(held, log, error)
    file = tmp_path / "flight.partial"
    assert file.exists() == stays
    assert said == ([f"what was flown until t = 2.495 s is kept: {file}"] if stays else [])
    with journal_beside(tmp_path / "flight.npz", said.append) as held:
        assert file.exists() == stays  # until the next flight has something to write
        held(500, offered(log))
        assert file.exists()
    assert not file.exists()


@pytest.mark.usefixtures("at_once")
def test_a_disk_that_is_full_ends_the_journal_and_not_the_flight(tmp_path, monkeypatch):
    log = drawn(skyarm.load_vehicle("hummingbird_arm2"), count=500)
    held = Journal(tmp_path / "none" / "flight.partial")
    with pytest.warns(UserWarning, match=r"flight\.partial': is not kept up \(No such file or directory\)"):
        held(500, offered(log))
    held(500, offered(log))
    held.remove()


def test_the_pause_grows_with_what_a_write_costs(tmp_path, monkeypatch):
    clock = [100.0]
    monkeypatch.setattr(journal, "perf_counter", lambda: clock[0])
    held, calls = Journal(tmp_path / "flight.partial"), []

    def slow(first, stop):
        calls.append((clock[0], first, stop))
        clock[0] += 2.0
        return rows_of(log, slice(first, stop))

    log = drawn(skyarm.load_vehicle("hummingbird_arm2"), count=400)
    for _ in range(100):
        held(400, slow)
        clock[0] += 0.5
    held.remove()
    assert len(calls) <= 0.2 * 50 / 2.0 + 2
    assert calls[0][0] - 100.0 >= journal.PAUSE


@pytest.mark.skipif(os.name == "nt", reason="sends signals")
@pytest.mark.parametrize("sent", sampled([signal.SIGKILL, signal.SIGINT], 2), ids=["killed", "interrupted"])
def test_a_run_that_is_killed_leaves_a_log_that_can_be_read(sent, tmp_path):
    words = ["run", "case3", "--plant", "mujoco", "--duration", "300", "--log", "flight.csv"]
    file = tmp_path / "flight.partial"
    with subprocess.Popen(
        [sys.executable, "-m", "skyarm", *words],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as flying:
        begun = time.monotonic()
        while not (file.exists() and file.stat().st_size > 700_000) and time.monotonic() - begun < 60:
            time.sleep(0.02)
            assert flying.poll() is None
        flying.send_signal(sent)
        err = flying.communicate()[1]
    assert [path.name for path in tmp_path.iterdir()] == [file.name]
    with pytest.warns(CutLogWarning, match="cut at t = "):
        read = skyarm.load_log(file)
    assert read.status == "cut"
    assert read.scenario == skyarm.load_scenario("case3", plant="mujoco", duration=300)
    wanted = skyarm.run(skyarm.load_scenario("case3", plant="mujoco", duration=1))
    assert begins(rows_of(wanted, slice(0, min(read.time.size, 200))), read)
    assert read.time.size >= 200
    if sent == signal.SIGINT:
        said = re.search(r"what was flown until t = (\S+) s is kept: (.*)\n", err)
        assert said[2] == str(partial_file(Path("flight.csv")))
        assert round(read.time[-1] - float(said[1]), 6) in (0, 1)  # a second may just have been written


def test_what_keeps_a_flight_must_be_a_function():
    with pytest.raises(skyarm.ScenarioError, match=r"^keep = 3: must be a function of periods flown"):
        skyarm.run(skyarm.load_scenario("case1", duration=0.25), keep=3)


@pytest.mark.usefixtures("at_once")
def test_an_interrupt_right_behind_the_writing_is_told_the_whole_of_it(tmp_path):
    log = skyarm.run(skyarm.load_scenario("case3_wind", duration=0.5))
    said = []

    def interrupted():
        with journal_beside(tmp_path / "case3.npz", said.append) as kept:
            kept(1, offered(log))
            stream, flush = kept._stream, kept._stream.flush

            class Struck:
                def __getattr__(self, name):
                    return getattr(stream, name)

                def flush(self):
                    flush()
                    raise KeyboardInterrupt

            kept._stream = Struck()
            kept(log.time.size, offered(log))

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert said == [f"what was flown until t = {log.time[-1]:g} s is kept: {tmp_path / 'case3.partial'}"]
