"""Types of ROS messages on the wire: decoding of received bytes, checksums and texts of ROS 1 definitions.

Sources: OMG DDS-XTypes 1.3, section 7.4.3 (plain CDR); wiki.ros.org/ROS/Technical Overview, roslib/gentools (checksum
of a ROS 1 type: MD5 of its constants and fields, where each nested type stands as its own checksum).
"""

from __future__ import annotations

import hashlib
import re
import struct
from collections.abc import Iterator, Mapping
from typing import Any

from skyarm.log.ros.messages import LINE, PRIMITIVES, fields

PART = re.compile(r"([\w/]+)(?:\[(\d*)\])?")
"""Type of a field, and the length of a list: nothing for one that varies."""

OLD_NAMES = {"builtin_interfaces/Time": "time", "builtin_interfaces/Duration": "duration"}
"""Types that are built into ROS 1."""

FORMATS = {"|u1": "B", "|i1": "b", "<u2": "H", "<i4": "i", "<u4": "I", "<u8": "Q", "<f4": "f", "<f8": "d"}

ENCAPSULATION = 4
"""Bytes before the first field of a CDR message."""


class MessageError(ValueError):
    """Received bytes that are no message of their type."""


class Decoder:
    """Reader of one message, field by field.

    Args:
        definitions: type -> its fields.
        data: the message.
        packed: bytes of ROS 1; else CDR with its encapsulation.
    """

    def __init__(self, definitions: Mapping[str, str], data: bytes, *, packed: bool) -> None:
        self._definitions, self._data, self._packed = definitions, data, packed
        self._at, self._order = 0, "<"
        if not packed:
            # representation: plain CDR, big or little endian
            if len(data) < ENCAPSULATION or data[0] != 0 or data[1] not in (0, 1):
                raise MessageError("must be plain CDR")
            self._at, self._order = ENCAPSULATION, "<" if data[1] else ">"

    def record(self, kind: str) -> dict[str, Any]:
        """Fields of a message type by name: numbers, texts, lists and records as dictionaries."""
        return {name: self._field(part) for part, name in fields(self._definitions[kind])}

    def _field(self, part: str) -> Any:
        match = PART.fullmatch(part)
        assert match is not None
        kind, length = match.groups()
        if length is None:
            return self._one(kind)
        count = int(length) if length else self._number("<u4")
        if kind in PRIMITIVES:
            return list(self._numbers(PRIMITIVES[kind], count))
        return [self._one(kind) for _ in range(count)]

    def _one(self, kind: str) -> Any:
        if kind in PRIMITIVES:
            return self._number(PRIMITIVES[kind])
        if kind == "string":
            content = self._bytes(self._number("<u4"))
            return content.removesuffix(b"" if self._packed else b"\0").decode(errors="replace")
        return self.record(kind)

    def _number(self, form: str) -> Any:
        return self._numbers(form, 1)[0]

    def _numbers(self, form: str, count: int) -> tuple[Any, ...]:
        size = int(form[2:])
        if count and not self._packed:
            self._at += -(self._at - ENCAPSULATION) % size
        return struct.unpack(f"{self._order}{count}{FORMATS[form]}", self._bytes(size * count))

    def _bytes(self, count: int) -> bytes:
        found = self._data[self._at : self._at + count]
        if len(found) < count:
            raise MessageError("is too short for its type")
        self._at += count
        return found


def decode(kind: str, definitions: Mapping[str, str], data: bytes, *, packed: bool = False) -> dict[str, Any]:
    """Decode one ROS message.

    Args:
        kind: its type, a key of ``definitions``.
        definitions: of it and of all types in it.
        data: its bytes.
        packed: bytes of ROS 1; else CDR.

    Returns:
        its fields by name; records in it are dictionaries in turn.

    Raises:
        MessageError: the bytes are no such message.
    """
    return Decoder(definitions, data, packed=packed).record(kind)


def checksum(kind: str, definitions: Mapping[str, str], constants: Mapping[str, str]) -> str:
    """MD5 checksum of a ROS 1 message type, by which two nodes compare their definitions."""
    rows = [constants[kind]] if kind in constants else []
    for part, name in fields(definitions[kind]):
        inner = part.partition("[")[0]
        nested = inner in definitions and inner not in OLD_NAMES
        rows.append(f"{checksum(inner, definitions, constants) if nested else _old(part)} {name}")
    return hashlib.md5("\n".join(rows).encode(), usedforsecurity=False).hexdigest()


def _old(part: str) -> str:
    """Name of a field's type in ROS 1."""
    inner, bracket, length = part.partition("[")
    return OLD_NAMES.get(inner, inner) + bracket + length


def old_definition(kind: str, definitions: Mapping[str, str], constants: Mapping[str, str]) -> str:
    """Definition of a ROS 1 message type followed by those of its nested types, as connections state it."""

    def inner_kinds(each: str) -> Iterator[str]:
        for part, _ in fields(definitions[each]):
            inner = part.partition("[")[0]
            if inner in definitions and inner not in OLD_NAMES:
                yield inner
                yield from inner_kinds(inner)

    def text(each: str) -> str:
        rows = [constants[each]] if each in constants else []
        return "\n".join([*rows, *(f"{_old(part)} {name}" for part, name in fields(definitions[each]))])

    return "".join(
        [f"{text(kind)}\n", *(f"{LINE}\nMSG: {each}\n{text(each)}\n" for each in dict.fromkeys(inner_kinds(kind)))]
    )
