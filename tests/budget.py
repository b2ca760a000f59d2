"""Seconds of each file of tests, and which of its cases the nightly workflow alone
runs: ``tests/budget.json``.

    # nothing else beside it on the machine
    pytest -m "not attack and not digests and not site" --junitxml=all.xml
    python tests/budget.py all.xml --seconds 300

A report of some files chooses among their cases only, and leaves what the table says of
others.

A case is nightly, as if it were marked ``thorough``, if it is slow and another case of
its function, or of its file, is left. What ``ALWAYS`` names is left whatever it takes.
The limit is of both cores together.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

BUDGET = Path(__file__).with_name("budget.json")

ALWAYS: tuple[str, ...] = (
    "tests/control/test_published_flights.py",
    "tests/paper/test_paper_acceptance.py",
    "tests/simulate/test_flight_digests.py",
    "tests/test_readme.py",
)
"""Files whose cases are run by every `make test`."""

Times = dict[str, dict[str, float]]


def measured(path: Path) -> Times:
    """Seconds of each case by file, of a report in JUnit's form."""
    times: Times = defaultdict(dict)
    root = Path(__file__).parents[1]
    for case in ElementTree.parse(path).iter("testcase"):
        # of a module that is left out the name is no path
        if case.find("skipped") is not None:
            continue
        file = Path(*case.attrib["classname"].split(".")).with_suffix(".py")
        if (root / file).is_file():
            times[file.as_posix()][case.attrib["name"]] = float(case.attrib["time"])
    return times


def chosen(times: Times, seconds: float) -> dict[str, list[str]]:
    """Nightly cases by file: the most that a threshold, the same for all files, allows
    within the limit.
    """
    low, high = 0.0, 60.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        nightly = _slower(times, middle)
        kept = sum(
            t
            for file, cases in times.items()
            for name, t in cases.items()
            if name not in nightly[file]
        )
        low, high = (low, middle) if kept > seconds else (middle, high)
    return _slower(times, low)


def _slower(times: Times, threshold: float) -> dict[str, list[str]]:
    """Cases above the threshold, but for the fastest of each function up to four times
    that, and one of each file.
    """
    found = {}
    for file, cases in times.items():
        functions: dict[str, list[str]] = defaultdict(list)
        for name in cases:
            functions[name.split("[")[0]].append(name)
        spared = {min(names, key=cases.__getitem__) for names in functions.values()}
        nightly = [
            name
            for name, t in cases.items()
            if t > (4.0 * threshold if name in spared else threshold) and t > 0.05
        ]
        if len(nightly) == len(cases):
            nightly.remove(min(cases, key=cases.__getitem__))
        found[file] = [] if file in ALWAYS else nightly
    return found


def written(times: Times, nightly: dict[str, list[str]]) -> dict[str, Any]:
    """Contents of the file; a function whose cases are all nightly is named without
    them.
    """
    table = {}
    for file in sorted(times):
        cases, slow = times[file], set(nightly[file])
        functions: dict[str, set[str]] = defaultdict(set)
        for name in cases:
            functions[name.split("[")[0]].add(name)
        whole = {function for function, names in functions.items() if names <= slow}
        names = sorted(whole) + sorted(
            name for name in slow if name.split("[")[0] not in whole
        )
        left = sum(t for name, t in cases.items() if name not in slow)
        table[file] = {
            "seconds": round(left, 1),
            **({"nightly": names} if names else {}),
        }
    return table


def main() -> None:
    """Choose anew from a report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("report", type=Path)
    parser.add_argument(
        "--seconds", type=float, default=300.0, help="of all processes together"
    )
    given = parser.parse_args()
    times = measured(given.report)
    before = json.loads(BUDGET.read_text("utf-8"))
    kept = {
        file: each
        for file, each in before.items()
        if (BUDGET.parents[1] / file).is_file()
    }
    table = dict(
        sorted({**kept, **written(times, chosen(times, given.seconds))}.items())
    )
    BUDGET.write_text(json.dumps(table, indent=1) + "\n", "utf-8")
    total = sum(each["seconds"] for each in table.values())
    print(
        f"{total:.0f} s in {len(table)} files; nightly:"
        f" {sum(len(each.get('nightly', ())) for each in table.values())}"
    )


if __name__ == "__main__":
    main()
