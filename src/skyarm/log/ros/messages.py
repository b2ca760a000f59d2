"""ROS message types: definitions, field lists, and the MD5 checksums of ROS 1.

Definitions: ros2/common_interfaces, ros2/geometry2 and ros2/rcl_interfaces, branch humble, without comments and
constants. They are written into every file, so that a reader needs no ROS. ROS 1 has the same types but for
:data:`ROS1_DEFINITIONS`. Bytes are written and read by them in :mod:`skyarm.log.ros.message_bytes`.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

from skyarm.log.log_columns import LogColumn

DEFINITIONS: Mapping[str, str] = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "std_msgs/ColorRGBA": "float32 r\nfloat32 g\nfloat32 b\nfloat32 a",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance",
    "geometry_msgs/PointStamped": "std_msgs/Header header\ngeometry_msgs/Point point",
    "geometry_msgs/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose",
    "geometry_msgs/WrenchStamped": "std_msgs/Header header\ngeometry_msgs/Wrench wrench",
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform"
    ),
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "sensor_msgs/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort"
    ),
    "sensor_msgs/CompressedImage": "std_msgs/Header header\nstring format\nuint8[] data",
    "sensor_msgs/Imu": (
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance"
    ),
    "skyarm_msgs/Reading": "std_msgs/Header header\nstring[] name\nfloat64[] value",
    "nav_msgs/Odometry": (
        "std_msgs/Header header\nstring child_frame_id\n"
        "geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist"
    ),
    "visualization_msgs/UVCoordinate": "float32 u\nfloat32 v",
    "visualization_msgs/MeshFile": "string filename\nuint8[] data",
    "visualization_msgs/Marker": (
        "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n"
        "geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\n"
        "bool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\n"
        "string texture_resource\nsensor_msgs/CompressedImage texture\n"
        "visualization_msgs/UVCoordinate[] uv_coordinates\nstring text\nstring mesh_resource\n"
        "visualization_msgs/MeshFile mesh_file\nbool mesh_use_embedded_materials"
    ),
    "visualization_msgs/MarkerArray": "visualization_msgs/Marker[] markers",
    "rosgraph_msgs/Clock": "builtin_interfaces/Time clock",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride",
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset",
    "std_msgs/Float64MultiArray": "std_msgs/MultiArrayLayout layout\nfloat64[] data",
}
"""Message type, without ``/msg/`` in its name -> its fields."""

_BUILT_IN = {"builtin_interfaces/Time": "time", "builtin_interfaces/Duration": "duration"}
"""Types that ROS 1 defines without a package."""

_MARKERS = "ARROW CUBE SPHERE CYLINDER LINE_STRIP LINE_LIST CUBE_LIST SPHERE_LIST POINTS TEXT_VIEW_FACING MESH_RESOURCE"

_CONSTANTS = (
    *((name, number) for number, name in enumerate([*_MARKERS.split(), "TRIANGLE_LIST"])),
    *(("ADD", 0), ("MODIFY", 0), ("DELETE", 2), ("DELETEALL", 3)),
)
"""Constants of a marker, which its checksum covers in ROS 1."""

_DIFFERENT: Mapping[str, str] = {
    "std_msgs/Header": "uint32 seq\nbuiltin_interfaces/Time stamp\nstring frame_id",
    "visualization_msgs/Marker": "".join(f"uint8 {name}={number}\n" for name, number in _CONSTANTS)
    + (
        "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n"
        "geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\n"
        "bool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\nstring text\n"
        "string mesh_resource\nbool mesh_use_embedded_materials"
    ),
}
"""Types that differ in ROS 1 (noetic): its header has a counter, its markers have fewer fields."""

ROS1_DEFINITIONS: Mapping[str, str] = {
    _BUILT_IN.get(kind, kind): re.sub("|".join(_BUILT_IN), lambda match: _BUILT_IN[match[0]], text)
    for kind, text in {**DEFINITIONS, **_DIFFERENT}.items()
}
"""Message type of ROS 1 -> its fields, with the constants that a checksum covers."""

FLIGHT = "skyarm_msgs/Flight"
"""Message type of skyarm: every number of a log at one control instant, one field per column."""


class MessageField(NamedTuple):
    """Field of a ROS message: name, type, and list length (0 for a variable length, None for a single value)."""

    name: str
    kind: str
    length: int | None


_FIELD = re.compile(r"^([\w/]+)(\[(\d*)\])? +(\w+) *(?:#.*)?$", re.MULTILINE)


@lru_cache(maxsize=256)
def fields(text: str) -> tuple[MessageField, ...]:
    """Fields of a ROS message definition, without its constants."""
    rows = _FIELD.findall(text)
    return tuple(
        MessageField(name, kind, int(length or 0) if bracket else None) for kind, bracket, length, name in rows
    )


def full_name(kind: str) -> str:
    """Full name of a message type in ROS 2: ``std_msgs/msg/Header``."""
    package, _, name = kind.partition("/")
    return f"{package}/msg/{name}"


def flight_definition(columns: Sequence[LogColumn]) -> str:
    """Definition of the ROS message with all columns of a log, whose units are comments."""
    width = max(len(each.name) for each in columns)
    rows = ((each.name, ", ".join(filter(None, (each.unit, each.meaning)))) for each in columns)
    return "\n".join(f"float64 {name:{width}} # {words}" if words else f"float64 {name}" for name, words in rows)


def definition(kind: str, definitions: Mapping[str, str]) -> str:
    """Definition of a ROS message type followed by those of its nested types, as MCAP and ROS 1 require."""
    nested = dict.fromkeys(_nested_types(kind, definitions))
    parts = (f"{'=' * 80}\nMSG: {each}\n{definitions[each]}\n" for each in nested)
    return "".join([f"{definitions[kind]}\n", *parts])


def _nested_types(kind: str, definitions: Mapping[str, str]) -> Iterator[str]:
    for field in fields(definitions[kind]):
        if "/" in field.kind:
            yield field.kind
            yield from _nested_types(field.kind, definitions)


def checksum(kind: str, definitions: Mapping[str, str]) -> str:
    """MD5 checksum of a ROS 1 message type, by which two nodes compare their definitions.

    It is that of its constants and fields, where each nested type stands as its own checksum. Source: ROS/Technical
    Overview of wiki.ros.org, roslib/gentools.
    """
    rows = []
    for line in definitions[kind].splitlines():
        part, _, name = line.partition(" ")
        inner = part.partition("[")[0]
        rows.append(f"{checksum(inner, definitions) if '/' in inner else part} {name}")
    return hashlib.md5("\n".join(rows).encode(), usedforsecurity=False).hexdigest()
