"""Waiting for what threads of kernels soon do."""

from __future__ import annotations

import time
from queue import SimpleQueue


def wait_until(true, seconds=60.0):
    """Look until something is true, which it soon is."""
    deadline = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def interrupted_queue():
    """A kind of queue, the first wait for which with a timeout is interrupted."""
    made = []

    class Interrupted(SimpleQueue):
        def get(self, block=True, timeout=None):
            if timeout is not None and not made:
                made.append(1)
                raise KeyboardInterrupt
            return super().get(block, timeout)

    return Interrupted
