"""ROS topics of a flight: message types, rates and contents.

Every number of the log stands at each control instant in ``/skyarm/flight``, from which a log is read back to the bit.
Base and joints are written at 200 Hz as viewers know them, frames, shapes, reference and tip at 50 Hz.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from skyarm.log.flight_log import Log
from skyarm.log.flown_scenario import restored_part
from skyarm.log.log_columns import Names, columns, names_of, word
from skyarm.log.ros.messages import DEFINITIONS, FLIGHT, Bytes, encode, flight_definition
from skyarm.log.ros.scene import (
    BASE_LINK,
    BASE_REFERENCE,
    WORLD,
    Frames,
    Part,
    markers,
    quaternion,
    transform,
    xyz,
)
from skyarm.log.sensor_data import ESTIMATE, Source, sources_of
from skyarm.log.tip_positions import yaw_quaternion
from skyarm.records.files.names import distinct
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]

FAST, SLOW = 200.0, 50.0
"""Hz: of base and joints; of the rest. Slower controls are written at each of their instants."""

HIGHEST = 1e6
"""Hz: no control is faster, and a log that says so is taken for one at FAST."""

FLIGHT_TOPIC = "/skyarm/flight"

MARKERS = "visualization_msgs/MarkerArray"


@dataclass(frozen=True, slots=True)
class Topic:
    """ROS topic: its message type, rate and content.

    Attributes:
        name, kind: of the topic and of its messages.
        every: control instants from one message to the next; 0 for one message at the beginning.
        values: part of a log -> fields of its messages.
        offset: instant of the first message, below ``every``.
    """

    name: str
    kind: str
    every: int
    values: Callable[[Part], Mapping[str, Any]]
    offset: int = 0


class FlightTopics:
    """All ROS topics of a flight.

    Args:
        log: of the flight, or its first part.

    Attributes:
        topics: in the order in which they are written at an instant.
        definitions: of all message types.
        period: instants after which the pattern of messages begins again.
    """

    def __init__(self, log: Log) -> None:
        self._columns = columns(log)
        self._names = names_of(log)
        self.definitions: dict[str, str] = {**DEFINITIONS, FLIGHT: flight_definition(self._columns)}
        fast, slow = every_of(log)
        self.period = period_of(log)
        self.topics = tuple(
            self._flight()
            + self._state(fast)
            + self._rest(slow, vehicle_of(log))
            + _sensor_topics(log, fast, self._names)
        )

    def encode(self, topic: Topic, log: Log) -> tuple[npt.NDArray[np.int64], Bytes]:
        """Times (ns) and encoded messages of a topic in a section of the flight.

        Args:
            topic: one of :attr:`topics`; one without a rate is written at the part's first instant.
            log: the part, which begins at a multiple of :attr:`period`.
        """
        chosen = slice(topic.offset, None, topic.every) if topic.every else slice(0, 1)
        part = Part(log, chosen)
        with np.errstate(all="ignore"):
            values = topic.values(part)
        return part.stamps, encode(topic.kind, self.definitions, values, len(part.stamps))

    def _flight(self) -> list[Topic]:
        def row(part: Part) -> dict[str, Any]:
            found = {}
            for column in self._columns:
                array = part[column.array]
                found[column.name] = array if column.index is None else array[:, column.index]
            return found

        return [Topic(FLIGHT_TOPIC, FLIGHT, 1, row)]

    def _state(self, every: int) -> list[Topic]:
        def odometry(part: Part) -> dict[str, Any]:
            velocity = part.in_base(part["velocity"])
            return {
                "header": part.header(WORLD),
                "child_frame_id": BASE_LINK,
                "pose": {"pose": _pose(part["position"], part.unit())},
                "twist": {"twist": {"linear": xyz(velocity), "angular": xyz(part["rate"])}},
            }

        moved = {"position": "joints", "velocity": "joint_rates"}
        if all(each is None for each in self._names.setpoints):  # setpoints of drives are no torques
            moved["effort"] = "efforts"
        return [
            Topic("/odom", "nav_msgs/Odometry", every, odometry),
            *_joints("/joint_states", every, self._names.joints, moved),
        ]

    def _rest(self, every: int, vehicle: Vehicle | None) -> list[Topic]:
        def reference(part: Part) -> dict[str, Any]:
            pose = _pose(part["position_reference"], yaw_quaternion(part["yaw_reference"]))
            return {"header": part.header(WORLD), "pose": pose}

        return [
            *_transforms(every, vehicle),
            Topic("/reference/base", "geometry_msgs/PoseStamped", every, reference),
            _point("/reference/tip", every, "tool_reference"),
            _point("/tip", every, "tool"),
        ]


def vehicle_of(log: Log) -> Vehicle | None:
    """Vehicle of the plant; None if the log has none or needs user code that is not loaded."""
    found = restored_part(log.info, "agent", "plant", "vehicle")
    shape = log.joints.shape[1], log.rotor_speeds.shape[1]
    return found if isinstance(found, Vehicle) and (found.n, len(found.rotors)) == shape else None


def every_of(log: Log) -> tuple[int, int]:
    """Message interval in control instants: of the state topics, and of the slower other topics."""
    rate = control_rate(log)
    fast = max(1, round(rate / FAST))
    return fast, fast * max(1, round(rate / fast / SLOW))


def period_of(log: Log) -> int:
    """Number of control instants after which the message pattern repeats."""
    return math.lcm(every_of(log)[1], *(each.every for each in sources_of(log.info).values()))


def control_rate(log: Log) -> float:
    """Control rate of a log, Hz."""
    rates = log.info.get("rates_hz")
    rate = rates.get("control") if isinstance(rates, dict) else None
    return float(rate) if isinstance(rate, (int, float)) and 0 < rate <= HIGHEST else FAST


def _joints(name: str, every: int, joints: Sequence[str], arrays: Mapping[str, str]) -> list[Topic]:
    """Topic of type sensor_msgs/JointState from arrays of the log; none for a vehicle without joints."""

    def values(part: Part) -> dict[str, Any]:
        return {"header": part.header(""), "name": joints} | {field: part[array] for field, array in arrays.items()}

    return [Topic(name, "sensor_msgs/JointState", every, values)] if joints else []


def _transforms(every: int, vehicle: Vehicle | None) -> list[Topic]:
    frames = None if vehicle is None else Frames(vehicle)

    def moving(part: Part) -> dict[str, Any]:
        goal = yaw_quaternion(part["yaw_reference"])
        base = transform(part.stamps, WORLD, BASE_LINK, part["position"], part.unit())
        reference = transform(part.stamps, WORLD, BASE_REFERENCE, part["position_reference"], goal)
        links = [] if frames is None else frames.moving(part.stamps, part["joints"])
        return {"transforms": [base, reference, *links]}

    topics = [Topic("/tf", "tf2_msgs/TFMessage", every, moving)]
    if frames is None or vehicle is None:
        return topics
    fixed, drawn = {"transforms": frames.fixed_transforms()}, {"markers": markers(vehicle, frames)}
    return [
        Topic("/tf_static", "tf2_msgs/TFMessage", 0, lambda _: fixed),
        Topic("/vehicle", MARKERS, 0, lambda _: drawn),
        *topics,
    ]


Fields = Mapping[str, Array]
"""Numbers of a reading by field."""

Message = dict[str, Any]


class Origin(NamedTuple):
    """Name of a sensor or estimator, with the names of the vehicle's joints and of the reading's numbers."""

    source: str
    joints: Sequence[str]
    names: Sequence[str]


def _odometry(part: Part, read: Fields, origin: Origin) -> Message:
    attitude = f"{origin.source}.quaternion"
    velocity = part.in_base(read["velocity"], attitude)
    return {
        "child_frame_id": f"base_{last_of(origin.source)}",
        "pose": {"pose": _pose(read["position"], part.unit(attitude))},
        "twist": {"twist": {"linear": xyz(velocity), "angular": xyz(read["rate"])}},
    }


def _imu(_part: Part, read: Fields, _origin: Origin) -> Message:
    unknown = np.array([-1.0, *8 * [0.0]])  # no orientation is read
    rate, force = xyz(read["rate"]), xyz(read["specific_force"])
    return {"orientation_covariance": unknown, "angular_velocity": rate, "linear_acceleration": force}


def _joint_state(_part: Part, read: Fields, origin: Origin) -> Message:
    return {"name": origin.joints, "position": read["joints"], "velocity": read["joint_rates"]}


def _own(_part: Part, read: Fields, origin: Origin) -> Message:
    return {"name": origin.names, "value": np.column_stack(list(read.values()))}


ODOMETRY = {"position": 3, "quaternion": 4, "velocity": 3, "rate": 3}
"""How many numbers each field has from which an odometry is written, whatever else there is."""

MESSAGES: Mapping[str, tuple[str, Mapping[str, int], Callable[[Part, Fields, Origin], Message]]] = {
    "sensor_msgs/Imu": (BASE_LINK, {"rate": 3, "specific_force": 3}, _imu),
    "geometry_msgs/PoseStamped": (
        WORLD,
        {"position": 3, "quaternion": 4},
        lambda _part, read, _origin: {"pose": _pose(read["position"], read["quaternion"])},
    ),
    "geometry_msgs/PointStamped": (
        WORLD,
        {"position": 3},
        lambda _part, read, _origin: {"point": xyz(read["position"])},
    ),
    "geometry_msgs/WrenchStamped": (
        WORLD,
        {"force": 3, "torque": 3},
        lambda _part, read, _origin: {"wrench": {field: xyz(array) for field, array in read.items()}},
    ),
    "nav_msgs/Odometry": (WORLD, ODOMETRY, _odometry),
    "sensor_msgs/JointState": ("", {}, _joint_state),
    "skyarm_msgs/Reading": ("", {}, _own),
}
"""Message -> its frame, how many numbers each field of the readings has that are written as it, and its fields."""


def _sensor_topics(log: Log, fast: int, names: Names) -> list[Topic]:
    """Topics of the estimate and of each sensor, at the instants of its readings; none without sensors."""
    sources = {name: each for name, each in sources_of(log.info).items() if set(each.fields) - {"time"}}
    found: list[Topic] = []
    for name, (source, each) in zip(distinct([word(last_of(name)) for name in sources]), sources.items(), strict=True):
        kind, values = _reading(source, each, names)
        if source == ESTIMATE:
            joints = {"position": "joints", "velocity": "joint_rates"}
            columns_of = {field: f"{source}.{array}" for field, array in joints.items() if array in each.fields}
            found.append(Topic("/estimate/base", kind, fast, values))
            found += _joints("/estimate/joints", fast, names.joints, columns_of) if columns_of else []
        else:
            found.append(Topic(f"/sensors/{name}", kind, each.every, values, each.late % each.every))
    return found


def _reading(source: str, described: Source, names: Names) -> tuple[str, Callable[[Part], Message]]:
    """Message type and fields of a sensor: the ROS type that fits its numbers, else one of this library."""
    sizes = {field: len(each.axes or ()) for field, each in described.fields.items()}
    stamped = sizes.pop("time", 1) == 0
    kind = next((kind for kind, (_, wanted, _) in MESSAGES.items() if wanted == sizes), "skyarm_msgs/Reading")
    if sizes == {"joints": len(names.joints), "joint_rates": len(names.joints)}:
        kind = "sensor_msgs/JointState"
    elif sizes.items() >= ODOMETRY.items():
        kind = "nav_msgs/Odometry"
    usual, _, fields = MESSAGES[kind]
    frame = usual if described.frame is None else described.frame
    endings = [f"{field}_{axis}".rstrip("_") for field in sizes for axis in described.fields[field].axes or [""]]
    origin = Origin(source, names.joints, endings)

    def values(part: Part) -> Message:
        header = part.header(frame, part[f"{source}.time"] if stamped else None)
        return {"header": header, **fields(part, {field: part[f"{source}.{field}"] for field in sizes}, origin)}

    return kind, values


def last_of(source: str) -> str:
    """Last part of a source's name: a sensor's name or ``estimate``."""
    return source.rpartition(".")[2]


def _pose(position: Array, wxyz: Array) -> dict[str, Any]:
    return {"position": xyz(position), "orientation": quaternion(wxyz)}


def _point(name: str, every: int, array: str) -> Topic:
    def values(part: Part) -> dict[str, Any]:
        return {"header": part.header(WORLD), "point": xyz(part[array])}

    return Topic(name, "geometry_msgs/PointStamped", every, values)
