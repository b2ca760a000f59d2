"""Recordings, unpacked again: their messages, and what they say of a node at an
instant.
"""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import zstandard


def unpacked(content: bytes) -> dict[str, Any]:
    """Messages and arrays of a recording: zstd of a length, msgpack and aligned arrays,
    after the packed length.
    """
    inner = zstandard.ZstdDecompressor().decompress(content[8:])
    length = int.from_bytes(inner[:8], "little")
    found: dict[str, Any] = msgspec.msgpack.decode(inner[8 : 8 + length])
    at, buffers = 8 + length, []
    for size in found["binaryBufferLengths"]:
        at = -(-at // 8) * 8
        buffers.append(inner[at : at + size])
        at += size
    return {**found, "buffers": buffers}


def place_at(
    messages: list[Any], name: str, kind: str, field: str, seconds: float
) -> np.ndarray:
    """What the last message up to an instant says of a node, which must be there."""
    assert name in {message.get("name") for _, message in messages}
    said = [
        message[field]
        for at, message in messages
        if message["type"] == kind and message["name"] == name and at <= seconds + 1e-9
    ]
    # viser leaves out what is as a node begins
    return np.array(
        said[-1]
        if said
        else {"position": (0.0, 0.0, 0.0), "wxyz": (1.0, 0.0, 0.0, 0.0)}[field]
    )
