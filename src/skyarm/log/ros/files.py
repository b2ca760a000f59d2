"""A flight as messages: an MCAP file of ROS 2, written and read back, and a bag of ROS 1, written."""

from __future__ import annotations

import io
import json
import os
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.log.contents import arrays_of, as_cut, columns_in, log_info, log_of
from skyarm.log.flight_log import Log, rows_of
from skyarm.log.ros.messages import FLIGHT, definition, full_name
from skyarm.log.ros.topics import FLIGHT_TOPIC, FlightTopics, Topic
from skyarm.records.files import needs_extra, shown, versions
from skyarm.records.files.writing import writing_atomically

INFO, SCENARIO = "info.json", "scenario.json"
"""Attachments of an MCAP file: the description of the flight, and in a file of its own the scenario as plain data."""

MAGIC = b"\x89MCAP0\r\n"

CHUNK = 1 << 19
"""Bytes of a chunk, about a second of flight: the most that is lost where a file is cut off."""

UNKNOWN = ("tf2_msgs/TFMessage", FLIGHT, "skyarm_msgs/Reading")
"""Types that rosbags does not know of ROS 1; all are the same there."""

PIECE = 10_000
"""Control instants that are made into messages at a time, about."""

EARLIEST = 1
"""ns: ROS 1 refuses messages of time zero (ros::TIME_MIN)."""


class McapError(ValueError):
    """Not an MCAP file of a flight, or a damaged one; the message states what is required."""


def write_mcap(log: Log, path: Path) -> Path:
    """Write a log as an MCAP file, which appears whole or not at all; equal flights give equal bytes.

    Raises:
        ValueError: mcap is missing. OSError: it cannot be written.
    """
    try:
        from mcap.writer import CompressionType, Writer
    except ImportError:
        raise ValueError(f"mcap: is missing; a log as MCAP {needs_extra('logs')}") from None
    topics, info = FlightTopics(log), log_info(log)
    scenario = info.pop("scenario_record", None)
    with writing_atomically(path) as stream:
        writer: Any = Writer(stream, chunk_size=CHUNK, compression=CompressionType.NONE, enable_data_crcs=True)
        writer.start(profile="ros2", library=f"skyarm {versions()['skyarm']}")
        for name, data in ((INFO, info), (SCENARIO, scenario)):
            if data is not None:
                writer.add_attachment(0, 0, name, "application/json", json.dumps(data).encode())
        plain = {name: str(value) for name, value in info.items() if isinstance(value, (str, int, float))}
        writer.add_metadata("skyarm", plain)
        schemas: dict[str, int] = {}
        channels: dict[str, int] = {}
        numbers: Counter[str] = Counter()
        for topic in topics.topics:
            if topic.kind not in schemas:
                text = definition(topic.kind, topics.definitions).encode()
                schemas[topic.kind] = writer.register_schema(full_name(topic.kind), "ros2msg", text)
            channels[topic.name] = writer.register_channel(topic.name, "cdr", schemas[topic.kind])
        for stamp, topic, data in _messages(topics, log):
            writer.add_message(channels[topic.name], stamp, data, stamp, numbers[topic.name])
            numbers[topic.name] += 1
        writer.finish()
    return path


def read_mcap(path: Path) -> Log:
    """Read a log from an MCAP file, to the bit; from one that was cut off what came before.

    The log of such a file has the status ``cut``, and a warning says at what time.

    Raises:
        OSError: the file cannot be read. ValueError: one line: it is no such file, it is damaged, or mcap is missing.
    """
    name, content = f"log = {shown(os.fspath(path))}", path.read_bytes()
    attachments: dict[str, bytes] = {}
    messages: list[bytes] = []
    try:
        whole = _scan(content, attachments, messages)
        if INFO not in attachments:
            raise McapError(f"must be a log that skyarm wrote, with the attachment {INFO}")
        info = _plain(attachments[INFO])
        if SCENARIO in attachments:
            info["scenario_record"] = _plain(attachments[SCENARIO])
        elif "digest" in info:
            raise McapError(f"must hold the attachment {SCENARIO}, before which it was cut off")
        names = columns_in(info)
        log = log_of(arrays_of(_numbers(messages, len(names)), names, info), info)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    return log if whole else as_cut(log, name)


