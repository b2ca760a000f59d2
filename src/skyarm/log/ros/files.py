"""MCAP files: write a log as ROS 2 messages, and read it back."""

from __future__ import annotations

import io
import json
from collections import Counter
from collections.abc import Iterator
from heapq import merge
from operator import itemgetter
from pathlib import Path
from typing import Any

from skyarm.log.contents import log_info
from skyarm.log.flight_log import Log, rows_of
from skyarm.log.formats import log_from_npz, npz_content
from skyarm.log.ros.messages import definition, full_name
from skyarm.log.ros.scene import Topic
from skyarm.log.ros.topics import FlightTopics
from skyarm.records.files import needs_extra, shown, versions
from skyarm.records.files.writing import writing_atomically

INFO, SCENARIO, ARRAYS = "info.json", "scenario.json", "flight.npz"
"""Attachments of an MCAP file: description of the flight, scenario as plain data, and
the log as an npz file, from which it is read back."""

CHUNK = 1 << 19
"""Size (bytes) of a chunk, about a second of flight."""

PIECE = 10_000
"""Approximate number of control instants converted to messages at a time."""


def write_mcap(log: Log, path: Path) -> Path:
    """Write a log as an MCAP file; equal flights give equal bytes.

    Raises:
        ValueError: mcap is missing. OSError: it cannot be written.
    """
    try:
        from mcap.writer import CompressionType, Writer
    except ImportError:
        raise ValueError(
            f"mcap: is missing; a log as MCAP {needs_extra('logs')}"
        ) from None
    topics, info = FlightTopics(log), log_info(log)
    scenario = info.pop("scenario_record", None)
    with writing_atomically(path) as stream:
        writer: Any = Writer(
            stream,
            # pictures fill chunks fast, and the index of every chunk stays in memory
            chunk_size=CHUNK << 2 if topics.pictures else CHUNK,
            # chosen: a reader needs no decompressor; ZSTD would make the file a third
            # as large (measured)
            compression=CompressionType.NONE,
            enable_data_crcs=True,
        )
        writer.start(profile="ros2", library=f"skyarm {versions()['skyarm']}")
        for name, data in ((INFO, info), (SCENARIO, scenario)):
            writer.add_attachment(
                0, 0, name, "application/json", json.dumps(data).encode()
            )
        # a log is read back from its own arrays, bit for bit, and not from messages
        writer.add_attachment(
            0, 0, ARRAYS, "application/octet-stream", npz_content(log)
        )
        # metadata of MCAP are texts
        plain = {
            name: str(value)
            for name, value in info.items()
            if isinstance(value, (str, int, float))
        }
        writer.add_metadata("skyarm", plain)
        schemas: dict[str, int] = {}
        channels: dict[str, int] = {}
        numbers: Counter[str] = Counter()
        seen = [topic for each in topics.pictures for topic in each.topics]
        for topic in (*topics.topics, *seen):
            if topic.kind not in schemas:
                text = definition(topic.kind, topics.definitions).encode()
                schemas[topic.kind] = writer.register_schema(
                    full_name(topic.kind), "ros2msg", text
                )
            if topic.name not in channels:
                channels[topic.name] = writer.register_channel(
                    topic.name, "cdr", schemas[topic.kind]
                )
        # pictures are not sorted in pieces with the others: one is in memory at a time
        pictures = (each.of_log(log) for each in topics.pictures)
        rows = merge(_messages(topics, log), *pictures, key=itemgetter(0))
        for stamp, topic, data in rows:
            writer.add_message(
                channels[topic.name], stamp, data, stamp, numbers[topic.name]
            )
            numbers[topic.name] += 1
        writer.finish()
    return path


def read_mcap(path: Path) -> Log:
    """Read a log from an MCAP file, bit for bit.

    Raises:
        OSError: the file cannot be read. ValueError: one line: it is no such file, it
            is damaged, or mcap is missing.
    """
    try:
        from mcap.reader import make_reader
    except ImportError:
        raise ValueError(
            f"mcap: is missing; a log as MCAP {needs_extra('logs')}"
        ) from None
    name, content = f"log = {shown(path)}", path.read_bytes()
    try:
        reader = make_reader(io.BytesIO(content), validate_crcs=True)
        flight = next(
            each.data for each in reader.iter_attachments() if each.name == ARRAYS
        )
    except Exception:  # a forged record fails as its reader does
        raise ValueError(
            f"{name}: must be a whole MCAP file that skyarm wrote;"
            " 'skyarm run SCENARIO --log FILE' writes one"
        ) from None
    return log_from_npz(flight, name)


def _messages(topics: FlightTopics, log: Log) -> Iterator[tuple[int, Topic, bytes]]:
    """Yield time (ns), topic and bytes of every ROS message of a log, ordered by
    time.
    """
    # pieces begin at whole periods, so that the pattern of topics is the same in each
    length = topics.period * max(1, PIECE // topics.period)
    for begin in range(0, log.time.size, length):
        piece = rows_of(log, slice(begin, begin + length))
        rows = []
        for order, topic in enumerate(topics.topics):
            if topic.every or not begin:
                stamps, data = topics.encode(topic, piece)
                rows += [
                    (t, order, row.tobytes())
                    for t, row in zip(stamps.tolist(), data, strict=True)
                ]
        # by time, then by the order of the topics; bytes are not compared
        rows.sort(key=lambda row: row[:2])
        yield from ((t, topics.topics[order], data) for t, order, data in rows)
