"""Frames of a vehicle for tf: the base in the world, each link in its parent, and what is fixed to them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Mat3, Vec3
from skyarm.drawing.shapes import turn_onto
from skyarm.dynamics.kinematics import every_joint, joint_placement
from skyarm.log.log_columns import distinct
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]

WORLD, BASE_LINK, BASE_REFERENCE = "world", "base_link", "base_reference"


class Frames:
    """Names of a vehicle's frames: unique, those of the world and the base among them.

    Attributes:
        links: name of each link. named: name of each named frame. rotors: name of each rotor's frame.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        links = [link.name for link in vehicle.moving]
        named = [frame.name for frame in vehicle.frames]
        rotors = [f"rotor_{rotor.name.removeprefix('rotor').lstrip('_') or rotor.name}" for rotor in vehicle.rotors]
        every = distinct([WORLD, BASE_LINK, BASE_REFERENCE, *links, *named, *rotors])[3:]
        self._vehicle = vehicle
        self.links = every[: len(links)]
        self.named = every[len(links) : len(links) + len(named)]
        self.rotors = every[len(links) + len(named) :]

    def of_body(self, body: int) -> str:
        """Frame of a link, or of the base."""
        return BASE_LINK if body == BASE else self.links[body]

    def moving(self, stamps: Any, joints: Array) -> list[dict[str, Any]]:
        """Transform of each link against its parent."""
        found = []
        values = every_joint(self._vehicle, list(joints.T))
        for i, link in enumerate(self._vehicle.moving):
            pose = joint_placement(link.joint, values[i])
            parent = self.of_body(link.parent)
            found.append(transform(stamps, parent, self.links[i], pose.p, of_matrices(_turns(pose.R, len(joints)))))
        return found

    def fixed(self) -> list[dict[str, Any]]:
        """Transforms of named frames and of the rotors' hubs, whose z is the axis of positive thrust."""
        found = []
        for name, frame in zip(self.named, self._vehicle.frames, strict=True):
            turn = of_matrices(_turns(frame.rotation, 1))[0]
            found.append(transform(0, self.of_body(frame.link), name, frame.position, turn))
        for name, rotor in zip(self.rotors, self._vehicle.rotors, strict=True):
            found.append(transform(0, BASE_LINK, name, rotor.position, of_matrices(_upright(rotor.axis))[0]))
        return found


def transform(stamps: Any, parent: str, child: str, position: Iterable[Any], wxyz: Any) -> dict[str, Any]:
    """A geometry_msgs/TransformStamped of many instants, or of none in particular."""
    return {
        "header": {"stamp": stamps, "frame_id": parent},
        "child_frame_id": child,
        "transform": {"translation": xyz(position), "rotation": quaternion(wxyz)},
    }


def xyz(vector: Any) -> dict[str, Any]:
    """A vector, (3,) or (N, 3), or a record of three, as fields."""
    parts = vector.T if isinstance(vector, np.ndarray) else list(vector)
    return dict(zip("xyz", parts, strict=True))


def quaternion(wxyz: Array) -> dict[str, Any]:
    """A quaternion wxyz, (4,) or (N, 4), as fields of ROS, whose order is xyzw."""
    return dict(zip("wxyz", wxyz.T, strict=True))


def _turns(R: Mat3, count: int) -> Array:
    """Matrices (N, 3, 3) of a rotation whose entries are numbers or arrays."""
    return np.array([[np.broadcast_to(np.asarray(c, dtype=float), (count,)) for c in row] for row in R.rows]).transpose(
        2, 0, 1
    )


def _upright(axis: Vec3) -> Array:
    """A rotation (1, 3, 3) that turns z onto an axis."""
    return np.array([turn_onto((float(axis.x), float(axis.y), float(axis.z)))])


def of_matrices(R: Array) -> Array:
    """Quaternions wxyz (N, 4) of rotation matrices, from the largest of their four components.

    Source: Shepperd 1978, Quaternion from rotation matrix.
    """
    xx, yy, zz = R[:, 0, 0], R[:, 1, 1], R[:, 2, 2]
    squares = np.stack([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz], axis=1)
    a, b, c = R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]
    d, e, f = R[:, 1, 0] + R[:, 0, 1], R[:, 0, 2] + R[:, 2, 0], R[:, 2, 1] + R[:, 1, 2]
    w, x, y, z = squares.T
    products = np.array([[w, a, b, c], [a, x, d, e], [b, d, y, f], [c, e, f, z]]).transpose(2, 0, 1)
    found: Array = products[np.arange(len(R)), squares.argmax(axis=1)]
    unit: Array = found / np.linalg.norm(found, axis=1, keepdims=True)
    return unit
