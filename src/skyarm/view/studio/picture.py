"""The picture of a fleet: for every law a vehicle with arrows, trail and world, and one ghost of the desired pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.view.studio.fleet import Flight
from skyarm.view.studio.scene_nodes import GREY, STILL, Arrows, Paint, SolidNodes, VehicleNodes
from skyarm.view.studio.sights import Load, Touching, goal_of
from skyarm.world.scene.shapes import RGBA, Solid, floats
from skyarm.world.scene.vehicle_shapes import Placed, disc_name, payload_shape, place, rotor_turns
from skyarm.world.scene.world_shapes import (
    CarriedPoses,
    ground_height,
    held_poses,
    hidden_share,
    point_shapes,
    world_shapes,
)

Array = npt.NDArray[np.float64]

COLORS = ((38, 110, 190), (214, 105, 30), (44, 140, 80))
"""Of the first, second and third law, here and in the plots: blue, orange, green."""

GHOST, LOST = (130, 130, 140), (200, 40, 40)

TONES = {"hull": 1.0, "boom": 0.75, "rotor": 0.5, "link": 0.85, "joint": 0.6, "tip": 1.15, "point": 1.4, "payload": 0.4}
"""Role of a shape -> how bright its law's colour is."""

THRUST, WIND, PUSHED, TOUCH = (240, 190, 40), (70, 170, 220), (225, 60, 60), (198, 26, 140)

NEWTON = 0.08
"""m of arrow per newton. Air: the same per metre a second."""

SHAFT, TOUCH_SHAFT = 0.004, 0.005
"""m: radius of an arrow."""

TRAIL = 4.0
"""s of tip trail."""

SLOW = 6
"""Frames between two drawings of what moves slowly: the ghost, trails, labels."""

STAGE = "/stage"
"""Node on which all others hang. A camera follows by its moving the other way: what each tab turns stays its own."""

VIEWS = tuple(np.array([x, y, 0.38]) for x, y in ((0.72, -0.85), (-0.72, -0.85), (-0.72, 0.85), (0.72, 0.85)))
"""m from the vehicle, from where a new tab may look at it."""


def tones_of(color: Sequence[int], opacity: float = 1.0) -> Paint:
    """Colours of a vehicle's shapes: tones of one colour, rotors see-through."""

    def paint(role: str) -> RGBA:
        red, green, blue = (min(1.0, TONES[role] * c / 255.0) for c in color)
        return (red, green, blue, 0.5 * min(opacity, 0.7) if role == "rotor" else opacity)

    return paint


