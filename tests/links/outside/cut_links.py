"""Cuts of the link in flight: 'skyarm fly' is killed or frozen at random times beside a real PX4, and the vehicle watched.

    python tests/links/outside/cut_links.py COUNT [INSTANCE]

The simulator with PX4 is one process, the law another, as users start them. Needs SKYARM_PX4, the path of PX4's program.
"""

from __future__ import annotations

import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from skyarm.links.autopilots.px4_ports import JOINT_PORT, ONBOARD_PORT
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

FROZEN = 0.15
"""Share of the cuts that freeze the process for two seconds in place of killing it."""


def simulate(folder: Path) -> None:
    """Fly the simulator's side in real time until a file ``stop`` is there; write the path and the wall's times."""
    session = open_session(load_scenario(str(folder / "sim.toml")))
    rows, stop = [], folder / "stop"
    while session.running and not (session.tick % 50 == 0 and stop.exists()):
        session.step()
        if session.tick % 5 == 0:
            rows.append((time.time(), *(float(c) for c in session.state.position)))
    ended = session.ended
    session.close()
    np.save(folder / "path.npy", np.array(rows))
    (folder / "status").write_text("hovers" if ended is None else f"{ended.status}: {ended.cause}")


def take_over(folder: Path, instance: int) -> subprocess.Popen[str]:
    """Start a law, and wait until it flies.

    Raises:
        RuntimeError: it does not.
    """
    law = subprocess.Popen(
        [
            sys.executable, "-m", "skyarm", "fly", "law.toml", "--link", f"mavlink://127.0.0.1:{ONBOARD_PORT + instance}",
            "--joints", f"udp://127.0.0.1:{JOINT_PORT + instance}", "--patience", "60", "--out", "out",
        ],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    assert law.stdout is not None
    said = []
    for line in law.stdout:
        said.append(line.strip())
        if "the law flies" in line:
            return law
    raise RuntimeError(f"the law did not fly: {said}")


def cut(law: subprocess.Popen[str], *, freeze: bool) -> int:
    """Kill the law, or freeze it for two seconds; its exit code."""
    if not freeze:
        law.kill()
        return law.wait()
    law.send_signal(signal.SIGSTOP)
    time.sleep(2.0)
    law.send_signal(signal.SIGCONT)
    return law.wait(20.0)


def cut_links(count: int, instance: int = 0, seed: int = 1, keep: str = "/tmp/flyw/cuts.npz") -> dict[str, object]:
    """Cut the link so many times in one flight; numbers of what the vehicle did.

    Returns:
        ``cuts``: how many. ``codes``: exit codes of frozen laws. ``status``: of the simulator's flight. ``excursion_m``,
        ``sink_m``: largest distance, and loss of height, from the place of a cut within three seconds. ``left``:
        processes that are still there.
    """
    rng, times, codes = random.Random(seed), [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        autopilot = f'autopilot = "px4"\noutside = true\ninstance = {instance}'
        (folder / "sim.toml").write_text(SCENARIO.format(name="sim", duration=30.0 * count, controller=autopilot))
        (folder / "law.toml").write_text(SCENARIO.format(name="law", duration=60.0, controller='preset = "paper_ct"'))
        simulator = subprocess.Popen([sys.executable, __file__, "--simulate", name])
        law = None
        try:
            wait_for_port(ONBOARD_PORT + instance, simulator)
            while len(times) < count and simulator.poll() is None:
                law = take_over(folder, instance)
                time.sleep(rng.uniform(0.2, 4.0))
                freeze = rng.random() < FROZEN
                times.append(time.time())
                code = cut(law, freeze=freeze)
                codes += [code] if freeze else []
                print(f"cut {len(times)}: {'frozen' if freeze else 'killed'}", flush=True)
                time.sleep(1.5)
            time.sleep(2.0)
        finally:
            if law is not None and law.poll() is None:
                law.kill()
            pids = descendants(simulator.pid)
            (folder / "stop").touch()
            simulator.wait(60.0)
        path = np.load(folder / "path.npy")
        status = (folder / "status").read_text()
    if keep:
        np.savez(keep, path=path, times=times)
    apart, sunk = [], []
    for at in times:
        after = path[(path[:, 0] >= at) & (path[:, 0] < at + 3.0), 1:]
        apart.append(np.linalg.norm(after - after[0], axis=1).max())
        sunk.append(after[0, 2] - after[:, 2].min())
    time.sleep(0.5)
    return {
        "cuts": len(times),
        "codes": codes,
        "status": status,
        "excursion_m": round(float(max(apart)), 3),
        "sink_m": round(float(max(sunk)), 3),
        "left": [name for pid in pids if (name := command_of(pid))],
    }


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


if __name__ == "__main__":
    if sys.argv[1] == "--simulate":
        simulate(Path(sys.argv[2]))
    else:
        print(cut_links(int(sys.argv[1]), *map(int, sys.argv[2:])))
