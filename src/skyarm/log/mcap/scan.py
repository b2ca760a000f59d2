"""Reading an MCAP file from its beginning, as far as it is whole: a file that was cut off has no index to read by."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from skyarm.files import shown
from skyarm.log.mcap.container import ATTACHMENT, CHANNEL, CHUNK, DATA_END, MAGIC, MESSAGE

_RECORD = struct.Struct("<BQ")

_BEFORE_DATA = 22
"""Bytes of a message's record before its data: channel, sequence and two times."""


class McapError(ValueError):
    """Bytes that are no MCAP file, or one that is damaged; says what must be."""


@dataclass
class Scanned:
    """What a file holds.

    Attributes:
        attachments: data by name. messages: data of the messages of the topic that was asked for.
        whole: whether the file was written to the end of its data.
    """

    attachments: dict[str, bytes] = field(default_factory=dict)
    messages: list[bytes] = field(default_factory=list)
    whole: bool = False


def scan(content: bytes, topic: str) -> Scanned:
    """Read the attachments and one topic.

    Args:
        content: of the file.
        topic: whose messages are kept.

    Raises:
        McapError: it is no MCAP file, a chunk is damaged, or is compressed.
    """
    if not content.startswith(MAGIC):
        raise McapError("must be an MCAP file" if content else "must be an MCAP file, and is empty")
    found, wanted = Scanned(), set[int]()
    for opcode, begin, end in _records(content, len(MAGIC), len(content)):
        try:
            if opcode == CHUNK:
                start, stop = _chunk(content, begin, end)
                for inner, first, last in _records(content, start, stop):
                    _take(content, inner, first, last, topic, wanted, found)
            else:
                _take(content, opcode, begin, end, topic, wanted, found)
        except (struct.error, UnicodeDecodeError, IndexError):
            raise McapError(f"record at byte {begin - _RECORD.size}: must be as MCAP files have it") from None
        if opcode == DATA_END:
            _require_data(content, begin, end)
            found.whole = True
            break
    return found


def _records(content: bytes, begin: int, stop: int) -> Iterator[tuple[int, int, int]]:
    """Opcode, begin and end of the content of each record that is there to its end."""
    while begin + _RECORD.size <= stop:
        opcode, length = _RECORD.unpack_from(content, begin)
        begin += _RECORD.size
        if begin + length > stop:
            return
        yield opcode, begin, begin + length
        begin += length


def _take(content: bytes, opcode: int, begin: int, end: int, topic: str, wanted: set[int], found: Scanned) -> None:
    """Keep what a record holds, if it is asked for."""
    if opcode == MESSAGE:
        if struct.unpack_from("<H", content, begin)[0] in wanted:
            found.messages.append(content[begin + _BEFORE_DATA : end])
    elif opcode == CHANNEL:
        if _text(content, begin + 4, end)[0] == topic:
            wanted.add(struct.unpack_from("<H", content, begin)[0])
    elif opcode == ATTACHMENT:
        name, at = _text(content, begin + 16, end)
        _, at = _text(content, at, end)
        (length,) = struct.unpack_from("<Q", content, at)
        if at + 8 + length + 4 != end:
            raise struct.error
        (crc,) = struct.unpack_from("<I", content, end - 4)
        _require_sum(content[begin : end - 4], crc, f"attachment {shown(name)}")
        found.attachments[name] = content[at + 8 : end - 4]


def _chunk(content: bytes, begin: int, end: int) -> tuple[int, int]:
    """Where the records of a chunk begin and end."""
    _, _, _, crc = struct.unpack_from("<QQQI", content, begin)
    compression, at = _text(content, begin + 28, end)
    if compression:
        raise McapError(f"chunk at byte {begin}: must not be compressed ({shown(compression)})")
    (length,) = struct.unpack_from("<Q", content, at)
    if at + 8 + length != end:
        raise struct.error
    _require_sum(content[at + 8 : end], crc, f"chunk at byte {begin}")
    return at + 8, end


def _require_data(content: bytes, begin: int, end: int) -> None:
    """Check all that stands before the end of the data: records have no checksum of their own kind and length."""
    crc = int.from_bytes(content[begin:end][:4], "little")
    _require_sum(content[: begin - _RECORD.size], crc, "file")


def _require_sum(content: bytes, crc: int, what: str) -> None:
    if crc and zlib.crc32(content) != crc:
        raise McapError(f"{what}: must have the checksum that it was written with; the file is damaged")


def _text(content: bytes, at: int, end: int) -> tuple[str, int]:
    """A text and where it ends."""
    (length,) = struct.unpack_from("<I", content, at)
    if at + 4 + length > end:
        raise struct.error
    return content[at + 4 : at + 4 + length].decode(), at + 4 + length


def numbers(messages: list[bytes], width: int) -> Any:
    """Float64 fields of messages that hold nothing else, (N, width).

    Raises:
        McapError: messages of another size.
    """
    size = 4 + 8 * width
    if any(len(each) != size for each in messages):
        raise McapError(f"messages of a flight: must have {width} numbers each")
    rows = np.frombuffer(b"".join(messages), dtype=np.uint8).reshape(-1, size)[:, 4:]
    return np.ascontiguousarray(rows).view("<f8").astype(float).reshape(-1, width)