class FlightNodes:
    """Nodes of one flight: vehicle, forces, trail, name and payloads; of the first one also the world.

    Args:
        scene: of viser. number: of the flight, from 0.
        scenario: that is flown. title: of the flight. placed: first poses.
    """

    def __init__(self, scene: Any, number: int, scenario: Scenario, title: str, placed: Placed) -> None:
        vehicle, end = scenario.plant.vehicle, number + 1
        self._vehicle, self._around, self._lost = vehicle, placed.tip, False
        self._above = np.array([0.0, 0.0, 0.16 + 0.08 * number])
        self._paint, points = tones_of(COLORS[number]), point_shapes(scenario.worlds, vehicle)
        self.vehicle = VehicleNodes(scene, f"{STAGE}/law{end}", vehicle, self._paint, points=points)
        colors, at = [THRUST] * len(vehicle.rotors) + [WIND, PUSHED], np.tile(placed.positions[0], (2, 1))
        self._forces = Arrows(scene, f"{STAGE}/arrows{end}", colors, SHAFT, at)
        still = np.tile(placed.tip, (1, 2, 1)).astype(np.float32)
        self._trail = scene.add_line_segments(f"{STAGE}/trail{end}", still, COLORS[number], thickness=0.004)
        self._cords = scene.add_line_segments(f"{STAGE}/cords{end}", still, GREY, thickness=0.003)
        self._label = scene.add_label(f"{STAGE}/label{end}", title, position=placed.positions[0] + self._above)
        self._loads = SolidNodes(scene, f"{STAGE}/loads{end}")
        self._world, self._touches, self._moves = None, None, False
        contacts = scenario.worlds
        if contacts and number == 0:
            self._world = SolidNodes(scene, f"{STAGE}/world{end}")
            self._place_world(scenario, 0.0, held_poses(contacts, [each.start(0.0, ()) for each in contacts]))
            surfaces = [each for contact in contacts for each in contact.surfaces]
            self._moves = any(each.moves for each in surfaces) or any(contact.carriers for contact in contacts)
        pairs = sum(contact.logged_pairs for contact in contacts)
        if pairs:
            self._touches = Arrows(scene, f"{STAGE}/touches{end}", [TOUCH] * pairs, TOUCH_SHAFT, at)
        self.draw_bodies(placed, rotor_turns(vehicle, _row(first_state(scenario).tilts)))

    def _place_world(self, scenario: Scenario, time: float, carried: CarriedPoses) -> None:
        if self._world is not None:
            solids = world_shapes(scenario.worlds, np.array([time]), tuple(self._around), carried=carried)
            self._world.place(solids)

    def draw_bodies(self, placed: Placed, turns: dict[str, Array]) -> None:
        """Move the bodies and the discs of rotors that tilt."""
        self.vehicle.place(placed.rotations, placed.positions)
        self.vehicle.tilt({name: turn[0] for name, turn in turns.items()})

    def draw(self, flight: Flight, *, slow: bool) -> Placed:
        """Show the flight as it is now, the world, trail and label only if ``slow``; returns its poses."""
        session, placed = flight.session, flight.poses()
        state, last = session.state, flight.last
        speeds, turns = np.array([float(w) for w in state.rotor_speeds]), rotor_turns(self._vehicle, _row(state.tilts))
        self.draw_bodies(placed, turns if session.running else {})
        self._carry(flight.loads, placed)
        self._forces.point(force_arrows(flight, placed, speeds, turns))
        if self._touches is not None:
            self._touches.point(touch_arrows(last.touching))
        if slow or self._moves:
            held = held_poses(session.scenario.components, session.now.components)
            self._place_world(session.scenario, session.time, held)
        if slow:
            self._trail.points = trail([seen.tip for seen in flight.recent(TRAIL)])
            if bool(flight.lost) != self._lost:
                self._lost = bool(flight.lost)
                self.vehicle.color(tones_of(LOST) if self._lost else self._paint)
            self._label.text = f"{flight.title}: lost" if self._lost else flight.title
            if np.isfinite(placed.positions[0]).all():
                self._label.position = placed.positions[0] + self._above
        return placed

    def _carry(self, loads: Sequence[Load], placed: Placed) -> None:
        """Show payloads where they are held, or where they hang on their cords."""
        solids: list[Solid] = []
        cords = []
        for each in loads:
            if each.frame or self._vehicle.end_effector:
                shape = payload_shape(self._vehicle, each.mass, each.frame, each.com)
                R = placed.rotations[1 + shape.body]
                holder = placed.positions[1 + shape.body] + R @ np.array(shape.position)
                at = holder if each.hangs is None else each.hangs
                named = replace(shape, name=f"payload{len(solids) + 1}")
                solids.append(Solid(named, at[None], R[None], self._paint("payload")))
                cords.append((holder, at))
        self._loads.place(solids)
        self._cords.visible = any(each.hangs is not None for each in loads)
        if self._cords.visible:
            self._cords.points = np.array(cords, np.float32)

    def remove(self) -> None:
        """Take it out of the scene."""
        parts = self.vehicle, self._forces, self._trail, self._cords, self._label, self._loads, self._world
        for node in (*parts, self._touches):
            if node is not None:
                node.remove()


