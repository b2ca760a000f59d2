"""3D picture of the studio: vehicles with force arrows and trails, surroundings, and
the desired pose.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from skyarm.dynamics import State
from skyarm.records.arrays import Array, float_array, lengths
from skyarm.scenario.scenario_record import Scenario, cameras_of
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.session import Session
from skyarm.vehicle import Vehicle
from skyarm.view.picture.depth_pixels import depth_pixels
from skyarm.view.picture.frames import goal_of, poses_of, scenes_at
from skyarm.view.picture.marks import tones_of, touch_arrows
from skyarm.view.picture.viser_sink import (
    STILL,
    Arrows,
    LineNodes,
    SolidNodes,
    VehicleNodes,
    add_light,
    segments,
)
from skyarm.view.studio.fleet import Flight, FlownAgent
from skyarm.view.studio.sights import PlottedInstant
from skyarm.world.scene.scene import OBSTACLES, Scene, hidden_share
from skyarm.world.scene.shapes import Solid, floats
from skyarm.world.scene.vehicle_shapes import (
    Placed,
    disc_name,
    matrices,
    payload_shape,
    quaternions_of,
    rotor_turns,
)

if TYPE_CHECKING:
    from skyarm.view.studio.server import CameraNode, SceneApi, ViserServer

COLORS = ((38, 110, 190), (214, 105, 30), (44, 140, 80))
"""Colours of the first, second and third law, here and in the plots: blue, orange,
green."""

GHOST, LOST = (130, 130, 140), (200, 40, 40)

SHELL = 0.06
"""Relative enlargement of the wire-frame vehicle of each further law, so that
coincident vehicles are all visible."""

FLOORS = {False: ((200, 200, 200), (140, 140, 140)), True: ((40, 40, 40), (62, 62, 62))}
"""True for a dark page -> colours of the floor's lines, of cells and of metres."""

THRUST, WIND, PUSHED, TOUCH = (
    (240, 190, 40),
    (70, 170, 220),
    (225, 60, 60),
    (198, 26, 140),
)

NEWTON = 0.08
"""Length of an arrow (m) per newton, or per metre a second of air; chosen by eye for
rotors of a few newtons."""

SHAFT, TOUCH_SHAFT = 0.004, 0.005
"""Radii (m) of the arrows of forces and of contacts."""

TRAIL = 4.0
"""Duration (s) of the tip's trail, as in films."""

SLOW = 6
"""Frames between two drawings of slowly moving parts: ghost, trails, labels; at 60
frames a second they are drawn as often as plots."""

FRUSTUM, THIN = 0.12, 0.003
"""Size and line width (m) of the frustum of a camera."""

QUICK = 20_000
"""Number of rays that take some milliseconds."""

STAGE = "/stage"
"""Root node of the scene. A following camera moves this node the other way, so that
each tab keeps its own view."""

VIEWS = tuple(
    np.array([x, y, 0.38])
    for x, y in ((0.72, -0.85), (-0.72, -0.85), (-0.72, 0.85), (0.72, 0.85))
)
"""Camera positions (m, relative to the vehicle) that a new tab may start from."""

LOOK_AT = np.array([0.12, 0.08, -0.28])
"""Camera target (m, relative to the vehicle) of a new tab, left of the panel on a wide
screen."""


