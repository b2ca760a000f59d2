"""Numbers of a scenario that are no field of any record: payloads, turbulence, the start, an attitude's angles."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.euler import euler_angles
from skyarm.dynamics import State
from skyarm.environment import Dryden, MovingAir, dryden
from skyarm.plant.interface import number
from skyarm.records.leaves import Place
from skyarm.records.replace_parts import part, replaced
from skyarm.scalars import cos, divide, sin, sqrt
from skyarm.scenario.places import places_of
from skyarm.scenario.scenario_record import Scenario, ScenarioError, first_state, trimmed_state

TURBULENCE = "environment.wind.turbulence."

ANGLES = ("roll", "pitch", "yaw")

ATTITUDE = tuple(f"initial.{angle}" for angle in ANGLES)

PAYLOADS: Mapping[str, Place] = {
    "plant.payload": ("world", "vehicle"),
    "model.payload": ("controller", "par", "model", "vehicle"),
}


def is_payload(path: str) -> bool:
    """Whether a path is that of a load."""
    return path.startswith(tuple(f"{root}." for root in PAYLOADS))


def payload_of(scenario: Scenario, path: str) -> tuple[Place, str | None] | None:
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
            raise ScenarioError(f"path = {path!r}: must be {root}.mass (at the tip) or one of {known}")
    return None


def is_of_turbulence(scenario: Scenario, path: str) -> bool:
    """A number of the file from which the turbulence is computed."""
    known = ("altitude", "wind_20ft", "minimum_airspeed")
    turbulent = isinstance(scenario.wind, MovingAir) and scenario.wind.turbulence is not None
    return turbulent and path.startswith(TURBULENCE) and path.removeprefix(TURBULENCE) in known


def turbulence_numbers(scenario: Scenario) -> dict[str, Any]:
    """The file's numbers, read back from the filters' (:func:`skyarm.environment.dryden.low_altitude`)."""
    held: Any = scenario.wind.turbulence if isinstance(scenario.wind, MovingAir) else None
    # the smallest airspeed is not known where the mean wind is faster, and does not matter there
    return {
        "altitude": held.scale_length.z,
        "wind_20ft": 10.0 * held.intensity.z,
        "minimum_airspeed": held.airspeed,
    }


def turbulence(scenario: Scenario, values: Mapping[str, Any]) -> Dryden:
    """Turbulence with some of the file's numbers replaced."""
    wind: Any = scenario.wind
    chosen = turbulence_numbers(scenario) | dict(values)
    mean = math.hypot(*(float(c) for c in wind.velocity_W))
    return dryden.low_altitude(
        chosen["altitude"], chosen["wind_20ft"], mean, wind.turbulence.direction_W, chosen["minimum_airspeed"]
    )


def start_with(scenario: Scenario, values: Mapping[str, Any]) -> State:
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
        if path not in ATTITUDE:
            for place in places_of(shape, path):
                changed = replaced(changed, {place[1:]: value})
    angles = [values.get(path) for path in ATTITUDE]
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
