"""A flight as a bag of ROS 1, which rosbags writes; the same topics as in an MCAP file. It is not read back."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from skyarm.files import needs_extra
from skyarm.files.atomic import writing_atomically
from skyarm.log.flight_log import Log, rows_of
from skyarm.log.ros.message_types import FLIGHT, full_name
from skyarm.log.ros.topics import FlightTopics, Topic

UNKNOWN = ("tf2_msgs/TFMessage", FLIGHT, "skyarm_msgs/Reading")
"""Types that rosbags does not know of ROS 1; all are the same there."""

PIECE = 10_000
"""Control instants that are made into messages at a time, about."""

EARLIEST = 1
"""ns: ROS 1 refuses messages of time zero (ros::TIME_MIN)."""


def write_bag(log: Log, path: Path) -> Path:
    """Write a log as a bag of ROS 1, which appears whole or not at all.

    Raises:
        ValueError: rosbags is missing. OSError: it cannot be written.
    """
    try:
        from rosbags.rosbag1 import Writer
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        raise ValueError(f"rosbags: is missing; a bag of ROS 1 {needs_extra('logs')}") from None
    topics = FlightTopics(log)
    types = get_typestore(Stores.ROS1_NOETIC)
    for kind in UNKNOWN:
        types.register(get_types_from_msg(topics.definitions[kind], full_name(kind)))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "flight.bag")
        with Writer(file) as writer:
            known = {
                topic.name: writer.add_connection(
                    topic.name, full_name(topic.kind), typestore=types, latching=int(not topic.every)
                )
                for topic in topics.topics
            }
            for stamp, topic, message in _messages(topics, log):
                writer.write(known[topic.name], max(stamp, EARLIEST), message)
        with writing_atomically(path) as stream, file.open("rb") as written:
            while block := written.read(1 << 20):
                stream.write(block)
    return Path(os.fspath(path))


def _messages(topics: FlightTopics, log: Log) -> Iterator[tuple[int, Topic, Any]]:
    """Time in ns, topic and bytes of every message, in the order of time."""
    length = topics.period * max(1, PIECE // topics.period)
    for begin in range(0, log.time.size, length):
        piece, rows = rows_of(log, slice(begin, begin + length)), []
        for order, topic in enumerate(topics.topics):
            if topic.every or not begin:
                stamps, data = topics.encoded(topic, piece, ros1=True)
                rows += [(t, order, row.tobytes()) for t, row in zip(stamps.tolist(), data, strict=True)]
        rows.sort(key=lambda row: row[:2])
        yield from ((t, topics.topics[order], data) for t, order, data in rows)
