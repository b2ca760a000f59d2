"""MAVLink message definitions: number, fields in wire order, and the check byte that follows from both.

Source: the dialects ``common`` and ``ardupilotmega`` of mavlink.io, as facts about the wire. The order on the wire is
by size of the type, largest first, otherwise as declared; extensions follow behind ``+`` in the order declared. Names,
units and frames of the fields are those of mavlink.io: body axes forward, right, down; world axes north, east, down.
"""

from __future__ import annotations

import binascii
import struct
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TypeAlias

from skyarm.records.immutable import immutable

FieldValue: TypeAlias = int | float | str | bytes | Sequence[int] | Sequence[float]
"""Value of a field to send: a number, a text for characters, or a sequence of numbers for an array."""

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
"""Type in the table below -> letter of ``struct``, and name in the definition."""

_TABLE = {
    "HEARTBEAT": (0, "u32 custom_mode; u8 type autopilot base_mode system_status mavlink_version"),
    "PARAM_REQUEST_READ": (20, "i16 param_index; u8 target_system target_component; text param_id[16]"),
    "PARAM_VALUE": (22, "f32 param_value; u16 param_count param_index; text param_id[16]; u8 param_type"),
    "PARAM_SET": (23, "f32 param_value; u8 target_system target_component; text param_id[16]; u8 param_type"),
    "ATTITUDE_QUATERNION": (
        31,
        "u32 time_boot_ms; f32 q1 q2 q3 q4 rollspeed pitchspeed yawspeed + f32 repr_offset_q[4]",
    ),
    "LOCAL_POSITION_NED": (32, "u32 time_boot_ms; f32 x y z vx vy vz"),
    "COMMAND_LONG": (
        76,
        "f32 param1 param2 param3 param4 param5 param6 param7; u16 command;"
        "u8 target_system target_component confirmation",
    ),
    "COMMAND_ACK": (
        77,
        "u16 command; u8 result + u8 progress; i32 result_param2; u8 target_system target_component",
    ),
    "SET_ATTITUDE_TARGET": (
        82,
        "u32 time_boot_ms; f32 q[4] body_roll_rate body_pitch_rate body_yaw_rate thrust;"
        "u8 target_system target_component type_mask + f32 thrust_body[3]",
    ),
    "SET_POSITION_TARGET_LOCAL_NED": (
        84,
        "u32 time_boot_ms; f32 x y z vx vy vz afx afy afz yaw yaw_rate; u16 type_mask;"
        "u8 target_system target_component coordinate_frame",
    ),
    "HIL_ACTUATOR_CONTROLS": (93, "u64 time_usec flags; f32 controls[16]; u8 mode"),
    "HIGHRES_IMU": (
        105,
        "u64 time_usec; f32 xacc yacc zacc xgyro ygyro zgyro xmag ymag zmag"
        " abs_pressure diff_pressure pressure_alt temperature; u16 fields_updated + u8 id",
    ),
    "HIL_SENSOR": (
        107,
        "u64 time_usec; f32 xacc yacc zacc xgyro ygyro zgyro xmag ymag zmag"
        " abs_pressure diff_pressure pressure_alt temperature; u32 fields_updated + u8 id",
    ),
    "TIMESYNC": (111, "i64 tc1 ts1 + u8 target_system target_component"),
    "HIL_GPS": (
        113,
        "u64 time_usec; i32 lat lon alt; u16 eph epv vel; i16 vn ve vd; u16 cog; u8 fix_type satellites_visible"
        "+ u8 id; u16 yaw",
    ),
    "EKF_STATUS_REPORT": (
        193,
        "f32 velocity_variance pos_horiz_variance pos_vert_variance compass_variance terrain_alt_variance; u16 flags"
        "+ f32 airspeed_variance",
    ),
    "ESTIMATOR_STATUS": (
        230,
        "u64 time_usec; f32 vel_ratio pos_horiz_ratio pos_vert_ratio mag_ratio hagl_ratio tas_ratio"
        " pos_horiz_accuracy pos_vert_accuracy; u16 flags",
    ),
    "EXTENDED_SYS_STATE": (245, "u8 vtol_state landed_state"),
    "STATUSTEXT": (253, "u8 severity; text text[50] + u16 id; u8 chunk_seq"),
    "ODOMETRY": (
        331,
        "u64 time_usec; f32 x y z q[4] vx vy vz rollspeed pitchspeed yawspeed"
        " pose_covariance[21] velocity_covariance[21]; u8 frame_id child_frame_id"
        "+ u8 reset_counter estimator_type; i8 quality",
    ),
}

