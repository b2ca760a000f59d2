"""A log as Parquet: columns with names and units, all that was flown in the metadata; read back to the bit."""

from __future__ import annotations

import json
import os
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.log.contents import arrays_of, log_info, log_of
from skyarm.log.flight_log import Log
from skyarm.log.log_columns import columns
from skyarm.records.files import needs_extra, shown
from skyarm.records.files.unpacked import TooLargeError, require_parquet_size
from skyarm.records.files.writing import writing_atomically

KEY = b"skyarm"
"""Key of the file's metadata under which the log's description stands, as JSON."""

SUM = b"skyarm.crc32"
"""Key of the description's checksum: Parquet has none for the metadata. Files of before have no such key."""


def _parquet() -> tuple[Any, Any]:
    """The libraries that write and read Parquet.

    Raises:
        ValueError: one line that names the extra.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise ValueError(f"pyarrow: is missing; a log as Parquet {needs_extra('logs')}") from None
    return pa, pq


def write_parquet(log: Log, path: Path) -> Path:
    """Write a log as Parquet, atomically; every field's metadata has its unit and meaning.

    Raises:
        ValueError: pyarrow is missing. OSError: it cannot be written.
    """
    pa, pq = _parquet()
    every = columns(log)
    said = [{"unit": each.unit, "meaning": each.meaning} for each in every]
    names = [each.name for each in every]
    fields = [pa.field(name, pa.float64(), nullable=False, metadata=m) for name, m in zip(names, said, strict=True)]
    arrays = [pa.array(np.ascontiguousarray(each.of(log))) for each in every]
    info = json.dumps(log_info(log)).encode()
    table = pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata={KEY: info, SUM: _sum(info)}))
    with writing_atomically(path) as stream:
        pq.write_table(table, stream, compression="zstd", write_page_checksum=True)
    return path


def read_parquet(path: Path) -> Log:
    """Read a log that :func:`write_parquet` wrote.

    Raises:
        OSError: the file cannot be read. ValueError: one line: it is no such file, or pyarrow is missing.
    """
    pa, pq = _parquet()
    name, content = f"log = {shown(os.fspath(path))}", path.read_bytes()
    try:
        file = pq.ParquetFile(pa.BufferReader(content), page_checksum_verification=True)
        require_parquet_size(file, content)
        if any(each != pa.float64() for each in file.schema_arrow.types):
            raise TypeError
        said = file.schema_arrow.metadata or {}
        info = json.loads(said[KEY])
        table = file.read()
        rows = np.stack([np.asarray(each, dtype=float) for each in table.columns], axis=1)
    except TooLargeError as error:
        raise ValueError(f"{name}: {error}") from None
    except Exception:  # file, pages, compression, columns and JSON have readers of their own, each with its own errors
        raise ValueError(f"{name}: must be a log that skyarm wrote as Parquet") from None
    if said.get(SUM, _sum(said[KEY])) != _sum(said[KEY]):
        raise ValueError(f"{name}: must have the checksum that it was written with; the file is damaged")
    try:
        return log_of(arrays_of(rows, table.column_names, info), info)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _sum(info: bytes) -> bytes:
    """Checksum of a description, as text."""
    return f"{zlib.crc32(info):08x}".encode()
