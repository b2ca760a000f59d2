"""Frames of a flight: poses, forces and surroundings at some instants, from a
simulation that runs.

A frame is a pure function of vehicles, states, memories of the environment models, and
time. Those of a log are resampled by :mod:`skyarm.view.film.filmed_flight`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from itertools import groupby
from typing import Any, SupportsFloat

import numpy as np

from skyarm.algebra import Scalar
from skyarm.dynamics import State
from skyarm.log.tip_positions import level_tip, tip, yaw_quaternion
from skyarm.plant.loads import wind_at
from skyarm.plant.surroundings import motions_of
from skyarm.records.arrays import Array, float_array
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_record import Agent, Scenario
from skyarm.simulate.inputs import EpisodeInputs, table_of
from skyarm.simulate.loop_state import LoopState
from skyarm.simulate.stages import Stages
from skyarm.vehicle import Vehicle
from skyarm.world.component import by_array
from skyarm.world.scene.component_scenes import scene_in_log, scene_now, scenes_of
from skyarm.world.scene.scene import PATCH, Instants, Scene, instant_of
from skyarm.world.scene.vehicle_shapes import Placed, Poses, body_poses, place

Color = tuple[float, float, float]

COLORS: tuple[Color, ...] = (
    (0.835, 0.369, 0.0),
    (0.0, 0.447, 0.698),
    (0.0, 0.620, 0.451),
    (0.8, 0.475, 0.655),
    (0.45, 0.35, 0.75),
    (0.35, 0.35, 0.35),
)
"""Colours (red, green, blue, 0 to 1) by the flight's index; the first four are Okabe
and Ito's, distinguishable by colour-blind eyes."""

WIDEST = 6.0
"""Extent (m) of the paths beyond which the patch of a plane does not grow."""


