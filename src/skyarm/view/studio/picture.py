"""3D picture of the studio: vehicles with force arrows and trails, surroundings, and the desired pose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from skyarm.dynamics import State
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.arrays import Array
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.vehicle import Vehicle
from skyarm.view.studio.fleet import Flight
from skyarm.view.studio.scene_nodes import STILL, Arrows, LineNodes, Paint, SolidNodes, VehicleNodes, segments
from skyarm.view.studio.sights import goal_of, poses_of
from skyarm.world.scene.component_scenes import first_memories, scene_now
from skyarm.world.scene.scene import OBSTACLES, Arrow, Scene, hidden_share, instant_of
from skyarm.world.scene.shapes import RGBA, Solid, floats
from skyarm.world.scene.vehicle_shapes import Placed, disc_name, payload_shape, rotor_turns

if TYPE_CHECKING:
    from skyarm.view.studio.server import SceneApi, ViserServer

COLORS = ((38, 110, 190), (214, 105, 30), (44, 140, 80))
"""Colours of the first, second and third law, here and in the plots: blue, orange, green."""

GHOST, LOST = (130, 130, 140), (200, 40, 40)

SHELL = 0.06
"""Relative enlargement of the wire-frame vehicle of each further law, so that coincident vehicles are all visible."""

FLOORS = {False: ((200, 200, 200), (140, 140, 140)), True: ((40, 40, 40), (62, 62, 62))}
"""True for a dark page -> colours of the floor's lines, of cells and of metres."""

TONES = {"hull": 1.0, "boom": 0.75, "rotor": 0.5, "link": 0.85, "joint": 0.6, "tip": 1.15, "point": 1.4, "payload": 0.4}
"""Role of a shape -> brightness of its law's colour; 0.6 for any other."""

THRUST, WIND, PUSHED, TOUCH = (240, 190, 40), (70, 170, 220), (225, 60, 60), (198, 26, 140)

NEWTON = 0.08
"""Length of an arrow (m) per newton, or per metre a second of air."""

SHAFT, TOUCH_SHAFT = 0.004, 0.005
"""Radii (m) of the arrows of forces and of contacts."""

TRAIL = 4.0
"""Duration (s) of the tip's trail."""

SLOW = 6
"""Frames between two drawings of slowly moving parts: ghost, trails, labels."""

STAGE = "/stage"
"""Root node of the scene. A following camera moves this node the other way, so that each tab keeps its own view."""

VIEWS = tuple(np.array([x, y, 0.38]) for x, y in ((0.72, -0.85), (-0.72, -0.85), (-0.72, 0.85), (0.72, 0.85)))
"""Camera positions (m, relative to the vehicle) that a new tab may start from."""

LOOK_AT = np.array([0.12, 0.08, -0.28])
"""Camera target (m, relative to the vehicle) of a new tab, left of the panel on a wide screen."""


def tones_of(color: Sequence[int], opacity: float = 1.0) -> Paint:
    """Make a function from a shape's role to a shade of one colour; rotors are transparent."""

    def paint(role: str) -> RGBA:
        red, green, blue = (min(1.0, TONES.get(role, 0.6) * c / 255.0) for c in color)
        return (red, green, blue, 0.5 * min(opacity, 0.7) if role == "rotor" else opacity)

    return paint


