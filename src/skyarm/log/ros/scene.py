"""Coordinate frames and shapes of a vehicle as ROS transforms and markers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Protocol

import numpy as np

from skyarm.algebra import Scalar
from skyarm.dynamics.kinematics import every_joint, joint_placement
from skyarm.log.log_columns import Arrays
from skyarm.log.ros.message_bytes import NANO, Values
from skyarm.records.arrays import Array, IntArray
from skyarm.records.files.names import distinct
from skyarm.records.immutable import positional
from skyarm.vehicle import BASE, Vehicle
from skyarm.vehicle.description import turn_onto
from skyarm.world.scene.vehicle_shapes import matrices, quaternions_of, vehicle_shapes


class TimedArrays(Arrays, Protocol):
    """Interface of a flight's arrays by name at some instants: a log, or the latest
    instant of a running flight.
    """

    @property
    def time(self) -> Array:
        """Times (s) of the instants at which a flight's arrays are given, (N,)."""


class LogSection:
    """Selected control instants of a flight log, from which ROS messages are made.

    Args:
        log: log of the flight.
        chosen: its instants.
        within: beginning of the names of all arrays that are read, such as ``left/`` of
            one of several vehicles.
        epoch: ns, time stamp of the start of the flight.
    """

    def __init__(
        self, log: TimedArrays, chosen: slice, within: str = "", epoch: int = 0
    ) -> None:
        self.log, self._chosen, self._within, self._epoch = log, chosen, within, epoch
        self.stamps = nanoseconds(log.time[chosen]) + epoch

    def __getitem__(self, array: str) -> Array:
        """Array of a log by name, at the selected control instants."""
        return self.log[f"{self._within}{array}"][self._chosen]

    def of(self, within: str) -> LogSection:
        """The same instants of one of several vehicles, by the beginning of its arrays'
        names.
        """
        return LogSection(self.log, self._chosen, within, self._epoch)

    def header(self, frame: str, time: Array | None = None) -> Values:
        """Fields of a std_msgs/Header: time stamps and frame name."""
        stamps = (
            self.stamps
            if time is None
            # a reading that has not come has no time; its stamp is zero
            else nanoseconds(np.nan_to_num(time)) + self._epoch
        )
        return {"stamp": stamps, "frame_id": frame}


@positional
class Topic:
    """ROS topic of a log, or of a camera or lidar: name, message type, rate, and the
    function that fills the messages.

    Attributes:
        name, kind: name of the topic, and type of its messages.
        every: control instants, or pictures, from one message to the next; 0 for one
            message at the beginning.
        values: part of a log, or picture -> fields of its messages.
        offset: instant of the first message, below ``every``.
    """

    name: str
    kind: str
    every: int
    values: Callable[[Any], Values]
    offset: int = 0


def nanoseconds(time: Array) -> IntArray:
    """Convert times in s to integer ns."""
    return np.rint(np.asarray(time) * NANO).astype(np.int64)


WORLD, BASE_LINK, BASE_REFERENCE = "world", "base_link", "base_reference"


