"""Byte encoding of ROS messages: encodes many messages of one type at a time, decodes
single messages.

CDR: OMG DDS-XTypes 1.3, section 7.4.3: plain CDR version 1: primitives lie at multiples
of their size, counted behind the four bytes of the encapsulation header; texts have
their length and a closing zero.

Within a channel texts and the lengths of lists stay, so that every message has its
numbers at the same places: a template is laid out once, and the numbers are copied into
its copies column by column. The serializers of rosbags and mcap-ros2-support make one
message at a time, 20 times slower.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from skyarm.log.ros.messages import MessageField, fields
from skyarm.records.arrays import AnyArray

Bytes = npt.NDArray[np.uint8]

Value: TypeAlias = (
    "float | str | AnyArray | Sequence[Value] | Mapping[str, Value] | None"
)
"""Value of a message's field: text, number, numbers of many messages (N,) or (N, k),
list, or record; None for zero or empty."""

Values = Mapping[str, Value]
"""Fields of a message by name."""

Message = dict[str, Any]
"""Fields of a received message by name: numbers, texts, lists, and nested records."""

HEADER = b"\x00\x01\x00\x00"
"""Head of serialised messages: plain CDR, little endian."""

LETTERS = {
    "bool": "B",
    "uint8": "B",
    "int8": "b",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
"""Primitive type -> its letter in ``struct`` and NumPy."""

LENGTH = LETTERS["uint32"]
"""Type of the length of a text or list."""

TIME = "builtin_interfaces/Time"

NANO = 1_000_000_000


class MessageError(ValueError):
    """Error if received bytes are not a valid message of their type."""


class Template:
    """Byte template of one ROS message type, with offsets of the numbers that vary
    between messages.

    Args:
        definitions: definition of each type.
    """

    def __init__(self, definitions: Mapping[str, str]) -> None:
        self._definitions, self._bytes = definitions, bytearray(HEADER)
        self._numbers: list[tuple[int, AnyArray]] = []

    def record(self, kind: str, values: Values) -> None:
        """Append all fields of a message type to a byte template; missing values become
        zero or empty.
        """
        for field in fields(self._definitions[kind]):
            self._field(field, values.get(field.name))

    def _field(self, field: MessageField, value: Value) -> None:
        if field.length is None:
            self._one(field.kind, value)
        elif field.kind in LETTERS:
            self._list(field, value)
        else:
            items = () if value is None else value
            assert isinstance(items, Sequence)
            self._numbers_at(LENGTH, len(items))
            for item in items:
                self._one(field.kind, item)

    def _one(self, kind: str, value: Value) -> None:
        if kind == "string":
            assert value is None or isinstance(value, str)
            content = (value or "").encode() + b"\0"
            self._numbers_at(LENGTH, len(content))
            self._bytes += content
        elif kind in LETTERS:
            self._numbers_at(LETTERS[kind], 0 if value is None else value)
        elif kind == TIME and value is not None:
            # seconds and nanoseconds; floor and remainder agree also before 1970
            self._numbers_at("i", np.asarray(value) // NANO)
            self._numbers_at("I", np.asarray(value) % NANO)
        else:
            assert value is None or isinstance(value, Mapping)
            self.record(kind, value or {})

    def _list(self, field: MessageField, value: Value) -> None:
        """Append a list of numbers to a message template: (k,), equal in all messages,
        or (N, k), a row per message.
        """
        given = np.zeros(field.length or 0) if value is None else np.asarray(value)
        # only a list of any length begins with its count
        if not field.length:
            self._numbers_at(LENGTH, given.shape[-1])
        if given.shape[-1]:
            self._numbers_at(LETTERS[field.kind], given, row=True)

    def _numbers_at(self, letter: str, value: Value, row: bool = False) -> None:
        """Append a number or list to a message template: its bytes if constant, else a
        gap to fill in each message.
        """
        array = np.asarray(value).astype(f"<{letter}", copy=False)
        # padding counts from behind the header
        self._bytes += bytes(-(len(self._bytes) - len(HEADER)) % array.itemsize)
        if array.ndim == int(row):
            self._bytes += array.tobytes()
            return
        columns = array if row else array[:, None]
        self._numbers.append((len(self._bytes), columns))
        self._bytes += bytes(array.itemsize * columns.shape[1])

    def messages(self, count: int) -> Bytes:
        """Return all encoded messages as bytes (count, size)."""
        rows = np.empty((count, len(self._bytes)), dtype=np.uint8)
        rows[:] = np.frombuffer(bytes(self._bytes), dtype=np.uint8)
        for start, array in self._numbers:
            # bytes can be viewed only of numbers that lie together
            content = np.ascontiguousarray(array).view(np.uint8)
            rows[:, start : start + content.shape[1]] = content
        return rows


def encode(
    kind: str, definitions: Mapping[str, str], values: Values, count: int
) -> Bytes:
    """Encode many ROS messages of one type as CDR bytes.

    Args:
        kind: key of ``definitions``.
        definitions: definitions of that type and of all types in it.
        values: fields by name: texts and lists of texts as they are; numbers for all
            messages, or arrays (count,), and (count, k) for lists of numbers; records
            as tables in turn; a Time in ns. What is left out is zero.
        count: number of messages.

    Returns:
        (count, size): the bytes of each.
    """
    template = Template(definitions)
    template.record(kind, values)
    return template.messages(count)


class Decoder:
    """Decoder of one ROS message, field by field.

    Args:
        definitions: type -> its fields.
        data: the message, with its encapsulation.
    """

    def __init__(self, definitions: Mapping[str, str], data: bytes) -> None:
        # representation: plain CDR, big or little endian
        if len(data) < len(HEADER) or data[0] != 0 or data[1] not in (0, 1):
            raise MessageError("must be plain CDR")
        self._definitions, self._data = definitions, data
        self._at, self._order = len(HEADER), "<" if data[1] else ">"

    def record(self, kind: str) -> Message:
        """Decode a message into a dictionary by field name, with nested messages as
        dictionaries.
        """
        return {
            field.name: self._field(field) for field in fields(self._definitions[kind])
        }

    def _field(
        self, field: MessageField
    ) -> float | str | Message | list[float] | list[float | str | Message]:
        if field.length is None:
            return self._one(field.kind)
        count = field.length or int(self._number(LENGTH))
        if field.kind in LETTERS:
            return list(self._numbers(LETTERS[field.kind], count))
        return [self._one(field.kind) for _ in range(count)]

    def _one(self, kind: str) -> float | str | Message:
        if kind in LETTERS:
            return self._number(LETTERS[kind])
        if kind == "string":
            return (
                # the bytes of a text end with a zero
                self._bytes(int(self._number(LENGTH)))
                .removesuffix(b"\0")
                .decode(errors="replace")
            )
        return self.record(kind)

    def _number(self, letter: str) -> int | float:
        return self._numbers(letter, 1)[0]

    def _numbers(self, letter: str, count: int) -> tuple[int | float, ...]:
        size = struct.calcsize(f"<{letter}")
        # a list of no items has no padding either
        if count:
            self._at += -(self._at - len(HEADER)) % size
        return struct.unpack(f"{self._order}{count}{letter}", self._bytes(size * count))

    def _bytes(self, count: int) -> bytes:
        data = self._data[self._at : self._at + count]
        if len(data) < count:
            raise MessageError("is too short for its type")
        self._at += count
        return data


def decode(kind: str, definitions: Mapping[str, str], data: bytes) -> Message:
    """Decode one ROS message.

    Args:
        kind: its type, a key of ``definitions``.
        definitions: definitions of that type and of all types in it.
        data: its bytes.

    Returns:
        its fields by name; records in it are dictionaries in turn.

    Raises:
        MessageError: the bytes are no such message.
    """
    return Decoder(definitions, data).record(kind)
