"""Which tests call which functions of skyarm: a tracer that sees the first call of each
function in each test.

A line of a function is taken for reached by a test that calls the function, in this
process or in one it starts. Every test file runs in a process of its own, so that no
cache filled by another file hides a call.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

# set for the traced process and those it starts: where their records go
FOLDER = "SKYARM_REACH_FOLDER"
# the sitecustomize of every process started below
CHILD = "import mutation_reach\nmutation_reach.trace_child()\n"


class Tracer:
    """Remember each function of skyarm at its first call in a test, as (file, first
    line).
    """

    def __init__(self, root: Path) -> None:
        self.root = str(root) + os.sep
        self.known: dict[CodeType, str | None] = {}
        self.seen: set[CodeType] = set()
        # a child writes at once: it may end without a last word
        self.append_to: Path | None = None

    def name(self, code: CodeType) -> str | None:
        """Return ``file:first line`` of a function in the package, None of any
        other.
        """
        if not code.co_filename.startswith(self.root):
            return None
        return f"{code.co_filename[len(self.root) :]}:{code.co_firstlineno}"

    def __call__(self, frame: FrameType, event: str, argument: Any) -> None:
        """Take one call; no line is traced."""
        code = frame.f_code
        if code in self.seen:
            return
        self.seen.add(code)
        if code not in self.known:
            self.known[code] = self.name(code)
        if self.append_to is not None and (name := self.known[code]) is not None:
            test = os.environ.get("PYTEST_CURRENT_TEST", "").rsplit(" (", 1)[0]
            with self.append_to.open("a") as file:
                file.write(json.dumps([test, name]) + "\n")

    def take(self) -> list[str]:
        """Return the functions called since the last time, and forget them."""
        seen, self.seen = self.seen, set()  # first of all: what follows is traced too
        return sorted(
            {name for code in seen if (name := self.known.get(code)) is not None}
        )

    def become_child(self) -> None:
        """Write every further function into a file of this process."""
        self.append_to = Path(os.environ[FOLDER]) / f"child_{os.getpid()}.jsonl"

    def start(self) -> None:
        """Trace this thread, those started later and forked processes."""
        os.register_at_fork(after_in_child=self.become_child)
        threading.settrace(self)
        sys.settrace(self)


def trace_child() -> None:
    """Trace a Python process that a test started, if it is to be traced."""
    if FOLDER in os.environ:
        root = next(
            (
                Path(p)
                for p in sys.path
                if (Path(p) / "skyarm" / "__init__.py").is_file()
            ),
            None,
        )
        if root is not None:
            tracer = Tracer(root)
            tracer.become_child()
            tracer.start()


class ReachPlugin:
    """A pytest plugin that writes for each test its functions, seconds and outcome."""

    def __init__(self, root: Path, file: Path) -> None:
        self.tracer = Tracer(root)
        self.file = file
        self.tracer.start()
        self.began = 0.0
        self.passed = True

    def write(
        self, test: str, functions: list[str], seconds: float, passed: bool
    ) -> None:
        """Append one line of the record."""
        with self.file.open("a") as file:
            file.write(
                json.dumps(
                    {
                        "test": test,
                        "functions": functions,
                        "s": round(seconds, 3),
                        "passed": passed,
                    }
                )
                + "\n"
            )

    def pytest_collection_finish(self, session: Any) -> None:
        """What collecting called belongs to the whole file."""
        self.write("", self.tracer.take(), 0.0, True)

    def pytest_runtest_logstart(self, nodeid: str, location: Any) -> None:
        """Begin a test."""
        self.began, self.passed = time.perf_counter(), True

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Remember a failure; a test that is skipped kills nothing and fails
        nothing.
        """
        self.passed = self.passed and not report.failed
        if sys.gettrace() is not self.tracer:  # a test that traced by itself
            sys.settrace(self.tracer)

    def pytest_runtest_logfinish(self, nodeid: str, location: Any) -> None:
        """End a test, fixtures included."""
        self.write(
            nodeid, self.tracer.take(), time.perf_counter() - self.began, self.passed
        )
