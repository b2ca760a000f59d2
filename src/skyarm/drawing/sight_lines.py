"""Whether surfaces of a world stand between a place and whoever looks at it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from skyarm.drawing.world_shapes import WorldShape

Array = npt.NDArray[np.float64]

WAY = np.linspace(0.03, 3.0, 100)
"""m from the place towards the eye at which something may be in the way."""


def hidden_share(solids: Iterable[WorldShape], places: Array, towards: Array) -> float:
    """Share of the instants at which something stands between a place and an eye.

    Args:
        solids: at N instants.
        places: (N, 3) m, world axes.
        towards: (3,) unit vector from the place to the eye.
    """
    ways = places[:, None] + WAY[:, None] * towards
    behind = np.zeros(len(places), bool)
    for solid in solids:
        local = np.einsum("kwi,kij->kwj", ways - solid.position[:, None], solid.rotation)
        behind |= inside(solid, local).any(axis=1)
    return float(behind.mean())


def inside(solid: WorldShape, places: Array) -> npt.NDArray[np.bool_]:
    """Whether places (..., 3) in a solid's axes are in it; of a patch, below it."""
    kind, size = solid.shape.kind, np.array(solid.shape.size)
    if kind == "patch":
        return np.asarray((np.abs(places[..., :2]) < size).all(axis=-1) & (places[..., 2] < 0.0))
    if kind == "box":
        return np.asarray((np.abs(places) < size).all(axis=-1))
    if kind == "hole":  # as if it were filled
        away, height = np.linalg.norm(places[..., :2], axis=-1), places[..., 2]
        return np.asarray((away < size[3]) & (height < 0.0) & (height > -size[4]))
    if kind == "cylinder":
        away = np.linalg.norm(places[..., :2], axis=-1)
        return np.asarray((away < size[0]) & (np.abs(places[..., 2]) < 0.5 * size[1]))
    return np.asarray(np.linalg.norm(places, axis=-1) < size[0])
