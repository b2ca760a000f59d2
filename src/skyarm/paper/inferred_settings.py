"""The paper's cases with settings inferred from its published numbers by a search."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Mapping
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.paper.flights import HOLDS, Flight, Metrics, metrics
from skyarm.records.files import require_replaceable, require_writable
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate import Window, run
from skyarm.studies.identify.identification import Progress, identify, study_digest
from skyarm.studies.identify.study import IdentificationStudy, read_identification

LIBRARY = resources.files("skyarm.paper") / "library"
STUDY, FOUND = "unstated_settings.toml", "unstated_settings.json"
"""The study, and what the search that ships with the package found."""

INFERRED, PREDICTED = "inferred", "predicted"
"""Settings found on all cells, and those found on Cases 2 and 3 only."""

MOTION = 6.0
"""s at which the motion begins as stated."""

PREDICTION = "from_cases_2_and_3"


@lru_cache(maxsize=1)
def unstated_study() -> IdentificationStudy:
    """The study of what the paper leaves open."""
    return read_identification((LIBRARY / STUDY).read_bytes(), Path(), STUDY)


def shipped_evidence() -> dict[str, Any]:
    """Shipped evidence of the search (``skyarm reproduce --infer`` makes it anew)."""
    found: dict[str, Any] = json.loads((LIBRARY / FOUND).read_text(encoding="utf-8"))
    return found


def is_of_this_study(evidence: Mapping[str, Any]) -> bool:
    """True if evidence was found with the study as it is now."""
    return bool(evidence.get("study_digest") == study_digest(unstated_study()))


def settings_in(evidence: Mapping[str, Any], kind: str) -> dict[str, Any]:
    """Settings of a kind: inferred, or predicted."""
    stage = "fit" if kind == INFERRED else f"prediction {PREDICTION}"
    return dict(evidence["stages"][stage]["settings"])


def inferred_scenario(flight: Flight, settings: Mapping[str, Any]) -> Scenario:
    """The scenario of a flight under settings of the study."""
    study, name = unstated_study(), f"{flight.case} {flight.controller}"
    planned = scenario_from(study.tables(name, settings), replaced={"plant": flight.plant})
    changed = with_numbers(planned, study.numbers(name, settings))
    # a single flight needs no room for longer delays
    return changed.with_words(delays=dataclasses.replace(changed.delays, longest_command=None))


def measure_inferred(flight: Flight, settings: Mapping[str, Any]) -> Metrics:
    """Fly and measure a flight of the paper under inferred settings."""
    planned = inferred_scenario(flight, settings)
    # the arm of Case 1 is held as long after the law has joined as it is after 6 s where all is as stated
    later = float(planned.tracking_start) - MOTION if flight.case == "case1" and planned.tracking_start else 0.0
    holds = tuple(Window(each.start + later, each.stop + later) for each in HOLDS)
    return metrics(flight.case, run(planned), holds)


def infer(
    out: str | os.PathLike[str] = "out/paper", *, threads: int = 1, progress: Progress | None = None
) -> dict[str, Any]:
    """Search for the settings that the paper leaves open, with ladder, choices, profiles, rivals and predictions.

    Writes ``unstated_settings.json`` after every stage; called again it continues where it was stopped, and flies
    nothing if all of it is there. Results do not depend on the number of threads.

    Args:
        out: folder, made if missing.
        threads: that fly.
        progress: called before every stage and at the end.

    Returns:
        The evidence, for :func:`skyarm.paper.reproduce.reproduce`.

    Raises:
        OSError: the folder or the file in it cannot be written; raised before any flight.
        NoMachineCodeError: before any flight; candidates fly in batches.
    """
    require_machine_code()
    file = require_writable(out) / FOUND
    require_replaceable(file)
    return identify(unstated_study(), file, threads=threads, progress=progress)
