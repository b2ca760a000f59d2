"""Parts of a scenario that a change replaces as a whole, in the words that a scenario file has for them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

from skyarm.actuation import AllocationError
from skyarm.control.controller import Controller, ControllerError
from skyarm.environment import faults_from, wind_from
from skyarm.files import Fields, shown
from skyarm.reference import Trajectory, trajectory_from
from skyarm.reference.reference_tables import reference_from
from skyarm.registry.plugins import is_law_of_file
from skyarm.scenario import registered_tables as added
from skyarm.scenario import scenario_tables as tables
from skyarm.scenario.law_by_name import controller_by_name, loop_facts
from skyarm.scenario.path_governor import with_governor
from skyarm.scenario.reference_setting import setting_of
from skyarm.scenario.scenario_record import Scenario


def with_part(scenario: Scenario, path: str, value: Any) -> Scenario:
    """The scenario with a part replaced as a whole.

    Args:
        scenario: whose belief and clocks a new law is made for.
        path: one of ``WHOLE_PARTS``.
        value: as a scenario file has it there: tables are dicts, lists lists.

    Raises:
        ValueError: one line with the path, the value and what is allowed.
    """
    try:
        return dataclasses.replace(scenario, **WHOLE_PARTS[path](scenario, value))
    except AllocationError as error:
        raise ValueError(f"model.vehicle = {scenario.controller.par.model.vehicle.name!r}: {error}") from None


def below(path: str) -> str:
    """Beginning of the paths whose numbers a part as a whole replaces."""
    return "controller." if path == LAW else f"{path}."


def _law(scenario: Scenario, name: Any) -> dict[str, Any]:
    """A law by its name, under the safety layer if the one before it was."""
    if not isinstance(name, str):
        raise ValueError(f"{LAW} = {shown(name)}: must be the name of a preset, a law or LAW_tuned")
    if is_law_of_file(name):
        raise ValueError(f"{LAW} = {shown(name)}: must not be a file's; only --controller takes FILE.py:make")
    try:
        return {"controller": controller_by_name(scenario, name)}
    except ControllerError as error:
        raise ValueError(str(error).replace("controller = ", f"{LAW} = ", 1)) from None


def _controller(scenario: Scenario, table: Any) -> dict[str, Any]:
    known = loop_facts(scenario.rates, scenario.delays)
    fields = Fields(table, "controller")
    made: Controller = tables.controller(fields, scenario.controller.par.model, None, known)
    return {"controller": made}


def _reference(scenario: Scenario, table: Any) -> dict[str, Any]:
    governed, options = tables.governor(table)
    motion, joined = tables.joined(governed)
    setting = setting_of(scenario.world, scenario.duration)
    trajectory = reference_from(motion, scenario.world.vehicle.n, "reference", setting)
    found = dataclasses.replace(scenario, trajectory=trajectory, joined=joined, path_time=None, pause=None)
    if options is not None:
        found = with_governor(found, options, setting)
    return {"trajectory": trajectory, "joined": joined, "path_time": found.path_time, "pause": found.pause}


def _of_reference(field: str) -> Callable[[Scenario, Any], dict[str, Any]]:
    """Reader of one entry of the reference's table; the others stay."""
    held = {"base": ("x", "y", "z"), "yaw": ("yaw",), "joints": ("joints",)}[field]

    def read(scenario: Scenario, value: Any) -> dict[str, Any]:
        if scenario.trajectory.tip is not None:
            allowed = "must stay as it is where the reference has a tip; replace reference as a whole"
            raise ValueError(f"reference.{field} = {shown(value)}: {allowed}")
        if scenario.path_time is not None:
            allowed = "must stay as it is where the reference has a governor; replace reference as a whole"
            raise ValueError(f"reference.{field} = {shown(value)}: {allowed}")
        setting = setting_of(scenario.world, scenario.duration)
        found: Trajectory = trajectory_from({field: value}, scenario.world.vehicle.n, "reference", setting)
        fields = {name: getattr(found, name) for name in held}
        return {"trajectory": dataclasses.replace(scenario.trajectory, **fields)}

    return read


def _components(name: str, kind: str) -> Callable[[Scenario, Any], dict[str, Any]]:
    return lambda _, value: {name: added.components(Fields({name: value}, "environment"), name, kind)}


def _ground(_: Scenario, value: Any) -> dict[str, Any]:
    return {"ground": tables.truth_value(Fields({"ground": value}, "environment"), "ground", True)}


LAW = "controller.law"

WHOLE_PARTS: Mapping[str, Callable[[Scenario, Any], dict[str, Any]]] = {
    LAW: _law,
    "controller": _controller,
    "reference": _reference,
    "reference.base": _of_reference("base"),
    "reference.yaw": _of_reference("yaw"),
    "reference.joints": _of_reference("joints"),
    "environment.wind": lambda _, value: {"wind": wind_from(value, "environment.wind")},
    "environment.faults": lambda _, value: {"faults": faults_from(value, "environment.faults")},
    "environment.air": _components("air", "air"),
    "environment.forces": _components("forces", "force"),
    "environment.ground": _ground,
    "estimator": lambda _, value: {"estimator": added.estimator(Fields({"estimator": value}, ""))},
    "endings": lambda _, value: {"endings": added.endings(Fields({"endings": value}, ""))},
}
"""Path -> reader of what stands there in a file: fields of the scenario."""
