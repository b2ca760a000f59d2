"""Instants of a log as messages need them, and what is computed of them alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Quaternion, Vec3
from skyarm.log.flight_log import Log
from skyarm.log.ros.cdr import NANO

Array = npt.NDArray[np.float64]


class Part:
    """Some instants of a log, and what messages need of them."""

    def __init__(self, log: Log, chosen: slice) -> None:
        self.log, self._chosen = log, chosen
        self.stamps = nanoseconds(log.time[chosen])

    def __getitem__(self, array: str) -> Array:
        """The instants' rows of one of the log's arrays."""
        return self.log[array][self._chosen]

    def header(self, frame: str, time: Array | None = None) -> dict[str, Any]:
        """A std_msgs/Header; its stamps are ``time`` (s), or the instants of the log."""
        stamps = self.stamps if time is None else nanoseconds(np.nan_to_num(time))
        return {"stamp": stamps, "frame_id": frame}

    def unit(self, array: str = "quaternion") -> Array:
        """Attitudes wxyz of length 1."""
        found: Array = self[array] / np.linalg.norm(self[array], axis=1, keepdims=True)
        return found

    def in_base(self, vectors: Array, array: str = "quaternion") -> Array:
        """World vectors (N, 3) in base axes."""
        R = Quaternion(*self.unit(array).T).rotation()
        return np.stack(list(R.apply_T(Vec3(*vectors.T))), axis=1)


def nanoseconds(time: Array) -> npt.NDArray[np.int64]:
    """Times in s as the clock of messages, ns."""
    return np.rint(np.asarray(time) * NANO).astype(np.int64)


def distance_from_reference(array: str) -> Callable[[Part], dict[str, Any]]:
    """The function that gives a std_msgs/Float64 of an array's distance from its continuous reference."""
    return lambda part: {"data": np.linalg.norm(part[array] - part[f"{array}_reference"], axis=1)}


def tilt(part: Part) -> dict[str, Any]:
    """Angle between the body's z and the world's, rad."""
    _, x, y, _ = part.unit().T
    return {"data": 2.0 * np.arctan2(np.hypot(x, y), np.sqrt(np.maximum(0.0, 1.0 - x * x - y * y)))}


METRICS: Mapping[str, Callable[[Part], dict[str, Any]]] = {
    "position_error": distance_from_reference("position"),
    "joint_error": distance_from_reference("joints"),
    "tip_error": distance_from_reference("tool"),
    "tilt": tilt,
}
"""Numbers of an instant: distances from the continuous reference, m and rad or m; tilt, rad."""