class AgentNodes:
    """Scene nodes of one vehicle of a flight in the studio: vehicle, force arrows,
    trail, name and surroundings.

    Args:
        scene: scene of viser. number: number of the flight, from 0.
        suffix: end of the nodes' names. title: name of the vehicle in the picture.
        vehicle: vehicle of the plant. state: first state. first: first surroundings.
    """

    def __init__(
        self,
        scene: SceneApi,
        number: int,
        suffix: str,
        title: str,
        vehicle: Vehicle,
        state: State,
        first: Scene,
    ) -> None:
        end = f"{number + 1}{suffix}"
        placed = poses_of(vehicle, state)
        self._vehicle = vehicle
        self._lost = False
        self._first = number == 0
        # the names of several flights stand above each other
        self._above = np.array([0.0, 0.0, 0.16 + 0.08 * number])
        self._paint = tones_of(COLORS[number])
        points = first.attached
        wires = SHELL * number
        self.vehicle = VehicleNodes(
            scene, f"{STAGE}/law{end}", vehicle, self._paint, points=points, wires=wires
        )
        colors = [THRUST] * len(vehicle.rotors) + [WIND, PUSHED]
        at = np.tile(placed.positions[0], (2, 1))
        self._forces = Arrows(scene, f"{STAGE}/arrows{end}", colors, SHAFT, at)
        # a trail begins as a line without length at the tip
        still = np.tile(placed.tip, (1, 2, 1)).astype(np.float32)
        self._trail = scene.add_line_segments(
            f"{STAGE}/trail{end}", still, COLORS[number], thickness=0.004
        )
        self._label = scene.add_label(
            f"{STAGE}/label{end}", title, position=placed.positions[0] + self._above
        )
        self._world = SolidNodes(scene, f"{STAGE}/scene{end}", self._paint)
        self._lines = LineNodes(scene, f"{STAGE}/lines{end}")
        touches = [TOUCH] * len(first.arrows)
        self._touches = Arrows(scene, f"{STAGE}/touches{end}", touches, TOUCH_SHAFT, at)
        self._place_scene(first)
        self.vehicle.place(placed.poses, turns_of(vehicle, state))

    def _place_scene(self, scene: Scene, more: Sequence[Solid] = ()) -> None:
        """Draw payloads and cables of a flight; surfaces and objects only for the first
        flight.
        """
        solids = (
            scene.solids
            if self._first
            else [each for each in scene.solids if each.shape.role not in OBSTACLES]
        )
        self._world.place([*solids, *more])
        self._lines.place(scene.lines)
        self._touches.point(touch_arrows(scene.arrows, 0, NEWTON))

    def draw(
        self, agent: FlownAgent, state: State, scene: Scene, *, slow: bool
    ) -> Array:
        """Draw a vehicle in a state with its surroundings; returns the position (m) of
        its base.
        """
        placed = poses_of(self._vehicle, state)
        flight = agent.flight
        speeds = float_array(state.rotor_speeds)
        turns = turns_of(self._vehicle, state)
        self.vehicle.place(placed.poses, turns if flight.session.running else {})
        self._place_scene(scene, self._attached_mass(agent.hung_mass, placed))
        self._forces.point(
            force_arrows(self._vehicle, agent.last, placed, speeds, turns)
        )
        if slow:
            self._trail.points = trail([seen.tip for seen in agent.recent(TRAIL)])
            if bool(flight.lost) != self._lost:
                self._lost = bool(flight.lost)
                self.vehicle.color(tones_of(LOST) if self._lost else self._paint)
            self._label.text = f"{agent.title}: lost" if self._lost else agent.title
            if np.isfinite(placed.positions[0]).all():
                self._label.position = placed.positions[0] + self._above
        base: Array = placed.positions[0]
        return base

    def _attached_mass(self, mass: float, placed: Placed) -> list[Solid]:
        """Solid of the mass (kg) that the user attached to the tip by a slider; empty
        for no mass.
        """
        if not (mass > 0.0 and self._vehicle.end_effector):
            return []
        shape = payload_shape(self._vehicle, mass)
        # row 0 is the base, and then come the links
        R = placed.rotations[1 + shape.body]
        return [
            Solid(
                shape,
                (placed.positions[1 + shape.body] + R @ np.array(shape.position))[None],
                R[None],
            )
        ]

    def remove(self) -> None:
        """Remove the vehicle's nodes from the scene."""
        for node in (
            self.vehicle,
            self._forces,
            self._trail,
            self._label,
            self._world,
            self._lines,
            self._touches,
        ):
            node.remove()


