"""The vehicles, what pushes on them and where they should be, as nodes of a viser scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from skyarm.drawing.meshes import blade_mesh, mesh_of
from skyarm.drawing.pose_program import Array, Placed
from skyarm.drawing.shapes import Shape, turn_onto
from skyarm.drawing.vehicle_shapes import payload_shape, rotor_radius, vehicle_shapes
from skyarm.studio.flight import Flight
from skyarm.vehicle.vehicle_records import BASE, Vehicle

COLORS = ((38, 110, 190), (214, 105, 30), (44, 140, 80))
"""Of the first, second and third law, here and in the plots: blue, orange, green."""

GREY, GHOST, LOST = (90, 96, 105), (130, 130, 140), (200, 40, 40)
WIND, PUSHED, OBSERVED = (70, 170, 220), (225, 60, 60), (150, 80, 190)

TONES = {"hull": 1.0, "boom": 0.75, "rotor": 0.5, "link": 0.85, "joint": 0.6, "tip": 1.15, "payload": 0.4}
"""Role of a shape -> how bright its law's colour is."""

NEWTON = 0.08
"""m of arrow per newton. Air: the same per metre a second."""

TRAIL = 4.0
"""s of tip trail."""


class VehicleNodes:
    """One vehicle in the scene.

    Args:
        scene: of viser. name: beginning of the nodes' names.
        vehicle: with concrete numbers. color: of its law.
        plain: without shadows. opacity: None draws all of it, with rotors; a ghost has none.
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
    ) -> None:
        self._scene, self._name, self._vehicle, self._opacity = scene, name, vehicle, opacity
        self._look = {"opacity": opacity, "cast_shadow": not plain and opacity is None, "receive_shadow": False}
        self._frames = [scene.add_frame(f"{name}/{body}", show_axes=False) for body in range(-1, vehicle.n)]
        self._meshes: list[tuple[Any, float]] = []
        for shape in vehicle_shapes(vehicle):
            self._add(shape, color)
        self._blades = None if opacity is not None or not vehicle.rotors else self._add_blades()
        self._turned = np.zeros(len(vehicle.rotors))
        self._payload: tuple[float, Any] = (0.0, None)
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
        self._hubs = np.array([[float(c) for c in rotor.position] for rotor in self._vehicle.rotors])
        axes = [turn_onto((float(r.axis.x), float(r.axis.y), float(r.axis.z))) for r in self._vehicle.rotors]
        self._axes = np.array(axes)
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
        for frame, wxyz, position in zip(self._frames, placed.quaternions, placed.positions + beside, strict=True):
            frame.wxyz, frame.position = wxyz, position

    def spin(self, speeds: Sequence[float], seconds: float) -> None:
        """Turn the blades by so much time; what is too fast to see is slowed down, and keeps its order.

        Args:
            speeds: of the rotors, rad/s.
            seconds: since the last picture.
        """
        if self._blades is None:
            return
        senses = np.array([float(rotor.direction) for rotor in self._vehicle.rotors])
        self._turned = (self._turned + senses * np.array(speeds) * seconds / 40.0) % (2.0 * math.pi)
        cos, sin = np.cos(0.5 * self._turned), np.sin(0.5 * self._turned)
        # about the axis of the rotor, after the turn of z onto it
        up = self._axes[:, :, 2]
        lift = np.array([_half(row) for row in self._axes])
        spun = np.concatenate([cos[:, None], sin[:, None] * up], axis=1)
        self._blades.batched_wxyzs = _times(spun, lift).astype(np.float32)

    def carry(self, mass: float) -> None:
        """Show a payload at the tip, kg; none where it weighs nothing."""
        held, node = self._payload
        if mass == held or not self._vehicle.end_effector:
            return
        if node is not None:
            node.remove()
        shown = self._add(payload_shape(self._vehicle, mass), self._color) if mass > 0.0 else None
        self._payload = (mass, shown)

    def mark(self, lost: bool) -> None:
        """Colour the vehicle as lost, or as its law."""
        color = LOST if lost else self._color
        for node, tone in self._meshes:
            node.color = _toned(color, tone)

    def show(self, visible: bool) -> None:
        """Show or hide it."""
        for frame in self._frames:
            frame.visible = visible

    def remove(self) -> None:
        """Take it out of the scene."""
        for frame in self._frames:
            frame.remove()


class Arrows:
    """Forces on one vehicle, and the air that it meets: an arrow each, in world axes.

    Args:
        scene: of viser.
        name: of the node.
        count: of rotors.
    """

    def __init__(self, scene: Any, name: str, count: int) -> None:
        colors = np.array([(240, 190, 40)] * count + [WIND, PUSHED, OBSERVED], dtype=np.uint8)
        self._points = np.zeros((count + 3, 2, 3), dtype=np.float32)
        self._node = scene.add_arrows(
            name, self._points, colors, shaft_radius=0.006, head_radius=0.016, head_length=0.03
        )

    def point(self, flight: Flight, placed: Placed, beside: Array) -> None:
        """Draw what acts now."""
        state, vehicle = flight.session.state, flight.first.world.vehicle
        R, p = placed.rotations[0], placed.positions[0] + beside
        arrows = np.zeros_like(self._points)
        for i, (rotor, speed) in enumerate(zip(vehicle.rotors, state.rotor_speeds, strict=True)):
            hub = p + R @ np.array([float(c) for c in rotor.position])
            thrust = float(rotor.thrust_coefficient) * float(speed) ** 2
            arrows[i] = hub, hub + R @ np.array([float(c) for c in rotor.axis]) * thrust * NEWTON
        last = flight.last
        seen = np.zeros(3) if last.observed is None else np.array([float(c) for c in last.observed])
        above = p + np.array([0.0, 0.0, 0.12])
        arrows[-3] = above - last.air * NEWTON - np.array([0.0, 0.0, -0.1]), above + np.array([0.0, 0.0, 0.1])
        arrows[-2] = p - last.pushed * NEWTON, p
        arrows[-1] = above, above + seen * NEWTON
        if np.isfinite(arrows).all():
            self._node.points = arrows

    def show(self, visible: bool) -> None:
        """Show or hide them."""
        self._node.visible = visible

    def remove(self) -> None:
        """Take them out of the scene."""
        self._node.remove()


def trail(sights: Sequence[Any], beside: Array) -> Array:
    """(N, 2, 3) segments of the tip's way."""
    tips = np.array([seen.tip for seen in sights], dtype=np.float32).reshape(-1, 3) + beside
    if len(tips) < 2:
        tips = np.zeros((2, 3))
    segments: Array = np.stack([tips[:-1], tips[1:]], axis=1).astype(np.float32)
    return segments


def _toned(color: Sequence[int], tone: float) -> tuple[int, int, int]:
    red, green, blue = (min(255, int(tone * c)) for c in color)
    return red, green, blue


def _half(rows: Array) -> Array:
    """Quaternion wxyz of a rotation that turns z somewhere by the shortest way."""
    x, y, z = rows[:, 2]
    if z < -1.0 + 1e-9:
        return np.array([0.0, 1.0, 0.0, 0.0])
    q = np.array([1.0 + z, -y, x, 0.0])
    found: Array = q / np.linalg.norm(q)
    return found


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
