"""Run a benchmark of several controllers into a folder: simulate, evaluate, write one report.

A suite says what flies and how it is judged; the rest is here. Each cell is a file of its own from the moment it has
flown, so that a suite that was killed continues; ``flights.parquet`` holds every flight of all cells in a row.
"""

from __future__ import annotations

import io
import json
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from concurrent.futures import as_completed
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Generic, TypeVar

from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.records.files import require_writable, write_atomically
from skyarm.records.registry.plugins import identities
from skyarm.simulate.workers import Progress, workers
from skyarm.studies.compare.cells import Cell, Cells, Flights, fly
from skyarm.view.pages import Report

DPI = 160
PAGE = "report.html"
Record = Mapping[str, Any]
"""Plain data of a results file."""

Document = dict[str, Any]
"""The same while it is written."""

F = TypeVar("F", bound=Flights)

Refused = Mapping[str, str]
"""Law, or law and trial -> why it does not fly."""


class Suite(ABC, Generic[F]):
    """Base class of controller benchmarks: the flights to simulate, their evaluation and report.

    Attributes:
        name: of the suite. file: name of its results, without the suffix.
    """

    name: str
    file: str

    @property
    @abstractmethod
    def options(self) -> Document:
        """Settings that determine a benchmark's report, as plain data."""

    @abstractmethod
    def plan_cells(self) -> tuple[Sequence[F], Refused]:
        """All flights of a benchmark, and reasons why a controller is excluded."""

    @abstractmethod
    def judge(self, todo: Sequence[F], cells: Sequence[Cell], refused: Refused) -> Document:
        """Evaluate all flights of a benchmark; returns the results as plain data."""

    def pictures(self, found: Record) -> dict[str, bytes]:
        """Pictures of a benchmark's report: file name -> PNG content."""
        return {}

    @abstractmethod
    def report(self, found: Record, pictures: Mapping[str, bytes] | None = None) -> Report:
        """Build the report of a benchmark from its results."""


def fly_suite(suite: Suite[F], folder: Path, *, threads: int = 1, progress: Progress | None = None) -> Document:
    """Simulate the missing flights of a benchmark, write its files, and return the content of its JSON file.

    Raises:
        ValueError: no law flies any trial.
        NoMachineCodeError: before any flight; most laws fly in batches.
        OSError: a file cannot be written.
    """
    require_machine_code()
    todo, refused = suite.plan_cells()
    if not todo:
        words = "; ".join(f"--laws: {law}: {why}" for law, why in refused.items())
        raise ValueError(words or "--only: must name trials that the vehicle flies")
    prepare(folder)
    cells = fly_all(todo, folder / "cells", threads=threads, progress=progress)
    found: Document = {"schema": 1, "suite": suite.name, **suite.options}
    if identities():
        found["plugins"] = identities()
    found |= suite.judge(todo, cells, refused)
    pictures = suite.pictures(found)
    write_suite(suite, found, pictures, folder)
    write_flights(todo, cells, folder)
    return found


def prepare(folder: Path) -> None:
    """Create the output folders of a benchmark.

    Raises:
        OSError: one of them cannot be written.
    """
    require_writable(folder)
    require_writable(folder / "cells")


def fly_all(todo: Sequence[Flights], folder: Path, *, threads: int = 1, progress: Progress | None = None) -> list[Cell]:
    """Simulate the flights of a benchmark, except for those whose results are already in the folder.

    Args:
        todo: flights of each cell.
        folder: of the cells.
        threads: of a batch, or processes if there are more cells. No number depends on it.
        progress: called after every cell.

    Raises:
        OSError: a process ended unexpectedly, or a cell cannot be written.
    """
    store, found = Cells(folder), dict[int, Cell]()

    def note(k: int, cell: Cell) -> None:
        found[k] = cell
        if progress is not None:
            progress(len(found), len(todo), todo[k].label.replace("__", " "))

    def keep(k: int, cell: Cell) -> None:
        store.put(todo[k], cell)
        note(k, cell)

    left = []
    for k, cell in enumerate(map(store.get, todo)):
        if cell is None:
            left.append(k)
        else:
            note(k, cell)
    if threads == 1 or len(left) <= threads:
        for k in left:
            keep(k, fly(todo[k], threads))
    else:  # of many cells each takes a processor
        with workers(threads) as submit:
            flying = {submit(fly, todo[k]): k for k in left}
            for future in as_completed(flying):
                keep(flying[future], future.result())
    return [found[k] for k in range(len(todo))]


def write_suite(suite: Suite[F], found: Record, pictures: dict[str, bytes], folder: Path) -> None:
    """Write results and report of a benchmark as JSON, Markdown, HTML and pictures."""
    report, results = suite.report(found, pictures), json.dumps(found, indent=1, allow_nan=False) + "\n"
    texts = {f"{suite.file}.json": results, "tables.md": report.markdown(), PAGE: report.html()}
    for name, content in (pictures | {name: text.encode() for name, text in texts.items()}).items():
        write_atomically(folder / name, content)


def write_flights(todo: Sequence[Flights], cells: Sequence[Cell], folder: Path) -> None:
    """Write every flight of a benchmark as a row of ``flights.parquet`` if pyarrow is installed."""
    if find_spec("pyarrow") is None:
        return
    import pyarrow as pa
    import pyarrow.parquet as pq

    tables = []
    for flights, cell in zip(todo, cells, strict=True):
        count = len(cell.status)
        names = dict(zip(("condition", "case", "law"), flights.name, strict=True))
        fixed = {name: pa.array([word] * count).dictionary_encode() for name, word in names.items()}
        numbers = {"trial": flights.trials(count), **cell.metrics}
        tables.append(pa.table({**fixed, "status": pa.array(cell.status), **numbers}))
    stream = io.BytesIO()
    pq.write_table(pa.concat_tables(tables, promote_options="default"), stream)
    write_atomically(folder / "flights.parquet", stream.getvalue())
