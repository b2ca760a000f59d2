"""Nodes of a viser scene for the studio and for recordings: vehicles, solids of the world, arrows.

A node is sent a value only where it differs from the last one by more than can be seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Quaternion
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.world.scene.shapes import RGBA, UPRIGHT, Shape, Solid, blade_mesh, floats, mesh_of, turn_onto
from skyarm.world.scene.vehicle_shapes import disc_name, quaternions_of, rotor_radius, vehicle_shapes

Array = npt.NDArray[np.float64]

Paint = Callable[[str], RGBA]
"""Role of a shape -> its colour."""

GREY = (90, 96, 105)

SLOWED = 40.0
"""Times that rotors are drawn slower than they turn."""

DIGITS = 4
"""Decimals of places (0.1 mm) and of quaternions that are sent: more would not be seen, and packs worse."""

STILL = 1e-4
"""m by which the end of an arrow must move to be sent again: an eighth of a pixel from where tabs look on."""

SHORTEST = 0.01
"""m of arrow below which none is drawn."""

SEGMENTS, SUBDIVISIONS = 24, 2
"""Of round shapes."""

THIN = 1e-3
"""m: half the thickness of a plane's patch."""

HEAD = 2.6, 5.3
"""Radius and length of an arrow's head, in radii of its shaft."""


class MovingNode:
    """A node that moves."""

    def __init__(self, node: Any) -> None:
        self.node = node
        self._place, self._turn = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])

    def put(self, position: Array, rotation: Array) -> None:
        """Move it to a place (3,), m, and an attitude (3, 3) in the axes of its parent; NaN leaves it where it is."""
        if not (np.isfinite(position).all() and np.isfinite(rotation).all()):
            return
        place, turn = np.round(position, DIGITS), np.round(quaternions_of(rotation[None])[0], DIGITS)
        if (place != self._place).any():
            self.node.position = self._place = place
        if (turn != self._turn).any():
            self.node.wxyz = self._turn = turn


def add_shape(scene: Any, name: str, shape: Shape, color: RGBA, *, cast: bool = False, receive: bool = False) -> Any:
    """One shape as a node of the scene, under the node of its body; the balls of a capsule are nodes below it."""
    clear = color[3] < 1.0
    look: dict[str, Any] = {
        "color": bytes_of(color),
        "opacity": color[3] if clear else None,
        "cast_shadow": cast and not clear,
        "receive_shadow": receive,
    }
    at = {"position": np.array(shape.position), "wxyz": quaternions_of(np.array([shape.rotation]))[0]}
    if shape.mesh or shape.kind == "hole":
        vertices, faces = mesh_of(replace(shape, position=(0.0, 0.0, 0.0), rotation=UPRIGHT))
        return scene.add_mesh_simple(name, vertices, faces, side="double", flat_shading=True, **look, **at)
    if shape.kind in ("sphere", "ellipsoid"):
        axes = (shape.size[0],) * 3 if shape.kind == "sphere" else shape.size
        return scene.add_icosphere(name, radius=1.0, scale=axes, subdivisions=SUBDIVISIONS, **look, **at)
    if shape.kind in ("box", "patch"):
        lengths = tuple(2.0 * half for half in (*shape.size, THIN)[:3])
        return scene.add_box(name, dimensions=lengths, **look, **at)
    radius, length = shape.size
    node = scene.add_cylinder(name, radius=radius, height=length, radial_segments=SEGMENTS, **look, **at)
    if shape.kind == "capsule":
        for end, sign in (("start", -0.5), ("end", 0.5)):
            place = np.array([0.0, 0.0, sign * length])
            scene.add_icosphere(f"{name}/{end}", radius=radius, subdivisions=SUBDIVISIONS, position=place, **look)
    return node


def bytes_of(color: Sequence[float]) -> tuple[int, int, int]:
    """Red, green and blue from 0 to 255."""
    red, green, blue = (min(255, round(255.0 * c)) for c in color[:3])
    return red, green, blue


