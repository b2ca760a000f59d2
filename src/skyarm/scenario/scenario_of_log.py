"""The scenario of a log, to fly it again."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skyarm.actuation import AllocationError
from skyarm.control.catalogue import make_named
from skyarm.files import unreadable
from skyarm.log.formats import load_log
from skyarm.scenario.changes import without_law
from skyarm.scenario.scenario_record import Delays, Rates, Scenario, ScenarioError


def scenario_of_log(path: str | os.PathLike[str], replaced: Mapping[str, Any] | None = None) -> Scenario:
    """The scenario that a log keeps, with what is replaced in it.

    Args:
        path: of a log in a format that can be read back.
        replaced: "plant", "controller", "seed", "duration" in place of the log's.

    Raises:
        ScenarioError: one line, ``file: what is wrong``.
    """
    changes = dict(replaced or {})
    reason = unreadable(Path(path))
    try:
        if reason:
            raise ValueError(reason)
        scenario: Scenario = load_log(path).scenario
        law = changes.pop("controller", None)
        if law is not None:
            model, known = scenario.controller.par.model, loop_facts(scenario.rates, scenario.delays)
            changes["controller"] = make_named(law, model, known)
            changes["changes"] = without_law(scenario.changes)
        return dataclasses.replace(scenario, **changes)
    except (ValueError, OSError, AllocationError) as error:
        raise ScenarioError(f"{os.fspath(path)}: {error}") from None


def loop_facts(rates: Rates, delays: Delays) -> dict[str, float]:
    """What a law may know of its loop: its clocks and the age of its measurements, s."""
    return {
        "control_period": 1.0 / rates.control,
        "reference_period": 1.0 / rates.reference,
        "delay": delays.measurement,
        "delay_periods": round(delays.measurement * rates.control),
    }
