"""Writing an MCAP file: records one behind the other, messages in chunks, an index at the end.

Source: MCAP format specification, mcap.dev/spec, version 0. Chunks are not compressed, so that no library is needed and
equal flights give equal bytes.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

MAGIC = b"\x89MCAP0\r\n"

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(9, 16)
"""Opcodes of the records."""

PROFILE, ENCODING, SCHEMA_ENCODING = "ros2", "cdr", "ros2msg"

Bytes = npt.NDArray[np.uint8]
Stamps = npt.NDArray[np.int64]

_HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)
"""What a message record begins with."""

_FIELDS = _HEAD.itemsize - 9
"""Bytes of a message's record before its data, opcode and length apart."""


@dataclass(frozen=True, slots=True)
class Messages:
    """Messages of one channel in a chunk.

    Attributes:
        channel: its number. first: number of the first of these messages in the channel.
        every: instants from one to the next; 0 for messages before the first instant. offset: instant of the first.
        stamps: (N,) ns. data: (N, size).
    """

    channel: int
    first: int
    every: int
    stamps: Stamps
    data: Bytes
    offset: int = 0

    def records(self) -> Bytes:
        """The messages with what their records begin with, (N, size)."""
        count, size = self.data.shape
        head = np.zeros(count, dtype=_HEAD)
        head["opcode"], head["length"], head["channel"] = MESSAGE, size + _FIELDS, self.channel
        head["sequence"] = self.first + np.arange(count)
        head["log_time"] = head["publish_time"] = self.stamps
        return np.concatenate([head.view(np.uint8).reshape(count, _HEAD.itemsize), self.data], axis=1)


@dataclass
class _Written:
    """What the index at the end tells of the records before it."""

    schemas: list[bytes] = field(default_factory=list)
    channels: list[bytes] = field(default_factory=list)
    chunks: list[bytes] = field(default_factory=list)
    attachments: list[bytes] = field(default_factory=list)
    metadata: list[bytes] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=dict)
    times: list[int] = field(default_factory=list)


