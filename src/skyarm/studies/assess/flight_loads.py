"""Loads along a flight: payloads, scheduled changes, and what wind, forces and faults add."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from skyarm.algebra import ZERO3, Quaternion, Vec3
from skyarm.control.controller import presses
from skyarm.dynamics.actuators.motion_demand import Disturbance, DisturbanceAt
from skyarm.dynamics.actuators.rotor import speed_of_push
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.plant.loads import STEADY, applied_force
from skyarm.plant.surroundings import Surroundings
from skyarm.reference.path_time import governed_reference
from skyarm.reference.trajectory import Reference, Trajectory
from skyarm.scenario.in_flight import stretches
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.assess.arm_poses import Array
from skyarm.vehicle.linkage import Body
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.world import NO_WIND, Component, Wrench
from skyarm.world.component import Force
from skyarm.world.faults import effectiveness_at

AT_ONCE = 1 << 14
"""Control periods whose frames are computed at once: bounds the memory of a long flight."""

OF_THE_LAW = ("model", "controller", "estimator", "sensors", "endings")
"""Beginnings of the paths of changes that leave plant, surroundings and reference as they are."""


@dataclass(frozen=True, slots=True)
class Load:
    """A load that the vehicle holds for a part of the flight. One on a cord counts as a point mass at its frame.

    Attributes:
        name: of the payload. start, stop: s. mass: kg. body: (link, body) of it on a vehicle.
    """

    name: str
    start: float
    stop: float
    mass: float
    body: Callable[[Vehicle], tuple[int, Body]]


@dataclass(frozen=True, slots=True)
class FlightPart:
    """A part of the flight in which scheduled changes and loads stay the same.

    Attributes:
        start, stop: s. scenario: with the changes so far. vehicle: the plant with its loads.
        words: what it holds, as " with 0.3 kg (box)"; empty without a load.
    """

    start: float
    stop: float
    scenario: Scenario
    vehicle: Vehicle
    words: str


def flight_parts(scenario: Scenario) -> list[FlightPart]:
    """The parts of a scenario's flight, in order."""
    of_the_world = tuple(c for c in scenario.changes if c.path.split(".", maxsplit=1)[0] not in OF_THE_LAW)
    scenario = dataclasses.replace(scenario, changes=of_the_world)
    loads = _payloads(scenario)
    changed = [(each.start / scenario.rates.control, each.overrides.of(scenario)) for each in stretches(scenario)]
    edges = {start for start, _ in changed} | {t for load in loads for t in (load.start, load.stop)}
    cuts = [0.0, *sorted(t for t in edges if 0.0 < t < scenario.duration), scenario.duration]
    found = []
    for start, stop in pairwise(cuts):
        now = [each for t, each in changed if t <= start][-1]
        held = [load for load in loads if load.start <= start < load.stop]
        vehicle = now.plant.vehicle
        for load in held:
            vehicle = vehicle.with_body(*load.body(vehicle))
        kilograms = f"{math.fsum(load.mass for load in held):g} kg ({', '.join(load.name for load in held)})"
        found.append(FlightPart(start, stop, now, vehicle, f" with {kilograms}" if held else ""))
    return found


def _payloads(scenario: Scenario) -> list[Load]:
    """Payloads, held from the first control period after their instants, or where the reference comes to a place."""
    found = []
    for i, payload in enumerate(scenario.payloads):
        start = stop = math.inf
        for times in _control_instants(scenario):
            pick, drop = payload.events_reached(times, Vec3(*_along(scenario, payload.frame, times)))
            if math.isinf(start):
                start = _first(times, pick)
            stop = _first(times, drop & (times > start))
            if math.isfinite(stop):
                break
        name = payload.name or f"payloads[{i}]"
        found.append(Load(name, start, stop, float(payload.mass), payload.body))
    return found


def _control_instants(scenario: Scenario) -> Iterator[Array]:
    """Beginnings of the flight's control periods, s, (K,) at a time: the instants at which loads are taken and left."""
    rate = scenario.rates.control
    count = math.ceil(scenario.duration * rate - 1e-9)
    for first in range(0, count, AT_ONCE):
        yield np.arange(first, min(first + AT_ONCE, count)) / rate


def _first(times: Array, found: Array) -> float:
    """First of the times at which something holds; inf for none."""
    return float(times[np.argmax(found)]) if np.any(found) else math.inf


def reference_at(scenario: Scenario, time: Array) -> Reference:
    """The reference that the law follows, at many instants."""
    path = scenario.path_time
    return scenario.reference.at(time) if path is None else governed_reference(scenario.reference, path, time)


