"""What reaches a mutant, which tests to run on it, and the table of what became of
all.
"""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from mutation_draw import Mutant, function_of, tests_of

SLOW = 60.0
"""Seconds, traced and on a busy machine, from which a test is not run on mutants."""
OWN, OTHERS = 90.0, 150.0
"""Seconds of tests run on one mutant: of its own room, and of all further rooms."""


@dataclass(frozen=True, kw_only=True)
class Test:
    """One test as the tracer saw it."""

    name: str
    seconds: float
    functions: frozenset[str]
    collected: frozenset[str]
    """What was called while its file was imported."""

    @property
    def file(self) -> str:
        """Return its file below the root of the repository."""
        return self.name.split("::")[0]


def traced(folder: Path) -> list[Test]:
    """Read what the tracer wrote; tests that failed there are left out."""
    found: list[Test] = []
    for record in sorted(folder.glob("*.jsonl")):
        lines = [json.loads(line) for line in record.read_text().splitlines()]
        inside: dict[str, set[str]] = defaultdict(set)
        for child in record.with_suffix(".children").glob("*.jsonl"):
            for line in child.read_text().splitlines():
                if line.endswith("]"):
                    test, function = json.loads(line)
                    inside[test].add(function)
        collected = frozenset(
            function
            for each in lines
            if not each["test"]
            for function in each["functions"]
        )
        found += [
            Test(
                name=each["test"],
                seconds=each["s"],
                functions=frozenset(each["functions"]) | inside[each["test"]],
                collected=collected,
            )
            for each in lines
            if each["test"] and each["passed"]
        ]
    return found


def chosen(
    mutant: Mutant, text: str, tests: Sequence[Test]
) -> tuple[list[Test], list[Test]]:
    """Return the tests to run on a mutant, of its own room and of the others.

    First those that call the function around the line, then the rest of their files,
    which may use what a fixture, a cache or the import of the file kept of such a call.
    A line outside functions is taken for reached by the tests that call any function of
    its file, and by all files of the own room that import it.
    """
    first = function_of(text, mutant)
    prefix, folder = (
        f"skyarm/{mutant.file}:",
        f"tests/{tests_of(mutant.room)}".rstrip("/"),
    )
    if first is None:
        direct = {
            t.name for t in tests if any(f.startswith(prefix) for f in t.functions)
        }
        imports = {
            t.file for t in tests if any(f.startswith(prefix) for f in t.collected)
        }
        files = {file for file in imports if in_room(file, folder)}
    else:
        direct = {t.name for t in tests if f"{prefix}{first}" in t.functions}
        files = {t.file for t in tests if f"{prefix}{first}" in t.collected}
    files |= {name.split("::")[0] for name in direct}
    own = [t for t in tests if t.file in files and in_room(t.file, folder)]
    others = [t for t in tests if t.file in files and not in_room(t.file, folder)]
    return _fitting(own, direct, OWN), _fitting(others, direct, OTHERS)


def in_room(file: str, folder: str) -> bool:
    """Return True if a test file is of a room: anywhere below its folder; beside the
    rooms, in ``tests`` itself.
    """
    return (
        str(Path(file).parent) == folder
        if folder == "tests"
        else Path(file).is_relative_to(folder)
    )


def _fitting(tests: Iterable[Test], direct: set[str], limit: float) -> list[Test]:
    """Return the fastest tests that fit into a time; direct ones first, in each part
    the quickest file first.
    """
    total = 0.0
    parts: dict[bool, dict[str, list[Test]]] = {
        False: defaultdict(list),
        True: defaultdict(list),
    }
    for test in sorted(tests, key=lambda t: (t.name not in direct, t.seconds)):
        if total + test.seconds <= limit and test.seconds <= SLOW:
            total += test.seconds
            parts[test.name not in direct][test.file].append(test)
    groups = [
        g
        for part in parts.values()
        for g in sorted(part.values(), key=lambda g: sum(t.seconds for t in g))
    ]
    return [test for group in groups for test in group]


def read_drawn(path: Path) -> tuple[int, list[Mutant]]:
    """Return the seed and the mutants of a record."""
    record = json.loads(path.read_text())
    return record["seed"], [
        Mutant(**{k: v for k, v in each.items() if k in Mutant.__annotations__})
        for each in record["mutants"]
    ]


def left_out(path: Path) -> list[str]:
    """Return the keys that the draw of a record passed over."""
    return list(json.loads(path.read_text())["left_out"])


def write_drawn(
    path: Path,
    seed: int,
    without: Sequence[str],
    mutants: Sequence[Mutant],
    fates: dict[str, dict[str, Any]],
) -> None:
    """Write the record: each mutant, and the test of its own room and of any that goes
    red on it.
    """
    rows = [{"key": m.key, **asdict(m), **fates.get(m.key, {})} for m in mutants]
    lines = ",\n".join("  " + json.dumps(row) for row in rows)
    path.write_text(
        f'{{"seed": {seed}, "left_out": {json.dumps(without)}, "mutants":'
        f" [\n{lines}\n]}}\n"
    )


def argued(path: Path) -> set[str]:
    """Return the keys of the mutants that the list of equivalent ones argues."""
    return (
        set(re.findall(r"^\| `([0-9a-f]{8})`", path.read_text(), re.MULTILINE))
        if path.is_file()
        else set()
    )


def table(
    mutants: Sequence[Mutant], fates: dict[str, dict[str, Any]], equivalent: set[str]
) -> str:
    """Return the score by room, and what is alive, as Markdown."""
    rooms: dict[str, list[Mutant]] = defaultdict(list)
    for mutant in mutants:
        rooms[mutant.room].append(mutant)
    rows = [
        "| room | drawn | killed by own room | killed by all | equivalent | alive |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    sums = [0] * 5
    for name, group in [*sorted(rooms.items()), ("all", list(mutants))]:
        own = sum(bool(fates.get(m.key, {}).get("own")) for m in group)
        every = sum(
            bool(fates.get(m.key, {}).get("own") or fates.get(m.key, {}).get("all"))
            for m in group
        )
        same = sum(m.key in equivalent for m in group)
        sums = [len(group), own, every, same, len(group) - every - same]
        rows.append(f"| {name} | " + " | ".join(map(str, sums)) + " |")
    drawn, own, every, same, _ = sums
    by_all, by_own = (100.0 * killed / max(1, drawn - same) for killed in (every, own))
    rows.append(
        f"\nKilled of those not equivalent: {by_all:.1f} %, {by_own:.1f} % by tests of"
        " their own room."
    )
    return "\n".join(rows) + "\n"
