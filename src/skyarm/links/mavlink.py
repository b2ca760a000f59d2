"""MAVLink frames: encode messages in version 2, and decode those of versions 1 and 2
from a stream or from datagrams.

A frame of version 2 is ``0xFD``, length of the payload, two bytes of flags, sequence,
system, component, three bytes of message number, payload without its trailing zeros,
two bytes of checksum, and 13 bytes of signature where a flag says so (mavlink.io,
"Packet serialization"). One of version 1 begins with ``0xFE``, has no flags, one byte
of message number, a whole payload without extensions, and no signature; an autopilot
may send it until it hears version 2. All numbers are little endian. No socket here:
bytes in, bytes out.
"""

from __future__ import annotations

import re
import reprlib
import struct
from collections.abc import Mapping
from typing import Any

from skyarm.links.mavlink_messages import (
    DEFINITIONS,
    DEFINITIONS_BY_NUMBER,
    Definition,
    FieldValue,
    checksum,
    is_possible_checksum,
)
from skyarm.records.immutable import immutable

DecodedValue = int | float | str | tuple[int, ...] | tuple[float, ...]
"""Value of a received field: a number, a text, or a tuple of numbers."""

_MAGIC_2, _MAGIC_1 = 0xFD, 0xFE
_MAGICS = re.compile(b"[\xfd\xfe]")
_HEADER_2, _HEADER_1 = 10, 6
_CHECKSUM, _SIGNATURE = 2, 13
_SIGNED = 1
"""Flag of a signed frame, the only one that MAVLink 2 defines; a frame with another
flag must not be read."""


_MISFITS = (struct.error, OverflowError, TypeError, ValueError)
"""Errors raised for a value that a payload cannot contain."""


class MavlinkError(ValueError):
    """Error if a message cannot be encoded: unknown name, or a value that does not fit
    its field.
    """


@immutable
class Message:
    """Decoded message: name, numbers of the system and component that sent it, and
    fields by name.
    """

    name: str
    system: int
    component: int
    fields: Mapping[str, DecodedValue]

    def __getitem__(self, field: str) -> Any:
        """Value of a message field: number, ``str`` for characters, ``tuple`` for an
        array; KeyError if missing.
        """
        return self.fields[field]


def pack(
    name: str,
    *,
    sequence: int,
    system: int = 1,
    component: int = 1,
    **fields: FieldValue,
) -> bytes:
    """Encode a message as a frame of MAVLink 2.

    Args:
        name: name of the message, as in ``DEFINITIONS``: ``"HIL_SENSOR"``.
        sequence: counter of the sender's frames; sent modulo 256.
        system: number of the sender, 0 to 255.
        component: number of the sender's component, 0 to 255.
        fields: values in units and frames of mavlink.io; one that is left out is zero
            (``mavlink_version`` is 3).

    Raises:
        MavlinkError: for an unknown message or field, or a value that does not fit.
    """
    definition = DEFINITIONS.get(name)
    if definition is None:
        raise MavlinkError(
            f"MAVLink message {name!r}: must be one of {', '.join(sorted(DEFINITIONS))}"
        )
    merged = {**definition.defaults, **fields}
    if len(merged) != len(definition.defaults):
        unknown = next(field for field in merged if field not in definition.defaults)
        raise MavlinkError(
            f"{name} has no field {unknown!r}: must be one of"
            f" {', '.join(definition.defaults)}"
        )
    try:
        payload = _payload(definition, merged)
    except _MISFITS as error:
        raise _misfit(definition, merged) from error
    # MAVLink 2 cuts trailing zeros, but one byte stays
    payload = payload.rstrip(b"\0") or b"\0"
    try:
        # length, two bytes of flags, none of which is set, and the sender
        header = bytes((len(payload), 0, 0, sequence & 0xFF, system, component))
    except (ValueError, TypeError) as error:
        raise MavlinkError(
            f"{name} from system {system!r}, component {component!r}, sequence"
            f" {sequence!r}: must be whole numbers, system and component from 0 to 255"
        ) from error
    body = header + definition.number.to_bytes(3, "little") + payload
    return b"\xfd" + body + checksum(body + definition.check).to_bytes(2, "little")


def _payload(definition: Definition, merged: Mapping[str, FieldValue]) -> bytes:
    """Encode a MAVLink message's payload with its trailing zeros; errors of types and
    lengths are not caught.
    """
    values: list[Any] = list(merged.values())
    for place, field in definition.texts:
        values[place] = _characters(values[place], field.count)
    for place, field in definition.arrays:
        if len(values[place]) != field.count:
            raise ValueError(field.name)
        values[place : place + 1] = values[place]
    return definition.layout.pack(*values)


def _characters(value: Any, count: int) -> bytes:
    """Encode text of at most ``count`` bytes; TypeError or ValueError for any other
    value.
    """
    # bytes() of a number would be as many zeros, which a memoryview refuses
    encoded = value.encode() if isinstance(value, str) else bytes(memoryview(value))
    if len(encoded) > count:
        raise ValueError(value)
    return encoded


def _misfit(definition: Definition, merged: Mapping[str, FieldValue]) -> MavlinkError:
    """Error that names the first message field whose value cannot be encoded."""
    for field in definition.fields:
        try:
            _payload(
                definition, {**definition.defaults, field.name: merged[field.name]}
            )
        except _MISFITS:
            value = " ".join(reprlib.repr(merged[field.name]).split())
            return MavlinkError(
                f"{definition.name}.{field.name}: {value}: must be {field.range_text}"
            )
    return MavlinkError(f"{definition.name}: its values do not fit together")


