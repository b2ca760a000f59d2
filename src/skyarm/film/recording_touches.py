"""Contact forces in a recording: an arrow for each pair of a surface and a point that touches at any time."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.film.filmed_flight import FilmedFlight
from skyarm.film.marks import LEAST_FORCE, LONGEST_TOUCH, TOUCH, TOUCH_PER_NEWTON

Array = npt.NDArray[np.float64]

COARSE = 3
"""Decimals of places (1 mm) and of lengths of arrows that are recorded."""


class RecordedTouches:
    """Arrows of one flight: each begins where its force acts and is as long as the force is large."""

    def __init__(self, scene: Any, root: str, flight: FilmedFlight, shift: Array, reach: float) -> None:
        self._shown: list[tuple[Any, Array, npt.NDArray[np.bool_]]] = []
        self._said: list[Any] = [None] * len(flight.touches)
        touches = [each for each in flight.touches if (np.linalg.norm(each.force, axis=1) > LEAST_FORCE).any()]
        for touch in touches:
            size = np.linalg.norm(touch.force, axis=1)
            length = np.where(size > LEAST_FORCE, np.minimum(TOUCH_PER_NEWTON * size, LONGEST_TOUCH), 0.0)
            along = touch.force / np.maximum(size, 1e-9)[:, None]
            ends = np.stack([touch.spot + shift, touch.spot + shift + length[:, None] * along], axis=1)
            # a viewer may leave out arrows that were not in view at first: these reach wherever they will be
            reached = ends[length > 0.0].reshape(-1, 3)
            node = scene.add_arrows(
                f"{root}/touch/{touch.surface}/{touch.point}",
                points=np.array([[reached.min(axis=0), reached.max(axis=0)]], np.float32),
                colors=np.array([round(255 * c) for c in TOUCH[:3]], np.uint8),
                shaft_radius=0.035 * reach,
                head_radius=0.08 * reach,
                head_length=0.15 * reach,
                visible=False,
            )
            self._shown.append((node, np.round(ends, COARSE), length > 0.0))

    def put(self, k: int) -> None:
        """Show the forces of frame k; what has not changed is not recorded again."""
        for i, (node, ends, acts) in enumerate(self._shown):
            said = ends[k].tobytes() if acts[k] else b""
            if said == self._said[i]:
                continue
            if acts[k]:
                node.points = ends[k : k + 1].astype(np.float32)
            if self._said[i] is None or bool(said) != bool(self._said[i]):
                node.visible = bool(said)
            self._said[i] = said


def turn_x_onto(along: Array) -> Array:
    """Quaternion wxyz of the shortest turn of x onto a unit vector."""
    w = 1.0 + along[0]
    if w < 1e-9:
        return np.array([0.0, 0.0, 0.0, 1.0])
    found = np.array([w, 0.0, -along[2], along[1]])
    turned: Array = found / np.linalg.norm(found)
    return turned
