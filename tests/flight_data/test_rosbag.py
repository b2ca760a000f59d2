"""Bags of ROS that rosbags wrote from a flight of ours, read back equal."""

from __future__ import annotations

import dataclasses
import re
import sqlite3
import sys
from collections.abc import Callable, Iterator
from functools import cache, partial
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.flight_data.flight_data import FlightData, load_flight
from skyarm.flight_data.rosbag import _Rows, _table
from skyarm.identify.measured_motion import joints_in_order
from support.logs import flown

pytest.importorskip("rosbags", reason="needs the extra 'flights'")
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ACTUATORS = (
    "std_msgs/Header header\nfloat64[] angles\nfloat64[] angular_velocities\nfloat64[]"
    " normalized\n"
)
START = 1_700_000_000_123_456_789
"""Time of the first message, ns."""
KINDS = ("bag", "db3", "mcap", "folder")


def writer(kind: str, folder: Path) -> tuple[Any, Path]:
    if kind == "bag":
        return Writer1(folder / "flight.bag"), folder / "flight.bag"
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    made = Writer2(folder / "flight", version=9, storage_plugin=plugin)
    return made, (
        folder / "flight" if kind == "folder" else folder / "flight" / f"flight.{kind}"
    )


def write(
    kind: str,
    folder: Path,
    messages: Callable[[Any, str], list[tuple[str, str, int, Any]]],
) -> Path:
    """Write messages (topic, type, ns, message) as a bag."""
    store = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(ACTUATORS, "mav_msgs/msg/Actuators"))
    made, path = writer(kind, folder)
    topics = {}
    with made:
        for topic, name, stamp, message in messages(store, kind):
            if topic not in topics:
                topics[topic] = made.add_connection(topic, name, typestore=store)
            data = (
                store.serialize_ros1(message, name)
                if kind == "bag"
                else store.serialize_cdr(message, name)
            )
            made.write(topics[topic], stamp, data)
    return path


class Messages:
    """Messages of a type store."""

    def __init__(self, store: Any, kind: str) -> None:
        self.types, self.kind = store.types, kind

    def make(self, kind: str, /, **fields: Any) -> Any:
        return self.types[kind](**fields)

    def header(self, stamp: int) -> Any:
        time = self.make(
            "builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9
        )
        counted = {"seq": 0} if self.kind == "bag" else {}
        return self.make("std_msgs/msg/Header", stamp=time, frame_id="base", **counted)

    def xyz(self, values: Any, name: str = "Vector3") -> Any:
        return self.make(
            f"geometry_msgs/msg/{name}",
            **dict(zip("xyz", map(float, values), strict=True)),
        )

    def turn(self, wxyz: Any) -> Any:
        return self.make(
            "geometry_msgs/msg/Quaternion",
            **dict(zip("wxyz", map(float, wxyz), strict=True)),
        )

    def imu(self, stamp: int, rate: Any, force: Any) -> Any:
        unknown = np.array([-1.0, *8 * [0.0]])
        return self.make(
            "sensor_msgs/msg/Imu",
            header=self.header(stamp),
            orientation=self.turn([1, 0, 0, 0]),
            orientation_covariance=unknown,
            angular_velocity=self.xyz(rate),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self.xyz(force),
            linear_acceleration_covariance=np.zeros(9),
        )


@cache
def states() -> list[tuple[int, Any]]:
    """Times, ns, and rows of a flight of ours."""
    return [
        (START + round(t * 1e9), k)
        for k, t in enumerate(flown().time.tolist())
        if k % 4 == 0
    ]


def flight_messages(store: Any, kind: str) -> list[tuple[str, str, int, Any]]:
    log, make, found = flown(), Messages(store, kind), []
    for stamp, k in states():
        late = stamp + 3_000_000
        pose = make.make(
            "geometry_msgs/msg/Pose",
            position=make.xyz(log.position[k], "Point"),
            orientation=make.turn(log.quaternion[k]),
        )
        goal = make.make(
            "geometry_msgs/msg/Pose",
            position=make.xyz([9, 9, 9], "Point"),
            orientation=make.turn([1, 0, 0, 0]),
        )
        joints = make.make(
            "sensor_msgs/msg/JointState",
            header=make.header(stamp),
            name=["shoulder", "elbow"],
            position=log.joints[k],
            velocity=log.joint_rates[k],
            effort=np.zeros(0),
        )
        rotors = {
            "header": make.header(stamp),
            "angles": np.zeros(0),
            "normalized": np.zeros(0),
        }
        for topic, name, message in (
            (
                "/imu",
                "sensor_msgs/msg/Imu",
                make.imu(stamp, log.rate[k], log.velocity[k]),
            ),
            ("/mocap", "geometry_msgs/msg/PoseStamped", (make.header(stamp), pose)),
            ("/setpoint", "geometry_msgs/msg/PoseStamped", (make.header(stamp), goal)),
            ("/joint_states", "sensor_msgs/msg/JointState", joints),
            ("/command/motor_speed", "mav_msgs/msg/Actuators", log.rotor_commands[k]),
            ("/motor_speed", "mav_msgs/msg/Actuators", log.rotor_speeds[k]),
        ):
            if name.endswith("Actuators"):
                made = make.make(name, angular_velocities=message, **rotors)
            else:
                made = (
                    make.make(name, header=message[0], pose=message[1])
                    if name.endswith("Stamped")
                    else message
                )
            found.append((topic, name, late, made))
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_a_flight_of_ours_is_read_back_equal_from_every_kind_of_bag(
    kind: str, tmp_path: Path
) -> None:
    log, flight = flown(), load_flight(write(kind, tmp_path, flight_messages))
    rows = [k for _, k in states()]
    wanted = {
        "gyro": log.rate,
        "accelerometer": log.velocity,
        "position": log.position,
        "joint_positions": log.joints,
        "joint_rates": log.joint_rates,
        "rotor_speed_commands": log.rotor_commands,
        "rotor_speeds": log.rotor_speeds,
    }
    assert set(flight) == {*wanted, "quaternion"}
    for name, array in wanted.items():
        np.testing.assert_array_equal(flight[name].values, array[rows])
        np.testing.assert_allclose(flight[name].time, log.time[rows], atol=1e-8)
    turns = np.abs(np.sum(flight["quaternion"].values * log.quaternion[rows], axis=1))
    np.testing.assert_allclose(
        turns, np.linalg.norm(log.quaternion[rows], axis=1), rtol=1e-12
    )
    assert flight.facts["start"] == pytest.approx(START * 1e-9, abs=1e-6)
    assert flight.notes == ()
    assert "/setpoint" in flight.unused


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_a_mapping_names_topics_fields_and_stamps(kind: str, tmp_path: Path) -> None:
    mapping = tmp_path / "mapping.toml"
    mapping.write_text(
        '[position]\ntopic = "/setpoint"\ncolumns = ["pose.position.x",'
        ' "pose.position.y", "-pose.position.z"]\n[gyro]\ncolumns ='
        ' ["angular_velocity.z", "angular_velocity.y", "angular_velocity.x"]\nstamp ='
        ' "receive"\n[rotor_commands]\ntopic = "/motor_speed"\nhigh = 2000\ncolumns ='
        ' ["angular_velocities[3]", "angular_velocities[0]"]\n'
    )
    log, flight = flown(), load_flight(write(kind, tmp_path, flight_messages), mapping)
    rows = [k for _, k in states()]
    np.testing.assert_array_equal(flight["position"].values[0], [9, 9, -9])
    np.testing.assert_array_equal(flight["gyro"].values, log.rate[rows][:, ::-1])
    np.testing.assert_allclose(flight["gyro"].time, log.time[rows] + 0.003, atol=1e-8)
    np.testing.assert_allclose(
        flight["rotor_commands"].values, log.rotor_speeds[rows][:, [3, 0]] / 2000
    )
    mapping.write_text('[position]\ntopic = "/setpoints"\ncolumns = ["a", "b", "c"]\n')
    with pytest.raises(
        ValueError, match=r"mapping.toml: position.topic = '/setpoints': .*'/setpoint'"
    ):
        load_flight(
            tmp_path / ("flight.bag" if kind == "bag" else "flight/flight.mcap"),
            mapping,
        )