class Parser:
    """Incremental MAVLink parser for the bytes from one peer; stores at most one
    incomplete frame.

    Bytes that are no frame are skipped: after a wrong checksum the search goes on
    behind the frame's first byte. A message of an unknown number cannot be checked in
    full, because its definition is part of its checksum. It counts as a frame where its
    sender has sent a frame before (or nobody has), where a frame follows or nothing,
    and where one definition of 256 would give its checksum.

    Args:
        datagrams: True where every call of ``feed`` brings whole frames, as over UDP:
            an incomplete one is then damaged and no later byte completes it.

    Attributes:
        bad: beginnings of frames with a wrong checksum, length or flag.
        skipped: bytes that belonged to no frame.
        unknown: frames whose message is not in ``DEFINITIONS``.
        version_1, version_2: frames of MAVLink 1 and of MAVLink 2, decoded or unknown.
        signed: decoded frames with a signature, which is not verified.
        lost_by_sender: frames that are missing in the sequence, by numbers of system
            and component.
    """

    def __init__(self, *, datagrams: bool = False) -> None:
        self.bad = self.skipped = self.unknown = 0
        self.version_1 = self.version_2 = self.signed = 0
        self.lost_by_sender: dict[tuple[int, int], int] = {}
        self._next_sequence: dict[tuple[int, int], int] = {}
        self._datagrams = datagrams
        self._pending = b""

    @property
    def lost(self) -> int:
        """Number of frames missing in the sequences of all senders; the restart of a
        peer counts as a gap, too.
        """
        return sum(self.lost_by_sender.values())

    def feed(self, data: bytes) -> list[Message]:
        """Parse received bytes, complete frames or not; return the messages completed
        by them, in order.
        """
        pending = self._pending + data
        end = len(pending)
        messages: list[Message] = []
        start = 0
        while start < end:
            if pending[start] not in (_MAGIC_2, _MAGIC_1):
                magic = _MAGICS.search(pending, start)
                start = self._skip(start, magic.start() if magic else end)
                continue
            stop = _frame_end(pending, start)
            if stop > end and not self._datagrams:
                break
            if start < stop <= end and self._accept(pending, start, stop, messages):
                start = stop
            else:
                self.bad += 1
                start = self._skip(start, start + 1)
        self._pending = pending[start:]
        return messages

    def _skip(self, start: int, stop: int) -> int:
        """Count the bytes from ``start`` to ``stop`` as skipped, and return
        ``stop``.
        """
        self.skipped += stop - start
        return stop

    def _accept(
        self, pending: bytes, start: int, stop: int, messages: list[Message]
    ) -> bool:
        """Check the MAVLink frame from ``start`` to ``stop`` and append its message;
        False if it is no frame.
        """
        version_2 = pending[start] == _MAGIC_2
        if version_2:
            payload = start + _HEADER_2
            sequence, system, component = pending[start + 4 : start + 7]
            number = int.from_bytes(pending[start + 7 : payload], "little")
        else:
            payload = start + _HEADER_1
            sequence, system, component, number = pending[start + 2 : payload]
        tail = payload + pending[start + 1]
        body = pending[start + 1 : tail]
        received = pending[tail] | pending[tail + 1] << 8
        definition = DEFINITIONS_BY_NUMBER.get(number)
        # its checksum cannot be known; by chance one of 256 passes, so a known sender
        # and a frame right behind it, or the end, are asked for as well
        if definition is None:
            follows = pending[stop : stop + 1] in (b"", b"\xfd", b"\xfe")
            admitted = (
                system,
                component,
            ) in self._next_sequence or not self._next_sequence
            if not (admitted and follows and is_possible_checksum(body, received)):
                return False
        elif checksum(body + definition.check) != received:
            return False
        self._count(sequence, (system, component))
        self.version_1 += not version_2
        self.version_2 += version_2
        if definition is None:
            self.unknown += 1
        else:
            self.signed += version_2 and pending[start + 2] & _SIGNED
            fields = _fields(definition, pending[payload:tail])
            messages.append(
                Message(
                    name=definition.name,
                    system=system,
                    component=component,
                    fields=fields,
                )
            )
        return True

    def _count(self, sequence: int, sender: tuple[int, int]) -> None:
        """Count the frames missing between a frame and the previous one of the same
        sender.
        """
        # a sequence number is one byte, and begins again at 0
        gap = (sequence - self._next_sequence.get(sender, sequence)) & 0xFF
        self._next_sequence[sender] = sequence + 1
        if gap:
            self.lost_by_sender[sender] = self.lost_by_sender.get(sender, 0) + gap


def _frame_end(pending: bytes, start: int) -> int:
    """Index after the MAVLink frame at ``start``; ``start`` for invalid flags, past the
    data for a cut header.
    """
    if pending[start] == _MAGIC_1:
        header, signature = _HEADER_1, 0
    else:
        flags = pending[start + 2] if start + 2 < len(pending) else 0
        # of flags that are not known the length is not known either
        if flags & ~_SIGNED:
            return start
        header, signature = _HEADER_2, _SIGNATURE * flags
    if start + header > len(pending):
        # one past what has arrived: the caller waits for more
        return len(pending) + 1
    return start + header + pending[start + 1] + _CHECKSUM + signature


def _fields(definition: Definition, payload: bytes) -> dict[str, DecodedValue]:
    """Decode the fields of a payload: zeros where it is short, unknown extension bytes
    ignored.
    """
    size = definition.layout.size
    numbers = definition.layout.unpack(payload[:size].ljust(size, b"\0"))
    fields: dict[str, Any] = {name: numbers[place] for name, place in definition.places}
    for _, field in definition.texts:
        # a text of a stranger must not steer the terminal
        text = fields[field.name].partition(b"\0")[0].decode(errors="replace")
        fields[field.name] = "".join(c if c.isprintable() else " " for c in text)
    return fields
