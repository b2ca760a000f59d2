"""Numbers of a scenario that are allowed and hardly meant: other units, as a rule. They are told of, never refused."""

from __future__ import annotations

import math
from collections.abc import Iterator

from skyarm.environment import ForceWind, MovingAir
from skyarm.environment.wind import all_gusts
from skyarm.scenario.law_and_rotors import law_without_priorities
from skyarm.scenario.law_and_undriven import law_of_undriven
from skyarm.scenario.reference_setting import feasibility_of
from skyarm.scenario.scenario_record import Scenario
from skyarm.scenario.unlikely_vehicle import EARTH, FARTHEST, TURN, unlikely_in_vehicle

NOISE = {
    "position": (1.0, "m", "mm"),
    "velocity": (5.0, "m/s", "mm/s"),
    "attitude": (0.5, "rad", "degrees"),
    "rate": (5.0, "rad/s", "degrees/s"),
    "specific_force": (50.0, "m/s^2", "milli-g"),
    "joints": (0.5, "rad or m", "degrees or mm"),
    "joint_rates": (5.0, "rad/s or m/s", "degrees/s or mm/s"),
    "rotor_speeds": (200.0, "rad/s", "rev/min"),
}
"""Sigma from which a sensor tells nothing, its unit, and what the number is perhaps in."""

HEAVIEST_PLANET = 25.0
"""m/s^2: Jupiter's."""

STORM = 60.0
"""m/s: a hurricane of category 4."""

MOST_WIND = 20.0
"""Force of the wind over the vehicle's weight."""

LATEST = 1.0
"""s of delay: no vehicle flies with so much."""

SPREAD = 1000.0
"""m: of a reference."""

LOADED = 10.0
"""Mass of the plant over that of the model, or the other way."""

SPUN = 50.0
"""rad/s, eight turns a second, of the body at the start."""

BEYOND = 1e-6
"""rad or m past a joint's limit that rounding leaves."""

LOOKS = 200
"""Instants at which a reference is looked at."""


def unlikely_numbers(scenario: Scenario) -> tuple[str, ...]:
    """Lines about numbers of a scenario that are allowed and hardly meant; empty where there is none."""
    vehicle = (f"plant: {line}" for line in unlikely_in_vehicle(scenario.world.vehicle))
    return (*vehicle, *unlikely_units(scenario), *plan_warnings(scenario), *law_warnings(scenario))


def unlikely_units(scenario: Scenario) -> tuple[str, ...]:
    """Lines about numbers that are probably in other units, without those of the plant's vehicle."""
    parts = (_belief, _surroundings, _sensing, _reference, _start)
    return tuple(line for part in parts for line in part(scenario))


def plan_warnings(scenario: Scenario) -> tuple[str, ...]:
    """Lines about limits that the plan of a tip's reference does not keep."""
    found = feasibility_of(scenario)
    return tuple(found.warnings()) if found is not None else ()


def law_warnings(scenario: Scenario) -> tuple[str, ...]:
    """Lines about a law that the vehicle's joints or rotors do not suit."""
    return (*law_of_undriven(scenario), *law_without_priorities(scenario))


def _belief(scenario: Scenario) -> Iterator[str]:
    truth, belief = scenario.world.vehicle, scenario.controller.par.model.vehicle
    if belief != truth:
        known = set(unlikely_in_vehicle(truth))
        yield from (f"model: {line}" for line in unlikely_in_vehicle(belief) if line not in known)
    plant, model = float(truth.mass), float(belief.mass)
    if not plant < LOADED * model or not model < LOADED * plant:
        yield f"plant.vehicle of {plant:g} kg, model.vehicle of {model:g} kg: differ; kg, not g (payload)?"
    for name, gravity in (("plant", scenario.world.gravity), ("model", scenario.controller.par.model.gravity)):
        if float(gravity) > HEAVIEST_PLANET:
            yield f"{name}.gravity = {float(gravity):g} m/s^2: is more than Jupiter's; m/s^2?"


