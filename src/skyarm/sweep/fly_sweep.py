"""A study from Python: its tables or its file in, its rows out."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from skyarm.sweep.runner import Progress, run_sweep
from skyarm.sweep.stats import Rows
from skyarm.sweep.study import Study
from skyarm.sweep.study_file import load_study, study_from


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
