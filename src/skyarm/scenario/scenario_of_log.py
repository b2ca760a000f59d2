"""The scenario of a log, to fly it again."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from skyarm.control.actuator_layer import ActuatorParameters
from skyarm.control.model import Model
from skyarm.control.safety.safety_layer import SafetyParameters
from skyarm.control.vectored_layer import VectoredParameters
from skyarm.dynamics.actuators import AllocationError
from skyarm.log.flown_scenario import written_part
from skyarm.log.formats import load_log
from skyarm.records.files import shown, unreadable
from skyarm.records.plain import dotted_name
from skyarm.scenario.controller_table import loop_facts, make_named_or_tuned, under_law
from skyarm.scenario.scenario_record import Change, Delays, Rates, Scenario, ScenarioError, without_law


def scenario_of_log(path: str | os.PathLike[str], replaced: Mapping[str, Any] | None = None) -> Scenario:
    """The scenario of a log, with replaced parts.

    Args:
        path: of a log in a format that can be read back.
        replaced: "plant", "controller", "seed", "duration" in place of the log's.

    Raises:
        ScenarioError: one line, ``file: what is wrong``.
    """
    changes = {"kind" if name == "plant" else name: value for name, value in (replaced or {}).items()}
    reason = unreadable(Path(path))
    try:
        if reason:
            raise ValueError(reason)
        law, log = changes.pop("controller", None), load_log(path)
        if law is not None and not _has_layers(log):
            unguarded: Scenario = log.scenario_with(changes, partial(_named_law, law))
            return unguarded
        scenario: Scenario = log.scenario_with(changes)
        return scenario if law is None else under_law(scenario, law)
    except (ValueError, OSError, AllocationError) as error:
        raise ScenarioError(f"{os.fspath(path)}: {error}") from None


def _has_layers(log: Any) -> bool:
    """True if a log's law flew inside a layer, of which the law that replaces it keeps safety and servos."""
    held = written_part(log.info, "agent", "controller", "par", "type")
    return held in (dotted_name(SafetyParameters), dotted_name(ActuatorParameters), dotted_name(VectoredParameters))


def _named_law(name: str, model: Model, fields: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a scenario with a preset or a law, with the belief and the clocks of a log."""
    rates, delays = fields["rates"], fields["delays"]
    pairs = (("controller.par.model", model, Model), ("rates", rates, Rates), ("delays", delays, Delays))
    for field, held, kind in pairs:
        if not isinstance(held, kind):
            raise ValueError(f"scenario_record: {field} = {shown(held)}: must be a {kind.__name__}")
    found: dict[str, Any] = {"controller": make_named_or_tuned(name, model, loop_facts(rates, delays))}
    changes = fields.get("changes", ())
    kept = isinstance(changes, tuple) and all(isinstance(each, Change) for each in changes)
    return found | ({"changes": without_law(changes)} if kept and changes else {})
