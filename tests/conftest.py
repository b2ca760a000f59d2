"""What holds for every process of the tests, before NumPy is loaded."""

from __future__ import annotations

import os
from typing import Any

import pytest

# one thread of BLAS a process, as the command line sets it: the processes of the tests take every core already, and
# threads that wait for each other there made some tests five times slower
for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")


@pytest.fixture(scope="session")
def campaign() -> Any:
    """Twenty episodes of the paper of 30 s as stated, thirty with settings that were found, on both plants."""
    from skyarm.paper.campaign import run_campaign

    return run_campaign(("rigid_body", "mujoco"), sensitivity=False, beyond=False)
