"""The vehicle as it moves in one control period: with the payloads that it holds, its stuck joints held fast."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from skyarm.plant.surroundings import Around, Surroundings
from skyarm.scalars import add, mul
from skyarm.vehicle.vehicle_records import Vehicle

LOCKED = 1e12
"""kg m^2 or kg: inertia of a stuck joint's motion. A torque of 1 N m moves it by 5e-13 rad in a second, less than what
rounding leaves of a joint's angle, and both plants solve for the other accelerations as if the joint were not there."""


def payloads_of(around: Around) -> list[tuple[Any, Any]]:
    """Rigid payloads with a time, and what has become of each."""
    if not isinstance(around, Surroundings):
        return []
    pairs = zip(around.components, around.memories, strict=True)
    return [(each, memory) for each, memory in pairs if each.rigid]


def stuck_of(around: Around) -> Sequence[Any]:
    """1 for each joint that is stuck, 0 for one that may become so, a structural 0 for every other; empty for none."""
    return () if around.effectiveness is None else around.effectiveness.stuck


def changes_inertia(around: Around) -> bool:
    """Whether anything of a period may change the inertia of what moves; known by structure."""
    return bool(payloads_of(around)) or bool(stuck_of(around))


def loaded_vehicle(vehicle: Vehicle, around: Around) -> Vehicle:
    """The vehicle with what it holds now; itself, at no cost, where nothing can be held or stuck."""
    for payload, memory in payloads_of(around):
        vehicle = vehicle.with_body(*payload.body(vehicle, memory.held))
    stuck = stuck_of(around)
    if not stuck:
        return vehicle
    links = list(vehicle.links)
    for i, share in enumerate(stuck):
        if type(share) is not int:
            joint = dataclasses.replace(links[i].joint, armature=add(links[i].joint.armature, mul(LOCKED, share)))
            links[i] = dataclasses.replace(links[i], joint=joint)
    return dataclasses.replace(vehicle, links=tuple(links))