def force_arrows(
    vehicle: Vehicle,
    last: PlottedInstant,
    placed: Placed,
    speeds: Array,
    turns: dict[str, Array],
) -> Array:
    """Start and end points (m) of arrows for thrusts, air velocity and external force,
    (rotors + 2, 2, 3).
    """
    R = placed.rotations[0]
    p = placed.positions[0]
    ends = []
    for rotor, speed in zip(vehicle.rotors, speeds, strict=True):
        hub = p + R @ float_array(rotor.position)
        turn = turns.get(disc_name(rotor.name), np.eye(3)[None])[0]
        # by the coefficient, also of a rotor with a table: it is only drawn
        thrust = float(rotor.thrust_coefficient) * speed**2
        axis = R @ turn @ float_array(rotor.axis)
        ends.append((hub, hub + NEWTON * thrust * axis))
    # the wind's arrow ends above the vehicle, which would hide it; chosen
    above = p + np.array([0.0, 0.0, 0.22])
    ends += [(above - NEWTON * last.air, above), (p - NEWTON * last.pushed, p)]
    return np.array(ends)


def trail(tips: Sequence[Array]) -> npt.NDArray[np.float32]:
    """Line segments (m) of the tip's trajectory, (N, 2, 3)."""
    places = np.array(tips).reshape(-1, 3) if len(tips) > 1 else np.zeros((2, 3))
    return segments(places).astype(np.float32)


def turns_of(vehicle: Vehicle, state: State) -> dict[str, Array]:
    """Rotation (1, 3, 3) of each tilting rotor's disc in a state, by its name."""
    return rotor_turns(vehicle, float_array(state.tilts)[None])


