"""Quantities of a running simulation that the studio draws and plots: errors, efforts, forces."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import SupportsFloat

import numpy as np

from skyarm.dynamics import State
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree
from skyarm.reference import Reference
from skyarm.simulate.session import Session
from skyarm.vehicle import Vehicle
from skyarm.world.component import Component
from skyarm.world.scene.shapes import floats
from skyarm.world.scene.vehicle_shapes import Placed, place


@immutable(kw_only=False)
class PlottedInstant:
    """Plotted quantities of a running simulation at one instant: tip error, tilt, efforts, rotor speeds, forces.

    Attributes:
        tick: control periods flown. time: s.
        tip: its position, world axes, m. error: its distance from its reference, m; across the model's normal while it
            shall press.
        tilt: angle of the base's z axis against the vertical, rad.
        efforts: share of each joint's limit that its setpoint takes; N m or N of a joint without a limit.
        rotors: share of each rotor's highest speed.
        air: velocity of the air at the base, world axes, m/s. pushed: force on the base of all that surrounds it, N.
        contacts: surface -> sum of its normal forces on the vehicle, N; empty without surfaces.
    """

    tick: int
    time: float
    tip: Array
    error: float
    tilt: float
    efforts: tuple[float, ...]
    rotors: tuple[float, ...]
    air: Array
    pushed: Array
    contacts: Mapping[str, float]

    @property
    def contact(self) -> float:
        """Sum (N) of all normal contact forces on the vehicle."""
        return sum(self.contacts.values())


def sight(session: Session) -> PlottedInstant:
    """Compute the plotted quantities of a simulation session at its current time."""
    scenario, now, time = session.scenario, session.now, session.time
    vehicle, state = scenario.agent.plant.vehicle, now.agent.state
    placed = poses_of(vehicle, state)
    outside = session.wind
    upward, away = (
        float(placed.rotations[0, 2, 2]),
        placed.tip - goal_of(vehicle, scenario.agent.reference.at(time)).tip,
    )
    push = getattr(scenario.agent.reference, "push", None)
    if push is not None:
        away = push.across(away, time, placed.tip)
    return PlottedInstant(
        tick=session.tick,
        time=time,
        tip=placed.tip,
        error=float(np.linalg.norm(away)),
        tilt=math.acos(min(1.0, max(-1.0, upward))) if math.isfinite(upward) else math.pi,
        efforts=_efforts(vehicle, now.agent.queue[-1].efforts),
        rotors=tuple(float(w) / float(r.max_speed) for w, r in zip(state.rotor_speeds, vehicle.rotors, strict=True)),
        air=np.array(floats(outside.air_velocity_W)),
        pushed=np.array(floats(outside.force_W)),
        contacts=contact_forces(scenario.components, now.memories, PointMotion(vehicle, state)),
    )


def contact_forces(
    components: Sequence[Component[Tree]], memories: Sequence[Tree], motion: PointMotion
) -> dict[str, float]:
    """Current sum of the normal forces (N) on the vehicle, by the name of each surface.

    Args:
        components: components of the scenario.
        memories: memory of each component.
        motion: motion of the vehicle.
    """
    forces: dict[str, float] = {}
    for part, memory in zip(components, memories, strict=True):
        pairs = [column[1].partition("/")[0] if column[0] == "contact_force" else "" for column in part.columns]
        for surface, force in zip(pairs, part.logged(memory, motion), strict=True) if any(pairs) else ():
            if surface:
                forces[surface] = forces.get(surface, 0.0) + float(force)
    return forces


def poses_of(vehicle: Vehicle, state: State) -> Placed:
    """Positions and rotations of the bodies in a state."""
    return place(vehicle, tuple(state.position), tuple(state.quaternion), state.joints)


def goal_of(vehicle: Vehicle, reference: Reference) -> Placed:
    """Desired positions and rotations of the bodies: level base and joints on a reference."""
    half = 0.5 * float(reference.yaw)
    return place(vehicle, tuple(reference.position), (math.cos(half), 0.0, 0.0, math.sin(half)), reference.joints)


def _efforts(vehicle: Vehicle, setpoints: Sequence[SupportsFloat]) -> tuple[float, ...]:
    """Joint effort commands as shares of their limits; in N m or N for a joint without a limit."""
    limits = [float(link.joint.effort_limit) for link in vehicle.links]
    return tuple(float(u) / m if m and math.isfinite(m) else float(u) for u, m in zip(setpoints, limits, strict=True))
