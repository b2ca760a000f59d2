"""Messages on the wire against rosbags, which shares no code with us: bytes, checksums and texts of definitions."""

from __future__ import annotations

import random
import struct

import numpy as np
import pytest

from skyarm.log.ros.message_bytes import MessageError, decode, encode
from skyarm.log.ros.messages import DEFINITIONS, ROS1_DEFINITIONS, checksum, definition

typesys = pytest.importorskip("rosbags.typesys", reason="needs the extra 'test'")

OLD = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
NEW = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
OLD.register(typesys.get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))

ONLY_NEW = {"visualization_msgs/UVCoordinate", "visualization_msgs/MeshFile", "skyarm_msgs/Reading"}
BUILT_IN = {"time", "duration"}
KINDS = sorted({*ROS1_DEFINITIONS} - ONLY_NEW - BUILT_IN)

FUZZED = 3500
"""Changed and random messages of each of six kinds."""


def full(kind: str) -> str:
    return kind.replace("/", "/msg/")


@pytest.mark.parametrize("kind", KINDS)
def test_checksums_and_texts_of_ros_1_are_those_of_rosbags(kind):
    text, md5 = OLD.generate_msgdef(full(kind), ros_version=1)
    assert checksum(kind, ROS1_DEFINITIONS) == md5
    assert definition(kind, ROS1_DEFINITIONS) == text


def test_known_checksums_of_ros_1():
    """As ``rosmsg md5`` of ROS Noetic prints them."""
    known = {
        "nav_msgs/Odometry": "cd5e73d190d741a2f92e81eda573aca7",
        "tf2_msgs/TFMessage": "94810edda583a504dfda3829e70d7eec",
        "sensor_msgs/JointState": "3066dcd76a6cfaef579bd0f34173e9fd",
        "geometry_msgs/PoseStamped": "d3812c3cbc69362b77dc0b19b345f8f5",
        "std_msgs/Float64MultiArray": "4b7d974086d4060e7db4613a7e6c3ba4",
        "rosgraph_msgs/Clock": "a9c97c1d230cfc112e270351a944ee47",
    }
    assert {kind: checksum(kind, ROS1_DEFINITIONS) for kind in known} == known


VALUES = {
    "nav_msgs/Odometry": {
        "header": {"stamp": 1_500_000_007, "frame_id": "world"},
        "child_frame_id": "base_link",
        "pose": {"pose": {"position": {"x": 1.5, "y": -2.0, "z": 3.25}, "orientation": {"w": 0.5, "z": -0.5}}},
        "twist": {"covariance": np.arange(36.0), "twist": {"angular": {"y": 7.0}}},
    },
    "sensor_msgs/JointState": {
        "header": {"stamp": 2, "frame_id": ""},
        "name": ["a", "long name", ""],
        "position": np.array([1.0, 2.0, -3.0]),
        "effort": np.array([0.5]),
    },
    "std_msgs/Float64MultiArray": {
        "layout": {"dim": [{"label": "rotors", "size": 4, "stride": 6}], "data_offset": 3},
        "data": np.array([1.0, np.inf, -0.0]),
    },
    "tf2_msgs/TFMessage": {
        "transforms": [
            {"header": {"stamp": 5, "frame_id": "w"}, "child_frame_id": name, "transform": {"rotation": {"w": 1.0}}}
            for name in ("b", "link")
        ]
    },
    "visualization_msgs/MarkerArray": {
        "markers": [{"ns": "hull", "id": 3, "color": {"r": 0.5}, "frame_locked": True, "lifetime": {"sec": 4}}]
    },
}


def plain(message) -> object:
    """Fields of a message of rosbags as dictionaries."""
    if hasattr(message, "__msgtype__"):
        return {name: plain(getattr(message, name)) for name in message.__dataclass_fields__ if name[0].islower()}
    if isinstance(message, np.ndarray):
        return message.tolist()
    return [plain(each) for each in message] if isinstance(message, list) else message


@pytest.mark.parametrize("packed", [False, True], ids=["cdr", "ros1"])
@pytest.mark.parametrize("kind", sorted(VALUES))
def test_messages_are_written_and_read_as_rosbags_reads_and_writes_them(kind, packed):
    store, definitions = (OLD, ROS1_DEFINITIONS) if packed else (NEW, DEFINITIONS)
    data = encode(kind, definitions, VALUES[kind], 1, packed=packed)[0].tobytes()
    read = (store.deserialize_ros1 if packed else store.deserialize_cdr)(data, full(kind))
    written = bytes((store.serialize_ros1 if packed else store.serialize_cdr)(read, full(kind)))
    assert written == data
    assert decode(kind, definitions, written, packed=packed) == plain(read)


def test_big_endian_messages_are_read():
    data = struct.pack(">4B3I4x2d", 0, 0, 0, 0, 0, 9, 2, 1.5, -2.5)
    assert decode("std_msgs/Float64MultiArray", DEFINITIONS, data) == {
        "layout": {"dim": [], "data_offset": 9},
        "data": [1.5, -2.5],
    }


@pytest.mark.parametrize("head", [b"\x00\x02", b"\x00\x06", b"\x00\x07", b"\x01\x01", b"\x00\x0b"])
def test_other_encapsulations_are_refused(head):
    """Parameter lists, the second version of CDR, and what is none."""
    whole = encode("geometry_msgs/PoseStamped", DEFINITIONS, {}, 1)[0].tobytes()
    decode("geometry_msgs/PoseStamped", DEFINITIONS, whole)
    with pytest.raises(MessageError, match="plain CDR"):
        decode("geometry_msgs/PoseStamped", DEFINITIONS, head + whole[2:])


@pytest.mark.parametrize("packed", [False, True], ids=["cdr", "ros1"])
@pytest.mark.parametrize("kind", ["geometry_msgs/PoseStamped", "sensor_msgs/JointState", "std_msgs/Float64MultiArray"])
def test_bytes_that_are_no_message_are_refused_in_one_line(kind, packed):
    """Cut, changed and random bytes: a message or a MessageError, and no list that fills the memory."""
    definitions, rng = ROS1_DEFINITIONS if packed else DEFINITIONS, random.Random(kind)
    whole = encode(kind, definitions, VALUES.get(kind, {}), 1, packed=packed)[0].tobytes()
    for length in range(len(whole)):
        with pytest.raises(MessageError):
            decode(kind, definitions, whole[:length], packed=packed)
    refused = 0
    for _ in range(FUZZED):
        data = bytearray(whole if rng.random() < 0.5 else rng.randbytes(rng.randrange(200)))
        for _ in range(rng.randrange(6)):
            if data:
                data[rng.randrange(len(data))] = rng.randrange(256)
        try:
            decode(kind, definitions, bytes(data), packed=packed)
        except MessageError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > FUZZED // 5
