"""Nodes of a viser scene for studio and recordings: vehicles, solids, lines and arrows.

A node is sent a value only where it differs from the last one by more than can be seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from skyarm.records.arrays import Array, lengths
from skyarm.vehicle import BASE, Vehicle
from skyarm.view.picture.marks import Paint
from skyarm.world.scene.scene import Line
from skyarm.world.scene.shapes import RGBA, Shape, Solid, in_own_axes, mesh_of
from skyarm.world.scene.vehicle_shapes import Poses, quaternions_of, vehicle_shapes

if TYPE_CHECKING:
    import viser
    from viser import SceneApi

SceneNode: TypeAlias = "viser.SceneNodeHandle"
ShapeNode: TypeAlias = "viser.MeshHandle | viser.CylinderHandle"
LineNode: TypeAlias = "viser.LineSegmentsHandle"

NO_TURNS: Mapping[str, Array] = MappingProxyType({})

DIGITS = 4
"""Decimals of transmitted positions (0.1 mm) and quaternions; more are invisible and
compress worse."""

STILL = 1e-4
"""Displacement (m) of an arrow's end below which it is not sent again; an eighth of a
pixel in the usual view."""

SHORTEST = 0.01
"""Shortest drawn arrow (m)."""

SEGMENTS = 24, 8
"""Number of segments around round shapes, solid and wire-frame."""

LINE_WIDTH = 0.003
"""Width (m) of a line."""

THIN = 1e-3
"""Half the thickness (m) of a plane's patch."""

HEAD = 2.6, 5.3
"""Radius and length of an arrow's head, in radii of its shaft."""


class MovingNode:
    """Scene node with a pose, which is sent to the browser only if it changed."""

    def __init__(self, node: SceneNode) -> None:
        self.node = node
        self._place, self._turn = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])

    def put(self, position: Array, rotation: Array) -> None:
        """Set position (3,) in m and rotation (3, 3) relative to the parent node; NaN
        has no effect.
        """
        # NaN hides nothing in a browser: the last place stays
        if not (np.isfinite(position).all() and np.isfinite(rotation).all()):
            return
        place = np.round(position, DIGITS)
        turn = np.round(quaternions_of(rotation[None])[0], DIGITS)
        if (place != self._place).any():
            self.node.position = self._place = place
        if (turn != self._turn).any():
            self.node.wxyz = self._turn = turn


def add_shape(
    scene: SceneApi, name: str, shape: Shape, color: RGBA, *, wires: bool = False
) -> ShapeNode:
    """Add a box, sphere, cylinder, capsule or mesh to a viser scene."""
    look: dict[str, Any] = {
        "color": bytes_of(color),
        "opacity": color[3] if color[3] < 1.0 else None,
        "wireframe": wires,
        # no light casts shadows (add_light)
        "cast_shadow": False,
        "receive_shadow": False,
    }
    at = {
        "position": np.array(shape.position),
        "wxyz": quaternions_of(np.array([shape.rotation]))[0],
    }
    if shape.kind == "cylinder" and not shape.mesh:
        radius, length = shape.size
        return scene.add_cylinder(
            name,
            radius=radius,
            height=length,
            radial_segments=SEGMENTS[wires],
            **look,
            **at,
        )
    if shape.kind == "patch":
        shape = replace(shape, kind="box", size=(*shape.size, THIN))
    vertices, faces = mesh_of(in_own_axes(shape), SEGMENTS[wires])
    smooth = wires or shape.kind in ("sphere", "ellipsoid", "capsule")
    # both sides: a file's mesh may wind its triangles either way; smooth shading hides
    # the few segments of round shapes, and would blur the edges of others
    return scene.add_mesh_simple(
        name, vertices, faces, side="double", flat_shading=not smooth, **look, **at
    )


def add_light(scene: SceneApi, ambient: float) -> None:
    """Light a viser scene, with a given intensity of the light from everywhere."""
    # shadows and a map of the surroundings take seconds a frame where no GPU draws
    scene.configure_default_lights(cast_shadow=False)
    scene.configure_environment_map(None)
    scene.add_light_ambient("/light", intensity=ambient)


