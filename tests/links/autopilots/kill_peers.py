"""Deaths of an autopilot's program: killed, frozen or asked to end at random instants
of a flight, and what is left.

    python tests/links/autopilots/kill_peers.py px4|ardupilot|betaflight COUNT [SEED]

Each flight is a process of its own, as users start them, with a hook that sends the
signal at a random instant: while the program starts, in take-off, at hand-over, in
flight. Needs the path of the program in SKYARM_PX4, SKYARM_ARDUPILOT or
SKYARM_BETAFLIGHT. Prints a line for each flight, and at last the counts.
"""

from __future__ import annotations

import collections
import contextlib
import dataclasses
import json
import os
import random
import runpy
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Timer
from typing import Any

import numpy as np

from skyarm.links.autopilots.betaflight_process import GUARDED_PORTS
from skyarm.links.autopilots.flight import PilotedSession
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

STAGES = {"start": 0.15, "take-off": 0.35, "hand-over": 0.25, "flight": 0.25}
"""Shares of the stages."""

PREPARED = {"px4": 19.0, "ardupilot": 52.0, "betaflight": 9.0}
"""s from power-on to hand-over, simulated."""

DURATION = 4.0
"""s of flight."""


@dataclass(frozen=True)
class Plan:
    """Signal, and when it is sent.

    Attributes:
        stage: of the flight.
        at: s, simulated, after power-on or hand-over; of a start and a hand-over 0.
        late: s by the wall clock from there.
    """

    how: str
    stage: str
    at: float
    late: float


def draw(name: str, rng: random.Random) -> Plan:
    """Plan by chance."""
    how = rng.choices(list(SIGNALS), list(SIGNALS.values()))[0]
    stage = rng.choices(list(STAGES), list(STAGES.values()))[0]
    at = rng.uniform(
        0.0, {"take-off": PREPARED[name], "flight": DURATION - 0.2}.get(stage, 0.0)
    )
    return Plan(
        how.name,
        stage,
        at,
        rng.uniform(0.0, {"start": 2.0, "hand-over": 0.5}.get(stage, 0.02)),
    )


def fly_with(plan: Plan) -> None:
    """Run the command line in this process, with a thread that signals the autopilot's
    program as planned.
    """
    take_off, step, sent = PilotedSession._take_off, PilotedSession.step, list[Timer]()

    def send(session: PilotedSession) -> None:
        child = session._link._child  # type: ignore[union-attr]
        sent.append(Timer(plan.late, os.kill, (child.pid, signal.Signals[plan.how])))
        sent[0].daemon = True
        sent[0].start()

    def watched_take_off(session: PilotedSession, *arguments: Any) -> bool:
        found = take_off(session, *arguments)
        if found and plan.stage == "hand-over":
            send(session)
        return found

    def watched_step(session: PilotedSession, *arguments: Any, **options: Any) -> bool:
        stage = "flight" if session._prepared else "take-off"
        if not sent and plan.stage == stage and session.time >= plan.at:
            send(session)
        return step(session, *arguments, **options)

    PilotedSession._take_off, PilotedSession.step = watched_take_off, watched_step  # type: ignore[method-assign]
    sys.argv = ["skyarm", "run", "flight.toml", "--out", "out"]
    runpy.run_module("skyarm", run_name="__main__")


def processes_of(folder: Path) -> dict[int, str]:
    """Command lines of the processes that were started with a folder for temporary
    files, by their numbers.
    """
    mark, found = f"TMPDIR={folder}\0".encode(), {}
    for place in Path("/proc").iterdir():
        if not place.name.isdigit() or int(place.name) == os.getpid():
            continue
        with contextlib.suppress(OSError):
            words = (place / "cmdline").read_bytes()
            if words and mark in (place / "environ").read_bytes() + b"\0":
                found[int(place.name)] = (
                    words.replace(b"\0", b" ").decode("utf-8", "replace").strip()
                )
    return found


