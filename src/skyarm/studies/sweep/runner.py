"""Execution of a parameter sweep into its folder, in chunks of episodes."""

from __future__ import annotations

import contextlib
import re
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.records.files import PathLike, require_writable, shown, taken_back
from skyarm.records.files.writing import one_writer
from skyarm.records.immutable import immutable
from skyarm.simulate.batch import Batch
from skyarm.studies.sweep.design import values
from skyarm.studies.sweep.plan import Plan, prepare
from skyarm.studies.sweep.stats import Rows
from skyarm.studies.sweep.store import MANIFEST, ROWS, StudyFolder, arrow
from skyarm.studies.sweep.study import Study, StudyError
from skyarm.studies.sweep.study_file import load_study, study_from

Progress = Callable[[int, int], None]
"""Called with (episodes there, episodes in all)."""


@immutable
class Summary:
    """Result of running a sweep: folder, number of flights, episodes simulated and reused, duration in s."""

    folder: Path
    rows: int
    flown: int
    found: int
    seconds: float


def fly_sweep(
    study: Study | Mapping[str, Any] | PathLike,
    folder: PathLike,
    *,
    workers: int = 1,
    part: str | None = None,
    progress: Progress | None = None,
) -> Rows:
    """Simulate the missing flights of a sweep into a folder, and return the results of all.

    Args:
        study: the tables of a study's file (:mod:`skyarm.studies.sweep.study_file`), the path of one, the name of a
            shipped one, or a study that was loaded before.
        folder: of the rows; one that holds some of this study is completed.
        workers: threads that fly; rows do not depend on it.
        part: "K/N", one of the machines that share the folder.
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
    run_sweep(study, folder, threads=workers, part=part, progress=progress)
    return Rows(folder)


def run_sweep(
    study: Study,
    out: PathLike,
    *,
    threads: int = 1,
    part: str | None = None,
    progress: Progress | None = None,
) -> Summary:
    """Simulate the missing flights of a sweep; an interrupted sweep ends with the same files.

    Args:
        study: from :func:`skyarm.studies.sweep.load_study`.
        out: folder of the rows; one that holds some of this study is completed.
        threads: that fly a chunk; rows do not depend on it.
        part: "K/N": of the chunks every N-th from the K-th on; others write into the same folder.
        progress: called after every chunk.

    Raises:
        StudyError: a number that cannot be flown, or a folder that holds another study.
        TakenError: another sweep writes into the folder.
        OSError: the folder cannot be written, which is seen before any flight.
    """
    arrow()
    first, stride = _part(part)
    plan, begin, flown = prepare(study), time.perf_counter(), 0
    report = progress or (lambda *_: None)
    folder = Path(out)
    with taken_back(folder, folder / MANIFEST, folder / ROWS):
        alone = one_writer(require_writable(folder)) if part is None else contextlib.nullcontext()
        with alone:
            try:
                store = StudyFolder(folder, plan.manifest)
            except StudyError as error:
                raise StudyError(f"{study.source}: {error}") from None
            store.write_manifest()
            found, todo = store.episodes, [i for i in range(first, study.chunks, stride) if i not in store.done]
            report(found, study.episodes)
            batches = plan.batches() if todo else {}
            try:
                for index in todo:
                    store.put(index, fly_chunk(plan, batches, index, threads))
                    flown += len(study.span(index))
                    report(store.episodes, study.episodes)
            finally:
                store.write_manifest()
    rows = store.episodes * len(study.scenarios)
    return Summary(folder=folder, rows=rows, flown=flown, found=found, seconds=time.perf_counter() - begin)


def _part(text: str | None) -> tuple[int, int]:
    """First chunk of episodes and stride between chunks, for one machine's share "K/N" of a sweep."""
    found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text or "1/1")
    if not found or not 1 <= int(found[1]) <= int(found[2]):
        raise StudyError(f"--part = {shown(text)}: must be K/N with K from 1 to N, such as 3/16")
    return int(found[1]) - 1, int(found[2])


def fly_chunk(plan: Plan, batches: Mapping[str, Batch], index: int, threads: int = 1) -> bytes:
    """Simulate one chunk of episodes with every controller; returns the content of its Parquet file.

    The bytes depend on study and index only: not on threads, nor on what flew before.
    """
    pa, study, statuses = arrow(), plan.study, plan.manifest.statuses
    span = study.span(index)
    episodes = np.arange(span.start, span.stop)
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
    return plan.manifest.parquet(pa.concat_tables(tables), index)


def _words(pa: Any, indices: Any, words: list[str]) -> Any:
    """Column of strings for a Parquet file, dictionary-encoded."""
    return pa.DictionaryArray.from_arrays(pa.array(indices, type=pa.int8()), pa.array(words))
