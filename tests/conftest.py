"""What holds for every process of the tests, before NumPy is loaded."""

from __future__ import annotations

import compileall
import gc
import importlib.util
import os
import sys
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

import pytest

# one thread of BLAS a process, as the command line sets it: the processes of the tests take every core already, and
# threads that wait for each other there made some tests five times slower
for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# a trace makes a hundred thousand nodes and no garbage; looking for some after every 700 took a sixth of all the time
gc.set_threshold(50_000, 20, 100)


def pytest_collection_finish() -> None:
    """Collected tests and imported modules stay: they need not be looked through again and again."""
    gc.collect()
    gc.freeze()


COMMANDS_LOAD = ("annotated_types", "llvmlite", "mujoco", "numpy", "pydantic", "rich", "shellingham", "typer")
"""Libraries that every process of a command loads, and light ones."""


def pytest_configure(config: pytest.Config) -> None:
    """Compile bytecode once, where each of some hundred processes would do so anew (PYTHONDONTWRITEBYTECODE is set).

    That of the library, and of the libraries that its commands load: `make` installs them without any.
    """
    if not sys.dont_write_bytecode or hasattr(config, "workerinput"):
        return
    compileall.compile_dir(Path(__file__).parents[1] / "src" / "skyarm", quiet=2)
    for name in COMMANDS_LOAD:
        found = importlib.util.find_spec(name)
        if found is not None and found.origin is not None and not Path(cache_from_source(found.origin)).exists():
            compileall.compile_dir(Path(found.origin).parent, quiet=2)


@pytest.fixture(scope="session")
def campaign() -> Any:
    """Twenty episodes of the paper of 30 s as stated, thirty with settings that were found, on both plants."""
    from skyarm.paper.campaign import run_campaign

    return run_campaign(("rigid_body", "mujoco"), sensitivity=False, beyond=False)