class VehicleNodes:
    """One vehicle in the scene.

    Args:
        scene: of viser. name: beginning of the nodes' names.
        vehicle: with concrete numbers.
        paint: colours.
        points: marks of contact points. blades: whether rotors have blades. cast: whether it casts shadows.
    """

    def __init__(
        self,
        scene: Any,
        name: str,
        vehicle: Vehicle,
        paint: Paint,
        *,
        points: Sequence[Shape] = (),
        blades: bool = False,
        cast: bool = False,
    ) -> None:
        self._vehicle = vehicle
        # every body hangs on the base: what stands still against it need not be sent
        self._base = MovingNode(scene.add_frame(name, show_axes=False))
        scene.add_frame(f"{name}/{BASE}", show_axes=False)
        frames = [scene.add_frame(f"{name}/{body}", show_axes=False) for body in range(len(vehicle.moving))]
        self._links = [MovingNode(frame) for frame in frames]
        shapes = (*vehicle_shapes(vehicle), *points)
        self._meshes = [
            (add_shape(scene, f"{name}/{shape.body}/{shape.name}", shape, paint(shape.role), cast=cast), shape)
            for shape in shapes
        ]
        self._discs = {shape.name: (MovingNode(node), shape) for node, shape in self._meshes if shape.role == "rotor"}
        self._blades = self._add_blades(scene, name) if blades and vehicle.rotors else None
        self._turned = np.zeros(len(vehicle.rotors))

    def _add_blades(self, scene: Any, name: str) -> Any:
        vertices, faces = blade_mesh(0.95 * rotor_radius(self._vehicle))
        rotors = self._vehicle.rotors
        hubs = np.array([floats(rotor.position) for rotor in rotors])
        turned = np.array([turn_onto(floats(rotor.axis)) for rotor in rotors])
        self._lifts, self._ups = quaternions_of(turned), turned[:, :, 2]
        still = np.tile([1.0, 0.0, 0.0, 0.0], (len(hubs), 1))
        return scene.add_batched_meshes_simple(
            f"{name}/{BASE}/blades", vertices, faces, still, hubs, batched_colors=GREY, lod="off", cast_shadow=False,
            receive_shadow=False,
        )  # fmt: skip

    def place(self, rotations: Array, positions: Array) -> None:
        """Move the bodies: R_WB (bodies, 3, 3) and p_WB (bodies, 3), the base first."""
        R, p = rotations[0], positions[0]
        self._base.put(p, R)
        for node, rotation, position in zip(self._links, rotations[1:], positions[1:], strict=True):
            node.put(R.T @ (position - p), R.T @ rotation)

    def spin(self, speeds: Array, seconds: float) -> None:
        """Turn the blades by so much time; what is too fast to see is slowed down, and keeps its order.

        Args:
            speeds: of the rotors, rad/s.
            seconds: since the last picture.
        """
        if self._blades is None:
            return
        senses = np.array([float(rotor.direction) for rotor in self._vehicle.rotors])
        self._turned = (self._turned + senses * speeds * seconds / SLOWED) % (2.0 * math.pi)
        half = 0.5 * self._turned
        # about the axis of the rotor, after the turn of z onto it
        spun = Quaternion(np.cos(half), *(np.sin(half) * self._ups.T)) * Quaternion(*self._lifts.T)
        self._blades.batched_wxyzs = np.stack(list(spun), axis=1).astype(np.float32)

    def tilt(self, turns: Mapping[str, Array]) -> None:
        """Turn discs and blades: name of a disc -> R_BB (3, 3)."""
        for i, rotor in enumerate(self._vehicle.rotors):
            if (name := disc_name(rotor.name)) in turns:
                disc, shape = self._discs[name]
                lift = turns[name] @ np.array(shape.rotation)
                disc.put(np.array(shape.position), lift)
                if self._blades is not None:
                    self._lifts[i], self._ups[i] = quaternions_of(lift[None])[0], lift[:, 2]

    def color(self, paint: Paint) -> None:
        """Give it other colours."""
        for node, shape in self._meshes:
            node.color = bytes_of(paint(shape.role))

    def show(self, visible: bool) -> None:
        """Show or hide it."""
        self._base.node.visible = visible

    def remove(self) -> None:
        """Take it out of the scene, with all that hangs on it."""
        self._base.node.remove()


class SolidNodes:
    """Solids of the world: surfaces, objects, payloads.

    Args:
        scene: of viser. name: beginning of the nodes' names.
        shadow: whether they cast and receive shadows.
    """

    def __init__(self, scene: Any, name: str, *, shadow: bool = False) -> None:
        self._scene, self._name, self._shadow = scene, name, shadow
        self.root = scene.add_frame(name, show_axes=False)
        self._nodes: dict[str, tuple[MovingNode, tuple[float, ...]]] = {}

    def place(self, solids: Sequence[Solid], k: int = 0) -> None:
        """Draw these solids, and no others, as they are at instant ``k``."""
        for name in set(self._nodes) - {each.shape.name for each in solids}:
            self._nodes.pop(name)[0].node.remove()
        for solid in solids:
            shape, name = solid.shape, solid.shape.name
            if name not in self._nodes or self._nodes[name][1] != shape.size:
                upright = replace(shape, position=(0.0, 0.0, 0.0), rotation=UPRIGHT)
                look = {"cast": self._shadow, "receive": self._shadow}
                node = add_shape(self._scene, f"{self._name}/{name}", upright, solid.rgba, **look)
                self._nodes[name] = MovingNode(node), shape.size
            self._nodes[name][0].put(solid.position[k], solid.rotation[k])

    def show(self, visible: bool) -> None:
        """Show or hide them."""
        self.root.visible = visible

    def remove(self) -> None:
        """Take them out of the scene."""
        self.root.remove()


class Arrows:
    """Arrows between places of the world.

    Args:
        scene: of viser. name: of the node.
        colors: (N, 3) from 0 to 255, one an arrow.
        radius: of a shaft, m.
        reached: (2, 3) m: two places between which all arrows will be; a viewer may leave out what began elsewhere.
    """

    def __init__(self, scene: Any, name: str, colors: Sequence[Sequence[int]], radius: float, reached: Array) -> None:
        self._points = np.tile(reached, (len(colors), 1, 1)).astype(np.float32)
        self._node = scene.add_arrows(
            name, self._points, np.array(colors, np.uint8), shaft_radius=radius, head_radius=HEAD[0] * radius,
            head_length=HEAD[1] * radius, visible=False,
        )  # fmt: skip
        self._acting, self._wanted = False, True

    def point(self, ends: Array) -> None:
        """Draw arrows (N, 2, 3) from first to second place, m; those that are too short are hidden."""
        long = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > SHORTEST
        acting = bool(long.any()) and bool(np.isfinite(ends).all())
        if acting:
            # the head of an arrow is drawn however short it is: it hides where another one begins
            drawn = np.where(long[:, None, None], ends, ends[np.argmax(long), 0]).astype(np.float32)
            if np.abs(drawn - self._points).max() > STILL:
                self._node.points = self._points = drawn
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
