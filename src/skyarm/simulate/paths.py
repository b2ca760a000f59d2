"""Numbers of a scenario by dotted path, to vary them.

A path starts with one of ``plant``, ``model``, ``controller``, ``environment.wind``, ``environment.faults``,
``sensors``, ``initial``, ``reference`` and goes on through the words of the scenario file (``reference.base.radius``,
``plant.joints.damping``, ``environment.wind.force.0``) or the fields of the records: ``plant.vehicle.base.mass``,
``plant.vehicle.links.forearm.joint.damping``, ``controller.gains.position.x``, ``reference.z.value``. Items of a tuple
are named by their number or, where they have one, by their name.

Some numbers are not a field of any record:

* ``plant.payload.mass``, ``model.payload.mass``: a point mass (kg) at the end effector, or at another frame as
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
import math
from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.actuation import make_mixer
from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.euler import euler_angles
from skyarm.control.controller import Controller
from skyarm.dynamics import State
from skyarm.environment import Airspeed, Dryden, dryden
from skyarm.plant.interface import number
from skyarm.reference import Constant
from skyarm.scalars import cos, divide, sin, sqrt
from skyarm.simulate.inputs import first_state
from skyarm.simulate.scenario import Scenario, ScenarioError, trimmed_state
from skyarm.simulate.vocabulary import Place, names, part, replaced

ROOTS: Mapping[str, Place] = {
    "plant": ("world",),
    "model": ("controller", "par", "model"),
    "controller": ("controller", "par"),
    "environment.wind": ("wind",),
    "environment.faults": ("faults",),
    "sensors": ("sensors",),
    "initial": ("initial",),
    "reference": ("trajectory",),
}

ROTORS: Place = ("controller", "par", "model", "vehicle", "rotors")

STRUCTURE = ("duration", "rates", "delays", "seed", "episode", "environment.ground", "plant.integrator", "plant.kind")
"""Fields of the file that shape an episode or key its noise; they are the same for all episodes of a batch."""

LATE = "delays.command"
"""It varies where the scenario says how long it gets (:class:`skyarm.simulate.scenario.Delays`)."""

TURBULENCE = "environment.wind.turbulence."

DERIVED = ("initial.", "reference.", "plant.payload.", "model.payload.", TURBULENCE)
"""Beginnings of paths that need not be made data in the scenario before they vary."""

ANGLES = ("roll", "pitch", "yaw")

PAYLOADS: Mapping[str, Place] = {
    "plant.payload": ("world", "vehicle"),
    "model.payload": ("controller", "par", "model", "vehicle"),
}


def places_of(scenario: Scenario, path: str) -> tuple[Place, ...]:
    """Places of the scenario record at which the number of a path stands; all hold the same.

    Raises:
        ScenarioError: a field that does not exist (with those that do), or one that is structure.
    """
    if path == LATE and scenario.delays.longest_command is not None:
        return (("delays", "command"),)
    for field in STRUCTURE:
        if path == field or path.startswith(f"{field}."):
            raise ScenarioError(f"path = {path!r}: {field} is structure, the same for all episodes; fly two studies")
    for root, start in ROOTS.items():
        if path.startswith(f"{root}."):
            return _follow(scenario, path, start, path[len(root) + 1 :].split("."))
    raise ScenarioError(f"path = {path!r}: must start with one of {', '.join(ROOTS)}")


def _follow(scenario: Scenario, path: str, start: Place, words: list[str]) -> tuple[Place, ...]:
    places: Any = (start,)
    for word in words:
        if isinstance(places, tuple):
            options = names(part(scenario, places[0]))
            heads = places
        else:
            options, heads = places, (start,)
        if word not in options:
            raise ScenarioError(f"path = {path!r}: no {word!r} here; there are {', '.join(options) or 'no fields'}")
        places = _joined(heads, options[word])
        start = heads[0]
    if not isinstance(places, tuple):
        raise ScenarioError(f"path = {path!r}: must lead to a number; there are {', '.join(places)}")
    # a number of the file that is held as a signal
    return tuple((*at, "value") if isinstance(part(scenario, at), Constant) else at for at in places)


def _joined(heads: tuple[Place, ...], found: Any) -> Any:
    """Places seen from the scenario; a tree of more words is seen from the first head."""
    if isinstance(found, tuple):
        return tuple((*head, *tail) for head in heads for tail in found)
    return found


def require_apart(scenario: Scenario, paths: Sequence[str]) -> None:
    """Refuse paths that mean the same number under two names.

    Raises:
        ScenarioError: names both.
    """
    seen: dict[Place, str] = {}
    for path in paths:
        derived = _payload(scenario, path) or _of_turbulence(scenario, path) or path in _attitude_paths()
        at = dataclasses.replace(scenario, initial=first_state(scenario)) if path.startswith("initial.") else scenario
        for place in ((path,),) if derived else places_of(at, path):
            if place in seen:
                raise ScenarioError(f"path = {path!r}: is the same number as {seen[place]!r}; vary one of them")
            seen[place] = path
    turned = [path for path in paths if path in _attitude_paths()]
    parts = [path for path in paths if path.startswith("initial.quaternion")]
    if turned and parts:
        raise ScenarioError(f"path = {parts[0]!r}: must not vary together with {turned[0]!r}")


def number_at(scenario: Scenario, path: str) -> float:
    """The number a path leads to.

    Raises:
        ScenarioError: a field that does not exist (with those that do), or something that is not a number.
    """
    if _payload(scenario, path):
        return 0.0
    if _of_turbulence(scenario, path):
        return float(_turbulence_numbers(scenario)[path.removeprefix(TURBULENCE)])
    if path.startswith("initial.") and scenario.initial is None:
        scenario = dataclasses.replace(scenario, initial=first_state(scenario))
    if scenario.initial is not None and path in _attitude_paths():
        angles = euler_angles(scenario.initial.quaternion.rotation())
        return float(angles[ANGLES.index(path.split(".")[1])])
    found = part(scenario, places_of(scenario, path)[0])
    if isinstance(found, bool) or not isinstance(found, (int, float)):
        raise ScenarioError(f"path = {path!r}: must lead to a number, not to {type(found).__name__}")
    return float(found)


def with_numbers(scenario: Scenario, values: Mapping[str, Any]) -> Scenario:
    """The scenario with other numbers at some paths; they may be traced.

    The mixer follows the believed rotors, and a trimmed start the vehicle. What else a law's maker took from its model
    stays as it was made: gains, limits, first memory. A study of beliefs therefore asks what a law does whose model is
    wrong in these numbers, not how it would be tuned for them.

    Raises:
        ScenarioError: as :func:`number_at`.
    """
    loads: list[tuple[Any, ...]] = []
    start: dict[str, Any] = {}
    air: dict[str, Any] = {}
    leaves: dict[Place, Any] = {}
    for path, value in values.items():
        number_at(scenario, path)
        load = _payload(scenario, path)
        if load:
            loads.append((*load, value))
        elif path.startswith("initial."):
            start[path] = value
        elif _of_turbulence(scenario, path):
            air[path.removeprefix(TURBULENCE)] = value
        else:
            leaves |= dict.fromkeys(places_of(scenario, path), value)
    if air:
        leaves[("wind", "turbulence")] = _turbulence(scenario, air)
    fields = _fields(scenario, leaves)
    for place, frame, mass in loads:
        record = fields.get(place[0], getattr(scenario, place[0]))
        fields[place[0]] = replaced(record, {place[1:]: part(record, place[1:]).with_payload(mass, frame)})
    # a scenario is checked whenever it is made: once
    changed: Any = dataclasses.replace(scenario, **fields) if fields else scenario
    if any(place[: len(ROTORS)] == ROTORS for place in leaves):
        par = changed.controller.par
        mixer = make_mixer(par.model.vehicle, par.mixer.policy)
        changed = dataclasses.replace(changed, controller=_with_par(changed.controller, mixer=mixer))
    if start:
        changed = dataclasses.replace(changed, initial=_start(changed, start))
    result: Scenario = changed
    return result


def _fields(scenario: Scenario, leaves: Mapping[Place, Any]) -> dict[str, Any]:
    """Those fields of a scenario that numbers at these places change."""
    below: dict[str, dict[Place, Any]] = {}
    for place, value in leaves.items():
        below.setdefault(place[0], {})[place[1:]] = value
    return {name: replaced(getattr(scenario, name), inner) for name, inner in below.items()}


def _with_par(controller: Controller, **fields: Any) -> Controller:
    return dataclasses.replace(controller, par=dataclasses.replace(controller.par, **fields))


def _payload(scenario: Scenario, path: str) -> tuple[Place, str | None] | None:
    """Place of the vehicle and name of the frame that a payload's path means."""
    for root, place in PAYLOADS.items():
        if path == root or path.startswith(f"{root}."):
            frames = [frame.name for frame in part(scenario, place).frames]
            words = path[len(root) + 1 :].split(".")
            if words == ["mass"] and part(scenario, place).end_effector:
                return place, None
            if len(words) == 2 and words[0] in frames and words[1] == "mass":
                return place, words[0]
            known = ", ".join(f"{root}.{frame}.mass" for frame in frames)
            raise ScenarioError(f"path = {path!r}: must be {root}.mass (at the end effector) or one of {known}")
    return None


