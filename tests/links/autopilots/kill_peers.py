"""Deaths of an autopilot's program: killed, frozen or asked to end at random instants of a flight, and what is left.

    python tests/links/autopilots/kill_peers.py px4|ardupilot|betaflight COUNT [SEED]

Each flight is a process of its own, as users start it. Needs the path of the program in SKYARM_PX4, SKYARM_ARDUPILOT or
SKYARM_BETAFLIGHT. Prints a line for each flight, and at last the counts.
"""

from __future__ import annotations

import collections
import contextlib
import json
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from skyarm.links.autopilots.betaflight_process import GUARDED_PORTS
from skyarm.log.formats import load_log

SCENARIO = """
schema = 1
name = "flight"
duration = {duration}
[plant]
vehicle = "hummingbird_arm2_rotors"
[controller]
autopilot = "{name}"
patience = {patience}
{options}
[reference.base]
kind = "hover"
position = [0.0, 0.0, 1.5]
"""

PATIENCE = 3.0
"""s of silence, of which a frozen program is guilty."""

INSTANCE = 9
"""Of PX4, which others seldom take."""

SIGNALS = {signal.SIGKILL: 0.8, signal.SIGSTOP: 0.1, signal.SIGTERM: 0.1}
"""Shares of the signals."""

DURATION = {"px4": 6.0, "ardupilot": 12.0, "betaflight": 4.0}
"""s of flight, about a quarter of the time from power-on."""


def processes_of(folder: Path) -> dict[int, str]:
    """Command lines of the processes that were started with a folder for temporary files, by their numbers."""
    mark, found = f"TMPDIR={folder}\0".encode(), {}
    for place in Path("/proc").iterdir():
        if not place.name.isdigit() or int(place.name) == os.getpid():
            continue
        with contextlib.suppress(OSError):
            words = (place / "cmdline").read_bytes()
            if words and mark in (place / "environ").read_bytes() + b"\0":
                found[int(place.name)] = words.replace(b"\0", b" ").decode("utf-8", "replace").strip()
    return found


def ports_of(name: str, words: str) -> list[tuple[socket.SocketKind, int]]:
    """Ports of a flight, by the name of the autopilot and the command line of its program."""
    if name == "px4":
        udp = [(socket.SOCK_DGRAM, port + INSTANCE) for port in (14540, 14580, 18570)]
        return [(socket.SOCK_STREAM, 4560 + INSTANCE), *udp]
    if name == "betaflight":
        return list(GUARDED_PORTS)
    said = words.split()
    udp = [(socket.SOCK_DGRAM, int(said[said.index(each) + 1])) for each in ("--sim-port-out", "--rc-in-port")]
    return [*udp, (socket.SOCK_STREAM, int(said[said.index("--serial0") + 1].rsplit(":", 1)[1]))]


def taken(ports: Sequence[tuple[socket.SocketKind, int]]) -> list[int]:
    """Numbers of the ports that somebody holds."""
    found = []
    for kind, port in ports:
        with socket.socket(socket.AF_INET, kind) as probe:
            if kind == socket.SOCK_STREAM:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("0.0.0.0", port))
            except OSError:
                found.append(port)
    return found


