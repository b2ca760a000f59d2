"""ROS topics of a flight: message types, rates and contents.

Every number of the log stands at each control instant in ``/skyarm/flight``, from which
a log is read back to the bit. Base and joints are written at 200 Hz as viewers know
them, frames, shapes, reference and tip at 50 Hz. Of several vehicles, topics and frames
begin with the vehicle's name, as ``/left/odom`` and ``left/base_link``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import cast

import numpy as np

from skyarm.algebra.frames import of_euler_angles, to_base, unit_rows
from skyarm.log.flight_log import Log
from skyarm.log.flown_scenario import restored_at
from skyarm.log.log_columns import Names, columns, names_of, word
from skyarm.log.ros.message_bytes import Bytes, Value, Values, encode
from skyarm.log.ros.messages import DEFINITIONS, FLIGHT, flight_definition
from skyarm.log.ros.pictures import OPTICAL, cameras_of, picture_topics
from skyarm.log.ros.scene import (
    BASE_LINK,
    BASE_REFERENCE,
    WORLD,
    Frames,
    LogSection,
    Topic,
    markers,
    quaternion,
    transform,
    xyz,
)
from skyarm.log.sensor_data import COMPONENTS, ESTIMATE, Source, sources_of
from skyarm.log.team_log import SHARED, WITHIN
from skyarm.log.tip_positions import yaw_quaternion
from skyarm.records.arrays import Array, IntArray
from skyarm.records.files.names import distinct
from skyarm.vehicle import Vehicle
from skyarm.world.scene.vehicle_shapes import matrices, quaternions_of

FAST, SLOW = 200.0, 50.0
"""Rates (Hz) of messages of base and joints, and of the others; a slower control writes
each of its instants."""

FLIGHT_TOPIC, CLOCK = "/skyarm/flight", "/clock"

EPOCH = "epoch"
"""Key of a log's description with the Unix time (s) of the start of the flight, from
which time stamps count."""

MARKERS = "visualization_msgs/MarkerArray"

TRANSFORMS = ("/tf", "/tf_static")
"""Topics of the transforms between all frames, of which there is one for all
vehicles."""

FRAMES = ("frame_id", "child_frame_id")
"""Fields of a message with the name of a frame."""


class FlightTopics:
    """All ROS topics of a log, with the encoder of their messages.

    Args:
        log: log of the flight, or its first part.

    Attributes:
        topics: in the order in which they are written at an instant.
        pictures: topics of each camera and lidar, which are filled from its pictures.
        definitions: of all message types.
        period: instants after which the pattern of messages begins again.
    """

    def __init__(self, log: Log) -> None:
        every = columns(log)
        self.definitions: dict[str, str] = {
            **DEFINITIONS,
            FLIGHT: flight_definition(every),
        }
        self.period = period_of(log)
        self._epoch = round(float(log.info.get(EPOCH, 0.0)) * 1e9)

        def row(part: LogSection) -> Values:
            return {each.name: each.of(part) for each in every}

        shared = log.info.get(SHARED, ())
        own = {name: _agent_topics(each, shared) for name, each in log.agents.items()}
        first = next(iter(log.agents.values()))
        self.topics = (
            Topic(FLIGHT_TOPIC, FLIGHT, 1, row),
            Topic(CLOCK, "rosgraph_msgs/Clock", 1, lambda part: {"clock": part.stamps}),
            *topics_of_all(own),
            *_sensor_topics(
                first, lambda source, field: source == COMPONENTS and field in shared
            ),
        )
        self.pictures = picture_topics(log, self._epoch)

    def encode(self, topic: Topic, log: Log) -> tuple[IntArray, Bytes]:
        """Encode the ROS messages of one topic from some instants of a flight; return
        their times (ns) and bytes.

        Args:
            topic: one of :attr:`topics`; one without a rate is written at the part's
                first instant.
            log: the part, which begins at a multiple of :attr:`period`.
        """
        # a topic without a rate is written once, at the first instant
        chosen = slice(topic.offset, None, topic.every) if topic.every else slice(0, 1)
        part = LogSection(log, chosen, epoch=self._epoch)
        with np.errstate(all="ignore"):
            values = topic.values(part)
        return part.stamps, encode(
            topic.kind, self.definitions, values, len(part.stamps)
        )


def _agent_topics(log: Log, shared: Collection[str]) -> list[Topic]:
    """ROS topics of one vehicle, without the arrays of environment models that all
    vehicles share.
    """
    names, (fast, slow) = names_of(log), every_of(log)
    # setpoints of drives are no torques
    efforts = [] if any(names.setpoints) else ["efforts"]
    return [
        _topic(
            "/odom",
            ODOMETRY,
            fast,
            {name: name for name in BASE_SIZES},
            {"child_frame_id": BASE_LINK},
        ),
        *_joints(
            "/joint_states",
            fast,
            names,
            {name: name for name in ("joints", "joint_rates", *efforts)},
        ),
        *_transforms(slow, vehicle_of(log), log),
        Topic("/reference/base", "geometry_msgs/PoseStamped", slow, _reference),
        _topic("/reference/tip", POINT, slow, {"position": "tool_reference"}, {}),
        _topic("/tip", POINT, slow, {"position": "tool"}, {}),
        *_sensor_topics(
            log, lambda source, field: source != COMPONENTS or field not in shared
        ),
    ]


def topics_of_all(topics: Mapping[str, Iterable[Topic]]) -> Iterator[Topic]:
    """Topics of all vehicles, given for each as if it flew alone; names and frames of
    several begin with its name.
    """
    for agent, own in topics.items():
        # one vehicle has the usual names of ROS without a namespace, as viewers expect
        # them
        yield from (_of_agent(each, agent) for each in own) if len(topics) > 1 else own


def namespace_of(agents: Collection[str], agent: str) -> str:
    """Beginning of the names of a vehicle's topics, given all vehicles; empty for the
    only one.
    """
    # programs of ROS expect the topics of a single vehicle without a namespace
    return f"/{agent}" if len(agents) > 1 else ""


def _of_agent(topic: Topic, agent: str) -> Topic:
    """Topic of one of several vehicles: its name and its frames begin with the
    vehicle's.
    """
    name = topic.name if topic.name in TRANSFORMS else f"/{agent}{topic.name}"
    return replace(
        topic,
        name=name,
        values=lambda part: cast(
            "Values", _in_frames(topic.values(part.of(f"{agent}{WITHIN}")), agent)
        ),
    )


def _in_frames(value: Value, agent: str, field: str = "") -> Value:
    """Field of a message, or a whole one, whose frames, other than the world's, begin
    with the name of a vehicle.
    """
    if isinstance(value, Mapping):
        return {name: _in_frames(each, agent, name) for name, each in value.items()}
    if isinstance(value, list):
        return [_in_frames(each, agent) for each in value]
    return f"{agent}/{value}" if field in FRAMES and value not in ("", WORLD) else value


def _reference(part: LogSection) -> Values:
    """Fields of the PoseStamped messages of the base's reference."""
    pose = _pose(part["position_reference"], yaw_quaternion(part["yaw_reference"]))
    return {"header": part.header(WORLD), "pose": pose}


