"""Whose rows a file holds: the facts of its study, which it carries, and what follows from them for its content."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np

from skyarm.files.unpacked import require_parquet_size
from skyarm.scenario.endings import STATUSES
from skyarm.sweep.seal import PLACE, SEAL, is_whole

MARK, FACTS, VERSION = b"skyarm", b"skyarm.study", b"skyarm.version"
"""Keys of a file's metadata: digest of the facts and number of the chunk, the facts, who wrote it."""

BEFORE_METRICS, AFTER_METRICS = ("episode", "controller"), ("status", "end_time")


class Verdict(Enum):
    """What a file is to a study.

    Rows of it, whole; rows of another one; whole rows, with a number that the study has no chunk of; no rows that
    anyone could rely on.
    """

    WHOLE = "whole"
    FOREIGN = "of another study"
    BEYOND = "beyond the study's last"
    DAMAGED = "damaged"


@dataclass(frozen=True, kw_only=True)
class Origin:
    """A study as its rows know it.

    Attributes:
        study: its document, plain values. scenarios: label of the controller -> digest of the scenario.
        version: of skyarm, which flew it.
    """

    study: Mapping[str, Any]
    scenarios: Mapping[str, str]
    version: str

    @cached_property
    def text(self) -> str:
        """The facts that rows depend on, in the order of the study's file: it chooses the channels of the draws."""
        return json.dumps({"study": self.study, "scenarios": self.scenarios})

    @cached_property
    def digest(self) -> str:
        """Digest of the facts."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def chunks(self) -> int:
        """How many files the rows take."""
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
        """How an episode can end, in the order of their numbers in the files."""
        return tuple(dict.fromkeys((*STATUSES, *self.study.get("endings", ()))))

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns, in order."""
        return (*BEFORE_METRICS, *self.parameters, *self.study["metrics"], *AFTER_METRICS)

    def span(self, index: int) -> range:
        """Episodes of a chunk."""
        size, episodes = self.study["chunk"], self.study["episodes"]
        return range(index * size, min((index + 1) * size, episodes))

    def metadata(self, index: int) -> dict[bytes, bytes]:
        """What the file of a chunk says of itself, before it is sealed."""
        mark = f"{self.digest}/{index}".encode()
        return {MARK: mark, FACTS: self.text.encode(), VERSION: self.version.encode(), SEAL: PLACE}

    def verdict(self, content: bytes, index: int, listed: str | None = None) -> Verdict:
        """What a file is, by its checksum, its facts and its columns.

        Args:
            content: of the file.
            index: of the chunk that it should be.
            listed: SHA-256 that a manifest of schema 1 gives for it; such a file has no seal.
        """
        if listed is None:
            return self._verdict(content, self.metadata(index), index) if is_whole(content) else Verdict.DAMAGED
        if hashlib.sha256(content).hexdigest() != listed:
            return Verdict.DAMAGED
        return self._verdict(content, {MARK: self.metadata(index)[MARK]}, index)

    def _verdict(self, content: bytes, metadata: Mapping[bytes, bytes], index: int) -> Verdict:
        found = parquet(content)
        if found is None:
            return Verdict.DAMAGED
        said = found.schema_arrow.metadata or {}
        if any(said.get(key) != value for key, value in metadata.items() if key != SEAL):
            return Verdict.FOREIGN
        fits = tuple(found.schema_arrow.names) == self.columns and all(map(_fits, found.schema_arrow))
        return Verdict.WHOLE if fits and self._each_episode_once(found, index) else Verdict.DAMAGED

    def _each_episode_once(self, found: Any, index: int) -> bool:
        """Whether the columns that say what a row is are those of the chunk; files may come from anyone."""
        table = columns_of(found, [*BEFORE_METRICS, "status", *self.parameters])
        span, labels = self.span(index), list(self.scenarios)
        if table is None or table.num_rows != len(span) * len(labels) or any(c.null_count for c in table.columns):
            return False
        held = {name: column.to_numpy() for name, column in zip(table.column_names, table.columns, strict=True)}
        return (
            np.array_equal(held["episode"], np.tile(np.arange(span.start, span.stop), len(labels)))
            and np.array_equal(held["controller"], np.repeat(np.array(labels, dtype=object), len(span)))
            and set(held["status"].tolist()) <= set(self.statuses)
            and all(np.isfinite(held[path]).all() for path in self.parameters)
        )


def _fits(field: Any) -> bool:
    """Whether a column has the type that a sweep writes."""
    if field.name == "episode":
        return str(field.type) == "uint32"
    if field.name in ("controller", "status"):
        return str(field.type).startswith("dictionary<values=string, indices=int8")
    return str(field.type) == "double"


def parquet(content: bytes) -> Any:
    """A Parquet file; None for anything else, and for one that would unpack to too much."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        found = pq.ParquetFile(pa.BufferReader(content))
        require_parquet_size(found, content)
    except (pa.ArrowException, OSError, ValueError):
        return None
    return found


def columns_of(found: Any, names: list[str]) -> Any:
    """Some columns of a Parquet file; None if they cannot be read."""
    import pyarrow as pa

    try:
        return found.read(columns=names)
    except (pa.ArrowException, OSError, ValueError):
        return None
