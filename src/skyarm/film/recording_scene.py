"""The scene of a recording: each vehicle's shapes as nodes of viser, one node a body, and what is drawn beside them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.drawing.moving_poses import moving_poses
from skyarm.drawing.shapes import Shape
from skyarm.drawing.vehicle_shapes import vehicle_shapes
from skyarm.film.filmed_flight import FilmedFlight
from skyarm.film.solids import RGBA, role_color

Array = npt.NDArray[np.float64]

DIGITS = 4
"""Decimals of places (0.1 mm) and of quaternions that are recorded: more would not be seen, and packs worse."""

SEGMENTS, SUBDIVISIONS = 24, 2
"""Of round shapes."""

PATH_COLOR = (90, 96, 110)


class RecordedBodies:
    """The bodies of one vehicle, or of its desired pose, in viser's scene."""

    def __init__(self, scene: Any, root: str, flight: FilmedFlight, shift: Array, *, ghost: bool) -> None:
        vehicle = flight.vehicle
        if ghost:
            pose = flight.desired_position, flight.desired_quaternion, flight.desired_joints
        else:
            pose = flight.position, flight.quaternion, flight.joints
        self._nodes: list[tuple[Any, Array, Array]] = []
        for body, (rotation, place) in moving_poses(vehicle, *pose).items():
            node = scene.add_frame(f"{root}/body{body + 1}", show_axes=False)
            for shape in vehicle_shapes(vehicle):
                if shape.body == body:
                    color = role_color(shape.role, flight.color, ghost=ghost)
                    add_shape(scene, f"{root}/body{body + 1}/{shape.name}", shape, color)
            self._nodes.append((node, np.round(place + shift, DIGITS), np.round(_quaternions(rotation), DIGITS)))

    def put(self, k: int) -> None:
        """Move every body to frame k; what has not moved is not recorded again."""
        for node, place, quaternion in self._nodes:
            if k == 0 or np.any(place[k] != place[k - 1]):
                node.position = place[k]
            if k == 0 or np.any(quaternion[k] != quaternion[k - 1]):
                node.wxyz = quaternion[k]


def add_shape(scene: Any, name: str, shape: Shape, color: RGBA) -> None:
    """One shape as a node of the scene, under the node of its body."""
    look = {
        "color": tuple(round(255 * c) for c in color[:3]),
        "opacity": None if color[3] >= 1.0 else color[3],
        "position": np.array(shape.position),
        "wxyz": _quaternions(np.array([shape.rotation]))[0],
    }
    if shape.kind in ("sphere", "ellipsoid"):
        axes = (shape.size[0],) * 3 if shape.kind == "sphere" else shape.size
        scene.add_icosphere(name, radius=1.0, scale=axes, subdivisions=SUBDIVISIONS, **look)
        return
    radius, length = shape.size
    scene.add_cylinder(name, radius=radius, height=length, radial_segments=SEGMENTS, **look)
    if shape.kind == "capsule":
        along = np.array(shape.rotation) @ [0.0, 0.0, 0.5 * length]
        for end, sign in (("start", -1.0), ("end", 1.0)):
            look["position"] = np.array(shape.position) + sign * along
            scene.add_icosphere(f"{name}/{end}", radius=radius, subdivisions=SUBDIVISIONS, **_within(look, shape))


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