def _surroundings(scenario: Scenario) -> Iterator[str]:
    wind = scenario.wind
    if isinstance(wind, MovingAir):
        speeds = [("velocity", wind.velocity_W), *(("gust.velocity", gust.peak) for gust in all_gusts(wind))]
    else:
        speeds = [("air_velocity", wind.air_velocity_W)]
    for name, velocity in speeds:
        speed = _norm(velocity)
        if speed > STORM:
            yield f"environment.wind.{name} of {speed:g} m/s: is a hurricane; m/s, not km/h?"
    if isinstance(wind, ForceWind):
        weight = float(scenario.world.vehicle.mass) * EARTH
        forces = [("force", wind.force_W), *(("gust.force", gust.peak) for gust in all_gusts(wind))]
        for name, force in forces:
            if _norm(force) > MOST_WIND * weight:
                times = _norm(force) / weight
                yield f"environment.wind.{name} of {_norm(force):g} N: is {times:.3g} times the weight; N?"
    yield from _without_drag(scenario)


def _without_drag(scenario: Scenario) -> Iterator[str]:
    """Air that moves about a vehicle on which it has no effect."""
    vehicle, wind = scenario.world.vehicle, scenario.wind
    if any(
        float(value) for rotor in vehicle.rotors for value in (rotor.drag_coefficient, rotor.rolling_moment_coefficient)
    ):
        return
    if _norm(vehicle.drag.area) * float(vehicle.drag.air_density):
        return
    moving = [f"environment.air[{i}]" for i in range(len(scenario.air))]
    if isinstance(wind, MovingAir) and (_norm(wind.velocity_W) or all_gusts(wind) or wind.turbulence is not None):
        moving.insert(0, "environment.wind")
    if moving:
        yield (
            f"{', '.join(moving)}: moves the air about a vehicle without drag, which does not feel it; "
            f"rotors.drag_coefficient or drag.area of {vehicle.name!r}?"
        )


def _sensing(scenario: Scenario) -> Iterator[str]:
    for name, (bound, unit, other) in NOISE.items():
        sigma = float(getattr(scenario.sensors, name))
        if sigma >= bound:
            yield f"sensors.{name} = {sigma:g} {unit}: is that much noise at every sample; {unit}, not {other}?"
    for name in ("measurement", "command"):
        late = float(getattr(scenario.delays, name))
        if late > LATEST:
            yield f"delays.{name} = {late:g} s: is long; s, not ms?"


def _reference(scenario: Scenario) -> Iterator[str]:
    links = scenario.world.vehicle.links
    looks = [scenario.trajectory.at(k / LOOKS * scenario.duration) for k in range(LOOKS + 1)]
    away = max(_norm(look.position) for look in looks)
    if away > SPREAD:
        yield f"reference.base reaches {away:.4g} m from the origin: m, not mm?"
    if abs(float(looks[0].yaw)) > TURN:
        yield f"reference.yaw = {float(looks[0].yaw):g} rad at the start: is more than a turn; rad, not degrees?"
    for i, link in enumerate(links):
        most = max((float(look.joints[i]) for look in looks), key=abs)
        yield from _joint(f"reference.joints[{i}]", most, link.joint.kind, "reaches")


def _start(scenario: Scenario) -> Iterator[str]:
    start = scenario.initial
    if start is None:
        return
    for i, (q, link) in enumerate(zip(start.joints, scenario.world.vehicle.links, strict=True)):
        yield from _joint(f"initial.joints[{i}]", float(q), link.joint.kind, "=")
        low, high = float(link.joint.lower), float(link.joint.upper)
        if not low - BEYOND <= float(q) <= high + BEYOND:
            yield (
                f"initial.joints[{i}] = {float(q):g}: is beyond the limits {low:g} ... {high:g} of "
                f"{link.joint.name!r}; rad, not degrees?"
            )
    if _norm(start.rate) > SPUN:
        yield f"initial.rate of {_norm(start.rate):g} rad/s: is fast; rad/s, not degrees/s?"
    if _norm(start.position) > SPREAD:
        yield f"initial.position of {_norm(start.position):.4g} m: is far; m, not mm?"


def _joint(name: str, value: float, kind: str, verb: str) -> Iterator[str]:
    if kind == "revolute" and abs(value) > TURN:
        yield f"{name} {verb} {value:g} rad: is more than a turn; rad, not degrees?"
    elif kind != "revolute" and abs(value) > FARTHEST:
        yield f"{name} {verb} {value:g} m: is far; m, not mm?"


def _norm(vector: object) -> float:
    return math.hypot(*(float(c) for c in vector))  # type: ignore[attr-defined]
