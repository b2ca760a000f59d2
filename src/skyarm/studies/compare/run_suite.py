"""Run a benchmark of several controllers into a folder: simulate, evaluate, write one
report.

A suite says what flies and how it is judged; the rest is here. Each cell has a file of
rows from the moment it has flown, so that a suite that was killed continues;
``flights.parquet`` holds every flight of all cells in a row.
"""

from __future__ import annotations

import json
import warnings
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import ClassVar, Generic, TypeVar

from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.records.files import (
    PathLike,
    needs_extra,
    require_writable,
    taken_back,
    write_atomically,
)
from skyarm.records.registry.plugins import identities
from skyarm.studies.compare.cell_flights import (
    NAMES,
    Cell,
    CellFlights,
    Document,
    Record,
    table,
)
from skyarm.studies.flights import Store, WorkRunner
from skyarm.studies.flights.executor import Progress
from skyarm.studies.flights.store import ROWS, concatenate, files_by_label, unpack_rows
from skyarm.view.pages import Report

DPI = 160
PAGE = "report.html"
F = TypeVar("F", bound=CellFlights)

Refused = Mapping[str, str]
"""Law, or law and trial -> reason why it does not fly."""

Pngs = Mapping[str, bytes] | None
"""Pictures of a report by their file names; None for a report without any."""


class Suite(ABC, Generic[F]):
    """Base class of controller benchmarks: the flights to simulate, their evaluation
    and report.

    Attributes:
        name: name of the suite. file: name of its results, without the suffix. folder:
            usual folder of its files.
        settings: fields that determine its report.
    """

    name: str
    file: str
    folder: ClassVar[str] = "out/compare"
    settings: ClassVar[tuple[str, ...]] = ("seed", "plant")

    @property
    def options(self) -> Document:
        """Settings that determine a benchmark's report, as plain data."""
        return {name: getattr(self, name) for name in self.settings}

    @abstractmethod
    def plan_cells(self) -> tuple[Sequence[F], Refused]:
        """All flights of a benchmark, and reasons why a controller is excluded."""

    @abstractmethod
    def judge(self, flown: Sequence[tuple[F, Cell]], refused: Refused) -> Document:
        """Evaluate all flights of a benchmark; returns the results as plain data."""

    def pictures(self, found: Record) -> dict[str, bytes]:
        """Pictures of a benchmark's report: file name -> PNG content."""
        return {}

    @abstractmethod
    def report(self, found: Record, pictures: Pngs = None) -> Report:
        """Build the report of a benchmark from its results."""


class SummarySuite(Suite[F]):
    """Base of benchmarks whose results are the statistics of each controller, case and
    condition.
    """

    def judge(self, flown: Sequence[tuple[F, Cell]], refused: Refused) -> Document:
        """Statistics of the metrics for every controller, case and condition, and why
        others do not fly.
        """
        named = {flights.name: cell for flights, cell in flown}
        return {"summaries": table(named)} | (
            {"not_flown": dict(refused)} if refused else {}
        )


def fly_suite(
    suite: Suite[F],
    out: PathLike,
    *,
    workers: int = 1,
    on: str | None = None,
    progress: Progress | None = None,
) -> Document:
    """Simulate the missing flights of a benchmark, write its files, and return the
    content of its JSON file.

    Args:
        suite: suite to fly.
        out: folder of its files; cells whose rows it holds do not fly again.
        workers: threads or processes that fly; no number depends on it.
        on: "local", "processes", "ray" or "ray:HOST:PORT"; for more cells than workers
            processes, if left out.
        progress: called after every cell with (cells done, all, the last).

    Raises:
        ValueError: no law flies any trial.
        TakenError: another comparison writes into the folder.
        NoMachineCodeError: before any flight; most laws fly in batches.
        OSError: a file cannot be written, or a process ended unexpectedly.
    """
    require_machine_code()
    todo, refused = suite.plan_cells()
    if not todo:
        words = "; ".join(f"--laws: {law}: {why}" for law, why in refused.items())
        raise ValueError(words or "--only: must name trials that the vehicle flies")
    folder = Path(out)
    # a suite that is refused leaves no empty folder behind
    with taken_back(folder, folder / ROWS):
        store = open_store(require_writable(out))
        with store.alone() if store else nullcontext():
            cells, flown = dict[str, Cell](), dict[str, bytes]()
            with WorkRunner(on, workers, store) as runner:
                for work, content in runner.fly(each.work() for each in todo):
                    cells[work.label] = Cell.of_rows(work, unpack_rows(content))
                    flown[work.label] = content
                    if progress is not None:
                        progress(len(cells), len(todo), work.label.replace("__", " "))
            document = {"schema": 1, "suite": suite.name, **suite.options}
            if identities():
                document["plugins"] = identities()
            # cells land in any order; the report keeps that of the plan
            pairs = [(each, cells[each.label]) for each in todo]
            document |= suite.judge(pairs, refused)
            write_suite(suite, document, suite.pictures(document), folder)
            if store:
                columns = [
                    (
                        flown[each.label],
                        (*NAMES, "status", "trial", *cells[each.label].metrics),
                    )
                    for each in todo
                ]
                write_atomically(folder / "flights.parquet", concatenate(columns))
    return document


def other_report(suite: Suite[F], folder: Path) -> str:
    """Name of another benchmark whose report is in a folder, where this one's is going
    to replace it; else empty.
    """
    name = there = suite.name
    with suppress(ValueError, LookupError, TypeError, OSError):  # it is no report
        there = json.loads((folder / f"{suite.file}.json").read_text("utf-8"))["suite"]
    return "" if there == name else str(there)


def open_store(folder: Path) -> Store | None:
    """Open the store of a benchmark's results, and warn of flights to repeat; None
    without pyarrow.
    """
    if not files_by_label(folder / ROWS) and any((folder / "cells").glob("*.cell")):
        warnings.warn(
            f"{folder}: cells of skyarm 0.3 do not count: what they hold is flown"
            " again",
            stacklevel=2,
        )
    store = Store.if_kept(folder)
    if store is None:
        warnings.warn(
            f"pyarrow: is missing: what has flown is not kept; {needs_extra('sweep')}",
            stacklevel=2,
        )
    return store


def write_suite(
    suite: Suite[F], found: Record, pictures: dict[str, bytes], folder: Path
) -> None:
    """Write results and report of a benchmark as JSON, Markdown, HTML and pictures."""
    report = suite.report(found, pictures)
    results = json.dumps(found, indent=1, allow_nan=False) + "\n"
    texts = {
        f"{suite.file}.json": results,
        "tables.md": report.markdown(),
        PAGE: report.html(),
    }
    for name, content in (
        pictures | {name: text.encode() for name, text in texts.items()}
    ).items():
        write_atomically(folder / name, content)
