"""The scene of a recording: each vehicle's shapes as nodes of viser, one node a body, and what is drawn beside them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.drawing.meshes import mesh_of
from skyarm.drawing.moving_poses import moving_poses
from skyarm.drawing.shapes import UPRIGHT, Shape
from skyarm.drawing.tilted_rotors import rotor_turns, turned_shape
from skyarm.drawing.vehicle_shapes import vehicle_shapes
from skyarm.film.filmed_flight import FilmedFlight
from skyarm.film.solids import RGBA, load_solids, role_color, world_color

Array = npt.NDArray[np.float64]

DIGITS = 4
"""Decimals of places (0.1 mm) and of quaternions that are recorded: more would not be seen, and packs worse."""

SEGMENTS, SUBDIVISIONS = 24, 2
"""Of round shapes."""

THIN = 1e-3
"""m: half the thickness of a plane's patch."""

PATH_COLOR = (90, 96, 110)


class RecordedBodies:
    """The bodies of one vehicle, or of its desired pose, in viser's scene."""

    def __init__(self, scene: Any, root: str, flight: FilmedFlight, shift: Array, *, ghost: bool) -> None:
        vehicle = flight.vehicle
        if ghost:
            pose = flight.desired_position, flight.desired_quaternion, flight.desired_joints
        else:
            pose = flight.position, flight.quaternion, flight.joints
        self._nodes: list[MovingNode] = []
        # nothing is wanted of the servos: the desired pose has them at rest
        turns = {} if ghost else rotor_turns(vehicle, flight.tilts)
        for body, (rotation, place) in moving_poses(vehicle, *pose).items():
            node = scene.add_frame(f"{root}/body{body + 1}", show_axes=False)
            for shape in (*vehicle_shapes(vehicle), *(() if ghost else flight.points)):
                if shape.body == body:
                    color = role_color(shape.role, flight.color, ghost=ghost)
                    disc = add_shape(scene, f"{root}/body{body + 1}/{shape.name}", shape, color)
                    if shape.name in turns:
                        still = np.broadcast_to(np.array(shape.position), place.shape)
                        self._nodes.append(MovingNode(disc, still, turned_shape(shape, turns)))
            self._nodes.append(MovingNode(node, place + shift, rotation))

    def put(self, k: int) -> None:
        """Move every body to frame k."""
        for node in self._nodes:
            node.put(k)


class MovingNode:
    """A node of the scene whose place (F, 3) and rotation (F, 3, 3) at every frame are known."""

    def __init__(self, node: Any, place: Array, rotation: Array) -> None:
        self._node, self._place = node, np.round(place, DIGITS)
        self._quaternion = np.round(_quaternions(rotation), DIGITS)

    def put(self, k: int) -> None:
        """Move it to frame k; what has not moved is not recorded again."""
        place, quaternion = self._place, self._quaternion
        if k == 0 or np.any(place[k] != place[k - 1]):
            self._node.position = place[k]
        if k == 0 or np.any(quaternion[k] != quaternion[k - 1]):
            self._node.wxyz = quaternion[k]


def add_world(scene: Any, root: str, flight: FilmedFlight, shift: Array) -> list[MovingNode]:
    """The surfaces of a flight's world and its payloads; returns those that move."""
    moving = []
    for i, load in enumerate(load_solids(flight)):
        node = add_shape(scene, f"{root}/payload{i + 1}", load.shape, load.rgba)
        moving.append(MovingNode(node, load.position + shift, load.rotation))
        moving[-1].put(0)
    for solid in flight.surfaces:
        node = add_shape(scene, f"{root}/{solid.shape.name}", solid.shape, world_color(solid.shape.role))
        placed = MovingNode(node, solid.position + shift, solid.rotation)
        placed.put(0)
        if solid.moves:
            moving.append(placed)
    return moving


