"""What takes seconds to make and is the same in every process of the tests: made by the first that asks for it."""

from __future__ import annotations

import fcntl
import os
import pickle
from collections.abc import Callable
from typing import TypeVar, cast

import pytest

Made = TypeVar("Made")


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[], Made]) -> Made:
    """Return what ``make`` gives, or what another process of this run has from it; it must travel by pickle.

    A process that asks meanwhile waits: making it there too would take it as long, and a core.
    """
    own = factory.getbasetemp()
    shared = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / f"made_once_{name}"
    with shared.open("a+b") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.seek(0)
        if content := file.read():
            return cast(Made, pickle.loads(content))
        made = make()
        file.write(pickle.dumps(made))
        return made