class FlightNodes:
    """Scene nodes of one flight in the studio: vehicle, force arrows, trail, name and surroundings.

    Args:
        scene: scene of viser. number: number of the flight, from 0.
        scenario: flown scenario. title: name of the flight. placed: first poses.
    """

    def __init__(self, scene: SceneApi, number: int, scenario: Scenario, title: str, placed: Placed) -> None:
        vehicle, end, first = scenario.agent.plant.vehicle, number + 1, first_scene(scenario, placed.tip)
        self._vehicle, self._around, self._lost, self._first = vehicle, placed.tip, False, number == 0
        self._above = np.array([0.0, 0.0, 0.16 + 0.08 * number])
        self._paint, points, wires = tones_of(COLORS[number]), first.attached, SHELL * number
        self.vehicle = VehicleNodes(scene, f"{STAGE}/law{end}", vehicle, self._paint, points=points, wires=wires)
        colors, at = [THRUST] * len(vehicle.rotors) + [WIND, PUSHED], np.tile(placed.positions[0], (2, 1))
        self._forces = Arrows(scene, f"{STAGE}/arrows{end}", colors, SHAFT, at)
        still = np.tile(placed.tip, (1, 2, 1)).astype(np.float32)
        self._trail = scene.add_line_segments(f"{STAGE}/trail{end}", still, COLORS[number], thickness=0.004)
        self._label = scene.add_label(f"{STAGE}/label{end}", title, position=placed.positions[0] + self._above)
        self._world = SolidNodes(scene, f"{STAGE}/scene{end}", self._paint)
        self._lines = LineNodes(scene, f"{STAGE}/lines{end}")
        touches = [TOUCH] * len(first.arrows)
        self._touches = Arrows(scene, f"{STAGE}/touches{end}", touches, TOUCH_SHAFT, at) if touches else None
        self._place_scene(first)
        self.vehicle.place(placed.rotations, placed.positions, _rotor_rotations(vehicle, first_state(scenario)))

    def _place_scene(self, scene: Scene, more: Sequence[Solid] = ()) -> None:
        """Draw payloads and cables of a flight; surfaces and objects only for the first flight."""
        solids = scene.solids if self._first else [each for each in scene.solids if each.shape.role not in OBSTACLES]
        self._world.place([*solids, *more])
        self._lines.place(scene.lines)
        if self._touches is not None:
            self._touches.point(touch_arrows(scene.arrows))

    def draw(self, flight: Flight, *, slow: bool) -> Placed:
        """Draw a flight at the current time; returns the poses of its bodies."""
        session, placed = flight.session, flight.poses()
        state = session.state
        speeds, turns = np.array([float(w) for w in state.rotor_speeds]), _rotor_rotations(self._vehicle, state)
        self.vehicle.place(placed.rotations, placed.positions, turns if session.running else {})
        self._place_scene(flight.scene(self._around), self._attached_mass(flight, placed))
        self._forces.point(force_arrows(flight, placed, speeds, turns))
        if slow:
            self._trail.points = trail([seen.tip for seen in flight.recent(TRAIL)])
            if bool(flight.lost) != self._lost:
                self._lost = bool(flight.lost)
                self.vehicle.color(tones_of(LOST) if self._lost else self._paint)
            self._label.text = f"{flight.title}: lost" if self._lost else flight.title
            if np.isfinite(placed.positions[0]).all():
                self._label.position = placed.positions[0] + self._above
        return placed

    def _attached_mass(self, flight: Flight, placed: Placed) -> list[Solid]:
        """Solid of the mass that the user attached to the tip by a slider; empty for no mass."""
        mass = flight.hung_mass
        if not (mass > 0.0 and self._vehicle.end_effector):
            return []
        shape = payload_shape(self._vehicle, mass)
        R = placed.rotations[1 + shape.body]
        return [Solid(shape, (placed.positions[1 + shape.body] + R @ np.array(shape.position))[None], R[None])]

    def remove(self) -> None:
        """Remove the flight's nodes from the scene."""
        parts = self.vehicle, self._forces, self._trail, self._label, self._world, self._lines
        for node in (*parts, self._touches):
            if node is not None:
                node.remove()


def force_arrows(flight: Flight, placed: Placed, speeds: Array, turns: dict[str, Array]) -> Array:
    """Start and end points (m) of arrows for thrusts, air velocity and external force, (rotors + 2, 2, 3)."""
    vehicle, last, (R, p) = flight.vehicle, flight.last, (placed.rotations[0], placed.positions[0])
    ends = []
    for rotor, speed in zip(vehicle.rotors, speeds, strict=True):
        hub, axis = p + R @ np.array(floats(rotor.position)), np.array(floats(rotor.axis))
        turn = turns.get(disc_name(rotor.name), np.eye(3))
        ends.append((hub, hub + NEWTON * float(rotor.thrust_coefficient) * speed**2 * (R @ turn @ axis)))
    above = p + np.array([0.0, 0.0, 0.22])
    ends += [(above - NEWTON * last.air, above), (p - NEWTON * last.pushed, p)]
    return np.array(ends)


def touch_arrows(arrows: Sequence[Arrow]) -> Array:
    """Start and end points (m) of contact force arrows, (N, 2, 3)."""
    return np.array([(each.spot[0], each.spot[0] + NEWTON * each.force[0]) for each in arrows]).reshape(-1, 2, 3)


def first_scene(scenario: Scenario, around: Array) -> Scene:
    """Surfaces, objects and cables at the start of a scenario."""
    motion = PointMotion(scenario.agent.plant.vehicle, first_state(scenario), gravity=scenario.agent.plant.gravity)
    memories = first_memories(scenario.components, 1.0 / scenario.rates.control)
    return scene_now(scenario.components, memories, instant_of(motion, 0.0, around), motion)


