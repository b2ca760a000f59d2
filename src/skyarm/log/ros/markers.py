"""The shapes that stand for a vehicle in every picture, as markers that viewers of ROS draw."""

from __future__ import annotations

from typing import Any

import numpy as np

from skyarm.drawing.shapes import Shape
from skyarm.drawing.vehicle_shapes import vehicle_shapes
from skyarm.log.ros.frame_transforms import Frames, of_matrices, quaternion, xyz
from skyarm.vehicle.vehicle_records import Vehicle

SPHERE, CYLINDER = 2, 3
"""Marker's types: an ellipsoid and a cylinder along z, both by their diameters."""

COLORS = {
    "hull": (0.23, 0.27, 0.33, 1.0),
    "boom": (0.23, 0.27, 0.33, 1.0),
    "rotor": (0.35, 0.55, 0.80, 0.45),
    "link": (0.80, 0.48, 0.16, 1.0),
    "joint": (0.25, 0.25, 0.25, 1.0),
    "tip": (0.75, 0.15, 0.20, 1.0),
}
"""Role of a shape -> red, green, blue, opacity."""


def markers(vehicle: Vehicle, frames: Frames) -> list[dict[str, Any]]:
    """A visualization_msgs/Marker for each shape, fixed to the frame of its body."""
    return [_marker(i, shape, frames) for i, shape in enumerate(vehicle_shapes(vehicle, meshes=False))]


def _marker(number: int, shape: Shape, frames: Frames) -> dict[str, Any]:
    turn = of_matrices(np.array([shape.rotation]))[0]
    return {
        "header": {"stamp": 0, "frame_id": frames.of_body(shape.body)},
        "ns": shape.name,
        "id": number,
        "type": SPHERE if shape.kind in ("ellipsoid", "sphere") else CYLINDER,
        "pose": {"position": xyz(np.array(shape.position)), "orientation": quaternion(turn)},
        "scale": xyz(_diameters(shape)),
        "color": dict(zip("rgba", COLORS.get(shape.role, COLORS["hull"]), strict=True)),
        "frame_locked": True,
    }


def _diameters(shape: Shape) -> tuple[float, float, float]:
    """Extents along the shape's axes, m; of a capsule those of its cylinder."""
    if shape.kind == "ellipsoid":
        x, y, z = shape.size
        return (2.0 * x, 2.0 * y, 2.0 * z)
    across = 2.0 * shape.size[0]
    return (across, across, across if shape.kind == "sphere" else shape.size[1])
