"""Slow cases that the nightly workflow alone may run: what they reach is reached by
others, and no mutant needs them.

    python tests/mutation/mutants.py nightly --share 0.5     after `reach` and `run`;
                                                             adds to tests/budget.json

A case stays in `make test` if it was the first to see a drawn mutant, if fewer than
``OTHERS`` others reach one of its functions, or if fewer than ``OTHERS`` others of the
function's own room do.
"""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

import mutation_draw
import mutation_record as record

OTHERS = 2
"""Cases that must be left for a function."""
QUICK = 0.3
"""Seconds, traced, below which a case always stays."""
ALWAYS = ("tests/project/", "tests/mutation/", "tests/website/", "tests/openness/")
"""Beginnings of files whose cases read the tree rather than run it: what they see
nothing else does."""


def own_functions(test: record.Test) -> frozenset[str]:
    """Functions that a test reaches in its own room."""
    return frozenset(
        name
        for name in test.functions
        if record.in_room(
            test.file, f"tests/{mutation_draw.tests_of(room_of(name))}".rstrip("/")
        )
    )


def room_of(function: str) -> str:
    """Room of a function that is named ``skyarm/FILE:LINE``."""
    return mutation_draw.room(function.rpartition(":")[0].partition("/")[2])


def spared(
    tests: Sequence[record.Test],
    killers: Collection[str],
    share: float,
    always: Collection[str] = (),
) -> list[str]:
    """Names of cases to leave to the nightly workflow, the slowest first, until a share
    of the seconds is left.

    Args:
        tests: cases as they were traced. killers: names of those that were the first to
            see a mutant.
        share: of all seconds, that `make test` shall take. always: files whose cases
            stay.
    """
    reached, own, cases = Counter[str](), Counter[str](), Counter[str]()
    for test in tests:
        reached.update(test.functions)
        own.update(own_functions(test))
        cases[test.file] += 1
    total = left = sum(test.seconds for test in tests)
    found = []
    for test in sorted(tests, key=lambda test: (-test.seconds, test.name)):
        if left <= share * total or test.seconds < QUICK:
            break
        mine = own_functions(test)
        if (
            test.name in killers
            or cases[test.file] == 1
            or test.file in always
            or test.file.startswith(ALWAYS)
        ):
            continue
        if any(reached[name] <= OTHERS for name in test.functions) or any(
            own[name] <= OTHERS for name in mine
        ):
            continue
        reached.subtract(test.functions)
        own.subtract(mine)
        cases[test.file] -= 1
        left -= test.seconds
        found.append(test.name)
    return found


def write_nightly(budget: Path, names: Iterable[str]) -> int:
    """Add cases to those that the nightly workflow alone runs; returns how many there
    are now.
    """
    table = json.loads(budget.read_text("utf-8"))
    by_file: dict[str, list[str]] = defaultdict(list)
    for name in names:
        path, bracket, values = name.partition("[")
        file, *_, function = path.split("::")
        by_file[file].append(f"{function}{bracket}{values}")
    for file, cases in by_file.items():
        row = table.setdefault(file, {"seconds": 0.0})
        row["nightly"] = sorted({*row.get("nightly", ()), *cases})
    budget.write_text(json.dumps(dict(sorted(table.items())), indent=1) + "\n", "utf-8")
    return sum(len(row.get("nightly", ())) for row in table.values())
