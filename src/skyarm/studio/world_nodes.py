"""The world in the scene: its surfaces, which may move, and the forces with which they push a vehicle back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from skyarm.drawing.carried_poses import CarriedPoses
from skyarm.drawing.meshes import mesh_of
from skyarm.drawing.pose_program import Array, quaternions_of
from skyarm.drawing.world_shapes import WorldShape, world_shapes
from skyarm.scenario.scenario_record import Scenario
from skyarm.studio.arrows import NEWTON, SHORTEST
from skyarm.studio.scene import STILL
from skyarm.studio.sights import Touching

SURFACE, OBJECT, TOUCH = (168, 163, 152), (158, 117, 76), (198, 26, 140)


class WorldNodes:
    """The surfaces of one flight's world.

    Args:
        scene: of viser. name: beginning of the nodes' names.
        scenario: what is flown.
        carried: where its objects are at first.
        place: (3,) m, about which planes are drawn.
        beside: (3,) m, how far beside its own place the world is drawn.
        plain: without shadows.
    """

    def __init__(
        self,
        scene: Any,
        name: str,
        scenario: Scenario,
        carried: CarriedPoses,
        place: Array,
        beside: Array,
        *,
        plain: bool = False,
    ) -> None:
        self._place = place
        self._root = scene.add_frame(name, show_axes=False, position=beside)
        self._nodes: list[Any] = []
        self._sent: list[tuple[Array, Array]] = []
        for solid in self._shapes(scenario, 0.0, carried):
            vertices, faces = mesh_of(solid.shape)
            node = scene.add_mesh_simple(
                f"{name}/{solid.shape.name}",
                vertices,
                faces,
                color=OBJECT if solid.shape.role == "object" else SURFACE,
                side="double",
                flat_shading=bool(solid.shape.mesh) or solid.shape.kind in ("box", "patch", "hole"),
                cast_shadow=not plain,
                receive_shadow=not plain,
            )
            self._nodes.append(node)
            self._sent.append((np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])))
        self.moves = any(surface.moves for contact in scenario.contacts for surface in contact.surfaces)
        self.moves = self.moves or bool(carried)
        self.place(scenario, 0.0, carried)

    def _shapes(self, scenario: Scenario, time: float, carried: CarriedPoses) -> Sequence[WorldShape]:
        return world_shapes(scenario.contacts, np.array([time]), tuple(self._place), carried=carried)

    def place(self, scenario: Scenario, time: float, carried: CarriedPoses) -> None:
        """Move the surfaces to where a scenario has them at a time, s; what has not moved is not sent again."""
        for i, solid in enumerate(self._shapes(scenario, time, carried)):
            position, turn = solid.position[0], quaternions_of(solid.rotation)[0]
            sent_position, sent_turn = self._sent[i]
            if np.abs(position - sent_position).max() > STILL:
                self._nodes[i].position = sent_position = position
            if np.abs(turn - sent_turn).max() > STILL:
                self._nodes[i].wxyz = sent_turn = turn
            self._sent[i] = sent_position, sent_turn

    def show(self, visible: bool) -> None:
        """Show or hide it."""
        self._root.visible = visible

    def remove(self) -> None:
        """Take it out of the scene."""
        self._root.remove()


class TouchArrows:
    """The force of each surface on each point, from where it acts.

    Args:
        scene: of viser. name: of the node.
        count: of pairs of a surface and a point.
        place: (3,) m, where the vehicle is at first.
    """

    def __init__(self, scene: Any, name: str, count: int, place: Array) -> None:
        self._points = np.tile(place, (count, 2, 1)).astype(np.float32)
        self._node = scene.add_arrows(
            name, self._points, np.array(TOUCH, np.uint8), shaft_radius=0.005, head_radius=0.013, head_length=0.025,
            visible=False,
        )  # fmt: skip
        self._acting = False
        self._wanted = True

    def point(self, touching: Sequence[Touching], beside: Array) -> None:
        """Draw what acts now."""
        ends = [(each.spot, each.spot + NEWTON * each.force) for each in touching]
        long = [start + beside for start, end in ends if np.linalg.norm(end - start) > SHORTEST]
        acting = bool(long) and bool(np.isfinite(ends).all())
        if acting:
            # an arrow without a length would show its head: it hides where another one begins
            points = [
                (start + beside, end + beside) if np.linalg.norm(end - start) > SHORTEST else (long[0], long[0])
                for start, end in ends
            ]
            drawn = np.array(points, np.float32)
            if drawn.shape == self._points.shape and np.abs(drawn - self._points).max() > STILL:
                self._points = drawn
                self._node.points = drawn
        if acting != self._acting:
            self._acting = acting
            self._node.visible = acting and self._wanted

    def show(self, visible: bool) -> None:
        """Show or hide them."""
        self._wanted = visible
        self._node.visible = visible and self._acting

    def remove(self) -> None:
        """Take them out of the scene."""
        self._node.remove()
