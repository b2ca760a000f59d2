"""The picture of a fleet: a vehicle for every law, one ghost of the desired pose, arrows and trails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyarm.drawing.carried_poses import held_poses
from skyarm.drawing.pose_program import Array, Placed, PoseProgram
from skyarm.drawing.sight_lines import hidden_share
from skyarm.drawing.world_shapes import ground_height, point_shapes, world_shapes
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.studio.arrows import TRAIL, Arrows, trail
from skyarm.studio.flight import Flight
from skyarm.studio.scene import COLORS, GHOST, STILL, VehicleNodes
from skyarm.studio.sights import goal_of
from skyarm.studio.world_nodes import TouchArrows, WorldNodes

APART = 1.2
"""m between vehicles that are drawn beside each other."""

SLOW = 6
"""Frames between two drawings of what moves slowly: the ghost, trails, labels, payloads."""


@dataclass(slots=True)
class View:
    """What of the picture is shown.

    Attributes:
        beside: vehicles beside each other, not over each other. follow: the camera goes along with the first vehicle.
        ghost, arrows, trails: whether they are drawn.
    """

    beside: bool = False
    follow: bool = False
    ghost: bool = True
    arrows: bool = True
    trails: bool = True


STAGE = "/stage"
"""Node on which all others hang. A camera follows by its moving the other way: what each tab turns stays its own."""

VIEWS = tuple(np.array([x, y, 0.38]) for x, y in ((0.72, -0.85), (-0.72, -0.85), (-0.72, 0.85), (0.72, 0.85)))
"""m from the vehicle, from where a new tab may look at it."""


class Picture:
    """Nodes of a viser scene for some flights.

    Args:
        server: of viser.
        plain: without shadows and environment map, for browsers that draw in software.
    """

    def __init__(self, server: Any, *, plain: bool = False) -> None:
        self._server, self._scene, self._plain, self.view = server, server.scene, plain, View()
        self._vehicles: list[VehicleNodes] = []
        self._arrows: list[Arrows] = []
        self._worlds: list[WorldNodes] = []
        self._touches: list[TouchArrows] = []
        self._trails: list[Any] = []
        self._labels: list[Any] = []
        self._ghost: VehicleNodes | None = None
        self._lost: list[bool] = []
        self._frame = 0
        self._scene.configure_default_lights(cast_shadow=not plain)
        if plain:
            self._scene.configure_environment_map(None)
            self._scene.add_light_ambient("/light", intensity=1.5)
        shade = 0.0 if plain else 0.15
        self._stage = self._scene.add_frame(STAGE, show_axes=False)
        self._origin, self._moved = np.zeros(3), np.zeros(3)
        self._ground = self._scene.add_grid(
            f"{STAGE}/ground", width=12.0, height=12.0, cell_size=0.5, shadow_opacity=shade
        )

    def build(self, scenario: Scenario, titles: Sequence[str]) -> None:
        """Draw vehicles at the scenario's first state, one for each title, in place of all that was there."""
        for node in (*self._vehicles, *self._arrows, *self._trails, *self._labels, *self._worlds, *self._touches):
            node.remove()
        if self._ghost is not None:
            self._ghost.remove()
        vehicle, state = scenario.world.vehicle, first_state(scenario)
        program = PoseProgram(vehicle)
        placed = program(tuple(state.position), tuple(state.quaternion), state.joints)
        self._origin = placed.positions[0]
        self._follow(self._origin)
        self._vehicles, self._arrows, self._trails, self._labels = [], [], [], []
        points = point_shapes(scenario.contacts, vehicle)
        for i, title in enumerate(titles):
            nodes = VehicleNodes(
                self._scene, f"{STAGE}/law{i + 1}", vehicle, COLORS[i], plain=self._plain, points=points
            )
            nodes.tilt(state.tilts)
            nodes.place(placed, self._beside(i))
            self._vehicles.append(nodes)
            self._arrows.append(Arrows(self._scene, f"{STAGE}/arrows{i + 1}", vehicle, placed.positions[0]))
            still = np.repeat(placed.tip[None, None], 2, axis=1).astype(np.float32)
            self._trails.append(
                self._scene.add_line_segments(f"{STAGE}/trail{i + 1}", still, COLORS[i], thickness=0.004)
            )
            above = placed.positions[0] + self._above(i)
            self._labels.append(self._scene.add_label(f"{STAGE}/label{i + 1}", title, position=above))
        self._ghost = VehicleNodes(self._scene, f"{STAGE}/ghost", vehicle, GHOST, plain=True, opacity=0.25)
        self._ghost.place(goal_of(program, scenario.trajectory.at(0.0)), np.zeros(3))
        self._lost = [False] * len(titles)
        self._build_world(scenario, placed.tip, len(titles))
        self._look_at(scenario, placed)

    def _build_world(self, scenario: Scenario, place: Array, count: int) -> None:
        """Surfaces and contact forces of every flight; nothing of a scenario without a world."""
        self._ground.position = (0.0, 0.0, ground_height(scenario.contacts))
        self._worlds, self._touches = [], []
        pairs = sum(contact.logged_pairs for contact in scenario.contacts)
        starts = [contact.start(0.0, ()) for contact in scenario.contacts]
        carried = held_poses(scenario.contacts, starts)
        for i in range(count if scenario.contacts else 0):
            name, beside = f"{STAGE}/world{i + 1}", np.array([0.0, APART * i, 0.0])
            self._worlds.append(WorldNodes(self._scene, name, scenario, carried, place, beside, plain=self._plain))
            if pairs:
                self._touches.append(TouchArrows(self._scene, f"{STAGE}/touches{i + 1}", pairs, place))
        self._show_world()

    def _show_world(self) -> None:
        """The world of the first flight stands for all that are drawn over each other."""
        for i, world in enumerate(self._worlds):
            world.show(i == 0 or self.view.beside)
        for arrows in self._touches:
            arrows.show(self.view.arrows)

    def _look_at(self, scenario: Scenario, placed: Placed) -> None:
        """The view that a new tab begins with: from ahead and the right, or from where no surface hides the tip."""
        solids = world_shapes(scenario.contacts, np.zeros(1), tuple(placed.tip))
        hidden = [hidden_share(solids, placed.tip[None], view / np.linalg.norm(view)) for view in VIEWS]
        camera, place = self._server.initial_camera, placed.positions[0]
        camera.look_at = tuple(place + np.array([0.12, 0.08, -0.06]))
        camera.position = tuple(place + VIEWS[int(np.argmin(hidden))])

    def _beside(self, index: int) -> Array:
        return np.array([0.0, APART * index if self.view.beside else 0.0, 0.0])

    def _above(self, index: int) -> Array:
        """Where the label of a vehicle stands over it."""
        return np.array([0.0, 0.0, 0.16 + 0.08 * index])

    def draw(self, flights: Sequence[Flight], seconds: float) -> None:
        """Show the flights as they are now.

        Args:
            flights: as many as were built.
            seconds: of flight since the last picture, for the blades.
        """
        self._frame += 1
        slow = self._frame % SLOW == 0
        for i, flight in enumerate(flights):
            state, beside = flight.session.state, self._beside(i)
            placed, speeds = flight.placed(state), np.array([float(w) for w in state.rotor_speeds])
            nodes = self._vehicles[i]
            nodes.place(placed, beside)
            nodes.carry(flight.loads, placed)
            if flight.session.running:
                nodes.tilt(state.tilts)
                nodes.spin(speeds, seconds)
            if self.view.arrows:
                self._arrows[i].point(flight.last, speeds, placed, beside, state.tilts)
            if self._worlds:
                self._draw_world(i, flight, beside, slow)
            if slow:
                self._slowly(i, flight, placed.positions[0] + beside, beside)
            if i == 0:
                self._follow(placed.positions[0])
        if slow and flights and self._ghost is not None and self.view.ghost:
            self._ghost.place(flights[0].goal(), np.zeros(3))

    def _draw_world(self, i: int, flight: Flight, beside: Array, slow: bool) -> None:
        """Surfaces, every picture where they move and now and then where a hand may have moved them; their forces."""
        if slow or self._worlds[i].moves:
            session = flight.session
            carried = held_poses(session.scenario.components, session.now.components)
            self._worlds[i].place(session.scenario, session.time, carried)
        if self.view.arrows and self._touches:
            self._touches[i].point(flight.last.touching, beside)

    def _follow(self, place: Array) -> None:
        """Keep the first vehicle, (3,) m, where the camera first saw it; without following, the ground."""
        moved = self._origin - place if self.view.follow else np.zeros(3)
        if np.abs(moved - self._moved).max() > STILL:
            self._stage.position = self._moved = moved

    def hurry(self) -> None:
        """Draw all of the next picture: a hand has moved something."""
        self._frame = -1

    def _slowly(self, i: int, flight: Flight, place: Array, beside: Array) -> None:
        """What need not move sixty times a second."""
        if self.view.trails:
            self._trails[i].points = trail(flight.seen(TRAIL), beside)
        lost = bool(flight.lost)
        if lost != self._lost[i]:
            self._vehicles[i].mark(lost)
            self._lost[i] = lost
        self._labels[i].text = f"{flight.title}: lost" if lost else flight.title
        if np.isfinite(place).all():
            self._labels[i].position = place + self._above(i)

    def choose(self, view: View) -> None:
        """Show and hide parts of the picture."""
        self.view = view
        self._show_world()
        for node in self._arrows:
            node.show(view.arrows)
        for node in self._trails:
            node.visible = view.trails
        if self._ghost is not None:
            self._ghost.show(view.ghost)
