"""A pytest plugin that writes which functions each test calls, of skyarm and of the
tests; of cases the first runs.

    pytest -n 0 -p calls_of_tests --calls FILE TEST ...

A call counts from the test's fixtures on to its end. FILE is JSON: test (without its
case) -> ["file:line", ...], the first lines of the functions.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest

import skyarm

ROOMS = (str(Path(skyarm.__file__).parent), str(Path(__file__).resolve().parents[1]))
"""Folders whose functions count: a form of the paper that no flight needs is among the
tests."""


class Calls:
    """Functions that were called, by test."""

    def __init__(self) -> None:
        self.seen: set[CodeType] = set()
        self.of: dict[str, list[str]] = {}

    def __call__(self, frame: FrameType, event: str, argument: Any) -> None:
        if event == "call":
            self.seen.add(frame.f_code)

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Keep the first case of each test."""
        first = {item.nodeid.partition("[")[0]: item for item in reversed(items)}
        items[:] = [
            item for item in items if first[item.nodeid.partition("[")[0]] is item
        ]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Count the calls of one test."""
        self.seen = set()
        sys.setprofile(self)
        try:
            return (yield)
        finally:
            sys.setprofile(None)
            ours = (code for code in self.seen if code.co_filename.startswith(ROOMS))
            self.of[item.nodeid.partition("[")[0]] = sorted(
                f"{c.co_filename}:{c.co_firstlineno}" for c in ours
            )


def pytest_addoption(parser: pytest.Parser) -> None:
    """The file that is written."""
    parser.addoption("--calls", type=Path)


def pytest_configure(config: pytest.Config) -> None:
    """Count where a file is named."""
    if config.getoption("--calls"):
        config.pluginmanager.register(Calls(), "calls")


def pytest_unconfigure(config: pytest.Config) -> None:
    """Write what was counted."""
    calls = config.pluginmanager.get_plugin("calls")
    if calls is not None:
        config.getoption("--calls").write_text(json.dumps(calls.of), "utf-8")
