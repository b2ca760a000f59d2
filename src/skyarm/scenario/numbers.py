"""Read and replace parameters of a scenario by dotted path, such as ``plant.vehicle.base.mass``.

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
* ``initial.roll``, ``.pitch``, ``.yaw``: ZYX angles (rad) in place of the quaternion, whose components are scaled to
  unit length together once one of them is replaced.

A state that a scenario sets stays as it is, whatever else changes. A *sequence* of the file is the sum of its first
value and its ramps, and varies as those: ``reference.joints.0.1.height``.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.quaternion import euler_angles
from skyarm.algebra.scalars import cos, data, divide, sin
from skyarm.control.actuator_layer import with_believed_queues
from skyarm.dynamics import State
from skyarm.dynamics.actuators import make_mixer
from skyarm.records import coerce
from skyarm.records.field_rules import rules
from skyarm.records.files import errors_as, shown
from skyarm.records.leaves import Place, part, replace_at
from skyarm.records.units import Unit, units
from skyarm.scenario.paths import places_of
from skyarm.scenario.scenario_checks import check_scenario
from skyarm.scenario.scenario_record import Scenario, ScenarioError, first_state, trimmed_state
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.world.payload import LOAD, Payload

ROTORS: Place = ("agent", "controller", "par", "model", "vehicle", "rotors")

DRIVES: Place = (*ROTORS[:-1], "drives")

INITIAL: Place = ("agent", "initial")

DERIVED = ("initial.", "reference.", "plant.payload.", "model.payload.")
"""Beginnings of paths that need not be made data in the scenario before they vary."""


def require_apart(scenario: Scenario, paths: Sequence[str]) -> None:
    """Raise an error if two parameter paths denote the same number of a scenario.

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
    """True if two parameter paths denote the same number of a scenario."""
    return not set(_meant(scenario, path)).isdisjoint(_meant(scenario, other))


def _meant(scenario: Scenario, path: str) -> tuple[Place, ...]:
    return _target(scenario, path)[1]


def _target(scenario: Scenario, path: str) -> tuple[str, tuple[Place, ...]]:
    """Kind of parameter that a path such as plant.gravity denotes, and all scenario fields that store it."""
    for root, vehicle in PAYLOADS.items():
        if path == root or path.startswith(f"{root}."):
            return "payload", ((*vehicle, "payload", _frame_of_payload(part(scenario, vehicle), path, root)),)
    if path in ATTITUDE:
        return "attitude", ((path,),)
    if path.startswith("initial."):
        return "initial", places_of(_with_start(scenario), path)
    return "field", places_of(scenario, path)


def _frame_of_payload(vehicle: Vehicle, path: str, root: str) -> str:
    """Vehicle frame that carries the payload of a parameter path such as model.payload.tip.mass."""
    frames, words = [frame.name for frame in vehicle.frames], path[len(root) + 1 :].split(".")
    if words == ["mass"] and vehicle.end_effector:
        return vehicle.end_effector
    if len(words) == 2 and words[0] in frames and words[1] == "mass":
        return words[0]
    known = ", ".join(f"{root}.{frame}.mass" for frame in frames)
    raise ScenarioError(f"path = {path!r}: must be {root}.mass (at the tip) or one of {known}")


def _with_start(scenario: Scenario) -> Scenario:
    """Scenario with an explicit initial state: the stated one, else hover trim."""
    return scenario if scenario.initial is not None else scenario.with_words(initial=first_state(scenario))


def number_at(scenario: Scenario, path: str) -> float:
    """Value of the parameter at a dotted path of a scenario, such as plant.vehicle.base.mass.

    Raises:
        ScenarioError: a field that does not exist (with those that do), or something that is not a number.
    """
    kind, places = _target(scenario, path)
    if kind == "payload":
        return 0.0
    if kind == "attitude":
        angles = euler_angles(first_state(scenario).quaternion.rotation())
        return float(angles[ATTITUDE.index(path)])
    found = part(_with_start(scenario) if kind == "initial" else scenario, places[0])
    if isinstance(found, bool) or not isinstance(found, (int, float)):
        raise ScenarioError(f"path = {path!r}: must lead to a number, not to {type(found).__name__}")
    if kind != "initial" and _declaration(scenario, places[0]).fixed:
        raise ScenarioError(f"path = {path!r}: must be equal in all episodes and throughout a flight")
    return float(found)


