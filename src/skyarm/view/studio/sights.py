"""Quantities of a running simulation that the studio draws and plots: errors, efforts,
forces.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import SupportsFloat

from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.loads import wind_at
from skyarm.records.arrays import Array, float_array, norm
from skyarm.records.immutable import positional
from skyarm.records.leaves import Tree
from skyarm.simulate.session import Session
from skyarm.simulate.stages import Stages
from skyarm.simulate.tip_and_goal import goal_of
from skyarm.vehicle import Vehicle
from skyarm.view.picture.frames import poses_of, tip_error
from skyarm.world.component import Component


@positional
class PlottedInstant:
    """Plotted quantities of a running simulation at one instant: tip error, tilt,
    efforts, rotor speeds, forces.

    Attributes:
        tick: control periods flown. time: s.
        tip: its position, world axes, m. error: its distance from its reference, m;
            across the model's normal while it shall press.
        tilt: angle of the base's z axis against the vertical, rad.
        efforts: share of each joint's limit that its setpoint takes; N m or N of a
            joint without a limit.
        rotors: share of each rotor's highest speed.
        air: velocity of the air at the base, world axes, m/s. pushed: force on the base
            of all that surrounds it, N.
        contacts: surface -> sum of its normal forces on the vehicle, N; empty without
            surfaces.
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


def sights(session: Session) -> list[PlottedInstant]:
    """Compute the plotted quantities of each vehicle of a simulation session at its
    current time, in order.
    """
    scenario = session.scenario
    now = session.now
    time = session.time
    plotted = []
    for agent, own, (around, motion) in zip(
        scenario.agents.values(),
        now.agents,
        Stages(scenario).around(now, time),
        strict=True,
    ):
        vehicle = agent.vehicle
        outside = wind_at(around, motion)
        placed = poses_of(vehicle, motion.state)
        upward = float(placed.rotations[0, 2, 2])
        # as metrics have it: a plan states where its tip is, with the base's tilt
        desired = float_array(goal_of(vehicle, agent.reference.at(time)).tool)
        away = tip_error(agent, time, placed.tip, desired)
        speeds = zip(motion.state.rotor_speeds, vehicle.rotors, strict=True)
        plotted.append(
            PlottedInstant(
                tick=session.tick,
                time=time,
                tip=placed.tip,
                error=norm(away),
                tilt=(
                    # rounding may take a cosine beyond 1
                    math.acos(min(1.0, max(-1.0, upward)))
                    # a lost vehicle's attitude may be no number: upside down
                    if math.isfinite(upward)
                    else math.pi
                ),
                efforts=_efforts(vehicle, own.queue[-1].efforts),
                rotors=tuple(float(w) / float(r.max_speed) for w, r in speeds),
                air=float_array(outside.air_velocity_W),
                pushed=float_array(outside.force_W),
                contacts=contact_forces(around.components, around.memories, motion),
            )
        )
    return plotted


OTHER = {"contact_force": 0, "collision_force": 2}
"""Array of forces -> whether what the vehicle touches is before or behind the slash in
the name of a column."""


def contact_forces(
    components: Sequence[Component[Tree]], memories: Sequence[Tree], motion: PointMotion
) -> dict[str, float]:
    """Current sum of the normal forces (N) on the vehicle, by the name of each surface
    and other body.

    Args:
        components: components of the scenario.
        memories: memory of each component.
        motion: motion of the vehicle.
    """
    forces: dict[str, float] = {}
    for part, memory in zip(components, memories, strict=True):
        own = part.of_agent(motion.name).columns
        pairs = [
            column[1].partition("/")[OTHER[column[0]]]
            if column[0] in OTHER and column in own
            else ""
            for column in part.columns
        ]
        for surface, force in (
            zip(pairs, part.logged(memory, motion), strict=True) if any(pairs) else ()
        ):
            if surface:
                forces[surface] = forces.get(surface, 0.0) + float(force)
    return forces


def _efforts(vehicle: Vehicle, setpoints: Sequence[SupportsFloat]) -> tuple[float, ...]:
    """Joint effort commands as shares of their limits; in N m or N for a joint without
    a limit.
    """
    limits = [float(joint.effort_limit) for joint in vehicle.joints]
    return tuple(
        float(u) / m if m and math.isfinite(m) else float(u)
        for u, m in zip(setpoints, limits, strict=True)
    )
