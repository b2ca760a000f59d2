"""Betaflight's link under fuzzed packets: motors over UDP, answers of MSP and of the
command line over TCP.
"""

from __future__ import annotations

import itertools
import random
import socket
import struct
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from skyarm.links.autopilots import betaflight, betaflight_process
from skyarm.links.autopilots.autopilot import BaseGoal, LinkError, SensedInstant
from skyarm.links.autopilots.betaflight import Betaflight, BetaflightLink
from skyarm.links.autopilots.betaflight_process import (
    LONGEST_ANSWER,
    VERSION_ANSWER,
    await_boot,
    set_up,
)
from skyarm.links.autopilots.betaflight_settings import MOTORS
from skyarm.links.autopilots.flight import planned_scenario
from skyarm.links.transcript import Tape
from skyarm.scenario.scenario_file import load_scenario

QUICKLY = [1000, pytest.param(20_000, marks=pytest.mark.thorough)]

ODD = (float("nan"), float("inf"), -float("inf"), 3e38, -1.0, 0.0, 999.9, 2000.1)

GOAL = BaseGoal((0.0, 0.0, 1.0), (0.0,) * 3, (0.0,) * 3, 0.0)


class Wire(Tape):
    """Tape of a link whose motors come from its socket, and whose states and channels
    go nowhere.
    """

    def __init__(self) -> None:
        super().__init__()
        self.plays = True

    def send(self, channel: str, data: bytes, send: Callable[[bytes], Any]) -> None:
        """Drop what is sent."""

    def receive(self, channel: str, receive: Callable[[], bytes]) -> bytes:
        """Read the socket."""
        return receive()


@pytest.fixture
def link() -> Iterator[BetaflightLink]:
    """Link without a program, with a port of its own, at rest."""
    made = BetaflightLink(
        Betaflight(patience=1e3),
        planned_scenario(load_scenario("case3", controller="betaflight")),
        Wire(),
    )
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made._motors:
        made._motors.bind(("127.0.0.1", 0))
        yield made


def motors(rng: random.Random) -> tuple[bytes, list[float] | None]:
    """Datagram at the port of the motors, and the signals that it means; None for one
    that is none.
    """
    kind, pulses = rng.randrange(6), [rng.uniform(1000.0, 2000.0) for _ in range(16)]
    if kind == 0:
        return rng.randbytes(rng.randrange(200)), None
    if kind == 1:
        return rng.randbytes(MOTORS.size), None
    if kind == 2:
        return MOTORS.pack(rng.choice((0, 3, 5, 16, 65535)), *pulses), None
    if kind == 3:
        pulses[rng.randrange(4)] = rng.choice(ODD)
    packet = struct.pack("<HH16f", 4, rng.randrange(65536), *pulses)
    if kind == 4 and rng.random() < 0.5:
        packet = (
            packet[: rng.randrange(MOTORS.size)]
            if rng.random() < 0.5
            else packet + rng.randbytes(rng.randint(1, 9))
        )
    if len(packet) != MOTORS.size or not all(
        abs(each) < float("inf") for each in pulses[:4]
    ):
        return packet, None
    return packet, [min(max((each - 1000.0) * 1e-3, 0.0), 1.0) for each in pulses[:4]]


@pytest.mark.parametrize("packets", QUICKLY)
def test_fuzzed_motors_end_as_one_line_or_are_passed_over(
    link: BetaflightLink, packets: int
) -> None:
    """The oracle: signals are those of the last whole message of the program, and
    change by nothing else.
    """
    rng, kept, refused, taken = random.Random(4), [0.0] * 4, 0, 0
    place = link._motors.getsockname()
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as odd,
    ):
        peer.sendto(MOTORS.pack(4, *(1000.0,) * 16), place)
        for step in range(packets):
            packet, means = motors(rng)
            if rng.random() < 0.2:
                odd.sendto(motors(rng)[0], place)
            peer.sendto(packet, place)
            readings = {
                "imu": (0.0,) * 6 + (9.8,),
                "pose": (step * 0.004, 0.0, 0.0, -5.0, 1.0, 0.0, 0.0, 0.0),
            }
            try:
                signals = link.exchange(SensedInstant(step * 0.004, readings, ()), GOAL)
            except LinkError as error:
                assert "\n" not in str(error)
                assert means is None
                assert len(packet) == MOTORS.size
                refused += 1
                continue
            kept = means or kept
            taken += means is not None
            assert list(signals) == pytest.approx(kept, abs=1e-6)
    assert min(refused, taken) > packets // 5
    assert link.facts["answered"] - taken in (0, 1)  # the very first one
    assert link.facts["bad_frames"] > packets // 5


def test_an_answer_of_a_busy_machine_is_waited_for(link: BetaflightLink) -> None:
    """Two states at once make Betaflight's clock leap, and it disarms."""

    class Slow:
        type, wait = socket.SOCK_DGRAM, 0.0

        def settimeout(self, seconds: float) -> None:
            self.wait = seconds

        def setblocking(self, blocks: bool) -> None:
            self.wait = 0.0

        def recvfrom(self, size: int) -> tuple[bytes, str]:
            if not self.wait:
                raise BlockingIOError
            if self.wait < 0.05:
                raise TimeoutError
            return MOTORS.pack(4, *(1000.0,) * 16), "peer"

    link._motors, link._sent = Slow(), time.monotonic()  # type: ignore[assignment]
    assert link._read()
    assert betaflight.ANSWER < 0.5  # after which Betaflight takes a state for its first


