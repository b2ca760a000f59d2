"""The threads of a kernel: callers at once, and signals."""

from __future__ import annotations

import _thread
import copy
import dataclasses
import os
import pickle
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from programs_random import oscillator, same_bits

from skyarm.compile.llvm import kernel as native
from skyarm.compile.llvm import shared_steps
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import trace_loop
from support.cases import sampled
from support.engines import wait_until


@pytest.fixture(autouse=True)
def shared(monkeypatch):
    """However little there is to do, it is shared."""
    monkeypatch.setattr(shared_steps, "SHARED", 1e-12)


def spring():
    return Kernel(
        trace_loop(oscillator, (0.0, 0.0), (0.0,), (0.0,), ((0, 2),)), Lanes(4)
    )


def fly(kernel, lanes=103, **options):
    carry = np.vstack([np.linspace(0.1, 1.0, lanes), np.zeros(lanes)])
    return kernel.run(
        carry, np.linspace(1.0, 30.0, lanes)[None], np.ones((50, 1)), **options
    )[0]


def test_little_work_is_not_shared(monkeypatch):
    monkeypatch.setattr(shared_steps, "SHARED", 1.0)
    shared = []
    monkeypatch.setattr(shared_steps.Workers, "put", lambda _, job: shared.append(job))
    fly(spring(), threads=4)
    assert shared == []


def test_callers_at_once_have_threads_of_their_own():
    kernel = spring()
    expected, found, errors = fly(kernel), [], []
    start = threading.Barrier(4)

    def work():
        try:
            start.wait(60)
            found.extend(fly(kernel, threads=3) for _ in range(50))
        except BaseException as error:
            errors.append(error)

    callers = [threading.Thread(target=work) for _ in range(4)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert not errors
    assert len(found) == 200
    assert all(same_bits(expected, one) for one in found)


def test_a_copy_flies_and_a_kernel_is_not_pickled():
    kernel = spring()
    expected = fly(kernel, threads=3)
    assert same_bits(fly(copy.copy(kernel), threads=3), expected)
    with pytest.raises(ValueError, match="cannot be pickled"):
        pickle.dumps(kernel)


PROGRAM = """
import os, signal, sys, threading, time, _thread
import numpy as np
from programs_random import oscillator
from skyarm.compile.llvm import shared_steps
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import trace_loop
from skyarm.compile.llvm.kernel import Kernel
shared_steps.SHARED = 1e-12
def driven(carry, parameters, row, uniforms):
    return oscillator(carry, parameters, uniforms[:1], uniforms)
loop = trace_loop(driven, (0.0, 0.0), (0.0,), (), ((0, 2),))
kernel = Kernel(loop, Lanes(4))
def fly(steps=50, lanes=103, threads=3):
    carry = np.vstack([np.linspace(0.1, 1.0, lanes), np.zeros(lanes)])
    stiffness, rows = np.linspace(1.0, 30.0, lanes)[None], np.zeros((steps, 0))
    return kernel.run(carry, stiffness, rows, threads=threads)[0]
def endless(**options):
    fly(steps=10**15, **options)  # rows without numbers take no memory
expected = fly()
"""


def ran(text, tmp_path, seconds=100):
    """Run a program; what it printed."""
    script = tmp_path / "one.py"
    script.write_text(PROGRAM + text)
    paths = os.pathsep.join(
        [str(Path(native.__file__).parents[3]), str(Path(__file__).parent)]
    )
    environment = {
        **os.environ,
        "PYTHONPATH": paths,
        "SKYARM_CACHE": str(tmp_path / "cache"),
    }
    command = [sys.executable, "-W", "ignore::DeprecationWarning", str(script)]
    done = subprocess.run(
        command,
        env=environment,
        capture_output=True,
        text=True,
        timeout=seconds,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("threads", sampled([3, 1], 2))
def test_whatever_a_handler_does_happens_soon_and_at_the_callers_place(
    tmp_path, threads
):
    """Handlers that raise and that do not, SIGALRM, SIGINT of the process,
    interrupt_main of a thread; long flights.

    Where 50 000 lanes make a round of many slices one signal stands for all that raise:
    they differ before machine code is reached.
    """
    text = f"""
class Ended(BaseException): pass
def end(*_): raise Ended
heard = []
def hear(*_):
    heard.append(True)
    threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGTERM)).start()
for lanes in (1, 50_000):
    option = dict(lanes=lanes, threads={threads})
    every = (signal.SIGALRM, signal.SIGTERM, signal.SIGUSR1)
    for number in every if lanes == 1 else (signal.SIGTERM,):
        signal.signal(number, end)
        try:
            threading.Timer(0.05, os.kill, (os.getpid(), number)).start()
            endless(**option)
        except Ended: print("ended")
    if lanes == 1:
        try:
            signal.setitimer(signal.ITIMER_REAL, 0.05)
            endless(**option)
        except Ended: print("ended")
    by_signal = lambda: os.kill(os.getpid(), signal.SIGINT)
    for interrupt in (by_signal, _thread.interrupt_main)[:1 + (lanes == 1)]:
        try:
            threading.Timer(0.05, interrupt).start()
            endless(**option)
        except KeyboardInterrupt: print("interrupted")
    signal.signal(signal.SIGUSR1, hear)
    try:
        threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGUSR1)).start()
        endless(**option)
    except Ended: print("heard", len(heard))
    heard.clear()
    print(np.array_equal(fly(), expected))
"""
    one = ["ended"] * 4 + ["interrupted"] * 2 + ["heard 1", "True"]
    many = ["ended", "interrupted", "heard 1", "True"]
    assert ran(text, tmp_path).split("\n") == [*one, *many, ""]


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_handler_that_raises_at_any_instant_leaves_no_lock_taken(tmp_path):
    """Within the start of threads and waits, too: Python's own pool hung or raised
    RuntimeError within seconds.
    """
    text = """
def end(*_): raise KeyboardInterrupt
signal.signal(signal.SIGALRM, end)
begun = time.monotonic(); fly(500, 2000); took = time.monotonic() - begun
draw, seen, until = np.random.default_rng(1), 0, time.monotonic() + 3.0
whole = fly(500, 2000)
while time.monotonic() < until:
    try:
        seconds = draw.uniform(2e-5, took * draw.choice([0.1, 1.2]))
        signal.setitimer(signal.ITIMER_REAL, seconds)
        fly(500, 2000, threads=int(draw.integers(2, 9)))
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    except KeyboardInterrupt: seen += 1
print(seen > 20, np.array_equal(fly(500, 2000), whole))
"""
    assert ran(text, tmp_path, 30) == "True True\n"


def test_threads_end_with_the_last_who_holds_them():
    workers, free = shared_steps.Workers(), threading.Event()
    counts = []
    workers.start(3)
    for _ in range(3):
        workers.put(lambda: (counts.append(threading.get_ident()), free.wait(10)))
    wait_until(lambda: len(counts) == 3)
    free.set()
    assert len(set(counts)) == 3
    before = _thread._count()
    del workers
    wait_until(lambda: _thread._count() == before - 3)


def test_what_a_thread_raises_reaches_the_caller(monkeypatch):
    kernel = spring()

    def broken(_):
        raise MemoryError

    monkeypatch.setattr(
        kernel, "machine", dataclasses.replace(kernel.machine, call=broken)
    )
    with pytest.raises(MemoryError):
        fly(kernel, threads=3)
