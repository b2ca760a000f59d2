"""Command ``skyarm fly``: words, results and exit codes, beside a stand-in for an
autopilot.
"""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from links.outside.stand_in import StandIn, free_port
from links.outside.test_offboard import SCENARIO
from skyarm.links.outside import offboard
from skyarm.log.formats import load_log
from support.commands import skyarm


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(offboard, "LEAD", 0.1)
    (tmp_path / "step.toml").write_text(SCENARIO.format(duration=0.8))
    return tmp_path


def fly(*more, **faults):
    port = free_port()
    with StandIn(port, **{"hover": 0.37} | faults) as peer:
        ended = skyarm(
            "fly",
            "step.toml",
            "--link",
            f"mavlink://127.0.0.1:{port}",
            "--rate-bandwidth",
            "18,18,18",
            "--patience",
            "5",
            *more,
        )
    return ended, peer


def test_a_flight_is_logged_and_summed_up(folder):
    ended, peer = fly("--json")
    assert ended.code == 0, ended.err
    found = json.loads(ended.out)
    assert found["status"] == "completed"
    assert found["outside"]["periods"] > 100
    assert peer.modes == ["offboard", "hold"]
    log = load_log(found["logs"][0])
    assert (folder / "out" / "fly" / "step.csv").exists()
    assert log.time == pytest.approx(np.arange(200) / 250.0, abs=0.03)
    assert log.info["outside"]["autopilot"] == "PX4"
    assert log.rotor_commands.shape == (len(log.time), 4)


def test_what_is_printed_names_the_times():
    ended, _ = fly("--duration", "0.3")
    for words in (
        "PX4 is heard",
        "the law flies",
        "step: completed",
        "from an estimate's arrival to its set point: median",
        "periods,",
        "log: out/fly/step.npz",
    ):
        assert words in ended.out


def test_a_flight_that_ends_early_keeps_its_log_and_says_so():
    ended, _ = fly("--duration", "3", silent_at=0.5)
    assert ended.code == 3
    assert "link_lost" in ended.out
    assert Path("out/fly/step.npz").exists()


def test_the_local_frame_can_be_the_world():
    """The vehicle hovers far from the scenario's place: the leash ends that at once."""
    ended, peer = fly("--world", "local")
    assert ended.code == 3
    assert "m from its reference" in ended.out
    assert peer.modes == ["offboard", "hold"]


def test_a_signal_hands_back_and_keeps_the_log(folder):
    """The command itself, by its entry point: what ends it is no KeyboardInterrupt
    there.
    """
    port = free_port()
    words = (
        "fly",
        "step.toml",
        "--link",
        f"mavlink://127.0.0.1:{port}",
        "--rate-bandwidth",
        "18,18,18",
    )
    with StandIn(port, hover=0.37) as peer:
        command = [sys.executable, "-m", "skyarm", *words, "--duration", "60"]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as child:
            until = time.monotonic() + 60.0
            while (
                "offboard" not in peer.modes
                and time.monotonic() < until
                and child.poll() is None
            ):
                time.sleep(0.05)
            time.sleep(0.5)
            child.send_signal(signal.SIGINT)
            out, err = child.communicate(timeout=60.0)
    assert child.returncode == 130, err
    assert "stopped" in out
    assert peer.modes == ["offboard", "hold"]
    assert load_log(folder / "out" / "fly" / "step.npz").status == "stopped"


def test_an_earlier_flight_is_kept():
    Path("out/fly").mkdir(parents=True)
    Path("out/fly/step.npz").write_bytes(b"an earlier flight")
    ended, _ = fly("--duration", "0.3")
    assert ended.code == 0, ended.err
    assert Path("out/fly/step_1.npz").read_bytes() == b"an earlier flight"
    assert load_log("out/fly/step.npz").status == "completed"


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--link", "udp:1"), "--link = 'udp:1': must be mavlink://HOST:PORT"),
        (("--link", "mavlink://127.0.0.1:1x"), "must be mavlink://HOST:PORT"),
        (
            ("--link", "mavlink://127.0.0.1:9", "--world", "there"),
            "--world = 'there': must be here or local",
        ),
        (
            ("--link", "mavlink://127.0.0.1:9", "--rate-bandwidth", "18"),
            "--rate-bandwidth = '18': must be three numbers",
        ),
        (
            ("--link", "mavlink://127.0.0.1:9", "--rate-bandwidth", "18,nan,1"),
            "must be three numbers",
        ),
        (("--link", "mavlink://127.0.0.1:9", "--leash", "-1"), "leash = -1.0"),
        (
            ("--link", "mavlink://127.0.0.1:9", "--leash", "nan"),
            "leash = nan: must be a finite number",
        ),
        (
            ("--link", "mavlink://127.0.0.1:9", "--patience", "inf"),
            "patience = inf: must be a finite number",
        ),
        (("--link", "mavlink://127.0.0.1:9", "--laws", "px4"), "must be a law"),
    ],
)
def test_wrong_words_are_one_line(words, line):
    ended = skyarm("fly", "step.toml", *words)
    assert ended.code == 2
    assert line in ended.err
    assert ended.err.count("\n") == 1


def test_an_arm_needs_its_port():
    ended = skyarm("fly", "case3", "--link", f"mavlink://127.0.0.1:{free_port()}")
    assert ended.code == 2
    assert (
        "--joints: is missing, must be given for the 2 joints of 'hummingbird_arm2'"
        in ended.err
    )


def test_nobody_there_is_one_line_and_no_folder():
    ended = skyarm(
        "fly",
        "step.toml",
        "--link",
        f"mavlink://127.0.0.1:{free_port()}",
        "--patience",
        "0.3",
    )
    assert ended.code == 2
    assert "no autopilot of PX4 or ArduPilot was heard within 0.3 s" in ended.err
    assert not Path("out").exists()