def bytes_of(color: Sequence[float]) -> tuple[int, int, int]:
    """Convert a colour to red, green and blue from 0 to 255."""
    red, green, blue = (min(255, round(255.0 * c)) for c in color[:3])
    return red, green, blue


def segments(places: Array) -> Array:
    """Line segments (N - 1, 2, 3) between successive points (N, 3)."""
    return np.stack([places[:-1], places[1:]], axis=1)


class VehicleNodes:
    """Scene nodes of one vehicle: base, links and rotor discs.

    Args:
        scene: scene of viser. name: beginning of the nodes' names.
        vehicle: vehicle with concrete numbers.
        paint: colours.
        points: marks on its bodies.
        wires: share by which it is thicker and drawn as wires; 0 for solids.
    """

    def __init__(
        self,
        scene: SceneApi,
        name: str,
        vehicle: Vehicle,
        paint: Paint,
        *,
        points: Sequence[Shape] = (),
        wires: float = 0.0,
    ) -> None:
        # every body hangs on the base: what stands still against it need not be sent
        self._base = MovingNode(scene.add_frame(name, show_axes=False))
        self._visible = True
        scene.add_frame(f"{name}/{BASE}", show_axes=False)
        frames = [
            scene.add_frame(f"{name}/{body}", show_axes=False)
            for body in range(len(vehicle.moving))
        ]
        self._links = [MovingNode(frame) for frame in frames]
        shapes = [
            _scale_thickness(shape, 1.0 + wires)
            for shape in (*vehicle_shapes(vehicle), *points)
        ]
        self._meshes = [
            (
                add_shape(
                    scene,
                    f"{name}/{shape.body}/{shape.name}",
                    shape,
                    paint(shape.role),
                    wires=wires > 0.0,
                ),
                shape,
            )
            for shape in shapes
        ]
        self._discs = {
            shape.name: (MovingNode(node), shape)
            for node, shape in self._meshes
            if shape.role == "rotor"
        }

    def place(
        self, poses: Poses, turns: Mapping[str, Array] = NO_TURNS, k: int = 0
    ) -> None:
        """Set the poses of the bodies and the tilt of rotor discs at instant ``k``.

        Args:
            poses: body -> R_WB (N, 3, 3) and p_WB (N, 3), the base first.
            turns: name of a disc -> R_BB (N, 3, 3).
            k: number of the instant.
        """
        (R, p), *links = (
            (rotations[k], positions[k]) for rotations, positions in poses.values()
        )
        self._base.put(p, R)
        for node, (rotation, position) in zip(self._links, links, strict=True):
            node.put(R.T @ (position - p), R.T @ rotation)
        for name, turn in turns.items():
            disc, shape = self._discs[name]
            disc.put(np.array(shape.position), turn[k] @ np.array(shape.rotation))

    def show(self, visible: bool) -> None:
        """Show or hide the vehicle."""
        if visible != self._visible:
            self._visible = self._base.node.visible = visible

    def color(self, paint: Paint) -> None:
        """Change the colours of the vehicle."""
        for node, shape in self._meshes:
            node.color = bytes_of(paint(shape.role))

    def remove(self) -> None:
        """Remove the vehicle and its child nodes from the scene."""
        self._base.node.remove()


def _scale_thickness(shape: Shape, factor: float) -> Shape:
    """Scale a shape's size; for a cylinder or capsule only its radius."""
    scaled = tuple(factor * size for size in shape.size)
    return replace(
        shape,
        size=(
            scaled[:1] + shape.size[1:]
            if shape.kind in ("cylinder", "capsule")
            else scaled
        ),
    )


