"""What holds for every process of the tests, before NumPy is loaded."""

from __future__ import annotations

import compileall
import os
from pathlib import Path

import pytest

# one thread of BLAS a process, as the command line sets it: the processes of the tests take every core already, and
# threads that wait for each other there made some tests five times slower
for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")


def pytest_configure(config: pytest.Config) -> None:
    """Compile the library's bytecode once, as pip does for what it installs.

    The tests start some hundred processes; where PYTHONDONTWRITEBYTECODE is set, each would compile all of it anew.
    """
    if not hasattr(config, "workerinput"):
        compileall.compile_dir(Path(__file__).parents[1] / "src" / "skyarm", quiet=2)
