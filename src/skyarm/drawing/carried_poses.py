"""Where the carriers of a world are: free objects and whatever else moves and carries surfaces, at many instants."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Quaternion
from skyarm.contact import Contact
from skyarm.drawing.moving_poses import stack

Array = npt.NDArray[np.float64]

CarriedPoses = Mapping[str, tuple[Array, Array]]
"""Name of a carrier -> (R_WC (N, 3, 3), p_WC (N, 3)), its axes to the world's."""


def logged_poses(contacts: Iterable[Contact], position: Array, quaternion: Array) -> CarriedPoses:
    """Poses of free objects as a log keeps them.

    Args:
        contacts: of the scenario.
        position: (N, 3 objects) m.
        quaternion: (N, 4 objects) wxyz, of any length but zero.
    """
    names = [each.name for contact in contacts for each in contact.objects]
    found = {}
    if position.shape[1] == 3 * len(names) and quaternion.shape[1] == 4 * len(names):
        for i, name in enumerate(names):
            turned = quaternion[:, 4 * i : 4 * i + 4]
            unit = turned / np.linalg.norm(turned, axis=1, keepdims=True)
            rows = Quaternion(*unit.T).rotation().rows
            found[name] = stack([list(row) for row in rows], len(unit)), position[:, 3 * i : 3 * i + 3]
    return found


def held_poses(components: Sequence[Any], memories: Sequence[Any]) -> CarriedPoses:
    """Poses of all carriers at one instant, from what their contact remembers.

    Args:
        components: of the scenario.
        memories: one for each.
    """
    found = {}
    for contact, memory in zip(components, memories, strict=True):
        if isinstance(contact, Contact):
            for carrier, held in zip(contact.carriers, memory.carried, strict=True):
                frame = carrier.frame(held)
                rotation = np.array([[[float(c) for c in row] for row in frame.rotation.rows]])
                found[carrier.name] = rotation, np.array([[float(c) for c in frame.position]])
    return found
