"""The scenario of a log, to fly it again."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skyarm.actuation import AllocationError
from skyarm.files import unreadable
from skyarm.log.formats import load_log
from skyarm.scenario.law_by_name import under_law
from skyarm.scenario.scenario_record import Scenario, ScenarioError


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
            scenario = under_law(scenario, law)
        return dataclasses.replace(scenario, **changes)
    except (ValueError, OSError, AllocationError) as error:
        raise ScenarioError(f"{os.fspath(path)}: {error}") from None
