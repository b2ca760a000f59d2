"""Recovery of the intact messages in a truncated or damaged ULog file.

pyulog goes on behind a damaged message wherever the next bytes lead it, and ends where
a number is short. So what it would stumble over is left out before. Little-endian: a
head of 16 bytes (magic, version, time in us) is followed by messages: length (two
bytes), type (a letter), body. ``F`` declares the fields of a format, ``A`` binds a
topic and its instance to a number, ``D`` holds a row of a topic, ``P`` a parameter,
``I`` a text about the flight, ``O`` a loss of the logger, ``B`` the places of data that
were appended after a crash.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping

MAGIC = b"ULog\x01\x12\x35"

HEAD = 16
"""Length (bytes) of the file's head."""

LETTERS = frozenset(b"BFIMPQARDLCSO")
"""Types of messages, as letters."""

TOO_LONG = 65536
"""Size (bytes) of a row that no message can have, since its length has two bytes."""

DEEPEST = 8
"""Largest nesting depth of formats."""

IN_A_ROW = 3
"""Number of consecutive intact messages at which reading resumes after damage; chosen:
one alone may be made up of lost bytes."""

SIZES: Mapping[bytes, int] = {
    kind: size
    for size, kinds in (
        (1, b"int8_t uint8_t bool char"),
        (2, b"int16_t uint16_t"),
        (4, b"int32_t uint32_t float"),
        (8, b"int64_t uint64_t double"),
    )
    for kind in kinds.split()
}
"""Size (bytes) of the types of fields."""

BEGINNING = re.compile(
    rb"(?=..(?:F\w{1,99}:\w|A...[a-zA-Z]|[IP].\w{1,99}(?:\[\d+\])? \w|[DOS]))",
    re.DOTALL,
)
"""Pattern of the beginnings of messages at which reading resumes after damage."""

FIELD = re.compile(rb"([A-Za-z_]\w*)(?:\[([1-9]\d{0,4})\])? ([A-Za-z_]\w*)(?:;|$)")
"""Pattern of a format's field: type, number, name."""

FORMAT = re.compile(rb"(\w+):((?:%b)+)" % FIELD.pattern)
"""Pattern of a format: name and fields."""

PADDING = re.compile(rb"([^;]* _padding\w*;?)+$")
"""Pattern of the last, padding fields of a format, which rows lack."""

TIMESTAMP = re.compile(rb"(^|;)uint64_t timestamp(;|$)")
"""Pattern of the time stamp field, on which pyulog relies."""

PARAMETER, TEXT = (
    re.compile(each, re.DOTALL)
    for each in (rb".(?:int32_t|float) \w", rb".char\[\d+\] \w")
)
"""Patterns of the beginnings of parameters and of texts about the flight, with the
length of type and name in the first byte."""


