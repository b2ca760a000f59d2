"""Forces on a vehicle as arrows of a viser scene, and the trail of its tip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from skyarm.drawing.pose_program import Array, Placed
from skyarm.drawing.tilted_rotors import disc_name, rotor_turns
from skyarm.studio.scene import STILL
from skyarm.studio.sights import Sight
from skyarm.vehicle.vehicle_records import Vehicle

THRUST, WIND, PUSHED, OBSERVED = (240, 190, 40), (70, 170, 220), (225, 60, 60), (150, 80, 190)

NEWTON = 0.08
"""m of arrow per newton. Air: the same per metre a second."""

SHORTEST = 0.01
"""m of arrow below which none is drawn."""

TRAIL = 4.0
"""s of tip trail."""


class Arrows:
    """Forces on one vehicle, and the air that it meets: an arrow each, in world axes.

    Args:
        scene: of viser.
        name: of the node.
        vehicle: with concrete numbers.
        place: (3,) m, where it is at first.
    """

    def __init__(self, scene: Any, name: str, vehicle: Vehicle, place: Array) -> None:
        rotors, count = vehicle.rotors, len(vehicle.rotors)
        self._hubs = np.array([[float(c) for c in rotor.position] for rotor in rotors]).reshape(count, 3)
        axes = np.array([[float(c) for c in rotor.axis] for rotor in rotors]).reshape(count, 3)
        self._thrusts = axes * np.array([[NEWTON * float(rotor.thrust_coefficient)] for rotor in rotors]).reshape(
            count, 1
        )
        self._vehicle, self._still = vehicle, self._thrusts.copy()
        colors = np.array([THRUST] * count + [WIND, PUSHED, OBSERVED], dtype=np.uint8)
        self._points = np.tile(place, (count + 3, 2, 1)).astype(np.float32)
        self._node = scene.add_arrows(
            name, self._points, colors, shaft_radius=0.004, head_radius=0.011, head_length=0.022
        )

    def point(self, last: Sight, speeds: Array, placed: Placed, beside: Array, tilts: Sequence[Any] = ()) -> None:
        """Draw what acts now.

        Args:
            last: what was seen last.
            speeds: of the rotors, rad/s.
            placed: where the bodies are.
            beside: (3,) m, how far beside its own place the vehicle is drawn.
            tilts: rad, of the rotors that tilt.
        """
        if self._vehicle.tilts:
            turns = rotor_turns(self._vehicle, np.array([[float(a) for a in tilts]]))
            for i, rotor in enumerate(self._vehicle.rotors):
                if disc_name(rotor.name) in turns:
                    self._thrusts[i] = turns[disc_name(rotor.name)][0] @ self._still[i]
        seen = np.zeros(3) if last.observed is None else np.array([float(c) for c in last.observed])
        R, p = placed.rotations[0], placed.positions[0] + beside
        arrows = np.zeros_like(self._points)
        arrows[:-3, 0] = p + self._hubs @ R.T
        arrows[:-3, 1] = arrows[:-3, 0] + (self._thrusts * (speeds**2)[:, None]) @ R.T
        above = p + np.array([0.0, 0.0, 0.22])
        arrows[-3] = above - last.air * NEWTON, above
        arrows[-2] = p - last.pushed * NEWTON, p
        arrows[-1] = p, p + seen * NEWTON
        # the head of an arrow is drawn however short it is: inside the hull nobody sees it
        short = ((arrows[:, 1] - arrows[:, 0]) ** 2).sum(axis=1) < SHORTEST**2
        arrows[short] = p
        if np.isfinite(arrows).all() and np.abs(arrows - self._points).max() > STILL:
            self._points = arrows
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