def test_the_fastest_of_several_topics_is_taken_and_said(tmp_path: Path) -> None:
    def messages(store: Any, kind: str) -> list[tuple[str, str, int, Any]]:
        make = Messages(store, kind)
        return [
            (
                topic,
                "sensor_msgs/msg/Imu",
                START + k * 10**7,
                make.imu(0, [value, 0, 0], [0, 0, 9.8]),
            )
            for k in range(40)
            for topic, value, every in (("/imu/data", 1.0, 4), ("/imu/raw", 2.0, 1))
            if k % every == 0
        ]

    flight = load_flight(write("mcap", tmp_path, messages))
    assert set(flight["gyro"].values[:, 0]) == {2.0}
    # a header without stamp
    np.testing.assert_allclose(np.diff(flight["gyro"].time), 0.01, atol=1e-8)
    assert "gyro: there is /imu/data, /imu/raw; the fastest is taken" in " ".join(
        flight.notes
    )


def test_a_message_without_a_stamp_has_its_time_of_arrival() -> None:
    stamped, arrived = (
        (
            "header.stamp.sec",
            "header.stamp.nanosec",
            "x",
        ),
        START + np.arange(3) * 10**8,
    )
    numbers = {
        stamped: [(0, np.array([2.0, 5e8, 1.0])), (2, np.array([3.0, 0.0, 1.0]))],
        ("x",): [(1, np.array([1.0]))],
    }
    table = _table(_Rows(received=arrived.tolist(), numbers=numbers), 0)
    np.testing.assert_allclose(table.time, [2.5, 1e-9 * arrived[1], 3.0])


def test_joints_are_told_by_their_names_in_whatever_order_messages_give_them(
    tmp_path: Path,
) -> None:
    angles = {"shoulder": 1.0, "elbow": 2.0, "finger": 3.0}

    def messages(store: Any, kind: str) -> list[tuple[str, str, int, Any]]:
        make, found = Messages(store, kind), []
        for k in range(90):
            names = (["elbow", "shoulder"], ["shoulder", "elbow"], ["finger"])[k % 3]
            fields = {
                "position": [angles[each] for each in names],
                "velocity": [],
                "effort": [],
            }
            lists = {name: np.array(values) for name, values in fields.items()}
            message = make.make(
                "sensor_msgs/msg/JointState",
                header=make.header(START + k * 10**7),
                name=names,
                **lists,
            )
            found.append(
                (
                    "/joint_states",
                    "sensor_msgs/msg/JointState",
                    START + k * 10**7,
                    message,
                )
            )
        return found

    flight = load_flight(write("mcap", tmp_path, messages))
    joints = flight["joint_positions"]
    assert joints.names == ("elbow", "shoulder")
    np.testing.assert_array_equal(joints.values, np.tile([2.0, 1.0], (60, 1)))
    arm = skyarm.load_vehicle("hummingbird_arm2")
    first, second = arm.links[:2]
    renamed = [
        dataclasses.replace(link, joint=dataclasses.replace(link.joint, name=name))
        for link, name in ((first, "shoulder"), (second, "elbow"))
    ]
    ordered = joints_in_order(flight, dataclasses.replace(arm, links=tuple(renamed)))
    np.testing.assert_array_equal(
        ordered["joint_positions"].values, np.tile([1.0, 2.0], (60, 1))
    )
    assert joints_in_order(flight, arm)["joint_positions"] is joints