class WholeMessages:
    """Intact messages of a ULog file that pyulog can read, such as formats, topics,
    data, parameters and losses.

    Attributes:
        found: bytes of a file of these.
        damaged: places at which messages are left out. cut: the file ends within a
            message.

    Raises:
        ValueError: one line: it is no such file, or one of a kind that is not known.
    """

    def __init__(self, data: bytes) -> None:
        if not data.startswith(MAGIC) or len(data) < HEAD:
            first = data[: len(MAGIC)].hex() or "none"
            raise ValueError(
                f"first bytes = {first}: must be {MAGIC.hex()}, of a ULog file"
            )
        self.data = data
        self.damaged = 0
        self.cut = False
        self.formats: dict[bytes, bytes] = {}
        self.rows: dict[bytes, int] = {}  # bytes by the number of the topic
        self.appended: list[int] = []
        self.found = b"".join([MAGIC, b"\x01", data[8:HEAD], *self._messages()])

    def _messages(self) -> Iterator[bytes]:
        """Yield the intact messages that pyulog reads."""
        data, place = self.data, HEAD
        while place < len(data):
            self.appended = [each for each in self.appended if each > place]
            end = self._end(place)
            if self.appended and not place < end <= self.appended[0]:
                place = self.appended[0]  # the message there was cut off by a crash
            elif not end:
                end = self._next_whole(place + 1)
                begun = place + 3 > len(data) or (
                    data[place + 2] in LETTERS and self._end_of(place) > len(data)
                )
                self.cut |= not end and begun
                self.damaged += not self.cut
                place = end or len(data)
            else:
                if self._is_read(data[place + 2 : place + 3], data[place + 3 : end]):
                    yield data[place:end]
                place = end

    def _end_of(self, place: int) -> int:
        """End offset of the message at a byte offset, from its stated length."""
        return place + 3 + int.from_bytes(self.data[place : place + 2], "little")

    def _end(self, place: int) -> int:
        """End offset of the message at a byte offset; 0 if it is invalid, or data of an
        unknown topic.
        """
        data = self.data
        end = self._end_of(place)
        if not place + 3 < end <= len(data) or data[place + 2] not in LETTERS:
            return 0
        # a row is as long as its topic's format, else the bytes are no message; 5 are
        # length, type and number of the topic
        is_row = data[place + 2] == ord("D")
        return (
            0
            if is_row and end - place - 5 != self.rows.get(data[place + 3 : place + 5])
            else end
        )

    def _next_whole(self, place: int) -> int:
        """Next byte offset at which several intact messages follow each other; 0 if
        there is none.
        """
        for match in BEGINNING.finditer(self.data, place):
            end = match.start()
            for _ in range(IN_A_ROW):
                end = self._end(end) if BEGINNING.match(self.data, end) else 0
                if not end or end == len(self.data):
                    break
            if end:
                return match.start()
        return 0

    def _is_read(self, letter: bytes, body: bytes) -> bool:
        """True if pyulog can read and needs a ULog message; stores formats and topics
        that the message declares.
        """
        if letter == b"F" and (match := FORMAT.fullmatch(body)):
            text = match[2]
            names = [name for _, _, name in FIELD.findall(text)]
            return (
                len(names) == len(set(names))
                and self.formats.setdefault(match[1], text) is text
            )
        if letter == b"A":
            number = body[1:3]
            fields = PADDING.sub(b"", self.formats.get(body[3:], b""))
            size = self._bytes_of(fields)
            readable = (
                number not in self.rows
                and size < TOO_LONG
                and TIMESTAMP.search(fields) is not None
            )
            if readable:
                self.rows[number] = size
            return readable
        # behind the first topic a parameter is a change in flight, which is not read
        if letter == b"P":
            # a byte with the length of type and name, and a value of four
            return (
                PARAMETER.match(body) is not None
                and len(body) == body[0] + 5
                and not self.rows
            )
        if letter == b"I":
            return TEXT.match(body) is not None
        # flags that need not be understood, eight that must be, and three places in the
        # file
        if letter == b"B" and len(body) >= 40:
            if body[8] & ~1 or any(body[9:16]):
                raise ValueError(
                    f"flags = {body[8:16].hex()}: must be those of ULog's first version"
                )
            places = struct.unpack_from("<3Q", body, 16) if body[8] else ()
            self.appended = sorted(each for each in places if each < len(self.data))
        return letter == b"D" or (letter == b"O" and len(body) == 2)

    def _bytes_of(self, fields: bytes, depth: int = 0) -> int:
        """Size in bytes of a format's fields; ``TOO_LONG`` or more for an unknown type
        or endless nesting.
        """
        total = 0
        for kind, count, _ in FIELD.findall(fields):
            nested = self.formats.get(kind) if depth < DEEPEST else None
            own = SIZES.get(kind) or (
                TOO_LONG if nested is None else self._bytes_of(nested, depth + 1)
            )
            total += own * int(count or 1)
            if total >= TOO_LONG:
                break
        return total
