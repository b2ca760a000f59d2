"""ROS message definitions, and fast encoding of many messages of one type as CDR bytes.

Definitions: ros2/common_interfaces, ros2/geometry2 and ros2/rcl_interfaces, branch humble, without comments and
constants. They are written into every file, so that a reader needs no ROS. ROS 1 has the same types but for
:data:`ROS1_DEFINITIONS`.

Bytes: OMG DDS-XTypes 1.3, section 7.4.3: plain CDR version 1, little endian: primitives lie at multiples of their size,
counted behind the four bytes of the encapsulation header; texts have their length and a closing zero. Within a channel
texts and the lengths of lists stay, so that every message has its numbers at the same places: a template is laid out
once, and the numbers are copied into its copies column by column. The serializers of rosbags and mcap-ros2-support make
one message at a time, 20 times slower. Messages of ROS 1 are the same fields without padding, header and closing zeros
(wiki.ros.org/ROS/Connection Header, msg).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.log.log_columns import Column

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
"""Type, without the ``/msg/`` in its name, -> its fields."""

ROS1_DEFINITIONS: Mapping[str, str] = {
    **DEFINITIONS,
    "std_msgs/Header": "uint32 seq\nbuiltin_interfaces/Time stamp\nstring frame_id",
    "visualization_msgs/Marker": (
        "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n"
        "geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\n"
        "bool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\nstring text\n"
        "string mesh_resource\nbool mesh_use_embedded_materials"
    ),
}
"""The same for ROS 1 (branch noetic): its header counts, its markers have fewer fields."""

_MARKERS = "ARROW CUBE SPHERE CYLINDER LINE_STRIP LINE_LIST CUBE_LIST SPHERE_LIST POINTS TEXT_VIEW_FACING MESH_RESOURCE"

_ACTIONS = (("ADD", 0), ("MODIFY", 0), ("DELETE", 2), ("DELETEALL", 3))

ROS1_CONSTANTS: Mapping[str, str] = {
    "visualization_msgs/Marker": "\n".join(
        f"uint8 {name}={value}"
        for name, value in (*((name, i) for i, name in enumerate([*_MARKERS.split(), "TRIANGLE_LIST"])), *_ACTIONS)
    )
}
"""Constants of a ROS 1 type, which its checksum covers."""

FLIGHT = "skyarm_msgs/Flight"
"""Type of our own: every number of a log at one control instant, a field a column."""

LINE = "=" * 80


def full_name(kind: str) -> str:
    """Full name of a message type in ROS 2: ``std_msgs/msg/Header``."""
    package, _, name = kind.partition("/")
    return f"{package}/msg/{name}"


def flight_definition(columns: Sequence[Column]) -> str:
    """Definition of the ROS message that holds all columns of a log, with units as comments."""
    width = max(len(each.name) for each in columns)
    rows = ((each.name, ", ".join(filter(None, (each.unit, each.meaning)))) for each in columns)
    return "\n".join(f"float64 {name:{width}} # {words}" if words else f"float64 {name}" for name, words in rows)


def definition(kind: str, definitions: Mapping[str, str]) -> str:
    """Definition of a ROS message type followed by those of its nested types, as MCAP requires."""
    found = list(dict.fromkeys(_inner(kind, definitions)))
    parts = (f"{LINE}\nMSG: {each}\n{definitions[each]}\n" for each in found)
    return "".join([f"{definitions[kind]}\n", *parts])


def _inner(kind: str, definitions: Mapping[str, str]) -> Iterator[str]:
    for part, _ in fields(definitions[kind]):
        inner = part.partition("[")[0]
        if inner in definitions:
            yield inner
            yield from _inner(inner, definitions)


def fields(text: str) -> list[tuple[str, str]]:
    """List type and name of each field in a ROS message definition."""
    lines = (line.partition("#")[0].split() for line in text.splitlines())
    return [(line[0], line[1]) for line in lines if line]


Bytes = npt.NDArray[np.uint8]
Values = Mapping[str, Any]

HEADER = b"\x00\x01\x00\x00"
"""Encapsulation: plain CDR, little endian."""

PRIMITIVES = {
    "bool": "|u1",
    "uint8": "|u1",
    "int8": "|i1",
    "uint16": "<u2",
    "int32": "<i4",
    "uint32": "<u4",
    "uint64": "<u8",
    "float32": "<f4",
    "float64": "<f8",
}

TIME = "builtin_interfaces/Time"

_TYPE = re.compile(r"([\w/]+)(?:\[(\d*)\])?")

NANO = 1_000_000_000


class Template:
    """Byte template of many ROS messages of one type, with offsets of the numbers that vary.

    Args:
        definitions: of the types.
        packed: bytes of ROS 1: no encapsulation, no padding, texts without a closing zero.
    """

    def __init__(self, definitions: Mapping[str, str], *, packed: bool = False) -> None:
        self._definitions, self._packed = definitions, packed
        self._bytes = bytearray(b"" if packed else HEADER)
        self._numbers: list[tuple[int, Any]] = []

    def record(self, kind: str, values: Values) -> None:
        """Append all fields of a message type to the template; missing values become zero or empty."""
        for part, name in fields(self._definitions[kind]):
            self._field(part, values.get(name))

    def _field(self, part: str, value: Any) -> None:
        match = _TYPE.fullmatch(part)
        assert match is not None
        kind, length = match.groups()
        if length is None:
            self._one(kind, value)
        elif kind in PRIMITIVES:
            self._list(kind, int(length) if length else None, value)
        else:
            items = list(value or ())
            self._numbers_at("<u4", len(items))
            for item in items:
                self._one(kind, item)

    def _one(self, kind: str, value: Any) -> None:
        if kind == "string":
            content = (value or "").encode() + (b"" if self._packed else b"\0")
            self._numbers_at("<u4", len(content))
            self._bytes += content
        elif kind in PRIMITIVES:
            self._numbers_at(PRIMITIVES[kind], 0 if value is None else value)
        elif kind == TIME and value is not None:
            self._numbers_at("<i4", np.asarray(value) // NANO)
            self._numbers_at("<u4", np.asarray(value) % NANO)
        else:
            self.record(kind, value or {})

    def _list(self, kind: str, length: int | None, value: Any) -> None:
        """Append a list of numbers to the template: (k,) for all messages, or (N, k)."""
        given = np.zeros(length or 0) if value is None else np.asarray(value)
        if length is None:
            self._numbers_at("<u4", given.shape[-1])
        if given.shape[-1]:
            self._numbers_at(PRIMITIVES[kind], given, row=True)

    def _numbers_at(self, form: str, value: Any, row: bool = False) -> None:
        """Append a number or list to the template: its bytes if constant, else a gap to be filled per message."""
        array, size = np.asarray(value).astype(form, copy=False), int(form[2:])
        if not self._packed:
            self._bytes += bytes(-(len(self._bytes) - len(HEADER)) % size)
        if array.ndim == int(row):
            self._bytes += array.tobytes()
            return
        columns = array if row else array[:, None]
        self._numbers.append((len(self._bytes), columns))
        self._bytes += bytes(size * columns.shape[1])

    def messages(self, count: int) -> Bytes:
        """Return all encoded messages as bytes (count, size)."""
        rows = np.empty((count, len(self._bytes)), dtype=np.uint8)
        rows[:] = np.frombuffer(bytes(self._bytes), dtype=np.uint8)
        for start, array in self._numbers:
            content = np.ascontiguousarray(array).view(np.uint8)
            rows[:, start : start + content.shape[1]] = content
        return rows


def encode(kind: str, definitions: Mapping[str, str], values: Values, count: int, *, packed: bool = False) -> Bytes:
    """Encode many ROS messages of one type as CDR bytes, or as those of ROS 1.

    Args:
        kind: key of ``definitions``.
        definitions: of it and of all types in it.
        values: fields by name: texts and lists of texts as they are; numbers for all messages, or arrays (count,), and
            (count, k) for lists of numbers; records as tables in turn; a Time in ns. What is left out is zero.
        count: of messages.
        packed: bytes of ROS 1.

    Returns:
        (count, size): the bytes of each.
    """
    template = Template(definitions, packed=packed)
    template.record(kind, values)
    return template.messages(count)