def vehicle_of(log: Log) -> Vehicle | None:
    """Vehicle of a log's plant; None if it cannot be restored."""
    # a vehicle of another size than the arrays belongs to a damaged log
    vehicle = restored_at(log.info, "plant.vehicle")
    shape = log.joints.shape[1], log.rotor_speeds.shape[1]
    return (
        vehicle
        if isinstance(vehicle, Vehicle) and (vehicle.n, len(vehicle.rotors)) == shape
        else None
    )


def every_of(log: Log) -> tuple[int, int]:
    """Number of control instants from one ROS message to the next: for fast topics
    (base, joints) and slow ones.
    """
    rate = float(log.info["rates_hz"]["control"])
    fast = max(1, round(rate / FAST))
    # slow topics at a multiple of the fast ones, so that both meet
    return fast, fast * max(1, round(rate / fast / SLOW))


def period_of(log: Log) -> int:
    """Number of control instants after which the pattern of due ROS messages
    repeats.
    """
    sensors = (
        each for own in log.agents.values() for each in sources_of(own.info).values()
    )
    # after the common multiple every topic is due again
    return math.lcm(every_of(log)[1], *(each.every for each in sensors))


def _transforms(every: int, vehicle: Vehicle | None, log: Log) -> list[Topic]:
    frames = None if vehicle is None else Frames(vehicle)

    def moving(part: LogSection) -> Values:
        goal = yaw_quaternion(part["yaw_reference"])
        base = transform(
            part.stamps,
            WORLD,
            BASE_LINK,
            part["position"],
            unit_rows(part["quaternion"]),
        )
        reference = transform(
            part.stamps, WORLD, BASE_REFERENCE, part["position_reference"], goal
        )
        links = [] if frames is None else frames.moving(part.stamps, part["joints"])
        return {"transforms": [base, reference, *links]}

    topics = [Topic("/tf", "tf2_msgs/TFMessage", every, moving)]
    if frames is None or vehicle is None:
        return topics
    optical = [
        transform(
            0,
            frames.of_body(each.sensor.body_of(vehicle)),
            f"{called}{OPTICAL}",
            each.sensor.position,
            quaternions_of(matrices(each.sensor.rotation, 1))[0],
        )
        for called, each in cameras_of(log).items()
    ]
    fixed = {"transforms": [*frames.fixed_transforms(), *_mounts(log), *optical]}
    drawn = {"markers": markers(vehicle, frames)}
    return [
        Topic("/tf_static", "tf2_msgs/TFMessage", 0, lambda _: fixed),
        Topic("/vehicle", MARKERS, 0, lambda _: drawn),
        *topics,
    ]


