"""Draw changes of the source, run the tests that reach each, and report what the tests
do not see.

    python tests/mutation/mutants.py draw --seed 9 --count 300     draw anew into
                                                                   drawn.json
    python tests/mutation/mutants.py reach                         which tests call
                                                                   which functions
    python tests/mutation/mutants.py run                           run the drawn mutants
                                                                   that were not run yet
    python tests/mutation/mutants.py score                         fates into
                                                                   drawn.json, the table
                                                                   into score.md
    python tests/mutation/mutants.py nightly --share 0.5           slow cases that none
                                                                   of these needs are
                                                                   nightly

What is found on the way lies in ``out/mutants``; remove the folder to begin anew. Needs
a system with ``fork``.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
import shutil
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

import mutation_draw
import mutation_processes as processes
import mutation_reach as reach
import mutation_record as record
import nightly_cases
from mutation_draw import Mutant

HERE = Path(__file__).resolve().parent
ROOT = processes.TESTS.parent
SOURCE = ROOT / "src"
OUT = ROOT / "out" / "mutants"
DRAWN, EQUIVALENT, SCORE = (
    HERE / "drawn.json",
    HERE / "equivalent.md",
    HERE / "score.md",
)
MEMORY = 8 << 30  # bytes of address space for a mutant that fills a list for ever


class Chosen:
    """A pytest plugin that runs the chosen tests in their order and writes the first
    that goes red.
    """

    def __init__(self, names: list[str], verdict: Path) -> None:
        self.order = {name: i for i, name in enumerate(names)}
        self.verdict = verdict

    def pytest_collection_modifyitems(self, config: Any, items: list[Any]) -> None:
        """Keep the chosen tests."""
        items[:] = sorted(
            (i for i in items if i.nodeid in self.order),
            key=lambda i: self.order[i.nodeid],
        )

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Write the name of a red test."""
        if report.failed and not self.verdict.is_file():
            self.verdict.write_text(report.nodeid)


def trace_file(file: Path) -> str:
    """Trace one test file in a process of its own; nothing to do if that was done and
    the file is as it was.
    """
    name = str(file.relative_to(processes.TESTS)).replace(os.sep, "+")
    lines, done = OUT / "reach" / f"{name}.jsonl", OUT / "reach" / f"{name}.done"
    if done.is_file() and done.stat().st_mtime > file.stat().st_mtime:
        return f"{name}: known"
    lines.unlink(missing_ok=True)
    children = lines.with_suffix(".children")
    shutil.rmtree(children, ignore_errors=True)
    children.mkdir(parents=True)
    environment = {
        reach.FOLDER: str(children),
        "SKYARM_CACHE": str(OUT / "cache"),
        "PYTHONPATH": os.pathsep.join([str(OUT / "child"), str(HERE)]),
    }

    def work() -> int:
        return processes.run_pytest(
            SOURCE,
            [str(file.relative_to(ROOT))],
            environment,
            lambda: [reach.ReachPlugin(SOURCE, lines)],
        )

    began = time.monotonic()
    status = processes.wait(processes.forked(work, lines.with_suffix(".txt")), 3600.0)
    done.write_text(str(status))
    return f"{name}: exit {status}, {time.monotonic() - began:.0f} s"


def trace_all(workers: int) -> None:
    """Trace every test file that is not traced yet."""
    (OUT / "child").mkdir(parents=True, exist_ok=True)
    (OUT / "reach").mkdir(exist_ok=True)
    (OUT / "child" / "sitecustomize.py").write_text(reach.CHILD)
    processes.import_heavy()
    files = sorted(
        p for p in processes.TESTS.rglob("test_*.py") if "attacks" not in p.parts
    )
    with ProcessPoolExecutor(workers, multiprocessing.get_context("fork")) as pool:
        for work in as_completed([pool.submit(trace_file, file) for file in files]):
            print(work.result(), flush=True)


def run_on(mutant: Mutant, tests: list[record.Test], stage: str) -> dict[str, Any]:
    """Run tests on a mutant; returns the red one, if any, the exit status and the
    seconds.
    """
    box = OUT / "mutant" / f"{mutant.key}_{stage}_{os.getpid()}"
    shutil.rmtree(box, ignore_errors=True)
    shutil.copytree(SOURCE / "skyarm", box / "src" / "skyarm")
    file = box / "src" / "skyarm" / mutant.file
    changed = mutant.changed(file.read_text())
    if changed is None:
        return {"key": mutant.key, "stage": stage, "status": None, "red": "", "s": 0.0}
    file.write_text(changed)
    # object code is kept under its program, so that mutants may share it; not those of
    # the compiler
    cache = box / "cache" if mutant.room == "compile" else OUT / "cache"
    verdict = box / "red.txt"

    def work() -> int:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        arguments = [
            "-x",
            "--tb=short",
            "--basetemp",
            str(box / "tmp"),
            *dict.fromkeys(t.file for t in tests),
        ]
        names = [t.name for t in tests]
        return processes.run_pytest(
            box / "src",
            arguments,
            {"SKYARM_CACHE": str(cache)},
            lambda: [Chosen(names, verdict)],
        )

    began = time.monotonic()
    output = OUT / "output" / f"{mutant.key}_{stage}.txt"
    status = processes.wait(
        processes.forked(work, output), 3.0 * sum(t.seconds for t in tests) + 90.0
    )
    red = (
        verdict.read_text()
        if verdict.is_file()
        else {processes.LATE: "late", 0: "", processes.NONE_CHOSEN: ""}.get(
            status, "not collected"
        )
    )
    shutil.rmtree(box, ignore_errors=True)
    return {
        "key": mutant.key,
        "stage": stage,
        "status": status,
        "red": red,
        "s": round(time.monotonic() - began, 1),
    }


