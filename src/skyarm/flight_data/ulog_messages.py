"""Messages of a file in the format ULog: topics with their arrays, parameters, and what is damaged.

Little-endian. A head of 16 bytes (magic, version, time in us) is followed by messages: length (two bytes), type (a
letter), body. ``F`` declares the fields of a format, ``A`` binds a topic and its instance to a number, ``D`` holds a
row of a topic, ``P`` a parameter, ``I`` a text about the flight, ``O`` a loss of the logger, ``B`` the places of data
that were appended after a crash. A damaged message is left out and the next whole one searched for.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from skyarm.records.arrays import Array
from skyarm.records.files import shown
from skyarm.records.immutable import immutable

MAGIC = b"ULog\x01\x12\x35"

HEAD = 16
"""Bytes before the first message."""

LETTERS = frozenset(b"BFIMPQARDLCSO")
"""Types of messages."""

LONGEST_MESSAGE = 65535
"""Bytes of a message, whose length has two: a format of more fields is damaged."""

DEEPEST = 8
"""Formats in one another."""

IN_A_ROW = 3
"""Messages that must be whole, one after another, to go on behind a damaged one."""

TYPES: Mapping[str, str] = {
    "int8_t": "i1",
    "uint8_t": "u1",
    "int16_t": "<i2",
    "uint16_t": "<u2",
    "int32_t": "<i4",
    "uint32_t": "<u4",
    "int64_t": "<i8",
    "uint64_t": "<u8",
    "float": "<f4",
    "double": "<f8",
    "bool": "u1",
    "char": "u1",
}
"""Type of a field -> its type in NumPy."""

BEGINNING = re.compile(rb"[FIPADOS]")
"""Types of the messages with which reading goes on behind a damaged one."""

DECLARATION, KEY = re.compile(rb"\w+:\w"), re.compile(rb".\w+(?:\[\d+\])? \w", re.DOTALL)
"""Beginnings of the bodies of a format, and of a parameter or text."""

FIELD = re.compile(r"([A-Za-z_]\w*)(?:\[(\d{1,5})\])? ([A-Za-z_]\w*)")
"""Type, number and name of a field in the text of a format."""


@immutable(kw_only=False)
class Topic:
    """Instance of a topic: name, number of the instance, and type of a row.

    Attributes:
        name, instance: of the topic.
        fields: names of its numbers, ``xyz[0]``, ``esc[2].esc_rpm``.
        row: type of a row in NumPy.
    """

    name: str
    instance: int
    fields: tuple[str, ...]
    row: np.dtype[np.void]


@dataclass(slots=True)
class Messages:
    """Contents of a ULog file.

    Attributes:
        start: us, time of the head.
        rows: numbers of each topic, (N,) by field.
        parameters: at the beginning, by name.
        texts: about vehicle and firmware, by name.
        lost: ms, each loss of the logger.
        damaged: messages that are left out. cut: the file ends within a message.
    """

    start: int
    rows: dict[tuple[str, int], dict[str, Array]] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    lost: list[int] = field(default_factory=list)
    damaged: int = 0
    cut: bool = False


def read_messages(data: bytes) -> Messages:
    """Read the messages of a ULog file.

    Raises:
        ValueError: one line: it is no such file, or one of a kind that is not known.
    """
    if not data.startswith(MAGIC) or len(data) < HEAD:
        raise ValueError(f"first bytes = {data[: len(MAGIC)].hex() or 'none'}: must be {MAGIC.hex()}, of a ULog file")
    return _File(data).read()


class _File:
    """Reader of one file."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.found = Messages(int.from_bytes(data[8:HEAD], "little"))
        self.formats: dict[str, list[tuple[str, int, str]]] = {}
        self.topics: dict[int, Topic] = {}
        self.bodies: dict[int, list[bytes]] = {}
        self.kept: dict[tuple[str, int], tuple[Topic, list[bytes]]] = {}
        self.appended: list[int] = []

    def read(self) -> Messages:
        """Read all messages."""
        for letter, body in self._messages():
            if letter == ord("D"):
                self.bodies[body[0] | body[1] << 8].append(body[2:])
            elif letter == ord("F"):
                self._format(body)
            elif letter == ord("A"):
                self._subscription(body)
            elif letter == ord("P") and not self.topics:
                self._parameter(body)
            elif letter == ord("I"):
                self._text(body)
            elif letter == ord("O") and len(body) == 2:
                self.found.lost.append(int.from_bytes(body, "little"))
            elif letter == ord("B"):
                self._flags(body)
        for (name, instance), (topic, bodies) in self.kept.items():
            if bodies:
                table = np.frombuffer(b"".join(bodies), topic.row)
                with np.errstate(invalid="ignore"):  # NaNs of a damaged file that signal
                    numbers = {each: table[f"f{k}"].astype(float) for k, each in enumerate(topic.fields)}
                self.found.rows[name, instance] = numbers
        return self.found

    def _messages(self) -> Iterator[tuple[int, bytes]]:
        """Yield type and body of each whole message."""
        data, place = self.data, HEAD
        while place < len(data):
            while self.appended and place >= self.appended[0]:
                self.appended.pop(0)
            end = self._end(place)
            if self.appended and not place < end <= self.appended[0]:
                place = self.appended.pop(0)  # the message there was cut off by a crash
                continue
            if not end:
                resumed = self._next_whole(place + 1)
                self.found.cut |= not resumed and self._is_cut(place)
                self.found.damaged += not self.found.cut
                if not resumed:
                    return
                place = resumed
                continue
            yield data[place + 2], data[place + 3 : end]
            place = end

    def _end(self, place: int) -> int:
        """End of the message at a place; 0 if it is none, or a row of no topic that is known."""
        data = self.data
        if place + 3 > len(data) or data[place + 2] not in LETTERS:
            return 0
        size = data[place] | data[place + 1] << 8
        end = place + 3 + size
        if end > len(data) or not size:
            return 0
        if data[place + 2] == ord("D"):
            topic = self.topics.get(data[place + 3] | data[place + 4] << 8) if size >= 2 else None
            if topic is None or size != topic.row.itemsize + 2:
                return 0
        return end

    def _is_cut(self, place: int) -> bool:
        """True if the file ends within a message that begins as one."""
        head = self.data[place : place + 3]
        return len(head) < 3 or (head[2] in LETTERS and place + 3 + (head[0] | head[1] << 8) > len(self.data))

    def _next_whole(self, place: int) -> int:
        """Place from where several messages are whole; 0 if there is none."""
        for found in BEGINNING.finditer(self.data, place + 2):
            end = start = found.start() - 2
            for _ in range(IN_A_ROW):
                end = self._end(end) if self._is_likely(end) else 0
                if not end or end == len(self.data):
                    break
            if end:
                return start
        return 0

    def _is_likely(self, place: int) -> bool:
        """True if the body of the message at a place begins as those of its type do."""
        letter, body = self.data[place + 2 : place + 3], self.data[place + 3 : place + 128]
        if letter == b"F":
            return DECLARATION.match(body) is not None
        if letter == b"A":
            return body[3:4].isalpha()
        return letter not in (b"I", b"P") or KEY.match(body) is not None

    def _flags(self, body: bytes) -> None:
        """Read the flags: data of kinds that are not known, and places of data that were appended."""
        if len(body) < 40:
            return
        if body[8] & ~1 or any(body[9:16]):
            raise ValueError(f"flags = {body[8:16].hex()}: must be those of ULog's first version")
        if body[8]:
            self.appended = sorted(each for each in struct.unpack_from("<3Q", body, 16) if HEAD < each < len(self.data))

    def _format(self, body: bytes) -> None:
        """Read the declaration of a format."""
        name, _, fields = body.decode("utf-8", "replace").partition(":")
        found = [FIELD.fullmatch(each.strip()) for each in fields.split(";") if each.strip()]
        if all(found) and name not in self.formats:
            self.formats[name] = [(each[1], int(each[2] or -1), each[3]) for each in found if each]

    def _subscription(self, body: bytes) -> None:
        """Read the topic of a number."""
        if len(body) < 4:
            return
        instance, number = body[0], body[1] | body[2] << 8
        name = body[3:].decode("utf-8", "replace")
        if name not in self.formats:
            return
        fields: list[tuple[str, str]] = []
        try:
            self._fields(name, "", fields, 0)
        except ValueError:
            self.found.damaged += 1
            return
        while fields and fields[-1][0].startswith("_padding"):
            fields.pop()
        names = tuple(each for each, _ in fields)
        if not fields or len(set(names)) < len(names):
            self.found.damaged += 1
            return
        row = np.dtype([(f"f{k}", kind) for k, (_, kind) in enumerate(fields)])
        known = self.kept.get((name, instance))
        topic = Topic(name, instance, names, row) if known is None else known[0]
        self.topics[number] = topic
        self.bodies[number] = self.kept.setdefault((name, instance), (topic, []))[1]

    def _fields(self, name: str, place: str, found: list[tuple[str, str]], depth: int) -> None:
        """Append the numbers of a format, and those of the formats within it."""
        if depth > DEEPEST:
            raise ValueError(f"format = {shown(name)}: must be nested at most {DEEPEST} deep")
        for kind, count, own in self.formats[name]:
            for k in range(abs(count)):
                at = f"{place}{own}" if count < 0 else f"{place}{own}[{k}]"
                if kind in TYPES:
                    found.append((at, TYPES[kind]))
                elif kind in self.formats:
                    self._fields(kind, f"{at}.", found, depth + 1)
                else:
                    raise ValueError(f"format = {shown(name)}: names the unknown format {shown(kind)}")
                if len(found) > LONGEST_MESSAGE:
                    raise ValueError(f"format = {shown(name)}: must be of at most {LONGEST_MESSAGE} bytes")

    def _parameter(self, body: bytes) -> None:
        """Read a parameter."""
        kind, name, value = _key_and_value(body)
        form = {"int32_t": "<i", "float": "<f"}.get(kind)
        if form and len(value) == 4:
            self.found.parameters[name] = float(struct.unpack(form, value)[0])

    def _text(self, body: bytes) -> None:
        """Read a text about the flight."""
        kind, name, value = _key_and_value(body)
        if kind.startswith("char["):
            self.found.texts[name] = value.decode("utf-8", "replace")


def _key_and_value(body: bytes) -> tuple[str, str, bytes]:
    """Type, name and value of a parameter or text."""
    length = body[0] + 1
    kind, _, name = body[1:length].decode("utf-8", "replace").partition(" ")
    return kind, name, body[length:]