def _of_turbulence(scenario: Scenario, path: str) -> bool:
    """A number of the file from which the turbulence is computed."""
    known = ("altitude", "wind_20ft", "minimum_airspeed")
    turbulent = isinstance(scenario.wind, Airspeed) and scenario.wind.turbulence is not None
    return turbulent and path.startswith(TURBULENCE) and path.removeprefix(TURBULENCE) in known


def _turbulence_numbers(scenario: Scenario) -> dict[str, Any]:
    """The file's numbers, read back from the filters' (:func:`skyarm.environment.dryden.low_altitude`)."""
    held: Any = scenario.wind.turbulence if isinstance(scenario.wind, Airspeed) else None
    # the smallest airspeed is not known where the mean wind is faster, and does not matter there
    return {
        "altitude": held.scale_length.z,
        "wind_20ft": 10.0 * held.intensity.z,
        "minimum_airspeed": held.airspeed,
    }


def _turbulence(scenario: Scenario, values: Mapping[str, Any]) -> Dryden:
    """Turbulence with some of the file's numbers replaced."""
    wind: Any = scenario.wind
    chosen = _turbulence_numbers(scenario) | dict(values)
    mean = math.hypot(*(float(c) for c in wind.velocity_W))
    return dryden.low_altitude(
        chosen["altitude"], chosen["wind_20ft"], mean, wind.turbulence.direction_W, chosen["minimum_airspeed"]
    )