class McapWriter:
    """Writes an MCAP file piece by piece; without its end, a reader still finds what was written.

    Args:
        write: takes bytes, in the order of the file.
        library: what writes it, in words.
    """

    def __init__(self, write: Callable[[bytes], object], library: str) -> None:
        self._write = write
        self._at, self._sum = 0, 0
        self._kept = _Written()
        self._put(MAGIC + _record(HEADER, _text(PROFILE) + _text(library)))

    def _put(self, content: bytes) -> int:
        """Write; returns where it begins."""
        begin, self._at = self._at, self._at + len(content)
        self._sum = zlib.crc32(content, self._sum)
        self._write(content)
        return begin

    def channel(self, topic: str, schema: str, definition: str) -> int:
        """Announce a topic and the definition of its messages; returns the channel's number."""
        kept, number = self._kept, len(self._kept.channels) + 1  # some readers take a zero for none
        content = _text(schema) + _text(SCHEMA_ENCODING) + _text(definition)
        known = [each[11:] for each in kept.schemas]
        if content not in known:
            known.append(content)
            kept.schemas.append(_record(SCHEMA, struct.pack("<H", len(known)) + content))
            self._put(kept.schemas[-1])
        of = known.index(content) + 1
        channel = struct.pack("<HH", number, of) + _text(topic) + _text(ENCODING) + _texts({})
        kept.channels.append(_record(CHANNEL, channel))
        kept.counts[number] = 0
        self._put(kept.channels[-1])
        return number

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Attach a file."""
        content = struct.pack("<QQ", 0, 0) + _text(name) + _text(media_type) + struct.pack("<Q", len(data)) + data
        content += struct.pack("<I", zlib.crc32(content))
        record = _record(ATTACHMENT, content)
        index = struct.pack("<QQQQQ", self._put(record), len(record), 0, 0, len(data)) + _text(name) + _text(media_type)
        self._kept.attachments.append(_record(ATTACHMENT_INDEX, index))

    def describe(self, name: str, values: Mapping[str, str]) -> None:
        """Write texts by name."""
        record = _record(METADATA, _text(name) + _texts(values))
        index = struct.pack("<QQ", self._put(record), len(record)) + _text(name)
        self._kept.metadata.append(_record(METADATA_INDEX, index))

    def chunk(self, messages: Sequence[Messages], period: int) -> None:
        """Write messages in the order of their instants.

        Args:
            messages: of each channel; those of one instant are written in this order.
            period: instants after which the pattern of channels begins again.
        """
        kept, given = self._kept, [each for each in messages if each.stamps.size]
        if not given:
            return
        records, places = _interleaved(given, period)
        for each in given:
            kept.counts[each.channel] += each.stamps.size
        begin, end = (int(f(f(each.stamps) for each in given)) for f in (min, max))
        kept.times += [begin, end]
        whole = struct.pack("<QQQI", begin, end, len(records), zlib.crc32(records)) + _text("")
        chunk = _record(CHUNK, whole + struct.pack("<Q", len(records)) + records)
        at, first = self._put(chunk), self._at
        offsets = b""
        for each, place in zip(given, places, strict=True):
            rows = np.stack([each.stamps, place], axis=1).astype("<u8").tobytes()
            content = struct.pack("<HI", each.channel, len(rows)) + rows
            offsets += struct.pack("<HQ", each.channel, self._put(_record(MESSAGE_INDEX, content)))
        index = struct.pack("<QQQQI", begin, end, at, len(chunk), len(offsets)) + offsets
        index += struct.pack("<Q", self._at - first) + _text("") + struct.pack("<QQ", len(records), len(records))
        kept.chunks.append(_record(CHUNK_INDEX, index))

    def end(self) -> None:
        """Write the index; nothing may be written after it."""
        kept = self._kept
        self._put(_record(DATA_END, struct.pack("<I", self._sum)))
        start, summary, offsets = self._at, b"", b""
        groups = {
            SCHEMA: kept.schemas,
            CHANNEL: kept.channels,
            STATISTICS: [self._statistics()],
            CHUNK_INDEX: kept.chunks,
            ATTACHMENT_INDEX: kept.attachments,
            METADATA_INDEX: kept.metadata,
        }
        for opcode, records in groups.items():
            content = b"".join(records)
            if content:
                place = struct.pack("<BQQ", opcode, start + len(summary), len(content))
                offsets += _record(SUMMARY_OFFSET, place)
            summary += content
        whole = summary + offsets + struct.pack("<BQQQ", FOOTER, 20, start, start + len(summary))
        self._put(whole + struct.pack("<I", zlib.crc32(whole)) + MAGIC)

    def _statistics(self) -> bytes:
        kept = self._kept
        lists = (kept.channels, kept.attachments, kept.metadata, kept.chunks)
        counts = b"".join(struct.pack("<HQ", *each) for each in kept.counts.items())
        content = struct.pack("<QH", sum(kept.counts.values()), len(kept.schemas))
        content += struct.pack("<IIII", *map(len, lists))
        content += struct.pack("<QQ", min(kept.times, default=0), max(kept.times, default=0))
        return _record(STATISTICS, content + struct.pack("<I", len(counts)) + counts)


def _interleaved(messages: Sequence[Messages], period: int) -> tuple[bytes, list[Stamps]]:
    """Records of all messages by instant, and where those of each channel begin.

    Within a period every record has its place: whole periods are rows of one table, what is left is a row of its own.
    """
    records = [each.records() for each in messages]
    places: list[list[Stamps]] = [[np.zeros(0, dtype=np.int64)] for _ in messages]
    pieces: list[bytes] = []
    at = 0
    for k, each in enumerate(messages):
        if each.every == 0:
            count, size = records[k].shape
            places[k].append(at + size * np.arange(count))
            pieces.append(records[k].tobytes())
            at += count * size
    ends = ((each.stamps.size - 1) * each.every + each.offset + 1 for each in messages if each.every)
    instants = max(ends, default=0)
    left = instants % period
    for rows, start, length in ((instants // period, 0, period), (1, instants - left, left)):
        if not rows or not length:
            continue
        row: list[tuple[int, Bytes]] = []
        for j in range(length):
            for k, each in enumerate(messages):
                if each.every and j % each.every == each.offset:
                    row.append((k, records[k][(start + j) // each.every :: period // each.every][:rows]))
        begins = np.cumsum([0, *(part.shape[1] for _, part in row)])
        for k in range(len(messages)):
            own = [begins[i] for i, (channel, _) in enumerate(row) if channel == k]
            places[k].append((at + begins[-1] * np.arange(rows)[:, None] + np.array(own, dtype=np.int64)).ravel())
        table = np.concatenate([part for _, part in row], axis=1)
        pieces.append(table.tobytes())
        at += table.size
    return b"".join(pieces), [np.concatenate(each) for each in places]


def _record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def _text(text: str) -> bytes:
    content = text.encode()
    return struct.pack("<I", len(content)) + content


def _texts(values: Mapping[str, str]) -> bytes:
    content = b"".join(_text(name) + _text(value) for name, value in values.items())
    return struct.pack("<I", len(content)) + content
