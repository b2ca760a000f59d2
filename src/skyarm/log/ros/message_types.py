"""Definitions of the messages that a flight is written as, in the language of ROS 2's .msg files.

Source: ros2/common_interfaces, ros2/geometry2 and ros2/rcl_interfaces, branch humble; comments and constants left out.
They are written into every file, so that a reader needs no ROS.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from skyarm.log.log_columns import Column

DEFINITIONS: Mapping[str, str] = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "std_msgs/Float64": "float64 data",
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
    "geometry_msgs/Vector3Stamped": "std_msgs/Header header\ngeometry_msgs/Vector3 vector",
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
}
"""Type, without the ``/msg/`` in its name, -> its fields."""

ROS1: Mapping[str, str] = {
    "std_msgs/Header": "uint32 seq\nbuiltin_interfaces/Time stamp\nstring frame_id",
    "visualization_msgs/Marker": (
        "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n"
        "geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\n"
        "bool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\n"
        "string text\nstring mesh_resource\nbool mesh_use_embedded_materials"
    ),
}
"""Types that ROS 1 has otherwise (branch noetic); times are primitives there, of the same bytes."""

FLIGHT = "skyarm_msgs/Flight"
"""Type of our own: every number of a log at one control instant, a field a column."""

LINE = "=" * 80


def full_name(kind: str) -> str:
    """A type's name as ROS 2 files have it: ``std_msgs/msg/Header``."""
    package, _, name = kind.partition("/")
    return f"{package}/msg/{name}"


def flight_definition(columns: Sequence[Column]) -> str:
    """Definition of FLIGHT, whose comments say units and meaning."""
    width = max(len(each.name) for each in columns)
    rows = ((each.name, ", ".join(filter(None, (each.unit, each.meaning)))) for each in columns)
    return "\n".join(f"float64 {name:{width}} # {words}" if words else f"float64 {name}" for name, words in rows)


def definition(kind: str, definitions: Mapping[str, str]) -> str:
    """A type's definition and behind it those of the types in it, as MCAP's encoding ``ros2msg`` wants them."""
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
    """(type, name) of each field of a definition."""
    lines = (line.partition("#")[0].split() for line in text.splitlines())
    return [(line[0], line[1]) for line in lines if line]
