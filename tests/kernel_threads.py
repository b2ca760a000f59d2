"""Waiting for what threads of kernels soon do."""

from __future__ import annotations

import time


def wait_until(true, seconds=60.0):
    """Look until something is true, which it soon is."""
    deadline = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.005)