def with_numbers(scenario: Scenario, values: Mapping[str, Any]) -> Scenario:
    """Scenario with the parameters at some paths replaced; values may be symbols of a traced program.

    The mixer follows the model's rotors, a trimmed start the vehicle, and the setpoints that are on their way to a
    servo of the model its latency. What else a law's maker took from its model
    stays as it was made: gains, limits, first memory. A study of models therefore asks what a law does whose model is
    wrong in these numbers, not how it would be tuned for them.

    Args:
        scenario: as it is.
        values: path -> number.

    Raises:
        ScenarioError: as :func:`number_at`; or no mapping of paths to numbers.
        ValueError: a number that the scenario cannot have.
    """
    _require_numbers(values)
    loads: dict[Place, Any] = {}
    start: dict[str, Any] = {}
    leaves: dict[Place, Any] = {}
    for path, value in values.items():
        number_at(scenario, path)
        kind, places = _target(scenario, path)
        if kind == "payload":
            loads[places[0]] = rules(Payload)["mass"](path, value)
        elif kind == "field":
            leaves |= dict.fromkeys(places, value)
        else:
            start[path] = value
    fields = _fields(scenario, leaves)
    for (field, *inner, _, frame), mass in loads.items():
        record, place = fields.get(field, getattr(scenario, field)), tuple(inner)
        fields[field] = replace_at(record, {place: part(record, place).with_payload(mass, frame)})
    changed = dataclasses.replace(scenario, **fields) if fields else scenario
    if any(place[: len(ROTORS)] == ROTORS for place in leaves):
        par = changed.controller.par
        mixer = make_mixer(par.model.vehicle, par.mixer.policy, bool(par.mixer.across))
        mixed = dataclasses.replace(changed.controller, par=dataclasses.replace(par, mixer=mixer))
        changed = changed.with_words(controller=mixed)
    if any(place[: len(DRIVES)] == DRIVES and place[-1] == "latency" for place in leaves):
        made = with_believed_queues(changed.controller, 1.0 / scenario.rates.control)
        changed = changed.with_words(controller=made)
    if start:
        changed = changed.with_words(initial=start_with(changed, start))
    replaced = [*leaves, *(place[:-2] for place in loads), *([INITIAL] if start else [])]
    check_scenario(changed, replaced, numbers=True)
    return changed


def _require_numbers(values: object) -> None:
    """Raise an error unless paths are texts and values are scalars.

    Raises:
        ScenarioError: one line that names the wrong path or value.
    """
    if not isinstance(values, Mapping):
        raise ScenarioError(f"values = {shown(values)}: must be a mapping of paths to numbers")
    for path, value in values.items():
        if not isinstance(path, str):
            raise ScenarioError(f"path = {shown(path)}: must be text, as 'plant.gravity'")
        if type(value) is not float:
            with errors_as(ScenarioError):
                coerce.number(f"values[{path!r}]", value)


def _fields(scenario: Scenario, leaves: Mapping[Place, Any]) -> dict[str, Any]:
    """Top-level fields of a scenario after values deep inside them are replaced."""
    below: dict[str, dict[Place, Any]] = {}
    for place, value in leaves.items():
        below.setdefault(place[0], {})[place[1:]] = value
    return {name: replace_at(getattr(scenario, name), inner) for name, inner in below.items()}


ATTITUDE = ("initial.roll", "initial.pitch", "initial.yaw")

PAYLOADS: Mapping[str, Place] = {
    "plant.payload": ("agent", "plant", "vehicle"),
    "model.payload": ("agent", "controller", "par", "model", "vehicle"),
}


def is_added(path: str) -> bool:
    """True if a parameter path denotes a payload mass, which adds to the vehicle's own mass."""
    return path.startswith(tuple(f"{root}." for root in PAYLOADS))