def add_shape(scene: Any, name: str, shape: Shape, color: RGBA) -> Any:
    """One shape as a node of the scene, under the node of its body."""
    look = {
        "color": tuple(round(255 * c) for c in color[:3]),
        "opacity": None if color[3] >= 1.0 else color[3],
        "position": np.array(shape.position),
        "wxyz": _quaternions(np.array([shape.rotation]))[0],
    }
    if shape.mesh or shape.kind == "hole":
        vertices, faces = mesh_of(replace(shape, position=(0.0, 0.0, 0.0), rotation=UPRIGHT))
        return scene.add_mesh_simple(name, vertices, faces, side="double", flat_shading=True, **look)
    if shape.kind in ("sphere", "ellipsoid"):
        axes = (shape.size[0],) * 3 if shape.kind == "sphere" else shape.size
        return scene.add_icosphere(name, radius=1.0, scale=axes, subdivisions=SUBDIVISIONS, **look)
    if shape.kind in ("box", "patch"):
        lengths = tuple(2.0 * half for half in (*shape.size, THIN)[:3])
        return scene.add_box(name, dimensions=lengths, **look)
    radius, length = shape.size
    node = scene.add_cylinder(name, radius=radius, height=length, radial_segments=SEGMENTS, **look)
    if shape.kind == "capsule":
        along = np.array(shape.rotation) @ [0.0, 0.0, 0.5 * length]
        for end, sign in (("start", -1.0), ("end", 1.0)):
            look["position"] = np.array(shape.position) + sign * along
            scene.add_icosphere(f"{name}/{end}", radius=radius, subdivisions=SUBDIVISIONS, **_within(look, shape))
    return node


def add_path(scene: Any, name: str, places: Array, color: tuple[int, ...], width: float) -> None:
    """A line through places (F, 3)."""
    places = np.round(places, DIGITS)
    points = np.stack([places[:-1], places[1:]], axis=1).astype(np.float32)
    if len(points):
        scene.add_line_segments(
            name, points=points, colors=np.array(color, np.uint8), thickness=width, thickness_units="screen"
        )


def _within(look: dict[str, Any], shape: Shape) -> dict[str, Any]:
    """The same place, told in the axes of the shape's own node."""
    offset = np.array(shape.rotation).T @ (look["position"] - np.array(shape.position))
    return {**look, "position": offset, "wxyz": np.array([1.0, 0.0, 0.0, 0.0])}


def _quaternions(R: Array) -> Array:
    """Quaternions (N, 4) wxyz of rotations (N, 3, 3); the largest component by which each is found is positive."""
    w, x, y, z = (
        1.0 + R[:, 0, 0] + R[:, 1, 1] + R[:, 2, 2],
        1.0 + R[:, 0, 0] - R[:, 1, 1] - R[:, 2, 2],
        1.0 - R[:, 0, 0] + R[:, 1, 1] - R[:, 2, 2],
        1.0 - R[:, 0, 0] - R[:, 1, 1] + R[:, 2, 2],
    )
    wx, wy, wz = R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]
    xy, xz, yz = R[:, 0, 1] + R[:, 1, 0], R[:, 0, 2] + R[:, 2, 0], R[:, 1, 2] + R[:, 2, 1]
    rows = [[w, wx, wy, wz], [wx, x, xy, xz], [wy, xy, y, yz], [wz, xz, yz, z]]
    four = np.stack([np.stack(row, axis=1) for row in rows], axis=1)
    best = np.argmax(np.stack([w, x, y, z], axis=1), axis=1)
    chosen = four[np.arange(len(R)), best]
    found: Array = chosen / np.linalg.norm(chosen, axis=1, keepdims=True)
    # signs that do not jump from one frame to the next
    same = np.concatenate([[1.0], np.cumprod(np.where(np.einsum("ni,ni->n", found[1:], found[:-1]) < 0.0, -1.0, 1.0))])
    return np.asarray(found * same[:, None], dtype=float)
