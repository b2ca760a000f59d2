"""Files of rows: a chunk of episodes as a Parquet file that states its study and carries its own checksum."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from skyarm.files import needs_extra
from skyarm.scenario.endings import STATUSES

MARK, FACTS, VERSION = b"skyarm", b"skyarm.study", b"skyarm.version"
"""Keys of a file's metadata: digest of the facts and number of the chunk; the facts; version of skyarm."""

SEAL, PLACE = b"skyarm.sha256", b"0" * 64
"""Key of the checksum, which is that of the file with zeros in its place."""

BETWEEN = b"\x18\x40"
"""Bytes between key and value in a Parquet footer: a text follows, of 64 characters (Thrift, compact protocol)."""


def arrow() -> Any:
    """The Parquet library.

    Raises:
        ValueError: it is not installed; names the extra that brings it.
    """
    try:
        import pyarrow as pa
    except ImportError:
        raise ValueError(f"pyarrow: is missing; {needs_extra('sweep')}") from None
    return pa


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Facts of a study on which its rows depend.

    Attributes:
        study: its document, plain values. scenarios: label of the controller -> digest of the scenario.
        version: of skyarm, which flew it.
    """

    study: Mapping[str, Any]
    scenarios: Mapping[str, str]
    version: str

    @cached_property
    def text(self) -> str:
        """The facts in the order of the study's file, which chooses the channels of the draws."""
        return json.dumps({"study": self.study, "scenarios": self.scenarios})

    @cached_property
    def digest(self) -> str:
        """Digest of the facts."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def chunks(self) -> int:
        """Number of files."""
        return -(-int(self.study["episodes"]) // int(self.study["chunk"]))

    @property
    def rows(self) -> int:
        """Rows of the whole study."""
        return int(self.study["episodes"]) * len(self.scenarios)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Paths and names that vary, derived ones last."""
        return (*(self.study["vary"] or {}), *(self.study.get("derived") or {}))

    @property
    def statuses(self) -> tuple[str, ...]:
        """Statuses of an episode, in the order of their numbers in the files."""
        return tuple(dict.fromkeys((*STATUSES, *self.study.get("endings", ()))))

    def span(self, index: int) -> range:
        """Episodes of a chunk."""
        size, episodes = self.study["chunk"], self.study["episodes"]
        return range(index * size, min((index + 1) * size, episodes))

    def metadata(self, index: int) -> dict[bytes, bytes]:
        """Metadata of a chunk's file, without its checksum."""
        mark = f"{self.digest}/{index}".encode()
        return {MARK: mark, FACTS: self.text.encode(), VERSION: self.version.encode()}


def origin_in(content: bytes) -> Origin | None:
    """The study of a file of rows; None if the file is damaged."""
    said = metadata_of(content)
    if said is None:
        return None
    return Origin(**json.loads(said[FACTS]), version=said[VERSION].decode())


def metadata_of(content: bytes) -> dict[bytes, bytes] | None:
    """Metadata of a file of rows without its checksum; None if the file does not fit its checksum."""
    if not is_whole(content):
        return None
    import pyarrow.parquet as pq

    said = dict(pq.read_schema(arrow().BufferReader(content)).metadata)
    del said[SEAL]
    return said


def chunk_file(table: Any, origin: Origin, index: int) -> bytes:
    """The sealed Parquet file of a chunk's rows."""
    import pyarrow.parquet as pq

    sink = io.BytesIO()
    table = table.replace_schema_metadata({**origin.metadata(index), SEAL: PLACE})
    pq.write_table(table, sink, compression="zstd", use_dictionary=["controller", "status"])
    content = sink.getvalue()
    at = _place(content)
    return content[:at] + hashlib.sha256(content).hexdigest().encode() + content[at + len(PLACE) :]


def is_whole(content: bytes) -> bool:
    """Whether a file is bit for bit as it was sealed."""
    at = _place(content)
    held = content[at : at + len(PLACE)]
    return at >= 0 and held == hashlib.sha256(content[:at] + PLACE + content[at + len(PLACE) :]).hexdigest().encode()


def _place(content: bytes) -> int:
    """Offset of the checksum; negative without one."""
    key = SEAL + BETWEEN
    at = content.rfind(key)
    return at + len(key) if at >= 0 else -1
