"""``skyarm studio`` from the shell: what it refuses, in one line, and how it ends."""

import http.client
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

import skyarm
from skyarm.view.studio.fleet import open_fleet
from support.commands import skyarm as typed

FLIGHTS = Path(__file__).resolve().parents[2] / "data" / "flights"

STUDIO = [sys.executable, "-m", "skyarm", "studio", "--no-browser"]


def refused(*words: str) -> str:
    """The one line of a command that is refused."""
    done = typed("studio", "--no-browser", *words)
    assert done.code == 2, done.err
    assert done.out == ""
    (line,) = done.err.splitlines()
    return line


def test_a_taken_port_is_said_in_one_line() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        line = refused("case1", "--port", str(taken.getsockname()[1]))
    assert "must be free (address already in use)" in line


def test_a_missing_extra_is_named(tmp_path: Path) -> None:
    (tmp_path / "viser.py").write_text("raise ImportError('no viser here')\n")
    words, hiding = (
        [*STUDIO, "case1", "--port", "0"],
        {
            **os.environ,
            "PYTHONPATH": str(tmp_path),
        },
    )
    done = subprocess.run(
        words, capture_output=True, text=True, timeout=60, env=hiding, check=False
    )
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert "needs the extra 'studio'" in line


def test_what_cannot_be_flown_is_said_before_a_page_opens() -> None:
    assert "did you mean 'paper_ct'" in refused("--laws", "papr_ct", "--port", "0")
    assert "--port = 70000: must be from 0 to 65535" in refused("--port", "70000")


def test_what_cannot_be_replayed_is_one_line() -> None:
    nano = str(next((FLIGHTS / "nanobench").glob("*.csv")))
    flight = [nano, "--vehicle", "hummingbird", "--port", "0"]
    assert "--laws: must be left out with --vehicle" in refused(
        *flight, "--laws", "paper_ct"
    )
    assert "--horizon: must be left out without --vehicle" in refused(
        "case1", "--horizon", "1", "--port", "0"
    )
    assert "--horizon = 9.0: must be from 0.05 to 5" in refused(
        *flight, "--horizon", "9"
    )
    assert "--delay = -1.0: must be from 0.0 to 1" in refused(*flight, "--delay", "-1")
    crazyflie = str(FLIGHTS / "crazyflie" / "log15_from_20_to_23_s")
    line = refused(crazyflie, "--vehicle", "crazyflie_arm1", "--port", "0")
    assert (
        "log15_from_20_to_23_s: must hold position and quaternion and joint_positions;"
        " there is" in line
    )


@pytest.mark.parametrize(
    ("source", "laws", "said"),
    [
        ("nothing", [], "scenario = 'nothing'"),
        ("case1", ["indi"] * 4, "at most 3 laws"),
        ("case1", ["x"], "must be a preset, a law or LAW_tuned"),
    ],
)
def test_a_scenario_and_its_laws_are_looked_at_first(
    source: str, laws: list[str], said: str
) -> None:
    with pytest.raises(skyarm.ScenarioError, match=said):
        open_fleet(source, laws)


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for a child there")
@pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.thorough)]
)
def test_the_page_opens_quickly_and_a_signal_ends_it_cleanly(
    number: signal.Signals, tmp_path: Path
) -> None:
    command = [*STUDIO, "case1", "--port", "0", "--out", str(tmp_path / "out")]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, bufsize=1
    ) as child:
        assert child.stdout is not None
        said = child.stdout.readline().strip()
        assert said.startswith("studio: http://127.0.0.1:")
        address, token = said.removeprefix("studio: http://").split("/?token=")
        client = http.client.HTTPConnection(address, timeout=20)
        client.request("GET", f"/?token={token}")
        assert client.getresponse().status == 200
        client.close()
        time.sleep(0.3)
        child.send_signal(number)
        out, errors = child.communicate(timeout=30)
    assert (child.returncode, out.strip(), errors) == (0, "studio: closed", "")
    assert not (tmp_path / "out").exists()
