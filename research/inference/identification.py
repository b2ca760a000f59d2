"""A study carried out stage by stage into one file, which the same command continues
after a stop.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from inference.candidates import Candidates
from inference.checks import require_searchable
from inference.evidence import Evidence
from inference.study import IdentificationStudy
from skyarm.paper.unstated_study import digest_of
from skyarm.records.files import versions, write_atomically
from skyarm.records.identity import identity
from skyarm.scenario.scenario_file import scenario_from

Progress = Callable[[int, int, str], None]
"""Called with (stages done, stages in all, what comes next)."""


def result_digest(study: IdentificationStudy) -> str:
    """Digest of all that results depend on: request, records that fly, and their
    laws.
    """
    scenarios = {
        flight.name: identity(scenario_from(flight.document, flight.folder))
        for flight in study.flights
    }
    return digest_of(
        {"study": study.digest, "scenarios": scenarios, "version": versions()["skyarm"]}
    )


def identify(
    study: IdentificationStudy,
    file: str | os.PathLike[str],
    *,
    threads: int = 1,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Carry out a study.

    Each stage is in the file as soon as it is found; stages that are there already are
    not done again if the file is of the same study, scenarios and version. Results do
    not depend on the number of threads.

    Args:
        study: what is asked.
        file: JSON; written whole or not at all.
        threads: that fly.
        progress: called before every stage and at the end.

    Returns:
        The content of the file: digests, and by stage what it found.

    Raises:
        ValueError: one line: a range whose ends a flight cannot have.
        OSError: the file cannot be written.
    """
    path, digest = Path(file), result_digest(study)
    done: dict[str, Any] = _stages_there(path, digest)
    if not done:
        require_searchable(study)
    evidence = Evidence(study, Candidates(study, threads))
    stages = evidence.stages()
    for number, (name, work) in enumerate(stages.items()):
        if name not in done:
            if progress is not None:
                progress(number, len(stages), name)
            done[name] = work(done)
            write_atomically(path, _json(study, digest, done))
    if progress is not None:
        progress(len(stages), len(stages), "")
    return _content(study, digest, {name: done[name] for name in stages})


def _json(study: IdentificationStudy, digest: str, done: Mapping[str, Any]) -> bytes:
    return (
        json.dumps(_content(study, digest, done), indent=1, allow_nan=False) + "\n"
    ).encode()


def _content(
    study: IdentificationStudy, digest: str, done: Mapping[str, Any]
) -> dict[str, Any]:
    asked = {
        "study": study.plan.name,
        "study_digest": study.digest,
        "version": versions()["skyarm"],
    }
    return {"schema": 1} | asked | {"digest": digest, "stages": dict(done)}


def _stages_there(path: Path, digest: str) -> dict[str, Any]:
    """Stages of a file of the same digest; none of a file that is not one."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    if (
        not isinstance(found, dict)
        or found.get("digest") != digest
        or not isinstance(found.get("stages"), dict)
    ):
        return {}
    return dict(found["stages"])
