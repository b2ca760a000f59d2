"""Measure the contact suite by the centroidal law: the table *Contact suite* of docs/results_contact.md.

    python tests/studies/compare/measure_contact_suite.py [--worlds 64] [--out out/contact_suite] [--small]

Successes with perfect state and with noise, and medians of the completed noisy flights of tasks that press. What was
flown is kept in the folder; the same command goes on with it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[2]))  # the tests' own modules, when this is run as a program

from skyarm.studies.compare.compare_laws import compare
from skyarm.studies.compare.contact_tasks import TASKS
from support.measured_tables import print_table, progress

LAWS = ("centroidal", "centroidal_load")
NUMBERS = ("force_error", "ripple", "peak", "tip")


def rows(found: Mapping[str, Any]) -> Iterator[list[str]]:
    """A task under a law a row."""
    for name, task in found["tasks"].items():
        perfect, noisy = (task["conditions"][condition] for condition in ("perfect", "noisy"))
        for law, cell in noisy.items():
            title = f"`{name}`" if law == LAWS[0] else f"`{name}`, with `{law}`"
            yield [title, str(perfect[law]["successes"]), str(cell["successes"]), *numbers(name, cell)]


def numbers(name: str, cell: Mapping[str, Any]) -> list[str]:
    """Medians of a task that presses; of others the force is no goal."""
    task = TASKS[name]
    if task.grip or task.object or task.stands is not None:
        return [""] * len(NUMBERS)
    return [f"{(1e3 if each == 'tip' else 1.0) * cell[each]:.2g}" for each in NUMBERS]


def measure(worlds: int, out: str, tasks: Sequence[str]) -> None:
    """Fly the tasks, and print the table."""
    options = {"tasks": tuple(tasks)} if tasks else {}
    flown = compare(
        "contact-suite",
        LAWS,
        out,
        worlds=worlds,
        progress=lambda done, of, last: progress(f"{done} of {of}"),
        **options,
    )
    heads = (
        "task",
        "successes, perfect",
        "successes, noisy",
        "force error, N",
        "ripple, N",
        "peak, N",
        "tip across, mm",
    )
    print_table(heads, rows(flown.document))


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=64)
    parser.add_argument("--out", default="out/contact_suite")
    parser.add_argument("--small", action="store_true", help="two tasks in four worlds")
    given = parser.parse_args()
    if given.small:
        with tempfile.TemporaryDirectory() as out:
            measure(4, out, ("press_and_hold", "pull_door"))
    else:
        measure(given.worlds, given.out, ())


if __name__ == "__main__":
    main()
