"""Numbers of a scenario by dotted path, to vary them.

A path starts with one of ``plant``, ``model``, ``controller``, ``environment.wind``, ``environment.faults``,
``sensors``, ``initial``, ``reference`` and goes on through the fields of the records: ``plant.vehicle.base.mass``,
``plant.vehicle.links.forearm.joint.damping``, ``controller.gains.position.x``, ``controller.joint_gains.stiffness.0``,
``environment.wind.force_W.x``. Items of a tuple are named by their number or, where they have one, by their name.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.actuation import make_mixer
from skyarm.control.controller import Controller
from skyarm.simulate.scenario import Scenario, ScenarioError

ROOTS: Mapping[str, tuple[str, ...]] = {
    "plant": ("world",),
    "model": ("controller", "par", "model"),
    "controller": ("controller", "par"),
    "environment.wind": ("wind",),
    "environment.faults": ("faults",),
    "sensors": ("sensors",),
    "initial": ("initial",),
    "reference": ("trajectory",),
}


def steps_of(path: str) -> tuple[str, ...]:
    """Field names of a path from the scenario record on.

    Raises:
        ScenarioError: the path starts with none of the allowed roots.
    """
    for root, fields in ROOTS.items():
        if path.startswith(f"{root}."):
            return (*fields, *path[len(root) + 1 :].split("."))
    raise ScenarioError(f"path = {path!r}: must start with one of {', '.join(ROOTS)}")


def _children(record: Any) -> dict[str, Any]:
    """Named parts of a record or tuple."""
    if dataclasses.is_dataclass(record):
        return {field.name: getattr(record, field.name) for field in dataclasses.fields(record)}
    if isinstance(record, tuple):
        found = {str(i): item for i, item in enumerate(record)}
        return found | {item.name: item for item in record if isinstance(getattr(item, "name", None), str)}
    return {}


def number_at(scenario: Scenario, path: str) -> float:
    """The number a path leads to.

    Raises:
        ScenarioError: a field that does not exist (with those that do), or something that is not a number.
    """
    found: Any = scenario
    for name in steps_of(path):
        children = _children(found)
        if name not in children:
            raise ScenarioError(f"path = {path!r}: no {name!r} here; there are {', '.join(children) or 'no fields'}")
        found = children[name]
    if isinstance(found, bool) or not isinstance(found, (int, float)):
        raise ScenarioError(f"path = {path!r}: must lead to a number, not to {type(found).__name__}")
    return float(found)


def with_numbers(scenario: Scenario, values: Mapping[str, Any]) -> Scenario:
    """The scenario with other numbers at some paths; they may be traced. What is derived from them follows.

    Raises:
        ScenarioError: as :func:`number_at`.
    """
    changed: Any = scenario
    for path, value in values.items():
        number_at(scenario, path)
        changed = _replaced(changed, steps_of(path), value)
    if any(path.startswith("model.vehicle.rotors") for path in values):
        par = changed.controller.par
        mixer = make_mixer(par.model.vehicle, par.mixer.policy)
        changed = dataclasses.replace(changed, controller=_with_par(changed.controller, mixer=mixer))
    result: Scenario = changed
    return result


def _with_par(controller: Controller, **fields: Any) -> Controller:
    return dataclasses.replace(controller, par=dataclasses.replace(controller.par, **fields))


def _replaced(record: Any, names: Sequence[str], value: Any) -> Any:
    if not names:
        return value
    if isinstance(record, tuple):
        index = next(i for i, item in enumerate(record) if names[0] in (str(i), getattr(item, "name", None)))
        return (*record[:index], _replaced(record[index], names[1:], value), *record[index + 1 :])
    return dataclasses.replace(record, **{names[0]: _replaced(getattr(record, names[0]), names[1:], value)})
