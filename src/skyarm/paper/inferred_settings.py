"""Cases of Barakou et al. 2026 with settings inferred from its published numbers."""

from __future__ import annotations

import dataclasses
import json
from functools import cache
from importlib import resources

from skyarm.log.metrics.windows import Window
from skyarm.paper.flights import HOLDS, PaperFlight, work_of
from skyarm.paper.published import Record
from skyarm.paper.unstated_study import (
    Tables,
    numbers,
    scenario_tables,
    stated_tables,
    study_digest,
)
from skyarm.records.files import read_toml
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.flights import Work

LIBRARY = resources.files("skyarm.paper") / "library"
STUDY, FOUND = "unstated_settings.toml", "unstated_settings.json"
"""Files of the study and of the settings that the shipped search found."""

INFERRED, PREDICTED = "inferred", "predicted"
"""Names of the settings found on all cells, and of those found on Cases 2 and 3
only."""

MOTION = 6.0
"""Stated start (s) of the motion."""

PREDICTION = "from_cases_2_and_3"


@cache
def unstated_study() -> Tables:
    """Definition of the search for settings that Barakou et al. 2026 do not state, as
    in its TOML file.
    """
    return read_toml((LIBRARY / STUDY).read_bytes())


def shipped_evidence() -> Record:
    """Read the shipped results of the search for unstated settings."""
    return dict(json.loads((LIBRARY / FOUND).read_text(encoding="utf-8")))


def is_of_this_study(evidence: Record) -> bool:
    """True if given search results belong to the current definition of the search."""
    study = unstated_study()
    flights = {
        each["name"]: stated_tables(study, each["name"]) for each in study["flights"]
    }
    # settings of another study are shown with a note, not refused
    return bool(evidence.get("study_digest") == study_digest(study, flights))


def settings_in(evidence: Record, kind: str) -> Record:
    """Inferred settings: fitted to all cases, or predicted from some cases."""
    stage = "fit" if kind == INFERRED else f"prediction {PREDICTION}"
    return dict(evidence["stages"][stage]["settings"])


def inferred_scenario(flight: PaperFlight, settings: Record) -> Scenario:
    """Scenario of one flight with inferred settings."""
    study = unstated_study()
    name = f"{flight.case} {flight.controller}"
    tables = scenario_tables(study, stated_tables(study, name), name, settings)
    planned = scenario_from(tables, replaced={"plant": flight.plant})
    changed = with_numbers(planned, numbers(study, name, settings))
    # a single flight needs no room for longer delays
    return changed.with_delays(
        dataclasses.replace(changed.agent.delays, longest_command=None)
    )


def inferred_work(flight: PaperFlight, evidence: Record, kind: str) -> Work:
    """Work item of a flight with inferred settings: fitted to all cases, or predicted
    from some cases.
    """
    planned = inferred_scenario(flight, settings_in(evidence, kind))
    # the arm of Case 1 is held as long after the law has joined as it is after 6 s
    # where all is as stated
    later = (
        float(planned.agent.tracking_start) - MOTION
        if flight.case == "case1" and planned.agent.tracking_start
        else 0.0
    )
    holds = tuple(Window(each.start + later, each.stop + later) for each in HOLDS)
    return work_of(flight, planned, kind, holds=holds)