def run_mutant(
    mutant: Mutant, own: list[record.Test], others: list[record.Test], known: set[str]
) -> list[dict[str, Any]]:
    """Run the own room's tests, and the others' if those stay green."""
    found = []
    for stage, tests in (("own", own), ("all", others)):
        if stage in known or not tests:
            continue
        found.append(run_on(mutant, tests, stage))
        if found[-1]["red"]:
            break
    return found


def fates() -> dict[str, dict[str, Any]]:
    """Return what is known: for each mutant the red test of each stage, the empty text
    if none.
    """
    found: dict[str, dict[str, Any]] = {}
    path = OUT / "fates.jsonl"
    for line in path.read_text().splitlines() if path.is_file() else []:
        each = json.loads(line)
        found.setdefault(each["key"], {})[each["stage"]] = each["red"]
    return found


def run_all(
    workers: int, stages: set[str], keys: list[str], rooms: list[str], again: bool
) -> None:
    """Run every drawn mutant that was not run yet; those that lived too if `again`,
    those named in any case.
    """
    _, mutants = record.read_drawn(DRAWN)
    tests, known = record.traced(OUT / "reach"), fates()
    for folder in ("output", "mutant"):
        (OUT / folder).mkdir(exist_ok=True)
    processes.import_heavy()
    with (
        ProcessPoolExecutor(workers, multiprocessing.get_context("fork")) as pool,
        (OUT / "fates.jsonl").open("a") as file,
    ):
        works = []
        for mutant in (m for m in mutants if m.there(SOURCE / "skyarm")):
            done = known.get(mutant.key, {})
            if not keys and any(done.values()):
                continue
            if (keys and mutant.key not in keys) or (
                rooms and mutant.room not in rooms
            ):
                continue
            own, others = record.chosen(
                mutant, (SOURCE / "skyarm" / mutant.file).read_text(), tests
            )
            skipped = (set() if keys or again else set(done)) | (
                {"own", "all"} - stages
            )
            if not (own if "own" not in skipped else []) and not (
                others if "all" not in skipped else []
            ):
                continue
            works.append(pool.submit(run_mutant, mutant, own, others, skipped))
        for work in as_completed(works):
            for found in work.result():
                file.write(json.dumps(found) + "\n")
                file.flush()
                print(json.dumps(found), flush=True)


def score() -> int:
    """Write fates into the record and the table into score.md; returns 1 if a mutant is
    alive that nobody argued.
    """
    seed, mutants = record.read_drawn(DRAWN)
    known, equivalent = fates(), record.argued(EQUIVALENT)
    record.write_drawn(DRAWN, seed, record.left_out(DRAWN), mutants, known)
    drawn = len(mutants)
    mutants = [m for m in mutants if m.there(SOURCE / "skyarm")]
    found = record.table(mutants, known, equivalent)
    if len(mutants) < drawn:
        found += (
            f"{drawn - len(mutants)} of the {drawn} drawn change lines that are no"
            " longer in the source.\n"
        )
    SCORE.write_text(f"# Score of the drawn mutants, seed {seed}\n\n{found}")
    print(found)
    alive = [
        m
        for m in mutants
        if not any(known.get(m.key, {}).values()) and m.key not in equivalent
    ]
    for m in alive:
        print(
            f"| `{m.key}` | {m.file} | `{m.line}` | `{m.old}` -> `{m.new}` | {m.kind} |"
        )
    return 1 if alive else 0


def leave_to_the_night(share: float) -> None:
    """Add slow cases that no drawn mutant needs, and whose functions others reach, to
    the nightly ones.
    """
    sys.path.insert(0, str(processes.TESTS))
    import budget

    killers = {red for stages in fates().values() for red in stages.values() if red}
    names = nightly_cases.spared(
        record.traced(OUT / "reach"), killers, share, budget.ALWAYS
    )
    print(
        f"{len(names)} more cases, {nightly_cases.write_nightly(budget.BUDGET, names)}"
        f" in all: {budget.BUDGET}"
    )


def main() -> int:
    """Do what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("step", choices=["draw", "reach", "run", "score", "nightly"])
    parser.add_argument("--seed", type=int, default=9)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument(
        "--leave-out",
        action="append",
        default=[],
        metavar="KEY",
        help="a mutant not to draw",
    )
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument(
        "--stage", choices=["own", "all"], action="append", help="run only this stage"
    )
    parser.add_argument(
        "--again",
        action="store_true",
        help="run those that lived once more, on tests written since",
    )
    parser.add_argument(
        "--room", action="append", default=[], help="run only this room"
    )
    parser.add_argument(
        "--key", action="append", default=[], help="run only this mutant, known or not"
    )
    parser.add_argument(
        "--share",
        type=float,
        default=0.5,
        help="of the seconds of all cases, that shall stay",
    )
    given = parser.parse_args()
    if given.step == "draw":
        drawn = mutation_draw.draw(
            SOURCE / "skyarm", given.count, given.seed, given.leave_out
        )
        record.write_drawn(DRAWN, given.seed, given.leave_out, drawn, {})
    elif given.step == "reach":
        trace_all(given.workers)
    elif given.step == "run":
        run_all(
            given.workers,
            set(given.stage or ["own", "all"]),
            given.key,
            given.room,
            given.again,
        )
    elif given.step == "nightly":
        leave_to_the_night(given.share)
    return score() if given.step == "score" else 0


if __name__ == "__main__":
    sys.exit(main())
