"""Payloads carried and parameter changes over a flight, as intervals of constant
load.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from skyarm.algebra import Vec3
from skyarm.dynamics.kinematics import frame_pose
from skyarm.records.arrays import Array, Mask, doubles, stack_values
from skyarm.records.immutable import positional
from skyarm.reference.path_time import governed_reference
from skyarm.reference.trajectory import Reference
from skyarm.scenario.in_flight import stretches
from skyarm.scenario.scenario_record import Scenario
from skyarm.vehicle import Body, Vehicle

AT_ONCE = 1 << 14
"""Number of control periods whose frames are computed at once, which bounds the memory
of a long flight."""

OF_THE_LAW = ("model", "controller", "estimator", "sensors", "endings")
"""Prefixes of the paths of changes that do not alter plant, surroundings or
reference."""


@positional
class Load:
    """Payload carried for part of a flight; one on a sling counts as a point mass at
    its attachment frame.

    Attributes:
        name: name of the payload. start, stop: s. mass: kg. body: (link, body) of it on
            a vehicle.
    """

    name: str
    start: float
    stop: float
    mass: float
    body: Callable[[Vehicle], tuple[int, Body]]


@positional
class FlightPart:
    """Time interval of a flight during which payloads and scheduled parameters are
    constant.

    Attributes:
        start, stop: s. scenario: scenario with the changes so far. vehicle: the plant
            with its loads.
        words: text of the load, as " with 0.3 kg (box)"; empty without a load.
    """

    start: float
    stop: float
    scenario: Scenario
    vehicle: Vehicle
    words: str


def flight_parts(scenario: Scenario, carried: Sequence[Load] = ()) -> list[FlightPart]:
    """Divide a scenario's flight into time intervals of constant payload and
    parameters, in order.

    ``carried`` are loads beside the scenario's payloads: shares of bodies that several
    vehicles carry.
    """
    # changes of the law would divide the flight and load nothing
    of_the_world = tuple(
        c
        for c in scenario.changes
        if c.path.split(".", maxsplit=1)[0] not in OF_THE_LAW
    )
    scenario = dataclasses.replace(scenario.as_begun, changes=of_the_world)
    loads = [*_payloads(scenario), *carried]
    changed = [
        (each.start / scenario.rates.control, each.overrides.of(scenario))
        for each in stretches(scenario)
    ]
    edges = {start for start, _ in changed} | {
        t for load in loads for t in (load.start, load.stop)
    }
    cuts = [
        0.0,
        *sorted(t for t in edges if 0.0 < t < scenario.duration),
        scenario.duration,
    ]
    parts = []
    for start, stop in pairwise(cuts):
        now = [each for t, each in changed if t <= start][-1]
        carried = [load for load in loads if load.start <= start < load.stop]
        vehicle = now.agent.vehicle
        for load in carried:
            vehicle = vehicle.with_body(*load.body(vehicle))
        kilograms = (
            f"{math.fsum(load.mass for load in carried):g} kg"
            f" ({', '.join(load.name for load in carried)})"
        )
        parts.append(
            FlightPart(
                start, stop, now, vehicle, f" with {kilograms}" if carried else ""
            )
        )
    return parts


def _payloads(scenario: Scenario) -> list[Load]:
    """Payloads with pick-up and release times, each set by a time or by the reference's
    arrival at a position.
    """
    loads = []
    for i, payload in enumerate(scenario.agent.payloads):
        start = stop = math.inf
        for times in _control_instants(scenario):
            pick, drop = map(
                np.asarray,
                payload.events_reached(
                    times, Vec3(*_along(scenario, payload.frame, times))
                ),
            )
            # a load taken in one block may be released in a later one
            if math.isinf(start):
                start = _first(times, pick)
            stop = _first(times, drop & (times > start))
            if math.isfinite(stop):
                break
        name = payload.name or f"payloads[{i}]"
        loads.append(Load(name, start, stop, float(payload.mass), payload.body))
    return loads


def _control_instants(scenario: Scenario) -> Iterator[Array]:
    """Start times (s) of a flight's control periods, in blocks (K,)."""
    for first in range(0, scenario.steps, AT_ONCE):
        block = np.arange(first, min(first + AT_ONCE, scenario.steps))
        yield block / scenario.rates.control


def _first(times: Array, reached: Mask) -> float:
    """First of the times at which a boolean array is true; inf if all are false."""
    return float(times[np.argmax(reached)]) if np.any(reached) else math.inf


def reference_at(scenario: Scenario, time: Array) -> Reference:
    """Reference trajectory of the controller at many times."""
    path = scenario.agent.path_time
    return (
        scenario.agent.reference.at(time)
        if path is None
        else governed_reference(scenario.agent.reference, path, time)
    )


def _along(scenario: Scenario, frame: str, time: Array) -> Array:
    """World positions (3, K) of a vehicle frame (m) at K times, if a level base tracks
    the reference exactly.
    """
    reference = reference_at(scenario, time)
    vehicle = scenario.agent.vehicle
    at = frame_pose(vehicle, vehicle.frame(frame or None), reference.joints).p
    return stack_values(
        len(time), reference.position + at.about_z(doubles(reference.yaw))
    )
