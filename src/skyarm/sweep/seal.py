"""A file of rows that carries its own checksum: any damage of it shows without a list kept elsewhere."""

from __future__ import annotations

import hashlib

SEAL = b"skyarm.sha256"
"""Key of a file's metadata that holds the checksum of the file, this one value counted as zeros."""

PLACE = b"0" * 64
"""What a file is written with, to be replaced by its checksum."""

BETWEEN = b"\x18\x40"
"""What stands between key and value in a Parquet file's end: a text follows, of 64 characters (Thrift, compact)."""


def sealed(content: bytes) -> bytes:
    """A Parquet file whose metadata has ``PLACE`` under ``SEAL``, with its checksum there.

    Raises:
        ValueError: it has no such place.
    """
    at = _place(content)
    if at < 0 or content[at : at + len(PLACE)] != PLACE:
        raise ValueError("Parquet file: must have a place for its checksum")
    return content[:at] + hashlib.sha256(content).hexdigest().encode() + content[at + len(PLACE) :]


def is_whole(content: bytes) -> bool:
    """Whether a file is bit for bit what was sealed; False for one that never was."""
    at = _place(content)
    if at < 0:
        return False
    digest = hashlib.sha256(content[:at])
    digest.update(PLACE)
    digest.update(content[at + len(PLACE) :])
    return content[at : at + len(PLACE)] == digest.hexdigest().encode()


def _place(content: bytes) -> int:
    """Where the checksum stands; negative if nowhere."""
    key = SEAL + BETWEEN
    at = content.rfind(key)
    return at + len(key) if at >= 0 else -1
