"""Threads of kernels, as the interpreter sees them."""

from __future__ import annotations

import sys
import time

from skyarm.compile.llvm import shared_steps


def queues(kernel):
    """What the threads of an idle kernel wait at."""
    return [pool._queue for pool in kernel.pools._idle]


def serving(waited_at=None):
    """Identifiers of the threads that serve kernels, or that wait at some queues."""
    found = set()
    for identifier, top in sys._current_frames().items():
        frame = top
        while frame is not None and frame.f_code is not shared_steps._serve.__code__:
            frame = frame.f_back
        if frame is not None and (waited_at is None or frame.f_locals["queue"] in waited_at):
            found.add(identifier)
    return found


def wait_until(true, seconds=60.0):
    """Look until something is true, which it soon is."""
    deadline = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.005)