def test_messages_of_a_log_of_ours_are_read_as_those_of_any_other(
    tmp_path: Path,
) -> None:
    path = skyarm.save_log(flown(), tmp_path / "own.mcap")
    (tmp_path / "other.mcap").write_bytes(
        path.read_bytes().replace(b"flight.npz", b"flight.xyz")
    )
    own, other = load_flight(path), load_flight(tmp_path / "other.mcap")
    assert own["gyro"].source == "rate"
    assert other["velocity"].source.startswith("/odom")
    for name in ("position", "velocity", "quaternion", "joint_positions", "gyro"):
        np.testing.assert_allclose(other[name].values, own[name].values, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_bag_is_one_line(kind: str, tmp_path: Path) -> None:
    path = write(kind, tmp_path, flight_messages)
    file = path / "metadata.yaml" if kind == "folder" else path
    data = file.read_bytes()
    file.write_bytes(
        data[: len(data) // 3]
        if kind != "folder"
        else b"rosbag2_bagfile_information: {version: 9}\n"
    )
    with pytest.raises(ValueError, match=r"bag: must be a whole bag of ROS") as error:
        load_flight(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("variances", "turns", "known"),
    [
        # REP 145: -1 in the first entry
        ([-1.0, -1.0], [[1, 0, 0, 0], [0.8, 0, 0, 0.6]], []),
        ([0.0, 0.0], [[1, 0, 0, 0], [0.8, 0, 0, 0.6]], [0, 1]),
        ([0.02, 0.02], [[1, 0, 0, 0], [0.8, 0, 0, 0.6]], [0, 1]),
        ([-1.0, 0.02], [[1, 0, 0, 0], [0.8, 0, 0, 0.6]], [1]),
        ([0.02, -1.0, 0.02], [[1, 0, 0, 0], [0.8, 0, 0, 0.6], [0, 0, 0, 0]], [0]),
        ([0.02, 0.02], [[0, 0, 0, 0], [0, 0, 0, 0]], []),
    ],
)
def test_an_attitude_of_an_inertial_unit_is_known_by_its_covariance(
    variances: list[float], turns: list[list[float]], known: list[int], tmp_path: Path
) -> None:
    def messages(store: Any, kind: str) -> list[tuple[str, str, int, Any]]:
        make, found = Messages(store, kind), []
        for k, (variance, turn) in enumerate(zip(variances, turns, strict=True)):
            stamp = START + k * 10**7
            covariance = np.array([variance, *8 * [0.0]])
            made = make.imu(stamp, [0.1, 0.2, 0.3], [0.0, 0.0, 9.8])
            made = dataclasses.replace(
                made, orientation=make.turn(turn), orientation_covariance=covariance
            )
            found.append(("/imu", "sensor_msgs/msg/Imu", stamp, made))
        return found

    flight = load_flight(write("mcap", tmp_path, messages))
    assert set(flight) == {"gyro", "accelerometer"} | (
        {"quaternion"} if known else set()
    )
    if known:
        np.testing.assert_allclose(flight["quaternion"].values, np.array(turns)[known])
        np.testing.assert_allclose(
            flight["quaternion"].time, 0.01 * np.array(known), atol=1e-9
        )


@pytest.mark.parametrize(
    ("field", "name"),
    [("angular_velocity", "gyro"), ("linear_acceleration", "accelerometer")],
)
def test_a_reading_that_an_inertial_unit_has_not_is_left_out_row_by_row(
    field: str, name: str, tmp_path: Path
) -> None:
    def messages(store: Any, kind: str) -> list[tuple[str, str, int, Any]]:
        make, found = Messages(store, kind), []
        for k in range(6):
            made = make.imu(START + k * 10**7, [0.1 * k, 0.2, 0.3], [0.1 * k, 0.0, 9.8])
            variance = np.array([-1.0 if k in (1, 4) else 0.01, *8 * [0.0]])
            made = dataclasses.replace(made, **{f"{field}_covariance": variance})
            found.append(("/imu", "sensor_msgs/msg/Imu", START + k * 10**7, made))
        return found

    flight = load_flight(write("mcap", tmp_path, messages))
    np.testing.assert_allclose(flight[name].values[:, 0], [0.0, 0.2, 0.3, 0.5])
    (other,) = {"gyro", "accelerometer"} - {name}
    assert flight[other].time.size == 6


def test_a_unit_without_attitude_is_no_second_source_of_it(tmp_path: Path) -> None:
    def messages(store: Any, kind: str) -> list[tuple[str, str, int, Any]]:
        make, found = Messages(store, kind), []
        for k in range(3):
            stamp = START + k * 10**7
            found.append(
                (
                    "/imu",
                    "sensor_msgs/msg/Imu",
                    stamp,
                    make.imu(stamp, [0.1, 0.2, 0.3], [0.0, 0.0, 9.8]),
                )
            )
            pose = make.make(
                "geometry_msgs/msg/Pose",
                position=make.xyz([k, 0, 1], "Point"),
                orientation=make.turn([1, 0, 0, 0]),
            )
            found.append(
                (
                    "/pose",
                    "geometry_msgs/msg/PoseStamped",
                    stamp,
                    make.make(
                        "geometry_msgs/msg/PoseStamped",
                        header=make.header(stamp),
                        pose=pose,
                    ),
                )
            )
        return found

    flight = load_flight(write("mcap", tmp_path, messages))
    assert flight["quaternion"].source.startswith("/pose")
    assert not any("fastest" in each for each in flight.notes)


def test_a_bag_without_measurements_lists_its_topics(tmp_path: Path) -> None:
    def messages(store: Any, kind: str) -> list[tuple[str, str, int, Any]]:
        return [
            (
                "/text",
                "std_msgs/msg/String",
                START,
                store.types["std_msgs/msg/String"](data="a"),
            )
        ]

    with pytest.raises(
        ValueError,
        match=r"topics: none that is read holds a message; there is /text \(std_msgs/",
    ):
        load_flight(write("mcap", tmp_path, messages))


def test_of_many_topics_without_measurements_twenty_are_listed(tmp_path: Path) -> None:
    def messages(store: Any, kind: str) -> list[tuple[str, str, int, Any]]:
        text = store.types["std_msgs/msg/String"](data="a")
        return [(f"/text{i}", "std_msgs/msg/String", START, text) for i in range(25)]

    with pytest.raises(ValueError, match="there is /text0 ") as error:
        load_flight(write("mcap", tmp_path, messages))
    assert str(error.value).count("/text") == 20


def test_without_rosbags_the_extra_that_has_it_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.bag").write_bytes(b"#ROSBAG V2.0\n")
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(
        ValueError,
        match=r"rosbags: is missing; a bag of ROS needs the extra 'flights': ",
    ):
        load_flight(tmp_path / "a.bag")


def test_an_entry_with_a_name_is_a_column_by_its_place_too(tmp_path: Path) -> None:
    mapping = tmp_path / "mapping.toml"
    mapping.write_text(
        '[joint_commands]\ntopic = "/joint_states"\ncolumns = ["position[1]",'
        ' "position[shoulder]"]\n'
    )
    flight = load_flight(write("mcap", tmp_path, flight_messages), mapping)
    rows = [k for _, k in states()]
    np.testing.assert_array_equal(
        flight["joint_commands"].values, flown().joints[rows][:, [1, 0]]
    )


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        (["a", "b"], ("position[a]", "position[b]")),
        (["a", "a"], ("position[0]", "position[1]")),  # one name twice
        (["a", ""], ("position[0]", "position[1]")),
        (["a"], ("position[0]", "position[1]")),  # fewer names than numbers
        ([], ("position[0]", "position[1]")),
        ([f"joint{k}" for k in range(33)], ()),  # a list of more than 32 numbers
    ],
)
def test_entries_of_lists_have_the_names_of_the_message_if_these_are_good(
    names: list[str], columns: tuple[str, ...], tmp_path: Path
) -> None:
    def messages(store: Any, kind: str) -> list[tuple[str, str, int, Any]]:
        make, found = Messages(store, kind), []
        lists = {
            "position": np.ones(max(2, len(names))),
            "velocity": np.zeros(0),
            "effort": np.zeros(0),
        }
        for k in range(3):
            stamp = START + k * 10**7
            joints = make.make(
                "sensor_msgs/msg/JointState",
                header=make.header(stamp),
                name=names,
                **lists,
            )
            found.append(("/joints", "sensor_msgs/msg/JointState", stamp, joints))
            found.append(
                (
                    "/imu",
                    "sensor_msgs/msg/Imu",
                    stamp,
                    make.imu(stamp, [1, 2, 3], [0, 0, 9.8]),
                )
            )
        return found

    flight = load_flight(write("mcap", tmp_path, messages))
    assert ("joint_positions" in flight) == bool(columns)
    if columns:
        assert flight["joint_positions"].source == f"/joints: {', '.join(columns)}"
        assert flight["joint_positions"].names == (
            ("a", "b") if "position[a]" in columns else ()
        )


def test_a_message_that_cannot_be_decoded_is_left_out_and_said(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    make, (made, path) = Messages(store, "mcap"), writer("mcap", tmp_path)
    with made:
        topic = made.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=store)
        for k in range(4):
            stamp = START + k * 10**7
            data = store.serialize_cdr(
                make.imu(stamp, [k, 2, 3], [0, 0, 9.8]), "sensor_msgs/msg/Imu"
            )
            made.write(topic, stamp, data[:20] if k == 2 else data)
    flight = load_flight(path)
    assert flight["gyro"].values[:, 0].tolist() == [0, 1, 3]
    assert flight.notes == ("bag: 1 messages cannot be decoded and are left out.",)


