"""Messages on the wire against rosbags, which shares no code with us: bytes, and texts
of definitions.
"""

from __future__ import annotations

import random
import struct

import numpy as np
import pytest

from skyarm.log.ros.message_bytes import MessageError, decode, encode
from skyarm.log.ros.messages import DEFINITIONS, definition

typesys = pytest.importorskip("rosbags.typesys", reason="needs the extra 'test'")

STORE = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)

LABELS = ("vision_msgs/LabelInfo", "vision_msgs/VisionClass")
"""Types of vision_msgs, which the store lacks."""

KINDS = sorted({*DEFINITIONS} - {"skyarm_msgs/Reading", *LABELS})

FUZZED = 3500
"""Changed and random messages of each of six kinds."""


def full(kind: str) -> str:
    return kind.replace("/", "/msg/")


@pytest.mark.parametrize("kind", KINDS)
def test_texts_of_definitions_are_of_the_types_of_ros(kind):
    """By the hash with which ROS 2 tells types apart (REP 2011)."""
    read = typesys.get_typestore(typesys.Stores.EMPTY)
    read.register(typesys.get_types_from_msg(definition(kind, DEFINITIONS), full(kind)))
    assert read.hash_rihs01(full(kind)) == STORE.hash_rihs01(full(kind))


VALUES = {
    "nav_msgs/Odometry": {
        "header": {"stamp": 1_500_000_007, "frame_id": "world"},
        "child_frame_id": "base_link",
        "pose": {
            "pose": {
                "position": {"x": 1.5, "y": -2.0, "z": 3.25},
                "orientation": {"w": 0.5, "z": -0.5},
            }
        },
        "twist": {"covariance": np.arange(36.0), "twist": {"angular": {"y": 7.0}}},
    },
    "sensor_msgs/JointState": {
        "header": {"stamp": 2, "frame_id": ""},
        "name": ["a", "long name", ""],
        "position": np.array([1.0, 2.0, -3.0]),
        "effort": np.array([0.5]),
    },
    "std_msgs/Float64MultiArray": {
        "layout": {
            "dim": [{"label": "rotors", "size": 4, "stride": 6}],
            "data_offset": 3,
        },
        "data": np.array([1.0, np.inf, -0.0]),
    },
    "tf2_msgs/TFMessage": {
        "transforms": [
            {
                "header": {"stamp": 5, "frame_id": "w"},
                "child_frame_id": name,
                "transform": {"rotation": {"w": 1.0}},
            }
            for name in ("b", "link")
        ]
    },
    "visualization_msgs/MarkerArray": {
        "markers": [
            {
                "ns": "hull",
                "id": 3,
                "color": {"r": 0.5},
                "frame_locked": True,
                "lifetime": {"sec": 4},
            }
        ]
    },
}


def plain(message) -> object:
    """Fields of a message of rosbags as dictionaries."""
    if hasattr(message, "__msgtype__"):
        return {
            name: plain(getattr(message, name))
            for name in message.__dataclass_fields__
            if name[0].islower()
        }
    if isinstance(message, np.ndarray):
        return message.tolist()
    return [plain(each) for each in message] if isinstance(message, list) else message


@pytest.mark.parametrize("kind", sorted(VALUES))
def test_messages_are_written_and_read_as_rosbags_reads_and_writes_them(kind):
    data = encode(kind, DEFINITIONS, VALUES[kind], 1)[0].tobytes()
    read = STORE.deserialize_cdr(data, full(kind))
    written = bytes(STORE.serialize_cdr(read, full(kind)))
    assert written == data
    assert decode(kind, DEFINITIONS, written) == plain(read)


def test_big_endian_messages_are_read():
    data = struct.pack(">4B3I4x2d", 0, 0, 0, 0, 0, 9, 2, 1.5, -2.5)
    assert decode("std_msgs/Float64MultiArray", DEFINITIONS, data) == {
        "layout": {"dim": [], "data_offset": 9},
        "data": [1.5, -2.5],
    }


@pytest.mark.parametrize(
    "head", [b"\x00\x02", b"\x00\x06", b"\x00\x07", b"\x01\x01", b"\x00\x0b"]
)
def test_other_encapsulations_are_refused(head):
    """Parameter lists, the second version of CDR, and what is none."""
    whole = encode("geometry_msgs/PoseStamped", DEFINITIONS, {}, 1)[0].tobytes()
    decode("geometry_msgs/PoseStamped", DEFINITIONS, whole)
    with pytest.raises(MessageError, match="plain CDR"):
        decode("geometry_msgs/PoseStamped", DEFINITIONS, head + whole[2:])


@pytest.mark.parametrize(
    "kind",
    [
        "geometry_msgs/PoseStamped",
        "sensor_msgs/JointState",
        "std_msgs/Float64MultiArray",
    ],
)
def test_bytes_that_are_no_message_are_refused_in_one_line(kind):
    """Cut, changed and random bytes: a message or a MessageError, and no list that
    fills the memory.
    """
    rng = random.Random(kind)
    whole = encode(kind, DEFINITIONS, VALUES.get(kind, {}), 1)[0].tobytes()
    for length in range(len(whole)):
        with pytest.raises(MessageError):
            decode(kind, DEFINITIONS, whole[:length])
    refused = 0
    for _ in range(FUZZED):
        data = bytearray(
            whole if rng.random() < 0.5 else rng.randbytes(rng.randrange(200))
        )
        for _ in range(rng.randrange(6)):
            if data:
                data[rng.randrange(len(data))] = rng.randrange(256)
        try:
            decode(kind, DEFINITIONS, bytes(data))
        except MessageError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > FUZZED // 5
