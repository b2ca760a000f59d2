"""Frames of a flight: poses, forces and surroundings at some instants, from a simulation that runs.

A frame is a pure function of vehicles, states, memories of the environment models, and time. Those of a log are
resampled by :mod:`skyarm.view.film.filmed_flight`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field
from functools import cached_property
from itertools import groupby

import numpy as np

from skyarm.dynamics import State
from skyarm.plant.surroundings import motions_of
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_record import Agent, Scenario
from skyarm.simulate.loop_state import LoopState
from skyarm.vehicle import Vehicle
from skyarm.world.scene.component_scenes import scene_now, scenes_of
from skyarm.world.scene.scene import PATCH, Instants, Scene, instant_of
from skyarm.world.scene.vehicle_shapes import Placed, Poses, body_poses, place

Color = tuple[float, float, float]

WIDEST = 6.0
"""Extent (m) of the paths beyond which the patch of a plane does not grow."""


@immutable(slots=False)
class FlightFrames(Instants):
    """Instants of one vehicle's flight with its desired pose, forces and surroundings, in SI units and world axes.

    Attributes:
        number: index of the flight in the picture, the same for the vehicles that fly together.
        label: name in the picture. color: colour of the vehicle, its trail and its curve.
        desired_position (F, 3), desired_quaternion (F, 4), desired_joints (F, n): the continuous reference, level.
        tip, desired_tip: (F, 3) m. force: (F, 3) N of the wind. air: (F, 3) m/s, velocity of the air.
        tilts: (F, rotors that tilt) rad; without columns where none does.
        scene: solids, lines and arrows of the scenario's components; of what vehicles share only with the first.
    """

    label: str
    color: Color
    tilts: Array
    desired_position: Array
    desired_quaternion: Array
    desired_joints: Array
    tip: Array
    desired_tip: Array
    force: Array
    air: Array
    scene: Scene = field(default_factory=Scene)
    number: int = 0

    @cached_property
    def desired_poses(self) -> Poses:
        """World rotations (F, 3, 3) and positions (F, 3) of all bodies in the desired pose, by body index."""
        return body_poses(self.vehicle, self.desired_position, self.desired_quaternion, self.desired_joints)


Flights = Sequence[FlightFrames]
"""Frames of single vehicles shown together in one picture, those of one flight next to each other."""


def by_flight(flights: Flights) -> list[list[FlightFrames]]:
    """Group the vehicles of a picture by the flight that they are in."""
    return [[*group] for _, group in groupby(flights, lambda each: each.number)]


def patch_about(tip: Array) -> float:
    """Half width (m) of the square drawn for an infinite plane, grown with the tip's displacement."""
    finite = tip[np.isfinite(tip).all(axis=1)]
    way = float(np.ptp(finite, axis=0).max()) if len(finite) else 0.0
    return PATCH + 0.5 * min(way, WIDEST)


def poses_of(vehicle: Vehicle, state: State) -> Placed:
    """Positions and rotations of the bodies in a state."""
    return place(vehicle, tuple(state.position), tuple(state.quaternion), state.joints)


def goal_of(agent: Agent, time: float) -> Placed:
    """Desired positions and rotations of a vehicle's bodies at a time (s): level base and joints on its reference."""
    desired = agent.reference.at(time)
    half = 0.5 * float(desired.yaw)
    level = math.cos(half), 0.0, 0.0, math.sin(half)
    return place(agent.vehicle, tuple(desired.position), level, desired.joints)


def scenes_at(scenario: Scenario, now: LoopState, time: float, around: Array, *, attached: bool = True) -> list[Scene]:
    """Drawn solids, lines and arrows around each vehicle at a state of the closed loop, in order.

    Args:
        scenario: flown scenario.
        now: state of its closed loop.
        time: s.
        around: (3,) m, place about which planes are drawn.
        attached: as of :func:`skyarm.world.scene.component_scenes.scenes_of`.
    """
    agents, names = scenario.agents.values(), tuple(scenario.agents)
    motions = motions_of([each.plant for each in agents], [own.state for own in now.agents], names)
    rows = {}
    for name, agent, own, motion in zip(names, agents, now.agents, motions, strict=True):
        motion.task_time = time
        rows[name] = scenario.own_components(agent), own.components, motion

    def draw(name: str, shared: bool) -> Scene:
        models, memories, motion = rows[name]
        every = (*models, *scenario.shared_components), (*memories, *now.components)
        return scene_now(*(every if shared else (models, memories)), instant_of(motion, time, around), motion)

    return [*scenes_of(names, draw, attached=attached)]
