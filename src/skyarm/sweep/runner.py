"""Fly a study chunk by chunk into its folder."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.files import require_writable, taken_back
from skyarm.files.writing import one_writer
from skyarm.simulate.batch import Batch
from skyarm.sweep.chunk_file import arrow, chunk_file
from skyarm.sweep.design import values
from skyarm.sweep.plan import Plan, prepare
from skyarm.sweep.stats import Rows
from skyarm.sweep.study import Study
from skyarm.sweep.study_file import load_study, study_from
from skyarm.sweep.study_folder import MANIFEST, ROWS, StudyFolder

Progress = Callable[[int, int], None]
"""Called with (episodes there, episodes in all)."""

MANIFEST_SECONDS, FOUND_SECONDS = 10.0, 1.0
"""Between two writings of the manifest, and between two calls of progress while the files that are there are read."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Summary:
    """Outcome of a sweep: its folder, rows there, episodes flown now and found from before, seconds of wall clock."""

    folder: Path
    rows: int
    flown: int
    found: int
    seconds: float


def fly_sweep(
    study: Study | Mapping[str, Any] | str | os.PathLike[str],
    folder: str | os.PathLike[str],
    *,
    workers: int = 1,
    ray: str | None = None,
    progress: Progress | None = None,
) -> Rows:
    """Fly a study, or what is missing of it, into a folder, and read its rows.

    Args:
        study: the tables of a study's file (:mod:`skyarm.sweep.study_file`), the path of one, the name of a shipped
            one, or a study that was loaded before.
        folder: of the rows; one that holds some of this study is completed.
        workers: threads that fly; rows do not depend on it.
        ray: address of a Ray cluster, or "local".
        progress: called with (episodes there, episodes in all).

    Returns:
        the rows, a column at a time: ``rows.of("paper_ct", "position_error_mean")``, one number an episode.

    Raises:
        StudyError: one line: a study that cannot be flown, or a folder that holds another one.
        OSError: the folder cannot be written.
    """
    if isinstance(study, Mapping):
        study = study_from(study)
    elif not isinstance(study, Study):
        study = load_study(study)
    run_sweep(study, folder, threads=workers, ray=ray, progress=progress)
    return Rows(folder)


def run_sweep(
    study: Study,
    out: str | os.PathLike[str],
    *,
    threads: int = 1,
    ray: str | None = None,
    progress: Progress | None = None,
) -> Summary:
    """Fly what is missing of a study; the content of the folder does not depend on how often it was interrupted.

    Args:
        study: from :func:`skyarm.sweep.load_study`.
        out: folder of the rows; one that holds some of this study is completed.
        threads: that fly a chunk; rows do not depend on it.
        ray: address of a Ray cluster that flies the chunks, "local" to start one here.
        progress: called after every chunk, and now and then while those that are there are read.

    Raises:
        StudyError: a number that cannot be flown, or a folder that holds another study.
        TakenError: another sweep writes into the folder.
        OSError: the folder cannot be written, which is seen before any flight; or files of rows vanished.
    """
    arrow()
    plan, begin, flown = prepare(study), time.perf_counter(), 0
    report = progress or (lambda *_: None)
    with taken_back(out, Path(out) / MANIFEST, Path(out) / ROWS), one_writer(require_writable(out)):
        store = StudyFolder(out, plan, _seldom(lambda there: report(there, study.episodes)))
        found, written = store.episodes, time.perf_counter()
        report(found, study.episodes)
        try:
            for index, content in _chunks(plan, list(store.todo), threads, ray):
                store.put(index, content)
                flown += len(study.span(index))
                if time.perf_counter() - written > MANIFEST_SECONDS:
                    store.write_manifest()
                    written = time.perf_counter()
                report(store.episodes, study.episodes)
        finally:
            store.finish()
    return Summary(
        folder=Path(out),
        rows=study.episodes * len(study.scenarios),
        flown=flown,
        found=found,
        seconds=time.perf_counter() - begin,
    )


def _seldom(call: Callable[[int], None]) -> Callable[[int], None]:
    """A function that calls at most every ``FOUND_SECONDS``."""
    last = time.monotonic()

    def found(there: int) -> None:
        nonlocal last
        if time.monotonic() - last > FOUND_SECONDS:
            last = time.monotonic()
            call(there)

    return found


def _chunks(plan: Plan, todo: list[int], threads: int, ray: str | None) -> Iterator[tuple[int, bytes]]:
    """Each chunk's file, in any order."""
    if not todo:
        return
    if ray is not None:
        from skyarm.sweep.distributed import fly_on_ray

        yield from fly_on_ray(plan, todo, ray)
        return
    batches = plan.batches()
    for index in todo:
        yield index, fly_chunk(plan, batches, index, threads)


def fly_chunk(plan: Plan, batches: Mapping[str, Batch], index: int, threads: int = 1) -> bytes:
    """Fly one chunk with every controller and return its Parquet file.

    The bytes depend on study and index only: not on threads, nor on what flew before.
    """
    pa, study, statuses = arrow(), plan.study, plan.origin.statuses
    episodes = np.arange(study.span(index).start, study.span(index).stop)
    drawn = values(study, episodes)
    tables = []
    for position, batch in enumerate(batches.values()):
        outcome = batch.fly(
            {path: drawn[path] for path in study.paths}, seed=study.seed, episodes=episodes, threads=threads
        )
        numbers = np.argmax([outcome.status == word for word in statuses], axis=0)
        columns: dict[str, Any] = {
            "episode": episodes.astype(np.uint32),
            "controller": _words(pa, np.full(len(episodes), position), list(batches)),
            **{path: np.asarray(column, dtype=float) for path, column in drawn.items()},
            **{name: np.asarray(column, dtype=float) for name, column in outcome.metrics.items()},
            "status": _words(pa, numbers, list(statuses)),
            "end_time": outcome.end_time,
        }
        tables.append(pa.table(columns))
    return chunk_file(pa.concat_tables(tables), plan.origin, index)


def _words(pa: Any, indices: Any, words: list[str]) -> Any:
    """A column of words, each stored once."""
    return pa.DictionaryArray.from_arrays(pa.array(indices, type=pa.int8()), pa.array(words))
