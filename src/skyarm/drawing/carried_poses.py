"""Where the carriers of a world are: free objects and whatever else moves and carries surfaces, at many instants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Mat3, Quaternion
from skyarm.contact import Contact
from skyarm.contact.mechanism_effort import MechanismMotion
from skyarm.drawing.moving_poses import stack

Array = npt.NDArray[np.float64]

CarriedPoses = Mapping[str, tuple[Array, Array]]
"""Name of a carrier -> (R_WC (N, 3, 3), p_WC (N, 3)), its axes to the world's."""


def logged_poses(contacts: Sequence[Contact], position: Array, quaternion: Array, coordinate: Array) -> CarriedPoses:
    """Poses of free objects and mechanisms as a log keeps them; arrays without columns where there are none.

    Args:
        contacts: of the scenario.
        position: (N, 3 objects) m.
        quaternion: (N, 4 objects) wxyz, of any length but zero.
        coordinate: (N, mechanisms) rad or m.
    """
    found: dict[str, tuple[Array, Array]] = {}
    objects = [each for contact in contacts for each in contact.objects]
    mechanisms = [each for contact in contacts for each in contact.mechanisms]
    if (position.shape[1], quaternion.shape[1]) == (3 * len(objects), 4 * len(objects)):
        for i, thing in enumerate(objects):
            turned = quaternion[:, 4 * i : 4 * i + 4]
            unit = turned / np.linalg.norm(turned, axis=1, keepdims=True)
            rotation = Quaternion(*unit.T).rotation()
            found[thing.name] = _arrays(rotation, len(unit)), position[:, 3 * i : 3 * i + 3]
    if coordinate.shape[1] == len(mechanisms):
        for mechanism, q in zip(mechanisms, coordinate.T, strict=True):
            frame = mechanism.frame(MechanismMotion(coordinate=q, rate=0.0, bristle=()))
            found[mechanism.name] = _arrays(frame.rotation, len(q)), stack(list(frame.position), len(q))
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
                found[carrier.name] = _arrays(frame.rotation, 1), stack(list(frame.position), 1)
    return found


def _arrays(R: Mat3, count: int) -> Array:
    """A matrix of numbers and columns (N,) as (N, 3, 3)."""
    return stack([list(row) for row in R.rows], count)
