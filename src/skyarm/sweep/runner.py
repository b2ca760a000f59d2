"""Fly a study chunk by chunk into its folder."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from skyarm.sweep.plan import Plan, prepare
from skyarm.sweep.rows import arrow, fly_chunk
from skyarm.sweep.store import Store
from skyarm.sweep.study import Study

Progress = Callable[[int, int], None]
"""Called with (episodes there, episodes in all)."""

MANIFEST_SECONDS = 1.0
"""Between two writings of the manifest; files that it does not list yet are found by looking."""


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
        progress: called after every chunk.

    Raises:
        StudyError: a number that cannot be flown, or a folder that holds another study.
        OSError: the folder cannot be written; raised before any flight.
    """
    arrow()
    plan = prepare(study)
    store = Store(out, plan)
    begin = time.perf_counter()
    found = sum(len(study.span(index)) for index in store.done)
    there, written = found, begin
    if progress is not None:
        progress(there, study.episodes)
    try:
        for index, content in _chunks(plan, store.todo, threads, ray):
            store.put(index, content)
            there += len(study.span(index))
            if time.perf_counter() - written > MANIFEST_SECONDS:
                store.write_manifest()
                written = time.perf_counter()
            if progress is not None:
                progress(there, study.episodes)
    finally:
        store.write_manifest()
    return Summary(
        folder=Path(out),
        rows=study.episodes * len(study.scenarios),
        flown=there - found,
        found=found,
        seconds=time.perf_counter() - begin,
    )


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