def force_arrows(flight: Flight, placed: Placed, speeds: Array, turns: dict[str, Array]) -> Array:
    """Ends (rotors + 2, 2, 3) of thrusts, air and force from outside, m."""
    vehicle, last, (R, p) = flight.vehicle, flight.last, (placed.rotations[0], placed.positions[0])
    ends = []
    for rotor, speed in zip(vehicle.rotors, speeds, strict=True):
        hub, axis = p + R @ np.array(floats(rotor.position)), np.array(floats(rotor.axis))
        turn = turns.get(disc_name(rotor.name), np.eye(3)[None])[0]
        ends.append((hub, hub + NEWTON * float(rotor.thrust_coefficient) * speed**2 * (R @ turn @ axis)))
    above = p + np.array([0.0, 0.0, 0.22])
    ends += [(above - NEWTON * last.air, above), (p - NEWTON * last.pushed, p)]
    return np.array(ends)


def touch_arrows(touching: Sequence[Touching]) -> Array:
    """Ends (N, 2, 3) of contact forces, m."""
    return np.array([(each.spot, each.spot + NEWTON * each.force) for each in touching]).reshape(-1, 2, 3)


def trail(tips: Sequence[Array]) -> Array:
    """(N, 2, 3) segments of the tip's path."""
    places = np.array(tips, dtype=np.float32).reshape(-1, 3) if len(tips) > 1 else np.zeros((2, 3))
    segments: Array = np.stack([places[:-1], places[1:]], axis=1).astype(np.float32)
    return segments


def _row(values: Sequence[Any]) -> Array:
    return np.array([[float(each) for each in values]])


class Picture:
    """Nodes of a viser scene for some flights.

    Args:
        server: of viser.
    """

    def __init__(self, server: Any) -> None:
        self._server, self._scene = server, server.scene
        self.follow = False
        self._flights: list[FlightNodes] = []
        self._ghost: VehicleNodes | None = None
        self._frame = 0
        # shadows and a map of the surroundings take seconds a frame where no GPU draws
        self._scene.configure_default_lights(cast_shadow=False)
        self._scene.configure_environment_map(None)
        self._scene.add_light_ambient("/light", intensity=1.5)
        self._stage = self._scene.add_frame(STAGE, show_axes=False)
        self._origin, self._moved = np.zeros(3), np.zeros(3)
        self._ground = self._scene.add_grid(f"{STAGE}/ground", width=12.0, height=12.0, cell_size=0.5)

    def build(self, scenario: Scenario, titles: Sequence[str]) -> None:
        """Draw vehicles at the scenario's first state, one for each title, in place of all that was there."""
        for nodes in self._flights:
            nodes.remove()
        if self._ghost is not None:
            self._ghost.remove()
        vehicle, state = scenario.plant.vehicle, first_state(scenario)
        placed = place(vehicle, tuple(state.position), tuple(state.quaternion), state.joints)
        self._origin = placed.positions[0]
        self._follow(self._origin)
        self._flights = [FlightNodes(self._scene, i, scenario, title, placed) for i, title in enumerate(titles)]
        self._ghost = VehicleNodes(self._scene, f"{STAGE}/ghost", vehicle, tones_of(GHOST, 0.25))
        self._draw_ghost(goal_of(vehicle, scenario.reference.at(0.0)))
        self._ground.position = (0.0, 0.0, ground_height(scenario.worlds))
        self._look_at(scenario, placed)

    def _look_at(self, scenario: Scenario, placed: Placed) -> None:
        """The view that a new tab begins with: from ahead and the right, or from where no surface hides the tip."""
        solids = world_shapes(scenario.worlds, np.zeros(1), tuple(placed.tip))
        hidden = [hidden_share(solids, placed.tip[None], view / np.linalg.norm(view)) for view in VIEWS]
        camera, at = self._server.initial_camera, placed.positions[0]
        camera.look_at = tuple(at + np.array([0.12, 0.08, -0.06]))
        camera.position = tuple(at + VIEWS[int(np.argmin(hidden))])

    def draw(self, flights: Sequence[Flight]) -> None:
        """Show the flights, as many as were built, as they are now."""
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

    def _follow(self, at: Array) -> None:
        """Keep the first vehicle, (3,) m, where the camera first saw it; without following, the ground."""
        moved = self._origin - at if self.follow else np.zeros(3)
        if np.abs(moved - self._moved).max() > STILL:
            self._stage.position = self._moved = moved

    def hurry(self) -> None:
        """Draw all of the next picture: a hand has moved something."""
        self._frame = -1
