"""Each worker of `make test` collects files of its own: collecting all of them took
each some thirteenth of the run.

Files are dealt in the order of their paths, so that a room stays in one process with
the flights that it keeps; each share has as many seconds of ``tests/budget.json``. The
last files are everyone's: who is ready first takes of them. What is named on the
command line, another choice of marks, and a worker in place of one that died are
collected whole.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
EVERYONES = 0.12
"""Part of the seconds that no worker owns: by so much the shares may be wrong before
one waits for another."""

COLLECTED = 0.05
"""s, to import a file and to make its tests."""


def shares_of(seconds: dict[str, float], count: int) -> list[set[str]]:
    """Files of each worker, and in the last place everyone's."""
    ends = list(accumulate(seconds[file] + COLLECTED for file in sorted(seconds)))
    own = (1.0 - EVERYONES) * ends[-1] / count
    found: list[set[str]] = [set() for _ in range(count + 1)]
    for file, end in zip(sorted(seconds), ends, strict=True):
        found[min(int(end / own), count)].add(file)
    return found


def seconds_of_files() -> dict[str, float]:
    """By path from the root; a file that was never measured takes the mean."""
    table = json.loads((ROOT / "tests/budget.json").read_text("utf-8"))
    files = [
        each.relative_to(ROOT).as_posix()
        for each in (ROOT / "tests").rglob("test_*.py")
    ]
    mean = sum(each["seconds"] for each in table.values()) / len(table)
    return {file: table.get(file, {}).get("seconds", mean) for file in files}


def is_shared(config: pytest.Config) -> bool:
    """Whether a run is of all that `make test` runs, by several workers."""
    whole = (
        config.args_source is pytest.Config.ArgsSource.TESTPATHS
        and "not thorough" in config.option.markexpr
    )
    return whole and config.option.dist == "worksteal" and len(config.option.tx) > 1


def others_of(worker: int, count: int) -> set[str]:
    """Files that a worker leaves to others."""
    shares = shares_of(seconds_of_files(), count)
    return set().union(*(share for k, share in enumerate(shares[:-1]) if k != worker))


class ShareScheduling:
    """Gives each worker all tests that it alone has collected, then everyone's by and
    by; `Scheduling` of pytest-xdist.

    A worker begins a test when it knows the next one, so that two are with it until
    there are no more.
    """

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self.expected = len(config.option.tx)
        self.collected: dict[Any, list[str]] = {}
        self.given: dict[Any, list[int]] = {}
        self.pending: list[str] | None = None

    @property
    def nodes(self) -> list[Any]:
        return list(self.given)

    @property
    def collection_is_completed(self) -> bool:
        return self.pending is not None or len(self.collected) >= self.expected

    @property
    def tests_finished(self) -> bool:
        return self.pending == [] and all(
            len(given) < 2 for given in self.given.values()
        )

    @property
    def has_pending(self) -> bool:
        return bool(self.pending) or any(self.given.values())

    def add_node(self, node: Any) -> None:
        self.given[node] = []

    def add_node_collection(self, node: Any, collection: Sequence[str]) -> None:
        self.collected[node] = list(collection)

    def schedule(self) -> None:
        """Give what is owned, once; then, as whenever a test ended, what is
        everyone's.
        """
        if self.pending is None:
            times = Counter(each for ids in self.collected.values() for each in ids)
            self.pending = [each for each, n in times.items() if n > 1]
            # not those of one worker
            self.config.pluginmanager.get_plugin("session").testscollected = len(times)
            for node, ids in self.collected.items():
                self._give(node, [each for each in ids if times[each] == 1])
        self._go_on()

    def mark_test_complete(
        self, node: Any, item_index: int, duration: float = 0.0
    ) -> None:
        self.given[node].remove(item_index)
        self._go_on()

    def mark_test_pending(self, item: str) -> None:
        assert self.pending is not None
        self.pending.insert(0, item)
        self._go_on()

    def remove_pending_tests_from_node(self, node: Any, indices: Sequence[int]) -> None:
        raise AssertionError("no test is asked back")

    def remove_node(self, node: Any) -> str | None:
        """The test during which a worker died, or None; a worker in its place collects
        all and does the others.
        """
        indices = self.given.pop(node)
        names = [self.collected[node][index] for index in indices]
        if self.pending is not None:
            self.pending += names[1:]
            self._go_on()
        return names[0] if names else None

    def _give(self, node: Any, names: list[str]) -> None:
        if names:
            place = {each: index for index, each in enumerate(self.collected[node])}
            indices = [place[each] for each in names]
            self.given[node] += indices
            node.send_runtest_some(indices)

    def _go_on(self) -> None:
        assert self.pending is not None
        for node in [
            each
            for each in self.given
            if each in self.collected and not each.shutting_down
        ]:
            if len(self.given[node]) >= 2:
                continue
            known = set(self.collected[node])
            names = [each for each in self.pending if each in known]
            taken = names[: max(2, len(names) // (2 * self.expected))]
            self.pending = [each for each in self.pending if each not in set(taken)]
            self._give(node, taken)
            if len(self.given[node]) < 2:
                node.shutdown()
