"""A law in one process, simulator and PX4 in another, as users start them: how well it flies, and how late it is.

    python tests/links/outside/beside_px4.py [LAW ...] [--instance N]

For each law: the tip's error on a slow circle, by the simulator's truth and by PX4's estimate, and that of the
simulator's own flight of the same law, with the measured delay in its delays. Needs SKYARM_PX4, the path of PX4's
program. The satellite receiver is as good as a camera system (3 mm), so that the error is the law's.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

import skyarm
from skyarm.links.autopilots.px4_ports import JOINT_PORT, ONBOARD_PORT
from skyarm.log.formats import load_log
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate.session import open_session

SCENARIO = """
schema = 1
name = "{name}"
duration = {duration}
[rates]
physics = 1000
control = 250
reference = 50
[plant]
vehicle = "hummingbird_arm2_rotors"
[model]
vehicle = "hummingbird_arm2"
[controller]
{controller}
[sensors.gnss]
kind = "gnss"
frequency = 10
position = {{ sigma = 0.003 }}
velocity = {{ sigma = 0.01 }}
[reference.base]
kind = "circle"
radius = 0.3
frequency_hz = 0.1
center = [0.0, 0.0, 1.0]
start = 0.5
[[reference.joints]]
kind = "sine"
amplitude = 0.3
frequency_hz = 0.5
[[reference.joints]]
kind = "sine"
amplitude = 0.2
frequency_hz = 0.5
"""


AUTOPILOT = """autopilot = "px4"
outside = true
instance = {instance}
parameters = {{ EKF2_HGT_REF = 1, EKF2_BARO_CTRL = 0 }}"""
"""Table of the simulator's side: height by the satellite receiver."""


def simulate(folder: Path) -> None:
    """Fly the simulator's side in real time until a file ``stop`` is there; write path, times and status."""
    session = open_session(load_scenario(str(folder / "sim.toml")))
    rows, stop = [], folder / "stop"
    while session.running and not (session.tick % 50 == 0 and stop.exists()):
        session.step()
        if session.tick % 5 == 0:
            rows.append((time.time(), *(float(c) for c in session.state.position)))
    ended = session.ended
    log = session.log
    session.close()
    log.save_npz(folder / "sim.npz")
    np.save(folder / "path.npy", np.array(rows))
    (folder / "status").write_text("hovers" if ended is None else f"{ended.status}: {ended.cause}")


@contextmanager
def simulator(folder: Path, instance: int, seconds: float) -> Iterator[subprocess.Popen[bytes]]:
    """Simulator and PX4 in a process of their own, for at most so long; they are ended at the end of the block."""
    table = AUTOPILOT.format(instance=instance)
    (folder / "sim.toml").write_text(SCENARIO.format(name="sim", duration=seconds, controller=table))
    process = subprocess.Popen([sys.executable, __file__, "--simulate", str(folder)])
    try:
        wait_for_port(ONBOARD_PORT + instance, process)
        yield process
    finally:
        (folder / "stop").touch()
        try:
            process.wait(90.0)
        finally:
            process.kill()


def start_law(folder: Path, instance: int, law: str, seconds: float) -> subprocess.Popen[str]:
    """Start 'skyarm fly', whose log will be in the folder ``out``."""
    (folder / "law.toml").write_text(SCENARIO.format(name="law", duration=seconds, controller=law))
    return subprocess.Popen(
        [
            sys.executable, "-m", "skyarm", "fly", "law.toml", "--patience", "60", "--out", "out",
            "--link", f"mavlink://127.0.0.1:{ONBOARD_PORT + instance}",
            "--joints", f"udp://127.0.0.1:{JOINT_PORT + instance}",
        ],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip


def wait_for_port(port: int, simulator: subprocess.Popen[bytes]) -> None:
    """Wait until the simulator has taken PX4's onboard port: a law that is there first would keep it."""
    until = time.monotonic() + 60.0
    while simulator.poll() is None and time.monotonic() < until:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                return
        time.sleep(0.02)
    raise RuntimeError("the simulator did not start")


def command_of(pid: int) -> str:
    """Command line of a process that runs; empty for one that has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode("utf-8", "replace").strip()
    except OSError:
        return ""


def descendants(pid: int) -> list[int]:
    """Numbers of the processes that a process has started, and theirs."""
    children = Path(f"/proc/{pid}/task/{pid}/children")
    found = []
    for child in children.read_text().split() if children.exists() else ():
        found += [int(child), *descendants(int(child))]
    return found


def fly_beside(law: str, instance: int = 0, seconds: float = 24.0) -> dict[str, object]:
    """Errors of a law that flies a circle outside, mm after 4 s, and its delays, ms.

    Args:
        law: lines of the table ``[controller]``.
        instance: of PX4.
        seconds: of flight.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with simulator(folder, instance, 4.0 * seconds):
            said = start_law(folder, instance, law, seconds).communicate(timeout=10.0 * seconds)[0]
        logs = [folder / "out" / "law.npz", folder / "sim.npz"]
        if not logs[0].exists():
            raise RuntimeError(said)
        flown, truth = map(load_log, logs)
        own = load_scenario(str(folder / "law.toml"))
        outside, inside = flown.info["outside"], truth.info["autopilot"]
        late = flown.time + outside["start_s"] - inside["prepared_s"]
        delay = inside["joints"]["age_p50_s"]
        delayed = own.with_words(delays=dataclasses.replace(own.delays, command=round(delay, 3)))
        found: dict[str, object] = {"status": flown.status, "law": flown.info["controller"]}
        late_part = flown.time > 4.0
        turn, start = outside["turn"], np.array(outside["start"])
        R = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
        begun = np.array([np.interp(late[0], truth.time, column) for column in truth.position.T])
        for what in ("tool", "position"):
            there = np.stack([np.interp(late, truth.time, column) for column in getattr(truth, what).T], axis=1)
            wanted = getattr(flown, f"{what}_reference")
            for kind, place in (("truth", (there - begun) @ R.T + start), ("estimate", getattr(flown, what))):
                found[f"{what}_{kind}_mm"] = mean_error(place[late_part], wanted[late_part])
        for words, scenario in (("own", own), ("own_delayed", delayed)):
            log = skyarm.run(scenario)
            part = log.time > 4.0
            found[f"tool_{words}_mm"] = mean_error(log.tool[part], log.tool_reference[part])
        found |= {"delay_p50_ms": 1e3 * delay, "delay_p99_ms": 1e3 * inside["joints"]["age_p99_s"]}
        return found | {name: outside[name] for name in ("computing", "round_trip", "periods", "missed", "lost_frames")}


def mean_error(place: np.ndarray, wanted: np.ndarray) -> float:
    """Mean distance, mm."""
    return round(1e3 * float(np.linalg.norm(place - wanted, axis=1).mean()), 1)


if __name__ == "__main__":
    words = argparse.ArgumentParser()
    words.add_argument("laws", nargs="*", default=['preset = "paper_ct"', 'law = "centroidal"'])
    words.add_argument("--instance", type=int, default=0)
    words.add_argument("--simulate", type=Path)
    given = words.parse_args()
    if given.simulate:
        simulate(given.simulate)
    else:
        for each in given.laws:
            print(json.dumps(fly_beside(each, given.instance), indent=1), flush=True)
