"""A small Ray cluster on this machine, and programs that fly on it."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

TESTS = Path(__file__).resolve().parents[2]

MARK = "SKYARM_TEST_MARK"
"""Variable of the environment that a program and all that it starts have in common."""


@contextmanager
def cluster(nodes: int = 2) -> Iterator[Any]:
    """Nodes of one processor each, the head first; ``address`` is that of the head."""
    from ray.cluster_utils import Cluster

    made = Cluster(
        initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False}
    )
    try:
        for _ in range(nodes - 1):
            made.add_node(num_cpus=1)
        yield made
    finally:
        made.shutdown()


class Program:
    """A program in a process group of its own, as a shell starts it.

    Args:
        folder: in which it runs. words: behind ``python``.
    """

    def __init__(self, folder: Path, *words: str) -> None:
        self.mark = uuid.uuid4().hex
        paths = [str(TESTS), *sys.path]
        environment = os.environ | {
            MARK: self.mark,
            "PYTHONPATH": os.pathsep.join(filter(None, paths)),
        }
        self.process = subprocess.Popen(
            [sys.executable, *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
            cwd=folder,
            start_new_session=True,
        )

    @classmethod
    def of_text(cls, folder: Path, text: str, *arguments: str) -> Program:
        """A program of this text, which gets the folder and these arguments."""
        (folder / "flies.py").write_text(text)
        return cls(folder, "flies.py", str(folder), *arguments)

    def end(self, seconds: float = 120.0) -> tuple[int, str, str]:
        """Exit code, standard output and error."""
        out, err = self.process.communicate(timeout=seconds)
        return self.process.returncode, out, err

    def left(self, seconds: float = 20.0) -> list[str]:
        """Command lines of processes that it started and that are still there after
        some seconds.
        """
        end = time.monotonic() + seconds
        while (found := self._there()) and time.monotonic() < end:
            time.sleep(0.2)
        return found

    def _there(self) -> list[str]:
        found = []
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                if f"{MARK}={self.mark}".encode() in (folder / "environ").read_bytes():
                    found.append(
                        (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                    )
            except OSError:
                continue
        return [line for line in found if line]
