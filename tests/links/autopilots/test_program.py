"""Programs of autopilots as child processes: found, started, and ended with us however
we end.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from px4_flights import make_program, scenario_of

from skyarm.links.autopilots.autopilot import LinkError
from skyarm.links.autopilots.program import Child, find_program
from skyarm.links.autopilots.px4 import PX4, find_etc
from skyarm.scenario.scenario_record import ScenarioError

FLIGHT = """
import sys
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate.session import open_session
open_session(load_scenario(sys.argv[1])).run()
"""


def alive(pid: int) -> bool:
    """True for a process that runs and is no zombie."""
    try:
        return (
            Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()[0]
            != "Z"
        )
    except OSError:
        return False


def wait_until_gone(pids: list[int]) -> list[int]:
    """Processes that still run after some seconds."""
    for _ in range(100):
        left = [pid for pid in pids if alive(pid)]
        if not left:
            break
        time.sleep(0.05)
    return left


def group_of(pid: int) -> list[int]:
    """Processes of the group of a process."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            if os.getpgid(int(place.name)) == pid:
                found.append(int(place.name))
        except (ProcessLookupError, PermissionError):
            pass
    return found


def test_a_child_is_the_program_itself_and_ends_with_its_guard(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    child = Child(
        ["/bin/sh", "-c", "echo $$ $NUMBER; sleep 100"], folder, {"NUMBER": "7"}
    )
    for _ in range(100):
        if child.output:
            break
        time.sleep(0.02)
    assert child.output == f"{child.pid} 7\n"
    assert child.running
    group = group_of(child.pid)
    assert len(group) >= 2  # program and guard
    child.close()
    child.close()
    assert wait_until_gone(group) == []
    assert not folder.exists()
    assert not child.running


def test_a_program_that_ends_says_its_last_words_without_colours(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    child = Child(
        ["/bin/sh", "-c", r"printf 'one\ntwo\n\033[31mthree\033[0m\nfour\n'"], folder
    )
    child._process.wait(10)
    assert not child.running
    assert child.last_words == "two | three | four"
    guards = group_of(child.pid)
    child.close()
    assert wait_until_gone(guards) == []


def test_last_words_name_a_line_once_and_the_last_ones_at_the_end(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    script = (
        r"echo 'Frame: HEXA'; for k in 1 2 3; do echo 'Loaded defaults'; done; echo"
        r" Killed; echo 'Loaded defaults'"
    )
    child = Child(["/bin/sh", "-c", script], folder)
    child._process.wait(10)
    assert child.last_words == "Frame: HEXA | Killed | Loaded defaults"
    child.close()


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("exit 3", " with code 3 and printed nothing: is it PX4's program?"),
        ("echo oh; exit 3", " (oh)"),
        ("echo oh; sleep 100", " (oh)"),
        ("sleep 100", ""),
    ],
)
def test_a_program_s_ending_is_its_words_or_its_code(
    tmp_path: Path, script: str, words: str
) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    child = Child(["/bin/sh", "-c", script], folder)
    try:
        if "exit" in script:
            child._process.wait(10)
        for _ in range(500):
            if "oh" not in script or child.output:
                break
            time.sleep(0.01)
        assert child.ending("PX4") == words
    finally:
        child.close()


def test_a_program_without_a_folder_does_not_start(tmp_path: Path) -> None:
    with pytest.raises((LinkError, FileNotFoundError)):
        Child(["/bin/true"], tmp_path / "absent")


def test_the_program_is_the_stated_one_or_that_of_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = make_program(tmp_path)
    monkeypatch.setenv("SKYARM_PX4", str(program))
    assert find_program(PX4()) == program
    monkeypatch.setenv("SKYARM_PX4", str(tmp_path / "absent"))
    assert find_program(PX4(program=str(program))) == program
    with pytest.raises(
        ScenarioError,
        match=r"SKYARM_PX4 = .*: must be an executable file, PX4's program",
    ):
        find_program(PX4())
    monkeypatch.delenv("SKYARM_PX4")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert find_program(PX4(), "px4") == program
    monkeypatch.setenv("PATH", "")
    with pytest.raises(ScenarioError, match="environment variable SKYARM_PX4"):
        find_program(PX4(), "px4")


def test_a_program_that_path_names_relatively_is_found_from_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_program(tmp_path)
    monkeypatch.delenv("SKYARM_PX4", raising=False)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", ".")
    assert find_program(PX4(), "px4").is_absolute()


def test_the_folder_etc_is_found_through_a_link(tmp_path: Path) -> None:
    program = make_program(tmp_path / "build")
    (tmp_path / "px4").symlink_to(program)
    assert find_etc(tmp_path / "px4") == tmp_path / "build" / "etc"


def test_a_child_gets_none_of_our_variables_of_a_beginning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PX4_PARAM_OF_MINE", "1")
    child = Child(
        ["/bin/sh", "-c", "env"],
        Path(tempfile.mkdtemp()),
        {"PX4_SIM_MODEL": "x"},
        without="PX4_",
    )
    try:
        for _ in range(100):
            if not child.running:
                break
            time.sleep(0.02)
        found = [line for line in child.output.splitlines() if line.startswith("PX4_")]
    finally:
        child.close()
    assert found == ["PX4_SIM_MODEL=x"]


def test_of_much_output_the_end_is_read(tmp_path: Path) -> None:
    child = Child(
        ["/bin/sh", "-c", "head -c 1000000 /dev/zero | tr '\\0' x; echo; echo bye"],
        Path(tempfile.mkdtemp()),
    )
    try:
        for _ in range(200):
            if not child.running:
                break
            time.sleep(0.02)
        assert len(child.output) == 1 << 16
        assert child.last_words.endswith("bye")
    finally:
        child.close()


@pytest.mark.skipif(sys.platform != "linux", reason="reads processes from /proc")
@pytest.mark.parametrize(
    "number",
    [
        signal.SIGKILL,
        *(
            pytest.param(each, marks=pytest.mark.thorough)
            for each in (signal.SIGINT, signal.SIGTERM)
        ),
    ],
)
def test_no_process_outlives_us(tmp_path: Path, number: int) -> None:
    program = make_program(tmp_path)
    pids = tmp_path / "pids"
    program.write_text(
        program.read_text("utf-8").replace("exec", f"echo $$ >> {pids}\nexec"), "utf-8"
    )
    scenario_of(tmp_path, duration=300.0)
    environment = {
        **os.environ,
        "PYTHONPATH": ":".join(p for p in sys.path if p),
        "TMPDIR": str(tmp_path),
    }
    environment["SKYARM_PX4"] = str(program)
    flight = subprocess.Popen(
        [sys.executable, "-c", FLIGHT, str(tmp_path / "swing.toml")],
        env=environment,
        stderr=subprocess.DEVNULL,
    )
    try:
        for _ in range(400):
            if pids.exists() and pids.read_text("ascii").strip():
                break
            time.sleep(0.05)
        time.sleep(0.5)
        group = group_of(int(pids.read_text("ascii")))
        assert len(group) >= 2
        flight.send_signal(number)
        flight.wait(20)
    finally:
        flight.kill()
        flight.wait()
    assert wait_until_gone(group) == []
    for _ in range(50):
        if not list(tmp_path.glob("skyarm_px4_*")):
            break
        time.sleep(0.05)
    assert not list(tmp_path.glob("skyarm_px4_*"))