_MIRRORED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
"""Every byte with its bits in reverse order."""


def checksum(data: bytes) -> int:
    """CRC-16/MCRF4XX checksum, which MAVLink calls X.25: 0x6F91 for ``b"123456789"``.

    The polynomial 0x1021 on reversed bits from 0xFFFF on: the standard library has it on unreversed ones, in C.
    """
    crc = binascii.crc_hqx(data.translate(_MIRRORED), 0xFFFF)
    return _MIRRORED[crc & 0xFF] << 8 | _MIRRORED[crc >> 8]


_STEPS = frozenset(binascii.crc_hqx(bytes([byte]), 0) for byte in range(256))


def is_possible_checksum(data: bytes, received: int) -> bool:
    """True if some CRC_EXTRA byte gives the received checksum, as for 1 of 256 random messages."""
    crc = binascii.crc_hqx(data.translate(_MIRRORED), 0xFFFF)
    unmirrored = _MIRRORED[received & 0xFF] << 8 | _MIRRORED[received >> 8]
    return unmirrored ^ (crc << 8 & 0xFF00) in _STEPS


@immutable
class MavlinkField:
    """Field of a message: name, type, and number of elements (0 for a single number)."""

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
        """Default value of a MAVLink field: zero, or the protocol version 3 in a heartbeat."""
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
            low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if self.type[0] == "i" else (0, 2**bits - 1)
            numbers = f"from {low} to {high}"
        kind = "number" if self.type == "f32" else "whole number"
        return f"{self.count} {kind}s {numbers}" if self.count else f"a {kind} {numbers}"


@immutable
class Definition:
    """Definition of a MAVLink message, with the precomputed layouts for encoding and decoding."""

    name: str
    number: int
    fields: tuple[MavlinkField, ...]
    layout: struct.Struct
    check: bytes
    """One byte, CRC_EXTRA: digest of name and fields without extensions, so that other definitions do not match."""
    defaults: Mapping[str, FieldValue]
    arrays: tuple[tuple[int, MavlinkField], ...]
    """Index among the fields, and the field, of every array of numbers, last first."""
    texts: tuple[tuple[int, MavlinkField], ...]
    places: tuple[tuple[str, int | slice], ...]
    """Name of every field and its index among the numbers of the payload."""


def _declared_fields(text: str) -> Iterator[MavlinkField]:
    """Parse the field list of a message definition: type, names, ``;`` between types, ``+`` before extensions."""
    for part, extension in zip(text.split("+"), (False, True), strict=False):
        for group in part.split(";"):
            kind, *names = group.split()
            for declared in names:
                name, _, count = declared.rstrip("]").partition("[")
                yield MavlinkField(name=name, type=kind, count=int(count or 0), extension=extension)


def _definition(name: str, number: int, text: str) -> Definition:
    """Make the definition of a MAVLink message from its name, number and field list."""
    fields = tuple(_declared_fields(text))
    base = [field for field in fields if not field.extension]
    digested = f"{name} ".encode()
    for field in base:
        digested += f"{_TYPES[field.type][1]} {field.name} ".encode() + (bytes([field.count]) if field.count else b"")
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
        check=bytes([(digest & 0xFF) ^ (digest >> 8)]),
        defaults=MappingProxyType({field.name: field.default for field in fields}),
        arrays=tuple((k, each) for k, each in enumerate(fields) if each.count and not each.is_text)[::-1],
        texts=tuple((k, each) for k, each in enumerate(fields) if each.is_text),
        places=tuple(places),
    )


DEFINITIONS: Mapping[str, Definition] = MappingProxyType(
    {name: _definition(name, number, text) for name, (number, text) in _TABLE.items()}
)
"""Definition of every message that can be sent and received, by name."""

DEFINITIONS_BY_NUMBER: Mapping[int, Definition] = MappingProxyType({each.number: each for each in DEFINITIONS.values()})
"""Definition of every message by its number in a frame's header."""