Fields = Mapping[str, Array]
"""Values of a reading by field."""

ODOMETRY, POINT, JOINTS, OWN = (
    "nav_msgs/Odometry",
    "geometry_msgs/PointStamped",
    "sensor_msgs/JointState",
    "skyarm_msgs/Reading",
)

BASE_SIZES = {"position": 3, "quaternion": 4, "velocity": 3, "rate": 3}
"""Number of components of the fields that form an odometry."""

JOINT_FIELDS = {"joints": "position", "joint_rates": "velocity", "efforts": "effort"}
"""Array -> its field in a sensor_msgs/JointState."""


def _odometry(read: Fields) -> Values:
    attitude = unit_rows(read["quaternion"])
    twist = {
        # ROS has a twist in the axes of the child frame, the log in those of the world
        "linear": xyz(to_base(attitude, read["velocity"])),
        "angular": xyz(read["rate"]),
    }
    return {
        "pose": {"pose": _pose(read["position"], attitude)},
        "twist": {"twist": twist},
    }


def _imu(read: Fields) -> Values:
    unknown = np.array([-1.0, *8 * [0.0]])  # no orientation is read
    rate, force = xyz(read["rate"]), xyz(read["specific_force"])
    return {
        "orientation_covariance": unknown,
        "angular_velocity": rate,
        "linear_acceleration": force,
    }


MESSAGES: Mapping[str, tuple[str, Mapping[str, int], Callable[[Fields], Values]]] = {
    "sensor_msgs/Imu": (BASE_LINK, {"rate": 3, "specific_force": 3}, _imu),
    "geometry_msgs/PoseStamped": (
        WORLD,
        {"position": 3, "quaternion": 4},
        lambda read: {"pose": _pose(read["position"], read["quaternion"])},
    ),
    POINT: (WORLD, {"position": 3}, lambda read: {"point": xyz(read["position"])}),
    "geometry_msgs/WrenchStamped": (
        WORLD,
        {"force": 3, "torque": 3},
        lambda read: {"wrench": {field: xyz(array) for field, array in read.items()}},
    ),
    ODOMETRY: (WORLD, BASE_SIZES, _odometry),
    JOINTS: (
        "",
        {},
        lambda read: {JOINT_FIELDS[field]: array for field, array in read.items()},
    ),
    OWN: ("", {}, lambda read: {"value": np.column_stack(list(read.values()))}),
}
"""Message type -> its frame, number of components of each source field, and its
fields."""


def _topic(
    name: str,
    kind: str,
    every: int,
    arrays: Mapping[str, str],
    fixed: Values,
    *,
    offset: int = 0,
    time: str = "",
    frame: str | None = None,
) -> Topic:
    """Make a ROS topic whose messages are filled from arrays of the log.

    Args:
        name: name of the topic.
        kind: type of its messages.
        every: control instants from one message to the next.
        arrays: field that the message is made of -> array of the log.
        fixed: further fields of every message.
        offset: instant of the first message.
        time: array of the time stamps, s; the instants of the log if left out.
        frame: frame of the header, in place of the message's usual one.
    """
    usual, _, fields = MESSAGES[kind]

    def values(part: LogSection) -> Values:
        header = part.header(
            usual if frame is None else frame, part[time] if time else None
        )
        return {
            "header": header,
            **fixed,
            **fields({field: part[array] for field, array in arrays.items()}),
        }

    return Topic(name, kind, every, values, offset)