@pytest.mark.parametrize("whole", [0, 3])
def test_messages_before_a_damaged_chunk_are_read_and_a_bag_without_any_is_refused(
    whole: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The reader ends with an error of its own after so many messages."""
    given = AnyReader.messages

    def damaged(self: AnyReader, *args: Any, **words: Any) -> Iterator[Any]:
        yield from islice(given(self, *args, **words), whole)
        raise EOFError("short")

    def messages(store: Any, kind: str) -> list[tuple[str, str, int, Any]]:
        make, stamps = Messages(store, kind), [START + k * 10**7 for k in range(5)]
        return [
            ("/imu", "sensor_msgs/msg/Imu", at, make.imu(at, [1, 2, 3], [0, 0, 9.8]))
            for at in stamps
        ]

    path = write("mcap", tmp_path, messages)
    monkeypatch.setattr(AnyReader, "messages", damaged)
    if whole:
        flight = load_flight(path)
        assert flight["gyro"].time.size == whole
        assert flight.notes == (
            "bag: is damaged and read up to there (EOFError: short).",
        )
    else:
        with pytest.raises(
            ValueError, match=r"bag: must be a whole bag of ROS \(EOFError: short\)"
        ):
            load_flight(path)


def test_an_inertial_unit_that_fixed_transforms_turn_is_read_in_base_axes(
    tmp_path: Path,
) -> None:
    """By SciPy, over two transforms; one whose frame is the base or leads nowhere is
    taken as it is.
    """
    rng = np.random.default_rng(5)
    links = {"imu_link": "plate", "plate": "hull/base_link", "lost_link": "map"}
    turns = {name: Rotation.random(random_state=k) for k, name in enumerate(links)}
    places = {name: rng.uniform(-0.2, 0.2, 3) for name in links}
    rates = {frame: rng.normal(size=(20, 3)) for frame in ("imu_link", "lost_link")}
    poses = Rotation.random(20, random_state=9)

    def messages(store: Any, kind: str, frame: str) -> list[tuple[str, str, int, Any]]:
        make, found = Messages(store, kind), []
        for child, parent in links.items():
            at = make.make(
                "geometry_msgs/msg/Transform",
                translation=make.xyz(places[child]),
                rotation=make.turn(turns[child].as_quat(scalar_first=True)),
            )
            header = make.header(START)
            header.frame_id = parent
            each = make.make(
                "geometry_msgs/msg/TransformStamped",
                header=header,
                child_frame_id=child,
                transform=at,
            )
            made = make.make("tf2_msgs/msg/TFMessage", transforms=[each])
            found.append(("/tf_static", "tf2_msgs/msg/TFMessage", START, made))
        for k, rate in enumerate(rates[frame]):
            read = make.imu(START + k * 10**7, rate, 2.0 * rate)
            read = dataclasses.replace(
                read,
                orientation=make.turn(poses[k].as_quat(scalar_first=True)),
                orientation_covariance=np.zeros(9),
            )
            read.header.frame_id = frame
            found.append(("/imu", "sensor_msgs/msg/Imu", START + k * 10**7, read))
        return found

    def flight_in(frame: str, *mapping: Path) -> skyarm.FlightData:
        folder = tmp_path / f"{frame}{len(mapping)}"
        folder.mkdir()
        return load_flight(
            write("mcap", folder, lambda store, kind: messages(store, kind, frame)),
            *mapping,
        )

    flight, turn = flight_in("imu_link"), turns["plate"] * turns["imu_link"]
    np.testing.assert_allclose(
        flight["gyro"].values, turn.apply(rates["imu_link"]), atol=1e-12
    )
    np.testing.assert_allclose(
        flight["accelerometer"].values, turn.apply(2.0 * rates["imu_link"]), atol=1e-12
    )
    attitude = Rotation.from_quat(flight["quaternion"].values, scalar_first=True)
    assert (attitude.inv() * poses * turn.inv()).magnitude().max() < 1e-7
    place = places["plate"] + turns["plate"].apply(places["imu_link"])
    np.testing.assert_allclose([*flight.place.values()], place, atol=1e-12)
    assert "gyro: is turned to base_link by /tf_static." in flight.notes
    lost = flight_in("lost_link")
    np.testing.assert_array_equal(lost["gyro"].values, rates["lost_link"])
    assert lost.place == {}
    own = tmp_path / "own.toml"
    own.write_text(
        '[gyro]\ncolumns = ["angular_velocity.x", "angular_velocity.y",'
        ' "angular_velocity.z"]\n'
    )
    np.testing.assert_array_equal(
        flight_in("imu_link", own)["gyro"].values, rates["imu_link"]
    )


OF_PX4 = {
    "SensorCombined": (
        "uint64 timestamp\nfloat32[3] gyro_rad\nfloat32[3] accelerometer_m_s2\n"
    ),
    "VehicleOdometry": (
        "uint64 timestamp\nuint64 timestamp_sample\nfloat32[3] position\n"
        "float32[4] q\nfloat32[3] velocity\n"
    ),
    "ActuatorMotors": "uint64 timestamp\nfloat32[12] control\n",
    "BatteryStatus": "uint64 timestamp\nfloat32 voltage_v\n",
}


def px4_bag(
    folder: Path, draw: np.random.Generator
) -> tuple[Path, dict[str, np.ndarray]]:
    """Bag of PX4's messages, sent every 4 ms since 30 s after boot and late by up to 9
    ms; and their numbers.
    """
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in OF_PX4.items():
        store.register(get_types_from_msg(text, f"px4_msgs/msg/{name}"))
    sent = {name: draw.normal(size=(100, 18)).astype(np.float32) for name in OF_PX4}
    rows = []
    for k in range(100):
        stamp = 30_000_000 + 4000 * k
        at = {
            name: np.split(numbers[k], [3, 6, 10, 13]) for name, numbers in sent.items()
        }
        place, _, turn, speed, _ = at["VehicleOdometry"]
        motors = np.array([*sent["ActuatorMotors"][k, :4], *[np.nan] * 8], np.float32)
        fields = {
            "SensorCombined": (stamp, *at["SensorCombined"][:2]),
            "VehicleOdometry": (stamp, stamp, place, turn, speed),
            "ActuatorMotors": (stamp, motors),
            "BatteryStatus": (stamp, float(sent["BatteryStatus"][k, 0])),
        }
        for name, values in fields.items():
            late = int(draw.integers(1_000_000, 9_000_000))
            message = store.types[f"px4_msgs/msg/{name}"](*values)
            rows.append((START + 4_000_000 * k + late, name, message))
    made, path = writer("mcap", folder)
    with made:
        topics = {
            each: made.add_connection(
                f"/fmu/out/{each}", f"px4_msgs/msg/{each}", typestore=store
            )
            for each in sent
        }
        for when, name, message in sorted(rows, key=lambda row: row[0]):
            made.write(
                topics[name], when, store.serialize_cdr(message, f"px4_msgs/msg/{name}")
            )
    return path, sent


def test_messages_of_px4_have_their_stamps_axes_and_order(tmp_path: Path) -> None:
    path, sent = px4_bag(tmp_path, np.random.default_rng(0))
    turn, found = np.array([1.0, -1.0, -1.0]), load_flight(path)
    for name in found:
        np.testing.assert_allclose(found[name].time, 0.004 * np.arange(100), atol=2e-6)
    np.testing.assert_array_equal(
        found["gyro"].values, sent["SensorCombined"][:, :3] * turn
    )
    np.testing.assert_array_equal(
        found["accelerometer"].values, sent["SensorCombined"][:, 3:6] * turn
    )
    np.testing.assert_array_equal(
        found["position"].values, sent["VehicleOdometry"][:, :3] * turn
    )
    np.testing.assert_array_equal(
        found["velocity"].values, sent["VehicleOdometry"][:, 10:13] * turn
    )
    q = Rotation.from_quat(sent["VehicleOdometry"][:, [7, 8, 9, 6]])
    flip = Rotation.from_quat([1, 0, 0, 0])  # half a turn about x, of world and of base
    read = Rotation.from_quat(found["quaternion"].values[:, [1, 2, 3, 0]])
    assert (read.inv() * (flip * q * flip)).magnitude().max() < 1e-6
    np.testing.assert_array_equal(
        found["rotor_commands"].values, sent["ActuatorMotors"][:, :4]
    )
    np.testing.assert_array_equal(found["voltage"].values, sent["BatteryStatus"][:, :1])
    said = "are shares of thrust, those of the signal only if THR_MDL_FAC is 0."
    assert found.notes == (f"rotor_commands: of /fmu/out/ActuatorMotors {said}",)
    assert START * 1e-9 <= float(found.facts["start"]) < START * 1e-9 + 0.009


def test_a_mapping_of_the_stamps_of_px4_fits_what_it_leaves_to_the_format(
    tmp_path: Path,
) -> None:
    from skyarm.flight_data.columns_file import columns_from

    path, sent = px4_bag(tmp_path, np.random.default_rng(0))
    gyro = {
        "topic": "/fmu/out/SensorCombined",
        "columns": [f"gyro_rad[{k}]" for k in range(3)],
    }
    found = load_flight(
        path,
        columns_from({"time": {"column": "timestamp", "unit": "us"}, "gyro": gyro}),
    )
    np.testing.assert_array_equal(found["gyro"].values, sent["SensorCombined"][:, :3])
    np.testing.assert_allclose(found["gyro"].time, found["position"].time, atol=2e-6)


def test_the_time_of_one_quantity_is_on_the_clock_of_the_others(tmp_path: Path) -> None:
    from skyarm.flight_data.columns_file import columns_from

    path, _ = px4_bag(tmp_path, np.random.default_rng(0))
    gyro = {
        "topic": "/fmu/out/SensorCombined",
        "time": "timestamp",
        "columns": [f"gyro_rad[{k}]" for k in range(3)],
    }
    found = load_flight(path, columns_from({"time": {"unit": "us"}, "gyro": gyro}))
    np.testing.assert_allclose(found["gyro"].time, found["position"].time, atol=2e-6)
    assert START * 1e-9 <= float(found.facts["start"]) < START * 1e-9 + 0.009


def test_a_mean_of_px4_is_put_at_the_middle_of_its_span(tmp_path: Path) -> None:
    """PX4's VehicleIMU::Publish stamps it with its last sample: 2 and 3 ms earlier
    here, 1 ms later in relation.
    """
    from skyarm.flight_data.columns_file import columns_from

    fields = (
        "uint32 gyro_integral_dt\nint32 accelerometer_timestamp_relative\nuint32"
        " accelerometer_integral_dt\n"
    )
    store, sent = get_typestore(Stores.ROS2_HUMBLE), []
    texts = {
        "SensorCombined": OF_PX4["SensorCombined"] + fields,
        "BatteryStatus": OF_PX4["BatteryStatus"],
    }
    for name, text in texts.items():
        store.register(get_types_from_msg(text, f"px4_msgs/msg/{name}"))
    make, numbers = (
        {name: store.types[f"px4_msgs/msg/{name}"] for name in texts},
        np.ones(3, np.float32),
    )
    for k in range(12):
        when, stamp = START + 10**7 * k, 30_000_000 + 10_000 * k
        sent.append(
            (
                when,
                "/fmu/out/a",
                make["SensorCombined"](stamp, numbers, numbers, 4000, 1000, 6000),
            )
        )
        sent.append((when, "/fmu/out/b", make["BatteryStatus"](stamp, 0.1 * k)))
    path = write_rows(tmp_path, "mcap", store, sent)
    found = load_flight(path)
    for name, late in (("gyro", 0.0), ("accelerometer", 0.0), ("voltage", 0.002)):
        np.testing.assert_allclose(
            found[name].time, late + 0.01 * np.arange(12), atol=1e-6
        )
    # a column of a few tenths, 30 s after boot, is on no clock of the file, and counts
    # from the first message
    voltage = {"topic": "/fmu/out/b", "time": "voltage_v", "columns": ["voltage_v"]}
    other = load_flight(path, columns_from({"time": {"unit": "s"}, "voltage": voltage}))
    np.testing.assert_allclose(
        other["voltage"].time, 0.002 + 0.1 * np.arange(12), atol=1e-6
    )


@pytest.mark.parametrize("reversible", [0, 1])
def test_a_stopped_motor_has_no_share_and_one_of_both_ways_no_commands(
    reversible: int, tmp_path: Path
) -> None:
    """PX4's msg/ActuatorMotors.msg: NaN is disarmed; bits of reversible_flags mark
    motors whose shares have a sign.
    """
    store, sent = get_typestore(Stores.ROS2_HUMBLE), []
    texts = {
        "ActuatorMotors": (
            "uint64 timestamp\nuint16 reversible_flags\nfloat32[12] control\n"
        ),
        "BatteryStatus": OF_PX4["BatteryStatus"],
    }
    for name, text in texts.items():
        store.register(get_types_from_msg(text, f"px4_msgs/msg/{name}"))
    make = {name: store.types[f"px4_msgs/msg/{name}"] for name in texts}
    for k in range(12):
        when, stamp = START + 10**7 * k, 30_000_000 + 10_000 * k
        shares = np.array(
            [0.25, 0.5, np.nan if k < 6 else 0.75, *9 * [np.nan]], np.float32
        )
        sent.append(
            (
                when,
                "/fmu/out/actuator_motors",
                make["ActuatorMotors"](stamp, reversible, shares),
            )
        )
        sent.append(
            (when, "/fmu/out/battery_status", make["BatteryStatus"](stamp, 15.0))
        )
    found = load_flight(write_rows(tmp_path, "mcap", store, sent))
    if reversible:
        assert "rotor_commands" not in found
        assert "motors turn both ways (CA_R_REV)" in " ".join(found.notes)
    else:
        wanted = [[0.25, 0.5, 0.75 * (k > 5)] for k in range(12)]
        np.testing.assert_array_equal(found["rotor_commands"].values, wanted)


HEADER = "std_msgs/Header header\n"
OF_MAVROS = {
    "RCOut": HEADER + "uint16[] channels\n",
    "ESCStatusItem": HEADER + "int32 rpm\nfloat32 voltage\nfloat32 current\n",
    "ESCStatus": HEADER + "mavros_msgs/ESCStatusItem[] esc_status\n",
}


def mavros_store(kind: str) -> Any:
    store = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_HUMBLE)
    for name, text in OF_MAVROS.items():
        store.register(get_types_from_msg(text, f"mavros_msgs/msg/{name}"))
    return store


def mavros_bag(
    folder: Path, kind: str, **more: Any
) -> tuple[Path, Rotation, np.ndarray]:
    store = mavros_store(kind)
    rows, turns, sent = mavros_rows(store, kind, **more)
    return write_rows(folder, kind, store, rows), turns, sent


def mavros_rows(
    store: Any, kind: str, space: str = "/mavros", seed: int = 0, **more: Any
) -> tuple[list[tuple[int, str, Any]], Rotation, np.ndarray]:
    """What MAVROS sends every 10 ms, late by up to 8 ms: messages, and the attitudes
    and numbers in them.
    """
    draw, make, rows = np.random.default_rng(seed), Messages(store, kind), []
    turns, sent = Rotation.random(60, random_state=seed), draw.normal(size=(60, 20))
    for k in range(60):
        stamp, numbers = START + 10_000_000 * k, np.split(sent[k], [3, 6, 9, 12, 16])
        header, quaternion = make.header(stamp), turns[k].as_quat(scalar_first=True)
        frames = {
            "header": make.header(stamp),
            "child_frame_id": more.get("child", "base_link"),
        }
        frames["header"].frame_id = more.get("parent", "map")
        pose = make.make(
            "geometry_msgs/msg/Pose",
            position=make.xyz(numbers[2], "Point"),
            orientation=make.turn(quaternion),
        )
        twist = make.make(
            "geometry_msgs/msg/Twist",
            linear=make.xyz(numbers[3]),
            angular=make.xyz(numbers[0]),
        )
        wide = {"covariance": np.zeros(36)}
        odometry = make.make(
            "nav_msgs/msg/Odometry",
            pose=make.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, **wide),
            twist=make.make(
                "geometry_msgs/msg/TwistWithCovariance", twist=twist, **wide
            ),
            **frames,
        )
        pulses = np.array(
            [*(1100 + 500 * (numbers[4] > 0)), 1100, 0, 65535, 1500], np.uint16
        )
        escs = [
            make.make(
                "mavros_msgs/msg/ESCStatusItem",
                header=header,
                rpm=rpm,
                voltage=0.0,
                current=0.0,
            )
            for rpm in (3000 + k, 3100, 3200, 3300, 0)
        ]
        imu = make.imu(stamp, *numbers[:2])
        held = {
            "imu/data": imu,
            "local_position/odom": odometry,
            "global_position/local": odometry,
            "rc/out": make.make(
                "mavros_msgs/msg/RCOut",
                header=header,
                channels=pulses if k else pulses * 0,
            ),
            "esc_status": make.make(
                "mavros_msgs/msg/ESCStatus", header=header, esc_status=escs
            ),
            **(
                {"local_position/pose": pose_of(make, frames["header"], pose)}
                if k % 2
                else {}
            ),
        }
        for name, message in held.items():
            rows.append(
                (stamp + int(draw.integers(1, 8_000_000)), f"{space}/{name}", message)
            )
    return rows, turns, sent


def pose_of(make: Messages, header: Any, pose: Any) -> Any:
    return make.make("geometry_msgs/msg/PoseStamped", header=header, pose=pose)


def write_rows(
    folder: Path, kind: str, store: Any, rows: list[tuple[int, str, Any]]
) -> Path:
    made, path = writer(kind, folder)
    topics = {}
    with made:
        for when, topic, message in sorted(rows, key=lambda row: row[0]):
            name = message.__msgtype__
            if topic not in topics:
                topics[topic] = made.add_connection(topic, name, typestore=store)
            data = (
                store.serialize_ros1(message, name)
                if kind == "bag"
                else store.serialize_cdr(message, name)
            )
            made.write(topics[topic], when, data)
    return path


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_a_bag_of_mavros_is_a_flight_without_a_mapping(
    kind: str, tmp_path: Path
) -> None:
    path, turns, sent = mavros_bag(tmp_path, kind)
    found = load_flight(path)
    for name in found:
        # its first message holds no pulses
        late = 0.01 if name == "rotor_commands" else 0.0
        np.testing.assert_allclose(
            found[name].time - found[name].time[0],
            0.01 * np.arange(found[name].time.size),
        )
        assert found[name].time[0] == pytest.approx(late, abs=1e-9)
    for name, columns in (
        ("gyro", slice(0, 3)),
        ("accelerometer", slice(3, 6)),
        ("position", slice(6, 9)),
    ):
        np.testing.assert_array_equal(found[name].values, sent[:, columns])
    np.testing.assert_allclose(
        found["velocity"].values, turns.apply(sent[:, 9:12]), atol=1e-12
    )
    read = Rotation.from_quat(found["quaternion"].values, scalar_first=True)
    assert (read.inv() * turns).magnitude().max() < 1e-7
    np.testing.assert_allclose(
        found["rotor_commands"].values, 0.1 + 0.5 * (sent[1:, 12:16] > 0)
    )
    np.testing.assert_allclose(
        found["rotor_speeds"].values[:, 1:],
        np.tile([3100, 3200, 3300], (60, 1)) * np.pi / 30,
    )
    assert "limits of 1000 and 2000 us are assumed" in " ".join(found.notes)
    assert "global_position" not in " ".join(found.notes)


@pytest.mark.parametrize(
    ("parent", "child"),
    [
        ("map", "map"),
        ("odom", "world"),
        ("odom_ned", "base_link_frd"),
        ("map_ned", "map_ned"),
        ("map", "base_link_frd"),
    ],
)
def test_odometry_is_in_the_axes_of_the_frames_that_it_names(
    parent: str, child: str, tmp_path: Path
) -> None:
    """Of a flight that is turned into these frames by SciPy's matrices; VINS-Fusion has
    its speeds in the world's.
    """
    path, turns, sent = mavros_bag(tmp_path, "mcap", parent=parent, child=child)
    found, flip = load_flight(path), Rotation.from_quat([1, 0, 0, 0])
    world = flip if parent.endswith("ned") else Rotation.identity()
    np.testing.assert_allclose(
        found["position"].values, world.apply(sent[:, 6:9]), atol=1e-12
    )
    is_world = child in ("map", "world", "map_ned")
    # rates in the world's axes are none
    assert ("gyro: there is /mavros/" in " ".join(found.notes)) == (not is_world)
    assert (
        "its rates are in the axes of the world" in " ".join(found.notes)
    ) == is_world
    base = flip if child.endswith("frd") else Rotation.identity()
    if parent == "map_ned":  # nothing says in which axes the base is
        assert "quaternion" not in found
    else:
        read = Rotation.from_quat(found["quaternion"].values, scalar_first=True)
        assert (read.inv() * (world * turns * base)).magnitude().max() < 1e-7
    speeds = sent[:, 9:12] if is_world else turns.apply(sent[:, 9:12])
    np.testing.assert_allclose(
        found["velocity"].values, world.apply(speeds), atol=1e-12
    )


@pytest.mark.parametrize(
    "spaces", [("/uav1/mavros", "/uav2/mavros"), ("/mavros", "/drone2/mavros")]
)
def test_of_two_vehicles_in_a_bag_none_has_numbers_of_the_other(
    spaces: tuple[str, str], tmp_path: Path
) -> None:
    store = mavros_store("mcap")
    rows = [
        mavros_rows(store, "mcap", space, seed)[0] for seed, space in enumerate(spaces)
    ]
    folders = [tmp_path / name for name in ("first", "second", "both")]
    for folder in folders:
        folder.mkdir()
    *apart, both = (
        write_rows(*each)
        for each in zip(
            folders, 3 * ["mcap"], 3 * [store], [*rows, [*chain(*rows)]], strict=True
        )
    )
    usual = load_flight(both)
    assert re.match(
        r"file: holds flights of .*, .*; the first vehicle is read, #1; write FILE#1 ",
        usual.notes[0],
    )
    for number, path in enumerate(apart, 1):
        alone, found = load_flight(path), load_flight(f"{both}#{number}")
        assert (found.name, found.file) == (f"flight#{number}", f"{both}#{number}")
        for name in alone:
            np.testing.assert_array_equal(found[name].values, alone[name].values)
            np.testing.assert_allclose(found[name].time, alone[name].time, atol=1e-6)
    with pytest.raises(
        ValueError, match=r"flight #3: must be 1 to 2, the flights of this file"
    ):
        load_flight(f"{both}#3")


def captured_bag(folder: Path, *topics: str) -> tuple[Path, Rotation, np.ndarray]:
    """Bag of MAVROS with poses of a motion capture beside it, one a topic: path,
    attitudes and places of the last.
    """
    store = mavros_store("mcap")
    rows, make = mavros_rows(store, "mcap")[0], Messages(store, "mcap")
    for number, topic in enumerate(topics, 5):
        turns, places = (
            Rotation.random(60, random_state=number),
            np.random.default_rng(number).normal(size=(60, 3)),
        )
        for k in range(60):
            header, turn = (
                make.header(START + 10_000_000 * k),
                turns[k].as_quat(scalar_first=True),
            )
            pose = make.make(
                "geometry_msgs/msg/Pose",
                position=make.xyz(places[k], "Point"),
                orientation=make.turn(turn),
            )
            rows.append((START + 10_000_000 * k, topic, pose_of(make, header, pose)))
    return write_rows(folder, "mcap", store, rows), turns, places


def is_captured(found: FlightData, turns: Rotation, places: np.ndarray) -> bool:
    read = Rotation.from_quat(found["quaternion"].values, scalar_first=True)
    return (
        np.array_equal(found["position"].values, places)
        and (read.inv() * turns).magnitude().max() < 1e-7
    )


@pytest.mark.parametrize(
    "topic",
    ["/mocap/pose", "/vicon/pose", "/optitrack/pose", "/vrpn_client_node/quad/pose"],
)
def test_a_vehicle_with_one_unit_has_the_pose_of_the_motion_capture(
    topic: str, tmp_path: Path
) -> None:
    from skyarm.flight_data.columns_file import columns_from

    path, turns, places = captured_bag(tmp_path, topic)
    found = load_flight(path)
    assert is_captured(found, turns, places)
    assert "velocity" not in found  # of the autopilot's clock and world
    assert (found["gyro"].time.size, found["rotor_commands"].time.size) == (60, 59)
    said = next(
        each for each in found.notes if each.startswith(f"pose: of {topic}, not ")
    )
    assert "/mavros/local_position/pose" in said
    assert "columns.toml" in said
    assert "flights of" not in " ".join(found.notes)
    names = [f"pose.position.{axis}" for axis in "xyz"]
    own = columns_from(
        {"position": {"topic": "/mavros/local_position/pose", "columns": names}}
    )
    other = load_flight(path, own)
    assert {
        other[name].source.split("/")[1]
        for name in ("position", "quaternion", "velocity")
    } == {"mavros"}


def test_beside_one_unit_bodies_of_a_motion_capture_are_chosen_by_number(
    tmp_path: Path,
) -> None:
    path, turns, places = captured_bag(tmp_path, "/vicon/box/pose", "/vicon/quad/pose")
    found = load_flight(f"{path}#2")
    assert is_captured(found, turns, places)
    assert not is_captured(load_flight(path), turns, places)
    assert {"gyro", "accelerometer", "rotor_commands"} <= set(found)


def test_a_place_that_px4_states_to_be_invalid_is_left_out(tmp_path: Path) -> None:
    store, sent = get_typestore(Stores.ROS2_HUMBLE), []
    flags = ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid")
    text = "uint64 timestamp\n" + "".join(
        f"float32 {each}\n" for each in ("x", "y", "z", "vx", "vy", "vz")
    )
    texts = {
        "VehicleLocalPosition": text + "".join(f"bool {each}\n" for each in flags),
        "VehicleOdometry": NEW,
    }
    for name, each in texts.items():
        store.register(get_types_from_msg(each, f"px4_msgs/msg/{name}"))
    make = {name: store.types[f"px4_msgs/msg/{name}"] for name in texts}
    nothing, turn = np.full(3, np.nan, np.float32), np.array([1, 0, 0, 0], np.float32)
    for k in range(12):
        when, stamp = START + 10**7 * k, 30_000_000 + 10_000 * k
        place = make["VehicleLocalPosition"](
            stamp, *map(float, range(6)), k > 3, True, True, False
        )
        sent.append((when, "/fmu/out/vehicle_local_position", place))
        sent.append(
            (
                when,
                "/fmu/out/vehicle_odometry",
                make["VehicleOdometry"](stamp, 1, nothing, turn, 1, nothing),
            )
        )
    found = load_flight(write_rows(tmp_path, "mcap", store, sent))
    assert set(found) == {"position", "quaternion"}
    np.testing.assert_array_equal(found["position"].values, [[0.0, -1.0, -2.0]] * 8)
    for said in (
        (
            "/fmu/out/vehicle_local_position: is not valid by xy_valid in 4, v_z_valid"
            " in 12 of 12 rows, which are left out."
        ),
        (
            "velocity: no row of /fmu/out/vehicle_odometry: velocity[0], velocity[1],"
            " velocity[2] holds numbers, so that the channel is left out."
        ),
    ):
        assert said in found.notes
    assert "the fastest" not in " ".join(found.notes)


@pytest.mark.parametrize("more", [False, True])
def test_a_bag_without_definitions_of_its_messages_names_their_types(
    more: bool, tmp_path: Path
) -> None:
    """ROS 2 Humble writes none to .db3, so that types beyond those of ROS itself are
    unknown.
    """
    store, sent = get_typestore(Stores.ROS2_HUMBLE), []
    store.register(
        get_types_from_msg(OF_PX4["SensorCombined"], "px4_msgs/msg/SensorCombined")
    )
    make, numbers = Messages(store, "db3"), np.zeros(3, np.float32)
    for k in range(12):
        combined = store.types["px4_msgs/msg/SensorCombined"](
            30_000_000 + 10_000 * k, numbers, numbers
        )
        sent.append((START + 10**7 * k, "/fmu/out/sensor_combined", combined))
        if more:
            sent.append(
                (
                    START + 10**7 * k,
                    "/imu",
                    make.imu(START + 10**7 * k, [k, 0, 0], [0, 0, 9]),
                )
            )
    path = write_rows(tmp_path, "db3", store, sent)
    with sqlite3.connect(path) as file:
        file.execute("DELETE FROM message_definitions")
    (path.parent / "metadata.yaml").unlink()
    said = (
        r"bag: holds no definition of px4_msgs/msg/SensorCombined; convert it by 'ros2"
        r" bag convert' to mcap "
    )
    if more:
        found = load_flight(path)
        assert re.match(said, found.notes[0])
        np.testing.assert_array_equal(found["gyro"].values[:, 0], np.arange(12))
        from skyarm.flight_data.columns_file import columns_from

        names = [f"gyro_rad[{k}]" for k in range(3)]
        own = columns_from(
            {"gyro": {"topic": "/fmu/out/sensor_combined", "columns": names}}
        )
        with pytest.raises(ValueError, match=said):
            load_flight(path, own)
    else:
        with pytest.raises(ValueError, match=said):
            load_flight(path)


def odometry_bag(
    folder: Path, text: str, *rows: tuple[Any, ...], attitude: bool = False
) -> FlightData:
    """Flight of a bag with PX4's odometry of the given definition, and perhaps an
    attitude in NED beside it.
    """
    store = get_typestore(Stores.ROS2_HUMBLE)
    texts = {
        "VehicleOdometry": text,
        "VehicleAttitude": "uint64 timestamp\nfloat32[4] q\n",
    }
    for name, each in texts.items():
        store.register(get_types_from_msg(each, f"px4_msgs/msg/{name}"))
    sent = []
    for k, row in enumerate(rows):
        odometry = store.types["px4_msgs/msg/VehicleOdometry"](
            30_000_000 + 10_000 * k, *row
        )
        sent.append((START + 10**7 * k, "/fmu/out/vehicle_odometry", odometry))
        if attitude:
            turn = store.types["px4_msgs/msg/VehicleAttitude"](
                30_000_000 + 10_000 * k, np.array([1, 0, 0, 0], np.float32)
            )
            sent.append((START + 10**7 * k, "/fmu/out/vehicle_attitude", turn))
    return load_flight(write_rows(folder, "mcap", store, sent))


NEW = (
    "uint64 timestamp\nuint8 pose_frame\nfloat32[3] position\nfloat32[4] q\nuint8"
    " velocity_frame\nfloat32[3] velocity\n"
)
OLD = (
    "uint64 timestamp\nuint8 local_frame\nfloat32 x\nfloat32 y\nfloat32 z\nfloat32[4]"
    " q\nuint8 velocity_frame\n" + "float32 vx\nfloat32 vy\nfloat32 vz\n"
)


@pytest.mark.parametrize("attitude", [False, True])
@pytest.mark.parametrize("is_old", [False, True])
@pytest.mark.parametrize("pose", [0, 1, 2])
@pytest.mark.parametrize("speed", [0, 1, 2, 3])
def test_odometry_of_px4_is_read_right_or_left_out_with_its_axes(
    pose: int, speed: int, is_old: bool, attitude: bool, tmp_path: Path
) -> None:
    """Numbers of the axes: unknown 0, NED 1, FRD 2, FRD of the base 3; before 2022 NED
    0, FRD 1, other 2, base 3.
    """
    draw, turns = np.random.default_rng(pose), Rotation.random(12, random_state=1)
    place, velocity = (draw.normal(size=(12, 3)).astype(np.float32) for _ in range(2))
    number = [2, 0, 1, 3] if is_old else [0, 1, 2, 3]
    rows = []
    for p, q, v in zip(
        place,
        turns.as_quat(scalar_first=True).astype(np.float32),
        velocity,
        strict=True,
    ):
        apart = [*map(float, p)] if is_old else [p]
        rows.append(
            (
                number[pose],
                *apart,
                q,
                number[speed],
                *([*map(float, v)] if is_old else [v]),
            )
        )
    made = partial(
        odometry_bag, tmp_path, OLD if is_old else NEW, *rows, attitude=attitude
    )
    if pose == 0 and speed in (0, 3) and not attitude:
        with pytest.raises(
            ValueError,
            match=r"channels = none: .*; (velocity|position): .*(axes|to turn it by)",
        ):
            made()
        return
    found = made()
    flip, notes = Rotation.from_quat([1, 0, 0, 0]), " ".join(found.notes)
    has_pose = pose == 1 or (pose == 2 and not attitude)
    assert ("position" in found) == has_pose
    assert ("position: of /fmu/out/vehicle_odometry is left out" in notes) == (
        not has_pose
    )
    if has_pose:
        np.testing.assert_allclose(
            found["position"].values, flip.apply(place), atol=1e-6
        )
    read = (
        Rotation.from_quat(found["quaternion"].values, scalar_first=True)
        if "quaternion" in found
        else None
    )
    if has_pose and not attitude:
        assert read is not None
        assert (read.inv() * (flip * turns * flip)).magnitude().max() < 1e-6
    is_in_world = speed == (
        1 if pose == 1 or attitude else pose or speed
    ) and speed in (1, 2)
    assert ("velocity" in found) == (is_in_world or speed == 3)
    if speed == 3:
        assert read is not None
        np.testing.assert_allclose(
            found["velocity"].values, read.apply(flip.apply(velocity)), atol=1e-5
        )
    elif is_in_world:
        np.testing.assert_allclose(
            found["velocity"].values, flip.apply(velocity), atol=1e-6
        )
    else:
        assert "velocity: of /fmu/out/vehicle_odometry is left out" in notes


def test_rates_before_the_filters_are_read_and_nothing_that_is_sent_to_px4(
    tmp_path: Path,
) -> None:
    """A pose of a motion capture that is sent to PX4 bears the clock of its sender."""
    store, sent = get_typestore(Stores.ROS2_HUMBLE), []
    texts = {
        "VehicleOdometry": NEW,
        **dict.fromkeys(
            ("VehicleAngularVelocity", "VehicleAcceleration"),
            "uint64 timestamp\nfloat32[3] xyz\n",
        ),
    }
    for name, text in texts.items():
        store.register(get_types_from_msg(text, f"px4_msgs/msg/{name}"))
    make = {name: store.types[f"px4_msgs/msg/{name}"] for name in texts}
    for k in range(12):
        when, stamp = START + 10**7 * k, 30_000_000 + 10_000 * k
        numbers = np.array([k, 2, 3], np.float32)
        pose = make["VehicleOdometry"](
            START // 1000 + k,
            2,
            numbers,
            np.array([1, 0, 0, 0], np.float32),
            2,
            numbers,
        )
        sent.append((when, "/fmu/in/vehicle_visual_odometry", pose))
        for name, topic in (
            ("VehicleAngularVelocity", "vehicle_angular_velocity"),
            ("VehicleAcceleration", "vehicle_acceleration"),
        ):
            sent.append((when, f"/fmu/out/{topic}", make[name](stamp, numbers)))
    found = load_flight(write_rows(tmp_path, "mcap", store, sent))
    assert set(found) == {"gyro", "accelerometer"}
    for name in found:
        np.testing.assert_array_equal(
            found[name].values, np.stack([[k, -2.0, -3.0] for k in range(12)])
        )
        np.testing.assert_allclose(found[name].time, 0.01 * np.arange(12), atol=1e-6)
