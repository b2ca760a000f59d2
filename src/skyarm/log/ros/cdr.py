"""Many messages of one type at once, as the bytes of CDR: a row of bytes a message.

Within a channel the texts and the lengths of lists stay, so that every message has its numbers at the same places: a
template is laid out once, and the numbers are copied into its copies column by column.

Source: OMG DDS-XTypes 1.3, section 7.4.3: plain CDR version 1, little endian: primitives lie at multiples of their
size, counted behind the four bytes of the encapsulation header; texts have their length and a closing zero.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.log.ros.message_types import fields

Bytes = npt.NDArray[np.uint8]
Values = Mapping[str, Any]

HEADER = b"\x00\x01\x00\x00"
"""Encapsulation: plain CDR, little endian."""

PRIMITIVES = {
    "bool": "|u1",
    "uint8": "|u1",
    "int32": "<i4",
    "uint32": "<u4",
    "float32": "<f4",
    "float64": "<f8",
}

TIME = "builtin_interfaces/Time"

_TYPE = re.compile(r"([\w/]+)(?:\[(\d*)\])?")

NANO = 1_000_000_000


class Template:
    """The bytes that all messages share, and the numbers that go into each of them."""

    def __init__(self, definitions: Mapping[str, str], ros1: bool = False) -> None:
        self._definitions, self._ros1 = definitions, ros1
        self._bytes = bytearray(b"" if ros1 else HEADER)
        self._numbers: list[tuple[int, Any]] = []

    def record(self, kind: str, values: Values) -> None:
        """Lay out a record: its fields that ``values`` lacks are zeros, empty texts and empty lists."""
        for part, name in fields(self._definitions[kind]):
            self._field(part, values.get(name))

    def _field(self, part: str, value: Any) -> None:
        match = _TYPE.fullmatch(part)
        assert match is not None
        kind, length = match.groups()
        if length is None:
            self._one(kind, value)
        elif kind in PRIMITIVES:
            self._list(kind, int(length) if length else None, value)
        else:
            items = list(value or ())
            self._numbers_at("<u4", len(items))
            for item in items:
                self._one(kind, item)

    def _one(self, kind: str, value: Any) -> None:
        if kind == "string":
            content = (value or "").encode() + (b"" if self._ros1 else b"\0")
            self._numbers_at("<u4", len(content))
            self._bytes += content
        elif kind in PRIMITIVES:
            self._numbers_at(PRIMITIVES[kind], 0 if value is None else value)
        elif kind == TIME and value is not None:
            self._numbers_at("<i4", np.asarray(value) // NANO)
            self._numbers_at("<u4", np.asarray(value) % NANO)
        else:
            self.record(kind, value or {})

    def _list(self, kind: str, length: int | None, value: Any) -> None:
        """Numbers in a row, (k,) of all messages or (N, k); of a list that is not fixed, its length before them."""
        given = np.zeros(length or 0) if value is None else np.asarray(value)
        if length is None:
            self._numbers_at("<u4", given.shape[-1])
        if given.shape[-1]:
            self._numbers_at(PRIMITIVES[kind], given, row=True)

    def _numbers_at(self, form: str, value: Any, row: bool = False) -> None:
        """Room for a number or a row of them, which are written now where they are the same in every message."""
        array, size = np.asarray(value).astype(form, copy=False), int(form[2:])
        if not self._ros1:
            self._bytes += bytes(-(len(self._bytes) - len(HEADER)) % size)
        if array.ndim == int(row):
            self._bytes += array.tobytes()
            return
        columns = array if row else array[:, None]
        self._numbers.append((len(self._bytes), columns))
        self._bytes += bytes(size * columns.shape[1])

    def messages(self, count: int) -> Bytes:
        """The messages (count, size)."""
        rows = np.empty((count, len(self._bytes)), dtype=np.uint8)
        rows[:] = np.frombuffer(bytes(self._bytes), dtype=np.uint8)
        for start, array in self._numbers:
            content = np.ascontiguousarray(array).view(np.uint8)
            rows[:, start : start + content.shape[1]] = content
        return rows


def encode(kind: str, definitions: Mapping[str, str], values: Values, count: int, ros1: bool = False) -> Bytes:
    """Messages of a type.

    Args:
        kind: key of ``definitions``.
        definitions: of it and of all types in it.
        values: fields by name: texts and lists of texts as they are; numbers for all messages, or arrays (count,), and
            (count, k) for lists of numbers; records as tables in turn; a Time in ns. What is left out is zero.
        count: of messages.
        ros1: as ROS 1 writes them: nothing before a message, no gaps, texts without a closing zero.

    Returns:
        (count, size): the bytes of each.
    """
    template = Template(definitions, ros1)
    template.record(kind, values)
    return template.messages(count)