def start_with(scenario: Scenario, values: Mapping[str, Any]) -> State:
    """Initial state of a scenario after parameters such as initial.position.x are replaced."""
    held = scenario.initial
    if held is None:
        joints = [data(q) for q in first_state(scenario).joints]
        for i in range(len(joints)):
            joints[i] = values.get(f"initial.joints.{i}", joints[i])
        at = scenario.reference.at(0.0)
        held = trimmed_state(scenario.plant, at.position, data(at.yaw), tuple(joints))
    # places are read from a scenario whose numbers are plain, as any initial state has them
    shape = scenario.with_words(initial=held)
    changed: Any = shape.initial
    for path, value in values.items():
        if path not in ATTITUDE:
            for place in places_of(shape, path):
                changed = replace_at(changed, {place[2:]: value})
    angles = [values.get(path) for path in ATTITUDE]
    if any(angle is not None for angle in angles):
        known = euler_angles(held.quaternion.rotation())
        chosen = (old if angle is None else angle for angle, old in zip(angles, known, strict=True))
        changed = dataclasses.replace(changed, quaternion=_quaternion_of_angles(*chosen))
    elif any(path.startswith("initial.quaternion") for path in values):
        q = changed.quaternion
        length = q.norm()
        changed = dataclasses.replace(changed, quaternion=Quaternion(*(divide(c, length) for c in q)))
    state: State = changed
    return state


def _quaternion_of_angles(roll: Any, pitch: Any, yaw: Any) -> Quaternion:
    """Quaternion from roll, pitch and yaw (ZYX), rad."""
    half = [(cos(0.5 * angle), sin(0.5 * angle)) for angle in (roll, pitch, yaw)]
    about = [Quaternion(c, *Vec3(*(s if i == axis else 0.0 for i in range(3)))) for axis, (c, s) in enumerate(half)]
    return about[2] * about[1] * about[0]


LEFT_OUT = ("environment", "vehicle", "body", "value", "par")
"""Words of a path that say nothing to a reader."""

WHOSE = {"plant": "plant", "model": "model", "controller": "law"}
"""First words that say whose number it is."""


def unit_at(scenario: Scenario, path: str) -> str:
    """SI unit of the parameter at a path, from its field's declaration; empty if dimensionless or unknown.

    Raises:
        ScenarioError: no number is there.
    """
    return declared_at(scenario, path).unit


def declared_at(scenario: Scenario, path: str) -> Unit:
    """Unit, meaning and bounds declared for the parameter at a path.

    Of a joint, whose numbers have one unit if it turns and another if it slides, those of its kind; of a number of a
    signal, those of what the signal is.

    Raises:
        ScenarioError: no number is there.
    """
    kind, places = _target(scenario, path)
    computed = {"payload": dataclasses.replace(LOAD, meaning="point mass at the tip"), "attitude": Unit("rad")}
    if kind in computed:
        return computed[kind]
    return _declaration(_with_start(scenario) if kind == "initial" else scenario, places[0])


def _declaration(record: object, place: Place) -> Unit:
    """Unit declaration of the innermost field on the way to a parameter that has a declaration."""
    found = Unit()
    for name in place:
        if isinstance(record, tuple):
            record = record[int(name)]
            continue
        said = units(type(record)).get(name)
        if said is not None and said.meaning != "in the unit of the signal":
            found = said
        slides = getattr(record, "kind", "revolute") == "prismatic"
        if " or " in found.unit and hasattr(record, "kind"):
            found = dataclasses.replace(found, unit=found.unit.split(" or ")[1 if slides else 0])
        record = getattr(record, name)
    return found


def words_of(path: str) -> str:
    """Parameter path in readable words: ``plant.vehicle.links.0.joint.damping`` is "link 1 joint damping (plant)"."""
    words = [word for word in path.split(".") if word not in LEFT_OUT]
    whose = WHOSE.get(words[0], "") if len(words) > 1 else ""
    if whose:
        words = words[1:]
    if words[0] == "sensors" and len(words) == 2:
        return f"noise of {words[1].replace('_', ' ')}"
    found: list[str] = []
    for word in words:
        if word.isdecimal() and found:
            one = found[-1] if found[-1].endswith("ss") else found[-1].removesuffix("s")
            found[-1] = f"{one} {int(word) + 1}"
        else:
            found.append(word.removesuffix("_W").removesuffix("_B").replace("_", " "))
    return " ".join(found) + (f" ({whose})" if whose else "")


def axis_label(words: str, unit: str) -> str:
    """Axis label: a text with its unit in brackets."""
    return f"{words} [{unit}]" if unit else words
