"""Compressed files, whose sizes are checked before they are unpacked: a small file may stand for gigabytes."""

from __future__ import annotations

import io
import zipfile
from typing import Any

import numpy as np

LARGEST = 1e9
"""Bytes that a file may unpack to, whatever its own size."""

RATIO = 20
"""Beyond that it may take so many times its own size: numbers of a flight shrink to a half or a tenth."""


class TooLargeError(ValueError):
    """A file that would unpack to more than is allowed; says how much that is."""


def require_size(unpacked: float, content: bytes) -> None:
    """Refuse what a file would unpack to.

    Args:
        unpacked: bytes.
        content: of the file.

    Raises:
        TooLargeError: one line, without the file's name.
    """
    most = max(LARGEST, RATIO * len(content))
    if not unpacked <= most:
        raise TooLargeError(f"must unpack to at most {most / 1e6:.0f} MB, and would to {unpacked / 1e6:.3g} MB")


def npz_arrays(content: bytes) -> dict[str, Any]:
    """Arrays of an npz file, by name; none of Python's objects.

    Raises:
        TooLargeError: it unpacks to too much. ValueError: it is no such file.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
        # zipfile unpacks whole blocks of other methods, which savez does not write; of these no more than it is asked
        if any(each.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for each in members):
            raise ValueError("members must be stored or deflated")
        # a member yields no more than its entry says; entries may overlap in the file
        require_size(sum(each.file_size for each in members), content)
        with np.load(io.BytesIO(content), allow_pickle=False) as data:
            return {name: data[name] for name in data.files}
    except TooLargeError:
        raise
    except Exception as error:  # archive, compression, header and numbers have readers with errors of their own
        raise ValueError(f"must be an npz file: {error}") from None


def require_parquet_size(found: Any, content: bytes) -> None:
    """Refuse a ``pyarrow.parquet.ParquetFile``, of which nothing is unpacked yet, by its footer and its pages' headers.

    Raises:
        TooLargeError: it unpacks to too much. ValueError: its pages are damaged, or of encodings that no log has.
    """
    footer = found.metadata
    groups = [footer.row_group(k) for k in range(footer.num_row_groups)]
    chunks = [group.column(k) for group in groups for k in range(group.num_columns)]
    # the reader takes from each chunk as many values as its entry says; equal numbers in a row take no bytes in a page
    values = max(sum(abs(each.num_values) for each in chunks), abs(footer.num_rows) * footer.num_columns)
    try:
        # it allocates what a page's own header says, whatever the footer says; without values it reads no page
        pages = sum(_page_bytes(content, each) for each in chunks if each.num_values > 0)
    except (IndexError, KeyError, RecursionError):
        raise ValueError("pages must have headers") from None
    require_size(max(pages, 8.0 * values), content)


def _page_bytes(content: bytes, chunk: Any) -> int:
    """Bytes that the pages of a column chunk unpack to."""
    stream, total = io.BytesIO(content), 0
    first = chunk.dictionary_page_offset if chunk.has_dictionary_page else 0
    begin = first if 0 < first < chunk.data_page_offset else chunk.data_page_offset
    stream.seek(begin)
    while stream.tell() < begin + chunk.total_compressed_size:
        header = _thrift_struct(stream)
        unpacked, packed = header[UNPACKED], header[PACKED]
        encodings = [header[kind][field] for kind, field in ENCODING.items() if kind in header]
        if min(unpacked, packed) < 0 or not set(encodings) <= BOUNDED:
            raise ValueError("pages must be plain or refer to a dictionary")
        total += unpacked
        stream.seek(packed, io.SEEK_CUR)
    return total


UNPACKED, PACKED = 2, 3
"""Numbers of the fields of a page's header, of Parquet's format."""

ENCODING = {5: 2, 7: 2, 8: 4}
"""Kind of page (data, dictionary, data of version 2) -> number of the field that says how its values are encoded."""

BOUNDED = {0, 2, 8}
"""Encodings in which values take no more than their page: plain, and places in a dictionary. Strings that repeat
beginnings of those before them may take any amount."""


def _thrift_struct(stream: io.BytesIO) -> dict[int, Any]:
    """Integers of 32 bits and structs of a struct of Thrift's compact protocol, by the numbers of their fields.

    Raises:
        ValueError, IndexError, RecursionError: it is none, or has what no page's header has.
    """
    found: dict[int, Any] = {}
    field = 0
    while (head := stream.read(1)[0]) & 15:
        kind = head & 15
        field = field + (head >> 4) if head >> 4 else _thrift_integer(stream)
        if not 0 < field < 100:
            raise ValueError(f"field {field}: must be one of a page's header")
        if kind == 12:
            found[field] = _thrift_struct(stream)
        elif kind in (4, 5, 6):
            value = _thrift_integer(stream)
            if kind == 5:
                if not -(2**31) <= value < 2**31:  # of more the reader takes the last 32 bits
                    raise ValueError(f"field {field}: must have 32 bits")
                found[field] = value
        elif kind == 8:
            stream.seek(_varint(stream), io.SEEK_CUR)
        elif kind == 3:
            stream.read(1)
        elif kind not in (1, 2):
            raise ValueError(f"type {kind}: must be one of a page's header")
    return found


def _thrift_integer(stream: io.BytesIO) -> int:
    zigzag = _varint(stream)
    return (zigzag >> 1) ^ -(zigzag & 1)


def _varint(stream: io.BytesIO) -> int:
    value = 0
    for shift in range(0, 64, 7):
        byte = stream.read(1)[0]
        value |= (byte & 127) << shift
        if byte < 128:
            return value
    raise ValueError("an integer must have at most 64 bits")