def _joints(
    name: str, every: int, names: Names, arrays: Mapping[str, str]
) -> list[Topic]:
    """Make a JointState topic from arrays of the log; empty for a vehicle without
    joints.
    """
    return (
        [_topic(name, JOINTS, every, arrays, {"name": names.joints})]
        if names.joints and arrays
        else []
    )


def _sensor_topics(log: Log, chosen: Callable[[str, str], bool]) -> list[Topic]:
    """Make the ROS topics of the estimate and of each sensor, of the fields that a
    function of both names chooses.
    """
    names, (fast, _) = names_of(log), every_of(log)
    # a source whose only field left is its time has nothing to send
    sources = {
        source: replace(
            each,
            fields={
                name: field
                for name, field in each.fields.items()
                if chosen(source, name)
            },
        )
        for source, each in sources_of(log.info).items()
    }
    sources = {
        name: each for name, each in sources.items() if set(each.fields) - {"time"}
    }
    topics: list[Topic] = []
    for name, (source, each) in zip(
        distinct([word(last_of(name)) for name in sources]),
        sources.items(),
        strict=True,
    ):
        if source == ESTIMATE:
            arrays = {
                array: f"{source}.{array}"
                for array in JOINT_FIELDS
                if array in each.fields
            }
            topics.append(_reading("/estimate/base", fast, 0, source, each, names))
            topics += _joints("/estimate/joints", fast, names, arrays)
        else:
            topics.append(
                _reading(f"/sensors/{name}", each.every, each.late, source, each, names)
            )
    return topics


def _reading(
    topic: str, every: int, offset: int, source: str, described: Source, names: Names
) -> Topic:
    """Make the ROS topic of a sensor or the estimate, with the standard message type
    that fits if there is one.
    """
    sizes = {field: len(each.axes or ()) for field, each in described.fields.items()}
    stamped = sizes.pop("time", 1) == 0
    kind = next(
        (kind for kind, (_, fitting, _) in MESSAGES.items() if fitting == sizes), OWN
    )
    # joints come in any number, so their message fits by the number of the vehicle
    if sizes == {"joints": len(names.joints), "joint_rates": len(names.joints)}:
        kind = JOINTS
    elif sizes.items() >= BASE_SIZES.items():
        kind = ODOMETRY
    endings = [
        f"{field}_{axis}".rstrip("_")
        for field in sizes
        for axis in described.fields[field].axes or [""]
    ]
    named: dict[str, Values] = {
        ODOMETRY: {"child_frame_id": f"base_{last_of(source)}"},
        JOINTS: {"name": names.joints},
        OWN: {"name": endings},
    }
    time = f"{source}.time" if stamped else ""
    arrays = {field: f"{source}.{field}" for field in sizes}
    frame = described.frame if described.mount is None else mount_frame(source)
    return _topic(
        topic,
        kind,
        every,
        arrays,
        named.get(kind, {}),
        offset=offset,
        time=time,
        frame=frame,
    )


def mount_frame(source: str) -> str:
    """Frame of a sensor beside the base origin: ``imu_link`` for a sensor ``imu``."""
    return f"{word(last_of(source))}_link"


def _mounts(log: Log) -> list[Values]:
    """Fields of ROS transform messages of the sensors beside the base origin."""
    sources = {
        name: each.mount for name, each in sources_of(log.info).items() if each.mount
    }
    turns = {
        name: np.array([*of_euler_angles(*mount[3:])])
        for name, mount in sources.items()
    }
    return [
        transform(0, BASE_LINK, mount_frame(name), mount[:3], turns[name])
        for name, mount in sources.items()
    ]


def last_of(source: str) -> str:
    """Last component of a source's dotted name: a sensor's name or ``estimate``."""
    return source.rpartition(".")[2]


def _pose(position: Array, wxyz: Array) -> Values:
    return {"position": xyz(position), "orientation": quaternion(wxyz)}