class Frames:
    """Unique ROS frame names of a vehicle's links, named frames and rotors.

    Attributes:
        links: name of each link. named: name of each named frame. rotors: name of each
            rotor's frame.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        links = [link.name for link in vehicle.moving]
        named = [frame.name for frame in vehicle.frames]
        rotors = [
            f"rotor_{rotor.name.removeprefix('rotor').lstrip('_') or rotor.name}"
            for rotor in vehicle.rotors
        ]
        # the three reserved names stay out of the vehicle's
        every = distinct([WORLD, BASE_LINK, BASE_REFERENCE, *links, *named, *rotors])[
            3:
        ]
        self._vehicle = vehicle
        self.links = every[: len(links)]
        self.named = every[len(links) : len(links) + len(named)]
        self.rotors = every[len(links) + len(named) :]

    def of_body(self, body: int) -> str:
        """ROS frame name of a link, or of the base."""
        return BASE_LINK if body == BASE else self.links[body]

    def moving(self, stamps: IntArray | int, joints: Array) -> list[Values]:
        """Fields of ROS transform messages from each link to its parent, for many
        instants.
        """
        transforms = []
        values = every_joint(self._vehicle, list(joints.T))
        for i, link in enumerate(self._vehicle.moving):
            pose = joint_placement(link.joint, values[i])
            parent = self.of_body(link.parent)
            transforms.append(
                transform(
                    stamps,
                    parent,
                    self.links[i],
                    pose.p,
                    quaternions_of(matrices(pose.R, len(joints))),
                )
            )
        return transforms

    def fixed_transforms(self) -> list[Values]:
        """Fields of ROS transform messages for named frames and rotor hubs, which are
        constant.
        """
        transforms = []
        for name, frame in zip(self.named, self._vehicle.frames, strict=True):
            turn = quaternions_of(matrices(frame.rotation, 1))[0]
            transforms.append(
                transform(0, self.of_body(frame.link), name, frame.position, turn)
            )
        for name, rotor in zip(self.rotors, self._vehicle.rotors, strict=True):
            transforms.append(
                transform(
                    0,
                    BASE_LINK,
                    name,
                    rotor.position,
                    quaternions_of(np.array([turn_onto(rotor.axis)]))[0],
                )
            )
        return transforms


def transform(
    stamps: IntArray | int,
    parent: str,
    child: str,
    position: Iterable[Scalar],
    wxyz: Array,
) -> Values:
    """Fields of a geometry_msgs/TransformStamped, for many instants or a constant
    one.
    """
    return {
        "header": {"stamp": stamps, "frame_id": parent},
        "child_frame_id": child,
        "transform": {"translation": xyz(position), "rotation": quaternion(wxyz)},
    }


def xyz(vector: Array | Iterable[Scalar]) -> Values:
    """Message fields x, y, z of a vector: (3,), (N, 3) or a record of three."""
    parts = vector.T if isinstance(vector, np.ndarray) else list(vector)
    return dict(zip("xyz", parts, strict=True))


def quaternion(wxyz: Array) -> Values:
    """Message fields x, y, z, w of a quaternion wxyz, (4,) or (N, 4)."""
    return dict(zip("wxyz", wxyz.T, strict=True))


COLORS = {
    "hull": (0.23, 0.27, 0.33, 1.0),
    "boom": (0.23, 0.27, 0.33, 1.0),
    "rotor": (0.35, 0.55, 0.80, 0.45),
    "link": (0.80, 0.48, 0.16, 1.0),
    "joint": (0.25, 0.25, 0.25, 1.0),
    "tip": (0.75, 0.15, 0.20, 1.0),
}
"""Role of a vehicle's shape -> red, green, blue, opacity."""

MARKER_TYPES = {"box": 1, "sphere": 2, "ellipsoid": 2}
"""Kind of a shape -> type of a marker: cube or sphere by lengths or diameters; a
capsule is drawn as its cylinder, 3."""


def markers(vehicle: Vehicle, frames: Frames) -> list[Values]:
    """Fields of a visualization_msgs/Marker for each shape of a vehicle."""
    fields: list[Values] = []
    for number, shape in enumerate(vehicle_shapes(vehicle, meshes=False)):
        turn = quaternions_of(np.array([shape.rotation]))[0]
        lengths = [2.0 * half for half in shape.size]
        # their size is radius and whole length; other shapes state half lengths
        if shape.kind in ("capsule", "cylinder"):
            lengths = [lengths[0], lengths[0], shape.size[1]]
        fields.append(
            {
                "header": {"stamp": 0, "frame_id": frames.of_body(shape.body)},
                "ns": shape.name,
                "id": number,
                # 3 is a cylinder, also for a capsule, for which ROS has no marker
                "type": MARKER_TYPES.get(shape.kind, 3),
                "pose": {
                    "position": xyz(shape.position),
                    "orientation": quaternion(turn),
                },
                "scale": xyz(lengths if len(lengths) == 3 else 3 * lengths),
                "color": dict(
                    zip("rgba", COLORS.get(shape.role, COLORS["hull"]), strict=True)
                ),
                "frame_locked": True,
            }
        )
    return fields
