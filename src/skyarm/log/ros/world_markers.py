"""The world as markers that viewers of ROS draw: what stands still once, what moves at every message."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.contact import Contact
from skyarm.drawing.shapes import Solid
from skyarm.drawing.world_shapes import logged_poses, without_holes, world_shapes
from skyarm.log.flight_log import Log
from skyarm.log.ros.frame_transforms import WORLD, of_matrices, quaternion, xyz
from skyarm.log.ros.instants import Part
from skyarm.records.restore import restore

Array = npt.NDArray[np.float64]

WORLD_TOPIC, MOVING_TOPIC = "/world", "/world/moving"

CUBE, SPHERE, CYLINDER = 1, 2, 3
"""Marker's types, by their diameters or lengths."""

THIN = 1e-3
"""m: height of a plane's patch."""


class WorldMarkers:
    """Markers of a flight's world.

    Args:
        log: of the flight, or its first part: planes are drawn about where its tip is at first.
    """

    def __init__(self, log: Log) -> None:
        self._contacts = contacts_of(log)
        tips = log.tip[:1]
        self._around = tuple(tips[0]) if len(tips) and np.isfinite(tips).all() else (0.0, 0.0, 0.0)
        surfaces = [each for contact in self._contacts for each in contact.surfaces]
        carriers = [each for contact in self._contacts for each in contact.carriers]
        self._moving = {f"world/{each.name}" for each in surfaces if each.moves}
        self._moving |= {f"world/{each.name}" for carrier in carriers for each in carrier.surfaces}

    def still(self) -> list[dict[str, Any]]:
        """A visualization_msgs/Marker for each surface that stays where it is."""
        shapes = world_shapes(self._contacts, np.zeros(1), self._around)
        still = without_holes(each for each in shapes if each.shape.name not in self._moving)
        return [_marker(i, each, 0, 0) for i, each in enumerate(still)]

    @property
    def moves(self) -> bool:
        """Whether anything of the world moves, by structure."""
        return bool(self._moving)

    def moving(self, part: Part) -> Mapping[str, Any]:
        """A visualization_msgs/MarkerArray of what moves, at every instant of a part of the flight."""
        arrays = [part[name] for name in ("object_position", "object_quaternion", "mechanism_position")]
        carried = logged_poses(self._contacts, *arrays)
        shapes = world_shapes(self._contacts, part["time"], self._around, carried=carried)
        moving = without_holes(each for each in shapes if each.shape.name in self._moving)
        return {"markers": [_marker(i, each, part.stamps, slice(None)) for i, each in enumerate(moving)]}


def contacts_of(log: Log) -> tuple[Contact, ...]:
    """The world's contact; empty without a world, or of a log that needs code of someone's own that is not loaded."""
    try:
        found = restore(log.info["scenario_record"]["contact"], log.info.get("plugins"))
    except (KeyError, TypeError, ValueError, AttributeError):
        return ()
    return (found,) if isinstance(found, Contact) else ()


def _marker(number: int, solid: Solid, stamps: Any, chosen: int | slice) -> dict[str, Any]:
    """One marker at one instant, or at many."""
    turns = of_matrices(solid.rotation)[chosen]
    return {
        "header": {"stamp": stamps, "frame_id": WORLD},
        "ns": solid.shape.name,
        "id": number,
        "type": {"box": CUBE, "patch": CUBE, "sphere": SPHERE, "cylinder": CYLINDER}[solid.shape.kind],
        "pose": {"position": xyz(solid.position[chosen]), "orientation": quaternion(turns)},
        "scale": xyz(_lengths(solid)),
        "color": dict(zip("rgba", solid.rgba, strict=True)),
        "frame_locked": False,
    }


def _lengths(solid: Solid) -> tuple[float, float, float]:
    """Extents along the solid's axes, m."""
    kind, size = solid.shape.kind, solid.shape.size
    if kind == "box":
        return (2.0 * size[0], 2.0 * size[1], 2.0 * size[2])
    if kind == "patch":
        return (2.0 * size[0], 2.0 * size[1], THIN)
    return (2.0 * size[0], 2.0 * size[0], 2.0 * size[0] if kind == "sphere" else size[1])
