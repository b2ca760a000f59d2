"""Execution of a parameter sweep into its folder, in chunks of episodes."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from skyarm.records.files import PathLike, errors_as, shown, taken_back
from skyarm.records.immutable import immutable
from skyarm.studies.flights import Store, WorkRunner
from skyarm.studies.flights.executor import LOCAL
from skyarm.studies.flights.store import ROWS, require_parquet
from skyarm.studies.sweep.manifest import MANIFEST
from skyarm.studies.sweep.plan import prepare
from skyarm.studies.sweep.rows import require_same_study, rows_there
from skyarm.studies.sweep.stats import Rows
from skyarm.studies.sweep.study import Study, StudyError
from skyarm.studies.sweep.study_file import load_study, study_from

Progress = Callable[[int, int], None]
"""Callback (episodes stored, total episodes)."""


@immutable
class SweepSummary:
    """Result of running a sweep: folder, number of flights, episodes simulated and
    reused, duration in s.
    """

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
    on: str = LOCAL,
    part: str | None = None,
    progress: Progress | None = None,
) -> Rows:
    """Simulate the missing flights of a sweep into a folder, and return the results of
    all.

    Args:
        study: the tables of a study's file (:mod:`skyarm.studies.sweep.study_file`),
            the path of one, the name of a shipped one, or a study that was loaded
            before.
        folder: folder of the rows; one that holds some of this study is completed.
        workers: threads or processes that fly; rows do not depend on it.
        on: "local", "processes", "ray" or "ray:HOST:PORT".
        part: "K/N", one of the machines that share the folder.
        progress: called with (episodes there, episodes in all).

    Returns:
        the rows, a column at a time: ``rows.of("paper_ct", "position_error_mean")``,
        one number an episode.

    Raises:
        StudyError: one line: a study that cannot be flown, or a folder that holds
            another one.
        OSError: the folder cannot be written.
    """
    if isinstance(study, Mapping):
        study = study_from(study)
    elif not isinstance(study, Study):
        study = load_study(study)
    run_sweep(study, folder, workers=workers, on=on, part=part, progress=progress)
    return Rows(folder)


def run_sweep(
    study: Study,
    out: PathLike,
    *,
    workers: int = 1,
    on: str = LOCAL,
    part: str | None = None,
    progress: Progress | None = None,
) -> SweepSummary:
    """Simulate the missing flights of a sweep; an interrupted sweep ends with the same
    files.

    Args:
        study: study from :func:`skyarm.studies.sweep.load_study`.
        out: folder of the rows; one that holds some of this study is completed.
        workers: threads or processes that fly; rows do not depend on it.
        on: "local", "processes", "ray" or "ray:HOST:PORT".
        part: "K/N": of the chunks every N-th from the K-th on; others write into the
            same folder.
        progress: called after every file of rows.

    Raises:
        StudyError: a number that cannot be flown, or a folder that holds another study.
        TakenError: another sweep writes into the folder.
        OSError: the folder cannot be written, which is seen before any flight.
    """
    require_parquet()
    first, stride = _part(part)
    plan = prepare(study)
    begin = time.perf_counter()
    report = progress or (lambda *_: None)
    folder = Path(out)
    manifest = plan.manifest
    controllers = len(study.scenarios)
    with taken_back(folder, folder / MANIFEST, folder / ROWS):
        store = Store(folder, study=manifest.digest)
        with store.alone(f"{first + 1}_of_{stride}" if stride > 1 else ""):
            with errors_as(StudyError, f"{study.source}: ", StudyError):
                require_same_study(folder, manifest)
            there = rows_there(folder, manifest)
            present = there.count // controllers
            manifest.write(folder, there.count, len(there.chunks))
            report(present, study.episodes)
            works = (
                work
                for index in range(first, manifest.chunks, stride)
                for work in plan.works(index)
            )
            try:
                with WorkRunner(on, workers, store) as runner:
                    for _ in runner.fly(works):
                        # stored chunks are yielded, too, and are counted already
                        if runner.flights:
                            report(
                                (there.count + runner.flights) // controllers,
                                study.episodes,
                            )
            finally:
                # also after an interruption the manifest says what is there
                there = rows_there(
                    folder, manifest, untrusted={*there.ignored} - store.written
                )
                manifest.write(folder, there.count, len(there.chunks))
    return SweepSummary(
        folder=folder,
        rows=there.count,
        flown=runner.flights // controllers,
        found=present,
        seconds=time.perf_counter() - begin,
    )


def _part(text: str | None) -> tuple[int, int]:
    """First chunk of episodes and stride between chunks, for one machine's share "K/N"
    of a sweep.
    """
    # six digits, chosen: a million machines
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", "1/1" if text is None else str(text))
    if not match or not 1 <= int(match[1]) <= int(match[2]):
        raise StudyError(
            f"--part = {shown(text)}: must be K/N with K from 1 to N, such as 3/16"
        )
    return int(match[1]) - 1, int(match[2])