class SolidNodes:
    """Scene nodes of surfaces, objects and payloads.

    Args:
        scene: scene of viser. name: beginning of the nodes' names.
        paint: colours of solids that have none of their own.
    """

    def __init__(self, scene: SceneApi, name: str, paint: Paint) -> None:
        self._scene = scene
        self._name = name
        self._paint = paint
        self.root = scene.add_frame(name, show_axes=False)
        self._nodes: dict[str, tuple[MovingNode, tuple[float, ...]]] = {}

    def place(self, solids: Sequence[Solid], k: int = 0) -> None:
        """Draw the given solids at instant ``k`` and remove all others."""
        for name in set(self._nodes) - {each.shape.name for each in solids}:
            self._nodes.pop(name)[0].node.remove()
        for solid in solids:
            shape = solid.shape
            name = shape.name
            # a solid whose size changes is made anew, as a node gets poses only
            if name not in self._nodes or self._nodes[name][1] != shape.size:
                node = add_shape(
                    self._scene,
                    f"{self._name}/{name}",
                    in_own_axes(shape),
                    solid.rgba or self._paint(shape.role),
                )
                self._nodes[name] = MovingNode(node), shape.size
            self._nodes[name][0].put(solid.position[k], solid.rotation[k])

    def remove(self) -> None:
        """Remove the solids from the scene."""
        self.root.remove()


class LineNodes:
    """Scene nodes of lines, such as cables.

    Args:
        scene: scene of viser. name: beginning of the nodes' names.
    """

    def __init__(self, scene: SceneApi, name: str) -> None:
        self._scene = scene
        self._name = name
        self._nodes: dict[str, tuple[LineNode, npt.NDArray[np.float32]]] = {}

    def place(self, lines: Sequence[Line], k: int = 0) -> None:
        """Draw the given lines at instant ``k`` and remove all others; lines with NaN
        are hidden.
        """
        drawn = {each.name: each for each in lines if np.isfinite(each.places[k]).all()}
        for name in set(self._nodes) - set(drawn):
            self._nodes.pop(name)[0].remove()
        for name, line in drawn.items():
            points = segments(np.round(line.places[k], DIGITS)).astype(np.float32)
            node, sent = self._nodes.get(name, (None, points))
            if node is None:
                color = bytes_of(line.rgba)
                node = self._scene.add_line_segments(
                    f"{self._name}/{name}", points, color, thickness=LINE_WIDTH
                )
            elif (sent != points).any():
                node.points = points
            self._nodes[name] = node, points

    def remove(self) -> None:
        """Remove the lines from the scene."""
        self.place(())


class Arrows:
    """Scene node of several arrows, such as contact forces.

    Args:
        scene: scene of viser. name: name of the node.
        colors: (N, 3) from 0 to 255, one an arrow; of no arrow there is no node.
        radius: radius of a shaft, m.
        reached: (2, 3) m: two places between which all arrows will be; a viewer may
            leave out what began elsewhere.
    """

    def __init__(
        self,
        scene: SceneApi,
        name: str,
        colors: Sequence[Sequence[int]],
        radius: float,
        reached: Array,
    ) -> None:
        self._acting = False
        self._points = np.tile(reached, (len(colors), 1, 1)).astype(np.float32)
        if colors:
            self._node = scene.add_arrows(
                name,
                self._points,
                np.array(colors, np.uint8),
                shaft_radius=radius,
                head_radius=HEAD[0] * radius,
                head_length=HEAD[1] * radius,
                visible=False,
            )

    def point(self, ends: Array) -> None:
        """Draw arrows (N, 2, 3) from start to end point (m); those that are too short
        are hidden.
        """
        long = lengths(ends[:, 1] - ends[:, 0]) > SHORTEST
        acting = bool(long.any()) and bool(np.isfinite(ends).all())
        if acting:
            # the head of an arrow is drawn however short it is: it hides where another
            # one begins
            drawn = np.where(
                long[:, None, None], ends, ends[np.argmax(long), 0]
            ).astype(np.float32)
            if np.abs(drawn - self._points).max() > STILL:
                self._node.points = self._points = drawn
        if acting != self._acting:
            self._acting = self._node.visible = acting

    def remove(self) -> None:
        """Remove the arrows from the scene."""
        if len(self._points):
            self._node.remove()