def _attitude_paths() -> tuple[str, ...]:
    return tuple(f"initial.{angle}" for angle in ANGLES)


def _start(scenario: Scenario, values: Mapping[str, Any]) -> State:
    """Initial state with some numbers replaced."""
    held = scenario.initial
    if held is None:
        joints = [number(q) for q in first_state(scenario).joints]
        for i in range(len(joints)):
            joints[i] = values.get(f"initial.joints.{i}", joints[i])
        at = scenario.trajectory.at(0.0)
        held = trimmed_state(scenario.world, at.position, number(at.yaw), tuple(joints))
    # places are read from a scenario whose numbers are plain, as any initial state has them
    shape = dataclasses.replace(scenario, initial=held)
    changed: Any = shape.initial
    for path, value in values.items():
        if path not in _attitude_paths():
            for place in places_of(shape, path):
                changed = replaced(changed, {place[1:]: value})
    angles = [values.get(path) for path in _attitude_paths()]
    if any(angle is not None for angle in angles):
        known = euler_angles(held.quaternion.rotation())
        chosen = (old if angle is None else angle for angle, old in zip(angles, known, strict=True))
        changed = dataclasses.replace(changed, quaternion=_of_angles(*chosen))
    elif any(path.startswith("initial.quaternion") for path in values):
        q = changed.quaternion
        length = sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z)
        changed = dataclasses.replace(changed, quaternion=Quaternion(*(divide(c, length) for c in q)))
    state: State = changed
    return state


def _of_angles(roll: Any, pitch: Any, yaw: Any) -> Quaternion:
    """Quaternion of ZYX angles, rad."""
    half = [(cos(0.5 * angle), sin(0.5 * angle)) for angle in (roll, pitch, yaw)]
    about = [Quaternion(c, *Vec3(*(s if i == axis else 0.0 for i in range(3)))) for axis, (c, s) in enumerate(half)]
    return about[2] * about[1] * about[0]
