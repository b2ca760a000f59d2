"""MAVLink message definitions: number, fields in wire order, and the check byte that
follows from both.

Source: the dialects ``common`` and ``ardupilotmega`` of mavlink.io, as facts about the
wire. The order on the wire is by size of the type, largest first, otherwise as
declared; extensions follow behind ``+`` in the order declared. Names, units and frames
of the fields are those of mavlink.io: body axes forward, right, down; world axes north,
east, down.
"""

from __future__ import annotations

import binascii
import struct
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

from skyarm.records.files import shipped_tables
from skyarm.records.immutable import immutable

FieldValue = int | float | str | bytes | Sequence[int] | Sequence[float]
"""Value of a field to send: a number, a text for characters, or a sequence of numbers
for an array."""

_TYPES = {
    "u64": ("Q", "uint64_t"),
    "i64": ("q", "int64_t"),
    "u32": ("I", "uint32_t"),
    "i32": ("i", "int32_t"),
    "f32": ("f", "float"),
    "u16": ("H", "uint16_t"),
    "i16": ("h", "int16_t"),
    "u8": ("B", "uint8_t"),
    "i8": ("b", "int8_t"),
    "text": ("s", "char"),
}
"""Type in ``mavlink_messages.toml`` -> letter of ``struct``, and name in the
definition."""

_MIRRORED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
"""Every byte with its bits in reverse order."""


def checksum(data: bytes) -> int:
    """CRC-16/MCRF4XX checksum, which MAVLink calls X.25: 0x6F91 for ``b"123456789"``.

    The polynomial 0x1021 on reversed bits from 0xFFFF on: the standard library has it
    on unreversed ones, in C.
    """
    crc = binascii.crc_hqx(data.translate(_MIRRORED), 0xFFFF)
    return _MIRRORED[crc & 0xFF] << 8 | _MIRRORED[crc >> 8]


# what a last byte of any value adds to a checksum, which is linear in it
_STEPS = frozenset(binascii.crc_hqx(bytes([byte]), 0) for byte in range(256))


def is_possible_checksum(data: bytes, received: int) -> bool:
    """True if some CRC_EXTRA byte gives the received checksum, as for 1 of 256 random
    messages.
    """
    crc = binascii.crc_hqx(data.translate(_MIRRORED), 0xFFFF)
    unmirrored = _MIRRORED[received & 0xFF] << 8 | _MIRRORED[received >> 8]
    return unmirrored ^ (crc << 8 & 0xFF00) in _STEPS


@immutable
class MavlinkField:
    """Field of a message: name, type, and number of elements (0 for a single
    number).
    """

    name: str
    type: str
    count: int
    extension: bool

    @property
    def format(self) -> str:
        """Format character of Python's ``struct`` for the field, without byte order."""
        return f"{self.count or ''}{_TYPES[self.type][0]}"

    @property
    def is_text(self) -> bool:
        """True if a MAVLink field is an array of characters."""
        return self.type == "text"

    @property
    def default(self) -> FieldValue:
        """Default value of a MAVLink field: zero, or the protocol version 3 in a
        heartbeat.
        """
        if self.is_text:
            return b""
        if self.count:
            return (0,) * self.count
        return 3 if self.name == "mavlink_version" else 0

    @property
    def range_text(self) -> str:
        """Description of the admissible values, for error messages."""
        if self.is_text:
            return f"a text of at most {self.count} bytes"
        if self.type == "f32":
            numbers = "within the range of 32-bit floats"
        else:
            bits = int(self.type[1:])
            low, high = (
                (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
                if self.type[0] == "i"
                else (0, 2**bits - 1)
            )
            numbers = f"from {low} to {high}"
        kind = "number" if self.type == "f32" else "whole number"
        return (
            f"{self.count} {kind}s {numbers}" if self.count else f"a {kind} {numbers}"
        )


@immutable
class Definition:
    """Definition of a MAVLink message, with the precomputed layouts for encoding and
    decoding.
    """

    name: str
    number: int
    fields: tuple[MavlinkField, ...]
    layout: struct.Struct
    check: bytes
    """One byte, CRC_EXTRA: digest of name and fields without extensions, so that other
    definitions do not match."""
    defaults: Mapping[str, FieldValue]
    arrays: tuple[tuple[int, MavlinkField], ...]
    """Index among the fields, and the field, of every array of numbers, last first."""
    texts: tuple[tuple[int, MavlinkField], ...]
    places: tuple[tuple[str, int | slice], ...]
    """Name of every field and its index among the numbers of the payload."""


def _declared_fields(text: str) -> Iterator[MavlinkField]:
    """Parse the field list of a message definition: type, names, ``;`` between types,
    ``+`` before extensions.
    """
    # a message without extensions has no second part
    for part, extension in zip(text.split("+"), (False, True), strict=False):
        for group in part.split(";"):
            kind, *names = group.split()
            for declared in names:
                name, _, count = declared.rstrip("]").partition("[")
                yield MavlinkField(
                    name=name, type=kind, count=int(count or 0), extension=extension
                )


def _definition(name: str, number: int, text: str) -> Definition:
    """Make the definition of a MAVLink message from its name, number and field list."""
    fields = tuple(_declared_fields(text))
    base = [field for field in fields if not field.extension]
    digested = f"{name} ".encode()
    for field in base:
        digested += f"{_TYPES[field.type][1]} {field.name} ".encode() + (
            bytes([field.count]) if field.count else b""
        )
    digest = checksum(digested)
    places: list[tuple[str, int | slice]] = []
    start = 0
    for field in fields:
        numbers = field.count if field.count and not field.is_text else 0
        places.append((field.name, slice(start, start + numbers) if numbers else start))
        start += numbers or 1
    return Definition(
        name=name,
        number=number,
        fields=fields,
        layout=struct.Struct("<" + "".join(field.format for field in fields)),
        # CRC_EXTRA of MAVLink: both bytes of the digest in one
        check=bytes([(digest & 0xFF) ^ (digest >> 8)]),
        defaults=MappingProxyType({field.name: field.default for field in fields}),
        # from the last on, as an array that is spread out moves all values behind it
        arrays=tuple(
            (k, each)
            for k, each in enumerate(fields)
            if each.count and not each.is_text
        )[::-1],
        texts=tuple((k, each) for k, each in enumerate(fields) if each.is_text),
        places=tuple(places),
    )


_TABLE = shipped_tables(__file__)

DEFINITIONS: Mapping[str, Definition] = MappingProxyType(
    {name: _definition(name, number, text) for name, (number, text) in _TABLE.items()}
)
"""Definition of every message that can be sent and received, by name."""

DEFINITIONS_BY_NUMBER: Mapping[int, Definition] = MappingProxyType(
    {each.number: each for each in DEFINITIONS.values()}
)
"""Definition of every message by its number in a frame's header."""