@immutable(slots=False)
class FlightFrames(Instants):
    """Instants of one vehicle's flight with its desired pose, forces and surroundings,
    in SI units and world axes.

    Attributes:
        number: index of the flight in the picture, the same for the vehicles that fly
            together.
        label: name in the picture. color: colour of the vehicle, its trail and its
            curve.
        desired_position (F, 3), desired_quaternion (F, 4), desired_joints (F, n): the
            continuous reference, level.
        tip, desired_tip: (F, 3) m. force: (F, 3) N of the wind. air: (F, 3) m/s,
            velocity of the air.
        tilts: (F, rotors that tilt) rad; without columns where none does.
        scene: solids, lines and arrows of the scenario's components; of what vehicles
            share only with the first.
        cameras: depth cameras and lidars by name, behind that of the vehicle if there
            are several.
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
    cameras: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def desired_poses(self) -> Poses:
        """World rotations (F, 3, 3) and positions (F, 3) of all bodies in the desired
        pose, by body index.
        """
        return body_poses(
            self.vehicle,
            self.desired_position,
            self.desired_quaternion,
            self.desired_joints,
        )


Flights = Sequence[FlightFrames]
"""Frames of single vehicles shown together in one picture, those of one flight next to
each other."""


def by_flight(flights: Flights) -> list[list[FlightFrames]]:
    """Group the vehicles of a picture by the flight that they are in."""
    return [[*group] for _, group in groupby(flights, lambda each: each.number)]


def patch_about(tip: Array) -> float:
    """Half width (m) of the square drawn for an infinite plane, grown with the tip's
    displacement.
    """
    # positions of a diverged flight may not be finite
    finite = tip[np.isfinite(tip).all(axis=1)]
    way = float(np.ptp(finite, axis=0).max()) if len(finite) else 0.0
    return PATCH + 0.5 * min(way, WIDEST)


def frames_now(
    inputs: EpisodeInputs,
    now: LoopState,
    time: float,
    times: Array,
    about: Array | None = None,
) -> FlightFrames:
    """Frames of a running episode of one vehicle, with its present state and
    surroundings at every instant.

    Args:
        inputs: inputs of the episode, for the desired pose at each instant.
        now: state of the closed loop.
        time: s.
        times: (F,) s; one instant for a picture of now, several for the desired path.
        about: (K, 3) m, places about which planes are drawn; about the desired tip, of
            their usual size, if left out.
    """
    scenario = inputs.scenario
    count = len(times)
    ((around, motion),) = Stages(scenario).around(now, time)
    vehicle = scenario.agent.vehicle
    state = motion.state
    wind = wind_at(around, motion)

    def still(numbers: Iterable[SupportsFloat]) -> Array:
        return np.tile(float_array(numbers), (count, 1))

    pose = still(state.position), still(state.quaternion), still(state.joints)
    desired = replace(inputs, times=times).reference
    goal, yaw, goal_joints = (
        table_of(each, count)
        for each in (desired.position, (desired.yaw,), desired.joints)
    )
    goal_tip = (
        table_of(desired.tip, count)
        if desired.tip
        else level_tip(vehicle, goal, yaw[:, 0], goal_joints)
    )
    frames = FlightFrames(
        label=scenario.name,
        color=COLORS[0],
        vehicle=vehicle,
        times=times,
        position=pose[0],
        quaternion=pose[1],
        joints=pose[2],
        tilts=still(state.tilts),
        tip=tip(vehicle, *pose),
        desired_position=goal,
        desired_quaternion=yaw_quaternion(yaw[:, 0]),
        desired_joints=goal_joints,
        desired_tip=goal_tip,
        force=still(wind.force_W),
        air=still(wind.air_velocity_W),
        around=np.mean(goal_tip if about is None else about, axis=0),
        patch=PATCH if about is None else patch_about(about),
    )
    # what the wind's sample holds is not evaluated again: of contacts it takes most of
    # a picture's time
    logged = by_array(scenario.components, wind.numbers)
    return replace(
        frames,
        scene=scene_in_log(
            scenario.components, frames, lambda name: still(logged.get(name, ()))
        ),
    )


def poses_of(vehicle: Vehicle, state: State) -> Placed:
    """Positions and rotations of the bodies in a state."""
    return place(vehicle, tuple(state.position), tuple(state.quaternion), state.joints)


def goal_of(agent: Agent, time: float) -> Placed:
    """Desired positions and rotations of a vehicle's bodies at a time (s): level base
    and joints on its reference.
    """
    desired = agent.reference.at(time)
    (level,) = yaw_quaternion(float_array([desired.yaw]))
    return place(agent.vehicle, tuple(desired.position), level, desired.joints)


def tip_error(agent: Agent, time: Scalar, tip: Array, desired: Array) -> Array:
    """Offset (..., 3) of the tip from its reference, m; during a push only across the
    surface's nominal normal.

    Args:
        agent: vehicle with its reference.
        time: s, one instant or (N,).
        tip: position of the tip, (..., 3) m.
        desired: its reference, (..., 3) m.
    """
    away = tip - desired
    push = getattr(agent.reference, "push", None)
    return away if push is None else push.across(away, time, tip)


def scenes_at(
    scenario: Scenario,
    now: LoopState,
    time: float,
    around: Array,
    *,
    attached: bool = True,
) -> list[Scene]:
    """Drawn solids, lines and arrows around each vehicle at a state of the closed loop,
    in order.

    Args:
        scenario: flown scenario.
        now: state of its closed loop.
        time: s.
        around: (3,) m, place about which planes are drawn.
        attached: as of :func:`skyarm.world.scene.component_scenes.scenes_of`.
    """
    agents = scenario.agents.values()
    names = tuple(scenario.agents)
    motions = motions_of(
        [each.plant for each in agents], [own.state for own in now.agents], names
    )
    rows = {}
    for name, agent, own, motion in zip(
        names, agents, now.agents, motions, strict=True
    ):
        motion.task_time = time
        rows[name] = scenario.own_components(agent), own.components, motion

    def draw(name: str, shared: bool) -> Scene:
        models, memories, motion = rows[name]
        # a scene of what all share is drawn once, with the first vehicle
        every = (*models, *scenario.shared_components), (*memories, *now.components)
        return scene_now(
            *(every if shared else (models, memories)),
            instant_of(motion, time, around),
            motion,
        )

    return [*scenes_of(names, draw, attached=attached)]
