"""The vehicles, and where they should be, as nodes of a viser scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from skyarm.drawing.meshes import blade_mesh, mesh_of
from skyarm.drawing.pose_program import Array, Placed, quaternions_of
from skyarm.drawing.shapes import Shape, turn_onto
from skyarm.drawing.tilted_rotors import disc_name, rotor_turns
from skyarm.drawing.vehicle_shapes import payload_shape, rotor_radius, vehicle_shapes
from skyarm.studio.sights import Load
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

COLORS = ((38, 110, 190), (214, 105, 30), (44, 140, 80))
"""Of the first, second and third law, here and in the plots: blue, orange, green."""

GREY, GHOST, LOST = (90, 96, 105), (130, 130, 140), (200, 40, 40)
TONES = {"hull": 1.0, "boom": 0.75, "rotor": 0.5, "link": 0.85, "joint": 0.6, "tip": 1.15, "point": 1.4, "payload": 0.4}
"""Role of a shape -> how bright its law's colour is."""

SLOWED = 40.0
"""Times that rotors are drawn slower than they turn."""

STILL = 1e-4
"""m, and components of a quaternion, below which a node stays as it was sent: an eighth of a pixel from where tabs look
on. It counts from what was sent last, so that slow motion does not add up."""


class VehicleNodes:
    """One vehicle in the scene.

    Args:
        scene: of viser. name: beginning of the nodes' names.
        vehicle: with concrete numbers. color: of its law.
        plain: without shadows. opacity: None draws all of it, with rotors; a ghost has none.
        points: marks of what may touch the world.
    """

    def __init__(
        self,
        scene: Any,
        name: str,
        vehicle: Vehicle,
        color: Sequence[int],
        *,
        plain: bool = False,
        opacity: float | None = None,
        points: Sequence[Shape] = (),
    ) -> None:
        self._scene, self._name, self._vehicle, self._opacity = scene, name, vehicle, opacity
        self._look = {"opacity": opacity, "cast_shadow": not plain and opacity is None, "receive_shadow": False}
        # every body hangs on the base: what stands still against it need not be sent
        self._base = scene.add_frame(name, show_axes=False)
        self._links = [scene.add_frame(f"{name}/{body}", show_axes=False) for body in range(len(vehicle.moving))]
        scene.add_frame(f"{name}/{BASE}", show_axes=False)
        self._sent_turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(vehicle.moving) + 1, 1))
        self._sent_places = np.zeros((len(vehicle.moving) + 1, 3))
        self._meshes: list[tuple[Any, float]] = []
        self._discs: dict[str, Any] = {}
        for shape in (*vehicle_shapes(vehicle), *points):
            node = self._add(shape, color)
            if shape.role == "rotor":
                self._discs[shape.name] = node
        self._blades = None if opacity is not None or not vehicle.rotors else self._add_blades()
        self._turned = np.zeros(len(vehicle.rotors))
        self._loads: tuple[tuple[float, str], ...] = ()
        self._balls: list[tuple[Any, Any]] = []
        self._color = tuple(color)

    def _add(self, shape: Shape, color: Sequence[int]) -> Any:
        vertices, faces = mesh_of(shape)
        tone, look = TONES[shape.role], dict(self._look)
        if shape.role == "rotor":
            look["opacity"], look["cast_shadow"] = 0.5 * (self._opacity or 0.7), False
        node = self._scene.add_mesh_simple(
            f"{self._name}/{shape.body}/{shape.name}", vertices, faces, color=_toned(color, tone), **look
        )
        if shape.role != "payload":
            self._meshes.append((node, tone))
        return node

    def _add_blades(self) -> Any:
        vertices, faces = blade_mesh(0.95 * rotor_radius(self._vehicle))
        rotors = self._vehicle.rotors
        self._hubs = np.array([[float(c) for c in rotor.position] for rotor in rotors])
        turned = np.array([turn_onto((float(r.axis.x), float(r.axis.y), float(r.axis.z))) for r in rotors])
        self._lifts, self._ups = quaternions_of(turned), turned[:, :, 2]
        self._senses = np.array([float(rotor.direction) for rotor in rotors])
        still = np.tile([1.0, 0.0, 0.0, 0.0], (len(self._hubs), 1))
        return self._scene.add_batched_meshes_simple(
            f"{self._name}/{BASE}/blades", vertices, faces, still, self._hubs, batched_colors=GREY, lod="off",
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip

    def place(self, placed: Placed, beside: Array) -> None:
        """Move the bodies.

        Args:
            placed: where they are.
            beside: (3,) m, how far beside its own place the vehicle is drawn.
        """
        if not np.isfinite(placed.rotations).all() or not np.isfinite(placed.positions).all():
            return
        R = placed.rotations[0]
        turns = quaternions_of(np.concatenate([placed.rotations[:1], R.T @ placed.rotations[1:]]))
        places = np.concatenate([placed.positions[:1] + beside, (placed.positions[1:] - placed.positions[0]) @ R])
        turned = np.abs(turns - self._sent_turns).max(axis=1) > STILL
        moved = np.abs(places - self._sent_places).max(axis=1) > STILL
        bodies = (self._base, *self._links)
        for i in np.flatnonzero(turned):
            bodies[i].wxyz = turns[i]
        for i in np.flatnonzero(moved):
            bodies[i].position = places[i]
        self._sent_turns[turned], self._sent_places[moved] = turns[turned], places[moved]

    def spin(self, speeds: Array, seconds: float) -> None:
        """Turn the blades by so much time; what is too fast to see is slowed down, and keeps its order.

        Args:
            speeds: of the rotors, rad/s.
            seconds: since the last picture.
        """
        if self._blades is None:
            return
        self._turned = (self._turned + self._senses * speeds * seconds / SLOWED) % (2.0 * math.pi)
        half = 0.5 * self._turned[:, None]
        # about the axis of the rotor, after the turn of z onto it
        spun = _times(np.concatenate([np.cos(half), np.sin(half) * self._ups], axis=1), self._lifts)
        self._blades.batched_wxyzs = spun.astype(np.float32)

    def tilt(self, angles: Sequence[Any]) -> None:
        """Turn the discs and blades of the rotors that tilt, rad; nothing of a vehicle without any."""
        if not self._vehicle.tilts:
            return
        turns = rotor_turns(self._vehicle, np.array([[float(a) for a in angles]]))
        for i, rotor in enumerate(self._vehicle.rotors):
            name, axis = disc_name(rotor.name), rotor.axis
            if name not in turns:
                continue
            turn, hub = turns[name][0], np.array([float(c) for c in rotor.position])
            disc = self._discs[name]
            disc.wxyz, disc.position = quaternions_of(turn[None])[0], hub - turn @ hub
            if self._blades is not None:
                lift = turn @ np.array(turn_onto((float(axis.x), float(axis.y), float(axis.z))))
                self._lifts[i], self._ups[i] = quaternions_of(lift[None])[0], lift[:, 2]

    def carry(self, loads: Sequence[Load], placed: Placed) -> None:
        """Show payloads where they are held, or where they hang on their cords.

        Args:
            loads: that are held.
            placed: where the bodies are.
        """
        loads = [each for each in loads if each.frame or self._vehicle.end_effector]
        shapes = [payload_shape(self._vehicle, each.mass, each.frame, each.com) for each in loads]
        if (held := tuple((each.mass, each.frame) for each in loads)) != self._loads:
            for node in (node for pair in self._balls for node in pair if node is not None):
                node.remove()
            self._balls = [self._add_ball(i, *pair) for i, pair in enumerate(zip(shapes, loads, strict=True))]
            self._loads = held
        for shape, load, (ball, cord) in zip(shapes, loads, self._balls, strict=True):
            R, p = placed.rotations[1 + shape.body], placed.positions[1 + shape.body]
            if load.hangs is not None and np.isfinite(R).all() and np.isfinite(p).all():
                at = (load.hangs - p) @ R
                ball.position = at - shape.position
                cord.points = np.array([[shape.position, at]], np.float32)

    def _add_ball(self, number: int, shape: Shape, load: Load) -> tuple[Any, Any]:
        """Ball of a payload, and its cord if it hangs on one."""
        name = f"payload{number + 1}"
        ball = self._add(replace(shape, name=name), self._color)
        if load.hangs is None:
            return ball, None
        points = np.array([[shape.position, shape.position]], np.float32)
        cord = self._scene.add_line_segments(f"{self._name}/{shape.body}/{name}_cord", points, GREY, thickness=0.003)
        return ball, cord

    def mark(self, lost: bool) -> None:
        """Colour the vehicle as lost, or as its law."""
        color = LOST if lost else self._color
        for node, tone in self._meshes:
            node.color = _toned(color, tone)

    def show(self, visible: bool) -> None:
        """Show or hide it."""
        self._base.visible = visible

    def remove(self) -> None:
        """Take it out of the scene, with all that hangs on it."""
        self._base.remove()


def _toned(color: Sequence[int], tone: float) -> tuple[int, int, int]:
    red, green, blue = (min(255, int(tone * c)) for c in color)
    return red, green, blue


def _times(a: Array, b: Array) -> Array:
    """Products of quaternions wxyz, row by row."""
    aw, ax, ay, az = a.T
    bw, bx, by, bz = b.T
    product: Array = np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=1,
    )
    return product
