"""Numbers of a batch with which air, a force or a drive bears only shorter steps than the batch was compiled for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from skyarm.files import shown
from skyarm.plant.largest_step import STATED, borne_step
from skyarm.records.leaves import Place, field_names, part, replaced
from skyarm.scenario.paths import places_of
from skyarm.scenario.scenario_record import Scenario, ScenarioError


def require_short_steps(scenario: Scenario, values: Mapping[str, Any], largest: float | None) -> None:
    """Refuse numbers that ask for shorter steps than those compiled: the flight would blow up without a word.

    Every lane is looked at with all of its numbers: of stiffness and mass each may be within what others fly.

    Args:
        scenario: of the batch.
        values: path -> (lanes,) or one number for all; all that differ from the scenario's.
        largest: step that the batch was compiled for, s; None for any.

    Raises:
        ScenarioError: names the paths and the values.
    """
    for place, fields in _stated(scenario, values).items():
        record = part(scenario, place)
        kind = type(record)
        if kind.largest_step is None and "largest_step" not in (field_names(kind) or ()):
            continue  # whatever its numbers are
        columns = [np.ravel(each) for each in np.broadcast_arrays(*(np.asarray(values[path]) for path in fields))]
        shortest, stiffest = math.inf, dict[str, float]()
        for numbers in np.unique(np.array(columns, dtype=float), axis=1).T.tolist():
            told = dict(zip(fields, numbers, strict=True))
            inside = {inner: told[path] for path in fields for inner in fields[path]}
            borne = _borne(record, inside, told, scenario.integrator == "euler")
            if borne is not None and borne < shortest:
                shortest, stiffest = borne, told
        if stiffest and (largest is None or shortest < largest * (1.0 - 1e-9)):
            compiled = "steps of any length" if largest is None else f"steps of up to {largest:g} s"
            these = "this number" if len(stiffest) == 1 else "these numbers"
            raise ScenarioError(
                f"{_words(stiffest)}: bears steps of {shortest:g} s, and the batch was compiled for {compiled}; "
                f"compile it from a scenario with {these}, or give it as stiffest"
            )


def _stated(scenario: Scenario, values: Mapping[str, Any]) -> dict[Place, dict[str, list[Place]]]:
    """Air, force or drive -> path -> places in it, of those paths from which a largest step may follow."""
    found: dict[Place, dict[str, list[Place]]] = {}
    for path in values:
        if path.startswith(STATED):
            for place in places_of(scenario, path):
                # air and forces stand in a tuple, a drive beside the name of its joint, in the scenario or its vehicle
                depth = {"drives": 3, "world": 5, "contact": 1}.get(place[0], 2)
                found.setdefault(place[:depth], {}).setdefault(path, []).append(place[depth:])
    return found


def _borne(record: Any, numbers: Mapping[Place, float], told: Mapping[str, float], euler: bool) -> float | None:
    """Largest step (s) of a record with other numbers; None where it states none."""
    try:
        other = replaced(record, numbers)
        stated = borne_step(other, euler=euler)
        if stated is None:
            return None
        if not stated > 0.0:
            raise ValueError(f"largest_step = {shown(stated)}: must be above 0")
        return float(stated)
    except (ValueError, TypeError, ArithmeticError) as error:
        raise ScenarioError(f"{_words(told)}: {error}") from error


def _words(told: Mapping[str, float]) -> str:
    """Paths with their numbers."""
    return ", ".join(f"values[{path!r}] = {value:g}" for path, value in told.items())