def ports_of(name: str, words: str) -> list[tuple[socket.SocketKind, int]]:
    """Ports of a flight, by the name of the autopilot and the command line of its
    program.
    """
    if name == "px4":
        udp = [(socket.SOCK_DGRAM, port + INSTANCE) for port in (14540, 14580, 18570)]
        return [(socket.SOCK_STREAM, 4560 + INSTANCE), *udp]
    if name == "betaflight":
        return list(GUARDED_PORTS)
    said = words.split()
    udp = [
        (socket.SOCK_DGRAM, int(said[said.index(each) + 1]))
        for each in ("--sim-port-out", "--rc-in-port")
    ]
    return [
        *udp,
        (socket.SOCK_STREAM, int(said[said.index("--serial0") + 1].rsplit(":", 1)[1])),
    ]


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
    """Flight under an autopilot in a process of its own and a folder for everything
    that it leaves.
    """

    def __init__(self, name: str, folder: Path, plan: Plan) -> None:
        self.name, self.folder, self.temporary = name, folder, folder / "tmp"
        self.temporary.mkdir()
        options = f"instance = {INSTANCE}" if name == "px4" else ""
        text = SCENARIO.format(
            name=name, duration=DURATION, patience=PATIENCE, options=options
        )
        (folder / "flight.toml").write_text(text)
        self._program = os.environ[f"SKYARM_{name.upper()}"]
        self.process = subprocess.Popen(
            [sys.executable, __file__, "--fly", *map(str, dataclasses.astuple(plan))],
            cwd=folder,
            env={**os.environ, "TMPDIR": str(self.temporary)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def program(self) -> tuple[int, str]:
        """Number and command line of the autopilot's program, as soon as it runs; zero
        if the flight has ended.
        """
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

    def faults(
        self, said: str, ports: Sequence[tuple[socket.SocketKind, int]]
    ) -> list[str]:
        """What is not as it must be after a program that died."""
        until = time.monotonic() + 2.0
        while (left := processes_of(self.temporary)) and time.monotonic() < until:
            time.sleep(0.02)
        found = [f"process left: {words}" for words in left.values()]
        found += [
            f"left: {each.name}"
            for each in self.temporary.iterdir()
            if each.name.startswith("skyarm_")
        ]
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
        """How far the flight came: the simulated second, of the take-off or after
        hand-over.
        """
        log = load_log(self.folder / "out" / "flight.npz")
        if not log.time.size:
            return "start"
        handed = log.info["autopilot"]["prepared_s"]
        return f"{'flight' if handed else 'take-off'} {log.time[-1]:.2f} s"


def kill_once(name: str, plan: Plan) -> dict[str, object] | None:
    """Fly with a plan; what came of it, None for a flight that ended before the signal.

    A program that is asked to end may fly on, as may a frozen Betaflight, which our own
    guard freezes and wakes in a pause of ours such as the hand-over.
    """
    with tempfile.TemporaryDirectory() as folder:
        flight = Flight(name, Path(folder), plan)
        try:
            pid, words = flight.program()
            if plan.stage == "start":
                time.sleep(plan.late)
                pid, words = flight.program()
                with contextlib.suppress(ProcessLookupError):
                    os.kill(
                        pid or flight.process.pid,
                        signal.Signals[plan.how] if pid else 0,
                    )
            said = flight.finish(300.0)
            spared = plan.how == "SIGTERM" or (name, plan.how) == (
                "betaflight",
                "SIGSTOP",
            )
            if not flight.process.returncode and (not pid or spared):
                return None
            found: dict[str, object] = {
                **dataclasses.asdict(plan),
                "faults": flight.faults(said, ports_of(name, words)),
            }
            with contextlib.suppress(OSError, ValueError):
                found |= {
                    "ended": flight.stage(),
                    "cause": (
                        load_log(flight.folder / "out" / "flight.npz").info["cause"]
                    ),
                }
            return found
        finally:
            flight.close()


def kill_peers(name: str, count: int, seed: int = 1) -> dict[str, object]:
    """Signal the program of an autopilot in so many flights; counts of stages and
    causes, and what was wrong.
    """
    rng, done = random.Random(seed), list[dict[str, object]]()
    while len(done) < count:
        found = kill_once(name, draw(name, rng))
        if found is not None:
            done.append(found)
            print(json.dumps(found), flush=True)

    def counted(what: str) -> dict[str, int]:
        return dict(
            collections.Counter(
                str(each.get(what, "none")).partition(" (")[0] for each in done
            )
        )

    faults = [each for each in done if each["faults"]]
    return {
        "kills": len(done),
        **{what: counted(what) for what in ("how", "stage", "cause")},
        "faults": faults,
    }


if __name__ == "__main__":
    if sys.argv[1] == "--fly":
        fly_with(Plan(*sys.argv[2:4], *map(float, sys.argv[4:])))
    else:
        print(json.dumps(kill_peers(sys.argv[1], *map(int, sys.argv[2:])), indent=1))