class Flight:
    """Flight under an autopilot in a process of its own and a folder for everything that it leaves."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self.folder, self.temporary = name, folder, folder / "tmp"
        self.temporary.mkdir()
        options = f"instance = {INSTANCE}" if name == "px4" else ""
        text = SCENARIO.format(name=name, duration=DURATION[name], patience=PATIENCE, options=options)
        (folder / "flight.toml").write_text(text)
        self._program = os.environ[f"SKYARM_{name.upper()}"]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "skyarm", "run", "flight.toml", "--out", "out"], cwd=folder,
            env={**os.environ, "TMPDIR": str(self.temporary)}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True,
        )  # fmt: skip

    def program(self) -> tuple[int, str]:
        """Number and command line of the autopilot's program, as soon as it runs; zero if the flight has ended."""
        while self.process.poll() is None:
            for pid, words in processes_of(self.temporary).items():
                if words.startswith(self._program):
                    return pid, words
            time.sleep(0.005)
        return 0, ""

    def finish(self, seconds: float = 60.0) -> str:
        """What the flight has printed until its end, at most so long."""
        try:
            return self.process.communicate(timeout=seconds)[0]
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.communicate()[0] + "\nhangs"

    def close(self) -> None:
        """End what is left."""
        for pid in processes_of(self.temporary):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.process.wait()

    def faults(self, said: str, ports: Sequence[tuple[socket.SocketKind, int]]) -> list[str]:
        """What is not as it must be after a program that died."""
        until = time.monotonic() + 2.0
        while (left := processes_of(self.temporary)) and time.monotonic() < until:
            time.sleep(0.02)
        found = [f"process left: {words}" for words in left.values()]
        found += [f"left: {each.name}" for each in self.temporary.iterdir() if each.name.startswith("skyarm_")]
        found += [f"port {port} is taken" for port in taken(ports)]
        if self.process.returncode != 3:
            found.append(f"exit code {self.process.returncode}")
        if "Traceback" in said or "hangs" in said:
            found.append(said[-400:])
        try:
            log = load_log(self.folder / "out" / "flight.npz")
        except (OSError, ValueError) as error:
            return [*found, f"log: {error}"]
        cause = log.info["cause"]
        if log.status != "autopilot" or not cause or "\n" in cause or len(cause) > 600:
            found.append(f"{log.status}: {cause!r}")
        if cause not in said:
            found.append("the cause is not printed")
        if not (np.isfinite(log.position).all() and (np.diff(log.time) > 0.0).all()):
            found.append("the log is not in order")
        return found

    def stage(self) -> str:
        """How far the flight came: the simulated second, of the take-off or after hand-over."""
        log = load_log(self.folder / "out" / "flight.npz")
        if not log.time.size:
            return "start"
        handed = log.info["autopilot"]["prepared_s"]
        return f"{'flight' if handed else 'take-off'} {log.time[-1]:.2f} s"


def fly_through(name: str) -> float:
    """Seconds by the wall clock from the program's start to the end of a flight of which nobody kills the program.

    Raises:
        RuntimeError: it did not fly.
    """
    with tempfile.TemporaryDirectory() as folder:
        flight = Flight(name, Path(folder))
        try:
            flight.program()
            begun = time.monotonic()
            said = flight.finish(300.0)
            if flight.process.returncode:
                raise RuntimeError(said)
            return time.monotonic() - begun
        finally:
            flight.close()


def kill_once(name: str, how: signal.Signals, after: float) -> dict[str, object] | None:
    """Send a signal to the program some seconds after it was started; what came of it, None for a flight that was over.

    A program that is asked to end may fly on.
    """
    with tempfile.TemporaryDirectory() as folder:
        flight = Flight(name, Path(folder))
        try:
            flight.program()
            time.sleep(after)
            pid, words = flight.program()
            if not pid:
                flight.finish()
                return None
            try:
                os.kill(pid, how)
            except ProcessLookupError:
                return None
            at = time.monotonic()
            said = flight.finish(120.0)
            if how == signal.SIGTERM and flight.process.returncode == 0:
                return {"signal": how.name, "faults": [], "cause": "flew on", "stage": ""}
            took = time.monotonic() - at
            found: dict[str, object] = {"signal": how.name, "faults": flight.faults(said, ports_of(name, words))}
            with contextlib.suppress(OSError, ValueError):
                found["stage"] = flight.stage()
                found["cause"] = load_log(flight.folder / "out" / "flight.npz").info["cause"]
            return {**found, "after_s": round(after, 2), "took_s": round(took, 2)}
        finally:
            flight.close()


def kill_peers(name: str, count: int, seed: int = 1) -> dict[str, object]:
    """Kill the program of an autopilot in so many flights; counts of stages and causes, and what was wrong.

    Half of the instants are anywhere in take-off and flight, half in the last third, where the hand-over lies.
    """
    rng, whole, done = random.Random(seed), fly_through(name), list[dict[str, object]]()
    while len(done) < count:
        how = rng.choices(list(SIGNALS), list(SIGNALS.values()))[0]
        after = whole * rng.uniform(rng.choice((0.0, 0.67)), 1.0)
        found = kill_once(name, how, after)
        if found is not None:
            done.append(found)
            print(json.dumps(found), flush=True)
    words = collections.Counter(str(each.get("stage", "")).split()[0] if each.get("stage") else "" for each in done)
    causes = collections.Counter(str(each.get("cause", "none")).partition(" (")[0] for each in done)
    signals = collections.Counter(str(each["signal"]) for each in done)
    faults = [each for each in done if each["faults"]]
    counts = {"signals": dict(signals), "stages": dict(words), "causes": dict(causes)}
    return {"kills": len(done), **counts, "faults": faults}


if __name__ == "__main__":
    print(json.dumps(kill_peers(sys.argv[1], *map(int, sys.argv[2:])), indent=1))