def answers(rng: random.Random) -> bytes:
    """Bytes of a console: text, escapes, prompts in the wrong place, floods, MSP with
    any length and checksum.
    """
    pieces = (
        b"\r\n# ",
        b"# ",
        b"\r\n#",
        b"\x1b[31m",
        b"###ERROR",
        b"Invalid",
        b"$M>",
        b"$M<\x00\x01\x01",
        b"$X>",
        VERSION_ANSWER,
        rng.randbytes(rng.randrange(64)),
        b"x" * rng.randrange(3000),
        b"$M>\xff\x01" + rng.randbytes(rng.randrange(300)),
    )
    return b"".join(rng.choice(pieces) for _ in range(rng.randrange(8))) + rng.choice(
        (b"", b"\r\n# ")
    )


class Console:
    """Socket of a console whose answers are made up; after the last one it is closed,
    silent or breaks off.
    """

    def __init__(self, said: Iterator[bytes], end: Exception | None) -> None:
        self._said, self._end = said, end

    def __enter__(self) -> Console:
        return self

    def __exit__(self, *_: object) -> None: ...

    def settimeout(self, seconds: float) -> None:
        """Take the time limit, which must be one."""
        assert seconds > 0.0

    def sendall(self, data: bytes) -> None:
        """Take a line; a console that has broken off does not."""
        if isinstance(self._end, BrokenPipeError):
            raise self._end

    def recv(self, size: int) -> bytes:
        """Next answer."""
        found = next(self._said, None)
        if found is None and self._end is not None:
            raise self._end
        return b"" if found is None else found[:size]


ENDS = (
    None,
    TimeoutError("timed out"),
    ConnectionResetError("reset by peer"),
    BrokenPipeError("broken pipe"),
)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each look at the clock takes a millisecond; nobody sleeps."""
    ticks = itertools.count()
    timed = SimpleNamespace(monotonic=lambda: next(ticks) * 1e-3, sleep=lambda _: None)
    monkeypatch.setattr(betaflight_process, "time", timed)


class Program:
    """Process that ends after some looks at it, with an exit code."""

    last_words = "words"

    def __init__(self, looks: int, code: int) -> None:
        self._looks, self.code = looks, code

    @property
    def running(self) -> bool:
        """True for some looks."""
        self._looks -= 1
        return self._looks >= 0

    def ending(self, title: str) -> str:
        """Last words."""
        return f" ({self.last_words})"


TASKS = {
    "set_up": lambda program: set_up(program, ["set a = 1"], 0.3),
    "await_boot": lambda program: await_boot(program, 0.3),
}


def ask(
    task: str,
    said: list[bytes],
    end: Exception | None,
    program: Program,
    monkeypatch: pytest.MonkeyPatch,
) -> str:
    """Cause for which a task fails at a console; empty if it does not."""
    console = Console(iter(said), end)
    monkeypatch.setattr(betaflight_process, "connect_console", lambda *_: console)
    try:
        TASKS[task](program)
    except LinkError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("packets", QUICKLY)
@pytest.mark.parametrize("task", TASKS)
def test_fuzzed_answers_of_the_console_end_as_one_line(
    task: str, packets: int, clock: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng, causes, count = random.Random(5), list[str](), 0
    while count < packets:
        said = [answers(rng) for _ in range(rng.randrange(1, 8))]
        count += len(said)
        program = Program(rng.randrange(100), rng.choice((0, 0, -9)))
        causes.append(ask(task, said, rng.choice(ENDS), program, monkeypatch))
    assert all(cause.isprintable() for cause in causes)
    assert causes.count("") > len(causes) // 50
    assert len({" ".join(cause.split()[:4]) for cause in causes}) > (
        4 if task == "set_up" else 1
    )


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("end", ENDS)
def test_a_console_that_breaks_off_is_one_line(
    task: str, end: Exception | None, clock: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert ask(task, [], end, Program(9, -9), monkeypatch)


def test_a_console_without_a_prompt_is_given_up_and_fills_no_memory(
    clock: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    flood = [b"x" * 4096] * 1000
    cause = ask("set_up", flood, None, Program(9, 0), monkeypatch)
    assert cause.endswith(f"no prompt behind {LONGEST_ANSWER + 4096} bytes")
    drip = [b"x"] * 100_000
    cause = ask("set_up", drip, None, Program(9, 0), monkeypatch)
    assert 100 < int(cause.split()[-2]) < 300


def test_settings_are_saved_only_if_the_program_ends_by_itself(
    clock: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    prompts = [b"\r\n# "] * 2
    assert ask("set_up", prompts, None, Program(9, 0), monkeypatch) == ""
    killed = ask("set_up", prompts, None, Program(9, -9), monkeypatch)
    assert killed == "Betaflight ended before its settings were saved (words)"