def _along(scenario: Scenario, frame: str, time: Array) -> Array:
    """Places (3, K) of a frame with the base level on its reference, m, world axes."""
    reference, vehicle = reference_at(scenario, time), scenario.plant.vehicle
    half = 0.5 * np.asarray(reference.yaw, dtype=float)
    state = State(
        position=reference.position,
        quaternion=Quaternion(np.cos(half), 0.0, 0.0, np.sin(half)),
        velocity=ZERO3,
        rate=ZERO3,
        joints=tuple(reference.joints),
        joint_rates=(0.0,) * vehicle.n,
    )
    motion = PointMotion(vehicle, state)
    return lanes(motion.position(*motion.frame(frame or None)), len(time))


def lanes(values: Iterable[Any], count: int) -> Array:
    """Numbers or arrays as rows (..., K)."""
    rows = [np.broadcast_to(np.asarray(v, dtype=float), count) for v in values]
    return np.stack(rows) if rows else np.zeros((0, count))


@dataclass(frozen=True, slots=True)
class Pressing(Force):
    """The surface's force on a tip that presses as its reference has it."""

    trajectory: Trajectory

    def wrenches(self, memory: Any, t: Any, motion: PointMotion, rotor_speeds: Sequence[Any]) -> Sequence[Wrench]:
        """Wrenches of touches along the nominal normal, while a force is commanded."""
        force, _, *normal = self.trajectory.at(t).push[:5]
        point, body = motion.frame(None)
        return (Wrench(force_W=Vec3(*(c * force for c in normal)), point=point, body=body),)


def disturbance_of(part: FlightPart, time: Array) -> DisturbanceAt | None:
    """Disturbance by wind, air, forces, faults and a desired push along the reference; None without any of them.

    Gusts and signals count, turbulence and noise do not.
    """
    scenario, vehicle = part.scenario, part.vehicle
    pushes = scenario.reference.push is not None and vehicle.end_effector and presses(scenario.controller.par)
    pressing = (Pressing(scenario.reference),) if pushes else ()
    wind = () if scenario.wind == NO_WIND else (scenario.wind,)
    components: tuple[Component, ...] = (*wind, *scenario.air, *scenario.forces, *pressing)
    if not components and not scenario.faults:
        return None
    # normal numbers of a uniform 1 are 0: the mean
    memories = tuple(each.start(1.0 / scenario.rates.control, (1.0,) * (2 * each.uniforms)) for each in components)
    around = Surroundings(
        components=components,
        memories=memories,
        time=time,
        effectiveness=effectiveness_at(scenario.faults, vehicle, time),
    )
    reference, still = reference_at(scenario, time), (0.0,) * vehicle.n

    def disturbance(R: Array, rate: Array, squared: Array) -> Disturbance:
        pairs = zip(vehicle.rotors, np.maximum(squared, 0.0), strict=True)
        speeds = tuple(
            speed_of_push(rotor, push) if rotor.table is not None else np.sqrt(push) for rotor, push in pairs
        )
        flying = State(
            position=reference.position,
            quaternion=_quaternion(R),
            velocity=reference.velocity,
            rate=Vec3(*rate),
            joints=tuple(reference.joints),
            joint_rates=tuple(reference.joint_rates),
            tilts=(0.0,) * len(vehicle.tilts),
        )
        calm = dataclasses.replace(flying, velocity=ZERO3, rate=ZERO3)
        force, efforts = applied_force(vehicle, flying, speeds, still, around)
        nominal, friction = applied_force(vehicle, calm, speeds, still, STEADY)
        more, count = force - nominal, len(time)
        return Disturbance(
            lanes(more.torque, count),
            lanes(more.force, count),
            lanes(efforts, count) - lanes(friction, count),
        )

    return disturbance


def _quaternion(R: Array) -> Quaternion:
    """Quaternions of rotations (3, 3, K) with less than half a turn of tilt: shortest tilt, after the heading."""
    x, y, z = R[:, 2]
    w = np.sqrt(np.maximum(0.5 * (1.0 + z), 1e-12))
    tilt = Quaternion(w, -0.5 * y / w, 0.5 * x / w, 0.0)
    ahead = tilt.rotation().apply_T(Vec3(*R[:, 0]))
    half = 0.5 * np.arctan2(np.asarray(ahead.y), np.asarray(ahead.x))
    return tilt * Quaternion(np.cos(half), 0.0, 0.0, np.sin(half))
