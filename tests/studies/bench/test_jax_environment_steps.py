"""The benchmark of environments in JAX, in a process of its own: JAX reads XLA's flags
once.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")
pytest.importorskip("jax", reason="needs the extra 'jax'")

HERE = Path(__file__).parent

SMALL = """
import math
import measure_jax_environment as room
room.TASK, room.STEPS = "skyarm/Hover-v0", 2
found = room.measure(lanes=3, calls=2)
assert all(0.0 < value < math.inf for value in found.values()), found
print(sorted(found))
"""


@pytest.mark.thorough
def test_a_rollout_is_timed():
    environment = {
        name: value for name, value in os.environ.items() if name != "XLA_FLAGS"
    }
    done = subprocess.run(
        [sys.executable, "-c", SMALL],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
        cwd=HERE,
    )
    assert (
        done.stdout.strip() == "['first_processor_s', 'first_s', 'rate', 'work_rate']"
    )
