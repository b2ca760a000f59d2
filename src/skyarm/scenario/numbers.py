"""Numbers of a scenario by dotted path, to vary them.

A path starts with one of ``plant``, ``model``, ``controller``, ``environment.wind``, ``environment.faults``,
``sensors``, ``initial``, ``reference`` and goes on through the words of the scenario file (``reference.base.radius``,
``plant.joints.damping``, ``environment.wind.force.0``) or the fields of the records: ``plant.vehicle.base.mass``,
``plant.vehicle.links.forearm.joint.damping``, ``controller.gains.position.x``, ``reference.z.value``. Items of a tuple
are named by their number or, where they have one, by their name.

Some numbers are not a field of any record:

* ``plant.payload.mass``, ``model.payload.mass``: a point mass (kg) at the tip, or at another frame as
  ``plant.payload.FRAME.mass``, on top of what the vehicle carries;
* ``initial.*`` of a scenario without an initial state: the number replaced in the hover trim of the episode's own
  vehicle;
* ``environment.wind.turbulence.altitude``, ``.wind_20ft``, ``.minimum_airspeed``: the turbulence is made anew from the
  three and the mean wind of the scenario as it was, whose direction and speed past the vehicle it keeps;
* ``initial.roll``, ``.pitch``, ``.yaw``: ZYX angles (rad) in place of the quaternion, whose components are scaled to
  unit length together once one of them is replaced.

A state that a scenario sets stays as it is, whatever else changes. A *sequence* of the file is the sum of its first
value and its ramps, and varies as those: ``reference.joints.0.1.height``.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.actuation import make_mixer
from skyarm.algebra.euler import euler_angles
from skyarm.control.actuator_layer import with_believed_queues
from skyarm.control.controller import Controller
from skyarm.files import shown
from skyarm.records import coerce
from skyarm.records.leaves import Place
from skyarm.records.replace_parts import part, replaced
from skyarm.scenario.derived import (
    ANGLES,
    ATTITUDE,
    TURBULENCE,
    is_of_turbulence,
    payload_of,
    start_with,
    turbulence,
    turbulence_numbers,
)
from skyarm.scenario.places import places_of
from skyarm.scenario.scenario_record import Scenario, ScenarioError, first_state

ROTORS: Place = ("controller", "par", "model", "vehicle", "rotors")

DRIVES: Place = (*ROTORS[:-1], "drives")

DERIVED = ("initial.", "reference.", "plant.payload.", "model.payload.", TURBULENCE)
"""Beginnings of paths that need not be made data in the scenario before they vary."""


def require_apart(scenario: Scenario, paths: Sequence[str]) -> None:
    """Refuse paths that mean the same number under two names.

    Raises:
        ScenarioError: names both.
    """
    seen: dict[Place, str] = {}
    for path in paths:
        for place in _meant(scenario, path):
            if place in seen:
                raise ScenarioError(f"path = {path!r}: is the same number as {seen[place]!r}; vary one of them")
            seen[place] = path
    turned = [path for path in paths if path in ATTITUDE]
    parts = [path for path in paths if path.startswith("initial.quaternion")]
    if turned and parts:
        raise ScenarioError(f"path = {parts[0]!r}: must not vary together with {turned[0]!r}")


def means_the_same(scenario: Scenario, path: str, other: str) -> bool:
    """Whether two paths lead to the same number."""
    return not set(_meant(scenario, path)).isdisjoint(_meant(scenario, other))


def known_as(scenario: Scenario, path: str, known: Sequence[str]) -> str:
    """The known path of the same number, or the path itself where none is."""
    meant = set(_meant(scenario, path))
    return next((other for other in known if set(_meant(scenario, other)) == meant), path)


def _meant(scenario: Scenario, path: str) -> tuple[Place, ...]:
    """Places of the numbers that a path leads to; of one that is computed from others, words that stand for it."""
    load = payload_of(scenario, path)
    if load:
        vehicle, frame = load
        return ((*vehicle, "payload", frame or part(scenario, vehicle).end_effector),)
    if is_of_turbulence(scenario, path) or path in ATTITUDE:
        return ((path,),)
    if path.startswith("initial."):
        scenario = dataclasses.replace(scenario, initial=first_state(scenario))
    return places_of(scenario, path)


def number_at(scenario: Scenario, path: str) -> float:
    """The number a path leads to.

    Raises:
        ScenarioError: a field that does not exist (with those that do), or something that is not a number.
    """
    if payload_of(scenario, path):
        return 0.0
    if is_of_turbulence(scenario, path):
        return float(turbulence_numbers(scenario)[path.removeprefix(TURBULENCE)])
    if path.startswith("initial.") and scenario.initial is None:
        scenario = dataclasses.replace(scenario, initial=first_state(scenario))
    if scenario.initial is not None and path in ATTITUDE:
        angles = euler_angles(scenario.initial.quaternion.rotation())
        return float(angles[ANGLES.index(path.split(".")[1])])
    found = part(scenario, places_of(scenario, path)[0])
    if isinstance(found, bool) or not isinstance(found, (int, float)):
        raise ScenarioError(f"path = {path!r}: must lead to a number, not to {type(found).__name__}")
    return float(found)


def with_numbers(scenario: Scenario, values: Mapping[str, Any]) -> Scenario:
    """Return the scenario with other numbers at some paths; they may be traced.

    The mixer follows the believed rotors, a trimmed start the vehicle, and the setpoints that are on their way to a
    believed servo its latency. What else a law's maker took from its model
    stays as it was made: gains, limits, first memory. A study of beliefs therefore asks what a law does whose model is
    wrong in these numbers, not how it would be tuned for them.

    Args:
        scenario: as it is.
        values: path -> number.

    Raises:
        ScenarioError: as :func:`number_at`; or no mapping of paths to numbers.
        ValueError: a number that the scenario cannot have.
    """
    _require_numbers(values)
    loads: list[tuple[Any, ...]] = []
    start: dict[str, Any] = {}
    air: dict[str, Any] = {}
    leaves: dict[Place, Any] = {}
    for path, value in values.items():
        number_at(scenario, path)
        load = payload_of(scenario, path)
        if load:
            loads.append((*load, value))
        elif path.startswith("initial."):
            start[path] = value
        elif is_of_turbulence(scenario, path):
            air[path.removeprefix(TURBULENCE)] = value
        else:
            leaves |= dict.fromkeys(places_of(scenario, path), value)
    if air:
        leaves[("wind", "turbulence")] = turbulence(scenario, air)
    fields = _fields(scenario, leaves)
    for place, frame, mass in loads:
        record = fields.get(place[0], getattr(scenario, place[0]))
        fields[place[0]] = replaced(record, {place[1:]: part(record, place[1:]).with_payload(mass, frame)})
    # a scenario is checked whenever it is made: once
    changed: Any = dataclasses.replace(scenario, **fields) if fields else scenario
    if any(place[: len(ROTORS)] == ROTORS for place in leaves):
        par = changed.controller.par
        mixer = make_mixer(par.model.vehicle, par.mixer.policy, bool(par.mixer.across))
        changed = dataclasses.replace(changed, controller=_with_par(changed.controller, mixer=mixer))
    if any(place[: len(DRIVES)] == DRIVES and place[-1] == "latency" for place in leaves):
        made = with_believed_queues(changed.controller, 1.0 / scenario.rates.control)
        changed = dataclasses.replace(changed, controller=made)
    if start:
        changed = dataclasses.replace(changed, initial=start_with(changed, start))
    result: Scenario = changed
    return result


def _require_numbers(values: Any) -> None:
    """Paths are texts and what stands there are scalars of any kind.

    Raises:
        ScenarioError: one line that names what is none.
    """
    if not isinstance(values, Mapping):
        raise ScenarioError(f"values = {shown(values)}: must be a mapping of paths to numbers")
    for path, value in values.items():
        if not isinstance(path, str):
            raise ScenarioError(f"path = {shown(path)}: must be text, as 'plant.gravity'")
        if type(value) is not float:
            try:
                coerce.number(f"values[{path!r}]", value)
            except coerce.RecordError as error:
                raise ScenarioError(str(error)) from None


def _fields(scenario: Scenario, leaves: Mapping[Place, Any]) -> dict[str, Any]:
    """Those fields of a scenario that numbers at these places change."""
    below: dict[str, dict[Place, Any]] = {}
    for place, value in leaves.items():
        below.setdefault(place[0], {})[place[1:]] = value
    return {name: replaced(getattr(scenario, name), inner) for name, inner in below.items()}


def _with_par(controller: Controller, **fields: Any) -> Controller:
    return dataclasses.replace(controller, par=dataclasses.replace(controller.par, **fields))