def trail(tips: Sequence[Array]) -> npt.NDArray[np.float32]:
    """Line segments (m) of the tip's trajectory, (N, 2, 3)."""
    places = np.array(tips).reshape(-1, 3) if len(tips) > 1 else np.zeros((2, 3))
    return segments(places).astype(np.float32)


def _rotor_rotations(vehicle: Vehicle, state: State) -> dict[str, Array]:
    """Rotation matrix (3, 3) of each tilting rotor in a state, by the name of its disc."""
    angles = np.array([[float(each) for each in state.tilts]])
    return {name: turn[0] for name, turn in rotor_turns(vehicle, angles).items()}


class StudioStage:
    """Light, ground and camera of a viser scene that can shift so that the camera follows a vehicle.

    Args:
        server: server of viser.
    """

    def __init__(self, server: ViserServer) -> None:
        self._server, self._scene = server, server.scene
        self.follow = False
        self._frame = 0
        # shadows and a map of the surroundings take seconds a frame where no GPU draws
        self._scene.configure_default_lights(cast_shadow=False)
        self._scene.configure_environment_map(None)
        self._scene.add_light_ambient("/light", intensity=1.5)
        self._stage = self._scene.add_frame(STAGE, show_axes=False)
        self._origin, self._moved = np.zeros(3), np.zeros(3)
        self._ground = self._scene.add_grid(f"{STAGE}/ground", width=12.0, height=12.0, cell_size=0.5)
        self._dark = False

    def _follow(self, at: Array) -> None:
        """Shift the scene to keep a vehicle in place for the camera, and match the floor to the page's colours."""
        dark = getattr(self._server, "dark", False)
        if dark != self._dark:
            self._dark = dark
            self._ground.cell_color, self._ground.section_color = FLOORS[dark]
        moved = self._origin - at if self.follow else np.zeros(3)
        if np.abs(moved - self._moved).max() > STILL:
            self._stage.position = self._moved = moved

    def hurry(self) -> None:
        """Redraw everything in the next frame, including parts usually drawn at a lower rate."""
        self._frame = -1


class FleetPicture(StudioStage):
    """3D picture of all flights, drawn in a viser scene.

    Args:
        server: server of viser.
    """

    def __init__(self, server: ViserServer) -> None:
        super().__init__(server)
        self._flights: list[FlightNodes] = []
        self._ghost: VehicleNodes | None = None

    def build(self, scenario: Scenario, titles: Sequence[str]) -> None:
        """Clear the scene and draw a vehicle for each flight at the scenario's initial state."""
        for nodes in self._flights:
            nodes.remove()
        if self._ghost is not None:
            self._ghost.remove()
        vehicle = scenario.agent.plant.vehicle
        placed = poses_of(vehicle, first_state(scenario))
        self._origin = placed.positions[0]
        self._follow(self._origin)
        self._flights = [FlightNodes(self._scene, i, scenario, title, placed) for i, title in enumerate(titles)]
        self._ghost = VehicleNodes(self._scene, f"{STAGE}/ghost", vehicle, tones_of(GHOST, 0.25))
        self._draw_ghost(goal_of(vehicle, scenario.agent.reference.at(0.0)))
        scene = first_scene(scenario, placed.tip)
        self._ground.position = (0.0, 0.0, scene.ground or 0.0)
        self._look_at(scene, placed)

    def _look_at(self, scene: Scene, placed: Placed) -> None:
        """Initial camera of a new tab: ahead and to the right, or where no surface hides the tip."""
        hidden = [hidden_share(scene.obstacles, placed.tip[None], view / np.linalg.norm(view)) for view in VIEWS]
        camera, at = self._server.initial_camera, placed.positions[0]
        camera.look_at = tuple(at + LOOK_AT)
        camera.position = tuple(at + VIEWS[int(np.argmin(hidden))])

    def draw(self, flights: Sequence[Flight]) -> None:
        """Draw the flights at the current time."""
        self._frame += 1
        slow = self._frame % SLOW == 0
        for i, (nodes, flight) in enumerate(zip(self._flights, flights, strict=False)):
            placed = nodes.draw(flight, slow=slow)
            if i == 0:
                self._follow(placed.positions[0])
        if slow and flights:
            self._draw_ghost(flights[0].goal())

    def _draw_ghost(self, goal: Placed) -> None:
        if self._ghost is not None:
            self._ghost.place(goal.rotations, goal.positions)
