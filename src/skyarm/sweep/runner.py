"""Fly a study chunk by chunk into its folder."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from skyarm.files import require_writable, taken_back
from skyarm.files.writing import one_writer
from skyarm.sweep.manifest import MANIFEST
from skyarm.sweep.plan import Plan, prepare
from skyarm.sweep.rows import arrow, fly_chunk
from skyarm.sweep.store import ROWS, Store
from skyarm.sweep.study import Study

Progress = Callable[[int, int], None]
"""Called with (episodes there, episodes in all)."""

MANIFEST_SECONDS = 10.0
"""Between two writings of the manifest: it is for people, what was flown is found by looking."""

FOUND_SECONDS = 1.0
"""Between two words of progress while the files that are there are read."""

ROUNDS = 3
"""How often chunks fly that are not on disk at the end, the first time included."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Summary:
    """What a sweep did: its folder, rows there, episodes flown now and found from before, seconds of wall clock."""

    folder: Path
    rows: int
    flown: int
    found: int
    seconds: float


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
        OSError: the folder cannot be written, which is seen before any flight; or files of rows vanish again and again.
    """
    arrow()
    plan = prepare(study)
    begin = time.perf_counter()
    with taken_back(out, Path(out) / MANIFEST, Path(out) / ROWS), one_writer(require_writable(out)):
        store = Store(out, plan, _now_and_then(progress, study.episodes))
        found = store.episodes
        if progress is not None:
            progress(found, study.episodes)
        flown = _complete(store, threads, ray, progress)
    return Summary(
        folder=Path(out),
        rows=study.episodes * len(study.scenarios),
        flown=flown,
        found=found,
        seconds=time.perf_counter() - begin,
    )


def _complete(store: Store, threads: int, ray: str | None, progress: Progress | None) -> int:
    """Fly what is missing until every chunk is seen on disk; returns the episodes flown."""
    study, flown, written = store.plan.study, 0, time.perf_counter()
    try:
        for _ in range(ROUNDS):
            for index, content in _chunks(store.plan, list(store.todo), threads, ray):
                store.put(index, content)
                flown += len(study.span(index))
                if time.perf_counter() - written > MANIFEST_SECONDS:
                    store.write_manifest()
                    written = time.perf_counter()
                if progress is not None:
                    progress(store.episodes, study.episodes)
            store.verify()
            if store.verified:
                return flown
    finally:
        store.write_manifest()
    lost = len(list(store.todo))
    raise OSError(
        f"{store.folder}: {lost} of {study.chunks} files of rows vanished or changed while the sweep ran, and again "
        f"each time that they were flown anew; the same command continues"
    )


def _now_and_then(progress: Progress | None, episodes: int) -> Callable[[int], None]:
    """Word of the episodes that were found, at most every ``FOUND_SECONDS``."""
    told = [time.monotonic()]

    def found(there: int) -> None:
        now = time.monotonic()
        if progress is not None and now - told[0] > FOUND_SECONDS:
            told[0] = now
            progress(there, episodes)

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