class SightNodes:
    """Scene nodes of the depth cameras of a flight: a frustum with the picture, on the
    link that carries it.

    Args:
        scene: scene of viser. scenario: scenario of the flight.
        roots: node of each vehicle.
    """

    def __init__(
        self, scene: SceneApi, scenario: Scenario, roots: Mapping[str, str]
    ) -> None:
        self._rows: list[tuple[str, int, CameraNode]] = []
        for name, (agent, sensor) in cameras_of(scenario).items():
            height, width = sensor.shape
            found = sensor.intrinsics()
            # the rays of a lidar fill no pyramid
            if found is None:
                continue
            body = sensor.body_of(scenario.vehicles[agent])
            node = scene.add_camera_frustum(
                f"{roots[agent]}/{body}/{name}",
                # vertical field of view, of the focal length fy in pixels
                2.0 * math.atan2(0.5 * height, found[1]),
                width / height,
                scale=FRUSTUM,
                thickness=THIN,
                position=floats(sensor.position),
                wxyz=quaternions_of(matrices(sensor.rotation, 1))[0],
            )
            every = SLOW * (1 + height * width // QUICK)
            self._rows.append((name, every, node))

    def draw(self, session: Session, frame: int) -> None:
        """Show what the cameras see now, seldom if they have many pixels."""
        for name, every, node in self._rows:
            if frame % every == 0:
                node.image = depth_pixels(session.frame(name).depth)


class StudioStage:
    """Light, ground and camera of a viser scene that can shift so that the camera
    follows a vehicle.

    Args:
        server: server of viser.
    """

    def __init__(self, server: ViserServer) -> None:
        self._server = server
        self._scene = server.scene
        self.follow = False
        self._frame = 0
        add_light(self._scene, 1.5)
        self._stage = self._scene.add_frame(STAGE, show_axes=False)
        self._origin, self._moved = np.zeros(3), np.zeros(3)
        self._ground = self._scene.add_grid(
            f"{STAGE}/ground", width=12.0, height=12.0, cell_size=0.5
        )
        self._dark = False

    def _follow(self, at: Array) -> None:
        """Shift the scene to keep a vehicle in place for the camera, and match the
        floor to the page's colours.
        """
        # configure_theme sets it; viser's server has no such attribute of its own
        dark = getattr(self._server, "dark", False)
        if dark != self._dark:
            self._dark = dark
            self._ground.cell_color, self._ground.section_color = FLOORS[dark]
        moved = self._origin - at if self.follow else np.zeros(3)
        if np.abs(moved - self._moved).max() > STILL:
            self._stage.position = self._moved = moved

    def hurry(self) -> None:
        """Redraw everything in the next frame, including parts usually drawn at a lower
        rate.
        """
        self._frame = -1


class FleetPicture(StudioStage):
    """3D picture of all flights, drawn in a viser scene.

    Args:
        server: server of viser.
    """

    def __init__(self, server: ViserServer) -> None:
        super().__init__(server)
        self._flights: list[list[AgentNodes]] = []
        self._ghosts: list[VehicleNodes] = []
        self._around = np.zeros(3)

    def build(self, scenario: Scenario, titles: Sequence[str]) -> None:
        """Clear the scene and draw the vehicles of each flight at the scenario's
        initial state.
        """
        for nodes in itertools.chain(*self._flights):
            nodes.remove()
        for ghost in self._ghosts:
            ghost.remove()
        now = first_loop_state(scenario)
        vehicles = scenario.vehicles
        placed = [
            poses_of(vehicle, own.state)
            for vehicle, own in zip(vehicles.values(), now.agents, strict=True)
        ]
        bases = np.array([each.positions[0] for each in placed])
        tips = np.array([each.tip for each in placed])
        self._origin = bases.mean(axis=0)
        self._around = tips.mean(axis=0)
        self._follow(self._origin)
        scenes = scenes_at(scenario, now, 0.0, self._around)
        ends = [f"_{name}" if len(vehicles) > 1 else "" for name in vehicles]
        rows = [*zip(ends, vehicles.items(), now.agents, scenes, strict=True)]
        self._flights = [
            [
                AgentNodes(
                    self._scene,
                    i,
                    end,
                    f"{title}, {name}" if end else title,
                    vehicle,
                    own.state,
                    scene,
                )
                for end, (name, vehicle), own, scene in rows
            ]
            for i, title in enumerate(titles)
        ]
        roots = {
            name: f"{STAGE}/law1{end}" for name, end in zip(vehicles, ends, strict=True)
        }
        self._sights = SightNodes(self._scene, scenario, roots)
        grey = tones_of(GHOST, 0.25)
        self._ghosts = [
            VehicleNodes(self._scene, f"{STAGE}/ghost{end}", each[1], grey)
            for end, each, *_ in rows
        ]
        self._draw_ghosts(scenario, 0.0)
        self._ground.position = (0.0, 0.0, scenes[0].ground or 0.0)
        # VIEWS are of one vehicle: the farther others stand from the middle, the
        # farther back is the camera
        self._look_at(scenes[0], tips, 1.0 + float(lengths(bases - self._origin).max()))

    def _look_at(self, scene: Scene, tips: Array, scale: float) -> None:
        """Initial camera of a new tab: ahead and to the right, or where no surface
        hides the tips.
        """
        hidden = [
            hidden_share(scene.obstacles, tips, view / np.linalg.norm(view))
            for view in VIEWS
        ]
        camera = self._server.initial_camera
        camera.look_at = tuple(self._origin + scale * LOOK_AT)
        camera.position = tuple(self._origin + scale * VIEWS[int(np.argmin(hidden))])

    def draw(self, flights: Sequence[Flight]) -> None:
        """Draw the flights at the current time."""
        self._frame += 1
        slow = self._frame % SLOW == 0
        # a flight that has just come may have no nodes yet
        for i, (nodes, flight) in enumerate(zip(self._flights, flights, strict=False)):
            session = flight.session
            now = session.now
            scenes = scenes_at(
                session.scenario, now, session.time, self._around, attached=False
            )
            rows = zip(nodes, flight.agents.values(), now.agents, scenes, strict=True)
            bases = [
                each.draw(agent, own.state, scene, slow=slow)
                for each, agent, own, scene in rows
            ]
            if i == 0:
                self._follow(np.mean(bases, axis=0))
                self._sights.draw(session, self._frame)
        if slow and flights:
            self._draw_ghosts(flights[0].session.scenario, flights[0].session.time)

    def _draw_ghosts(self, scenario: Scenario, time: float) -> None:
        for ghost, agent in zip(self._ghosts, scenario.agents.values(), strict=True):
            ghost.place(goal_of(agent, time).poses)