def _scan(content: bytes, attachments: dict[str, bytes], messages: list[bytes]) -> bool:
    """Collect attachments by name and the messages of the flight; whether the file was written to its end."""
    wanted = None
    for record in _records(content):
        kind = type(record).__name__
        if kind == "Attachment":
            attachments[record.name] = record.data
        elif kind == "Channel" and record.topic == FLIGHT_TOPIC:
            wanted = record.id
        elif kind == "Message" and record.channel_id == wanted:
            messages.append(record.data)
        elif kind == "DataEnd":
            return True
    return False


def _records(content: bytes) -> Iterator[Any]:
    """Records of a file and of its chunks, to the end of the last that is whole.

    Raises:
        McapError: it is no MCAP file, is damaged, or its chunks are compressed, whose size is unknown in advance.
    """
    try:
        from mcap.exceptions import EndOfFile, RecordLengthLimitExceeded
        from mcap.records import Chunk
        from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
    except ImportError:
        raise McapError(f"mcap: is missing; a log as MCAP {needs_extra('logs')}") from None
    if not content.startswith(MAGIC):
        raise McapError("must be an MCAP file" if content else "must be an MCAP file, and is empty")
    reader = StreamReader(
        io.BytesIO(content), emit_chunks=True, validate_crcs=True, record_size_limit=max(len(content), 1)
    )
    try:
        for record in reader.records:
            if not isinstance(record, Chunk):
                yield record
            elif record.compression:
                raise McapError(f"chunks: must not be compressed ({shown(record.compression)})")
            else:
                yield from breakup_chunk(record, validate_crc=True)
    except (EndOfFile, RecordLengthLimitExceeded):
        return
    except CRCValidationError as error:
        raise McapError("must have the checksums that it was written with; the file is damaged") from error
    except McapError:
        raise
    except Exception as error:  # a forged record fails as its reader does
        raise McapError("must be a whole MCAP file; the file is damaged") from error


def _plain(data: bytes) -> Any:
    try:
        found = json.loads(data)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise McapError(f"{INFO}, {SCENARIO}: must be as skyarm writes them of a flight")
    return found


def _numbers(messages: list[bytes], width: int) -> Any:
    """Float64 fields of messages that hold nothing else, (N, width)."""
    size = 4 + 8 * width
    if any(len(each) != size for each in messages):
        raise McapError(f"messages of a flight: must have {width} numbers each")
    rows = np.frombuffer(b"".join(messages), dtype=np.uint8).reshape(-1, size)[:, 4:]
    return np.ascontiguousarray(rows).view("<f8").astype(float).reshape(-1, width)


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
            for stamp, topic, message in _messages(topics, log, ros1=True):
                writer.write(known[topic.name], max(stamp, EARLIEST), message)
        with writing_atomically(path) as stream, file.open("rb") as written:
            while block := written.read(1 << 20):
                stream.write(block)
    return path


def _messages(topics: FlightTopics, log: Log, ros1: bool = False) -> Iterator[tuple[int, Topic, Any]]:
    """Time in ns, topic and bytes of every message, in the order of time."""
    length = topics.period * max(1, PIECE // topics.period)
    for begin in range(0, log.time.size, length):
        piece, rows = rows_of(log, slice(begin, begin + length)), []
        for order, topic in enumerate(topics.topics):
            if topic.every or not begin:
                stamps, data = topics.encode(topic, piece, ros1)
                rows += [(t, order, row.tobytes()) for t, row in zip(stamps.tolist(), data, strict=True)]
        rows.sort(key=lambda row: row[:2])
        yield from ((t, topics.topics[order], data) for t, order, data in rows)
