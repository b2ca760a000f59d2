"""Flights are interrupted at random times: no thread flies on, no array changes, the
next flight is right.

Shown by this attack on the thread pool of one call that it replaced: 1 in 5 interrupts
left threads in machine code.
"""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from skyarm.compile.llvm import kernel as native

PROGRAM = Path(__file__).with_name("interrupted_flights.py")
LEAKED = 0.003
"""s of processor time that idle threads do not take while they are listened to."""


class Flights:
    """A process that flies, and what it says."""

    def __init__(
        self,
        cache,
        seed,
        count,
        *,
        lanes=2048,
        steps=2000,
        listen=True,
        threads=0,
        endless=False,
    ):
        source = os.environ.get(
            "SKYARM_ATTACKED", str(Path(native.__file__).parents[2])
        )
        environment = {**os.environ, "PYTHONPATH": source, "SKYARM_CACHE": str(cache)}
        numbers = [seed, count, lanes, steps, int(listen), threads, int(endless)]
        self.process = subprocess.Popen(
            [sys.executable, str(PROGRAM), *map(str, numbers)],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        self.said = b""
        self.seconds = self.heard()["seconds"]

    def heard(self, patience=60.0):
        """The next line; None if it does not come."""
        while b"\n" not in self.said:
            if not select.select([self.process.stdout], [], [], patience)[0]:
                return None
            more = os.read(self.process.stdout.fileno(), 65536)
            if not more:
                raise EOFError
            self.said += more
        line, self.said = self.said.split(b"\n", 1)
        return json.loads(line)

    def interrupted(self, delay, number):
        """Send a signal after ``delay`` s; returns what was found, with the s until it
        was answered.
        """
        assert "ready" in self.heard()
        time.sleep(delay)
        sent = time.monotonic()
        self.process.send_signal(number)
        found = self.heard(10.0)
        if found is None:
            # Python drops what is raised in a callback of its garbage collector: once
            # more
            self.process.send_signal(number)
            found = self.heard()
        if found is None:
            self.process.kill()
            raise EOFError
        return {**found, "latency": found["caught"] - sent}

    def ended(self):
        """What it printed on its way out, and its exit status."""
        _, errors = self.process.communicate(timeout=60)
        return errors.decode(), self.process.returncode


def attack(cache, rng, processes, count, **options):
    """What was found after each interrupt, and how each process that broke ended."""
    found, broken = [], []
    for _ in range(processes):
        flights = Flights(cache, int(rng.integers(1000)), count, **options)
        try:
            for _ in range(count):
                # half of them while threads are set to work
                delay = rng.uniform(
                    0.0, flights.seconds if rng.random() < 0.5 else 0.004
                )
                found.append(
                    flights.interrupted(
                        delay, rng.choice([signal.SIGINT, signal.SIGTERM])
                    )
                )
            assert flights.heard() == {"done": True}
        except EOFError:
            pass
        errors, status = flights.ended()
        if status:
            broken.append((status, errors[-300:]))
    return found, broken


def told(found, broken):
    """The attack in one line."""
    inside = [each for each in found if each["inside"]]
    latency = np.array([each["latency"] for each in inside])
    counts = {
        "interrupts": len(found),
        "inside": len(inside),
        "leaked": sum(each["work"] > LEAKED for each in found),
        "changed": sum(each["changed"] > 0 for each in found),
        "touched": sum(each["touched"] for each in found),
        "wrong": sum(each["wrong"] for each in found),
        "broken": len(broken),
    }
    return (
        counts,
        (
            f"{counts}, latency p99 {np.percentile(latency, 99):.3f} s, max"
            f" {latency.max():.3f} s {broken}"
        ),
    )


def require_nothing(found, broken):
    counts, line = told(found, broken)
    print(line)
    assert counts["inside"] > 0.3 * counts["interrupts"], line
    assert {name for name, count in counts.items() if count} == {
        "interrupts",
        "inside",
    }, line


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_interrupts_at_random_times_leave_nothing_behind(tmp_path):
    require_nothing(*attack(tmp_path, np.random.default_rng(1), 1, 12))


@pytest.mark.attack
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_thousand_interrupts_leave_nothing_behind(tmp_path):
    found, broken = attack(tmp_path, np.random.default_rng(2), 20, 50)
    assert len(found) == 1000, broken
    require_nothing(found, broken)


def answered(cache, rng, count, **options):
    """s from a signal to its exception, in flights that are far from their end."""
    flights = Flights(cache, 3, count, listen=False, **options)
    found = [
        flights.interrupted(rng.uniform(0.0, 0.5), signal.SIGINT) for _ in range(count)
    ]
    flights.process.kill()
    flights.ended()
    return np.array([each["latency"] for each in found if each["inside"]])


@pytest.mark.attack
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(
    ("lanes", "steps", "threads"),
    [(20_000, 20_000, 1), (2**18, 2000, 2), (1, 10_000_000, 1)],
)
def test_an_interrupt_is_answered_within_a_second(tmp_path, lanes, steps, threads):
    """Twenty thousand lanes on one thread, very many lanes, one lane for a day; on a
    machine with little else to do.
    """
    latency = answered(
        tmp_path,
        np.random.default_rng(3),
        100,
        lanes=lanes,
        steps=steps,
        threads=threads,
        endless=True,
    )
    print(
        f"{lanes} lanes, {threads} threads: p99 {np.percentile(latency, 99):.3f} s, max"
        f" {latency.max():.3f} s"
    )
    assert len(latency) == 100
    assert latency.max() < 1.0
