"""Measure the contact suite: the tables of the section *Contact suite* of
docs/data/results_contact.md.

    python tests/studies/compare/measure_contact_suite.py [--worlds 64]
        [--out out/contact_suite] [--small]
    python tests/studies/compare/measure_contact_suite.py --others [--worlds 16]
        [--out out/contact_others] [--small]

The first form flies the centroidal law in all tasks. The second flies the tasks that
press under other laws, too. Successes with perfect state and with noise, and medians of
the completed noisy flights of tasks that press. What was flown is kept in the folder;
the same command goes on with it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[2]))

from skyarm.studies.compare.compare_laws import compare
from skyarm.studies.compare.contact_tasks import TASKS
from support.measured_tables import print_table, progress

LAWS = ("centroidal", "centroidal_load")
OTHERS = ("centroidal", "hybrid_ct", "admittance_pd", "paper_ct", "paper_pd")
PRESSING = (
    "press_and_hold",
    "slide_up",
    "slide_circle",
    "write_on_wall",
    "push_button",
    "open_door",
)
NUMBERS = ("force_error", "ripple", "peak", "tip")


def rows(found: Mapping[str, Any]) -> Iterator[list[str]]:
    """A task under a law a row."""
    for name, task in found["tasks"].items():
        perfect, noisy = (
            task["conditions"][condition] for condition in ("perfect", "noisy")
        )
        for law, cell in noisy.items():
            title = f"`{name}`" if law == LAWS[0] else f"`{name}`, with `{law}`"
            yield [
                title,
                str(perfect[law]["successes"]),
                str(cell["successes"]),
                *numbers(name, cell),
            ]


def numbers(name: str, cell: Mapping[str, Any]) -> list[str]:
    """Medians of a task that presses; of others the force is no goal."""
    task = TASKS[name]
    if task.grip or task.object or "standing" in task.success:
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


def measure_others(worlds: int, out: str, tasks: Sequence[str]) -> None:
    """Fly the tasks under several laws, and print the noisy successes: a task a row, a
    law a column.
    """
    flown = compare(
        "contact-suite",
        OTHERS,
        out,
        worlds=worlds,
        tasks=tuple(tasks),
        progress=lambda done, of, last: progress(f"{done} of {of}"),
    )
    counts = []
    for name, task in flown.document["tasks"].items():
        noisy = task["conditions"]["noisy"]
        counts.append([f"`{name}`", *(str(noisy[law]["successes"]) for law in OTHERS)])
    print_table(("task", *(f"`{law}`" for law in OTHERS)), counts)


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--worlds", type=int, help="64, with --others 16")
    parser.add_argument(
        "--out", help="out/contact_suite, with --others out/contact_others"
    )
    parser.add_argument(
        "--others", action="store_true", help="tasks that press, under several laws"
    )
    parser.add_argument(
        "--small", action="store_true", help="one or two tasks in four worlds"
    )
    given = parser.parse_args()
    fly = measure_others if given.others else measure
    if given.small:
        with tempfile.TemporaryDirectory() as out:
            fly(
                4,
                out,
                PRESSING[:1] if given.others else ("press_and_hold", "pull_door"),
            )
    elif given.others:
        fly(given.worlds or 16, given.out or "out/contact_others", PRESSING)
    else:
        fly(given.worlds or 64, given.out or "out/contact_suite", ())


if __name__ == "__main__":
    main()
