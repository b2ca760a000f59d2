"""Result files in a folder: one Parquet file per work item, named by the SHA-256 digest
of its bytes.

A file counts if its bytes fit its name and its metadata names the work that is asked
for. Everything else is flown again: a flipped bit, half a file, rows of other numbers
or of another version. Nothing is unpacked before its size is known.
"""

from __future__ import annotations

import hashlib
import io
import os
import pickle
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from skyarm.log.metrics.metric_catalogue import is_torque, row_names
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.arrays import doubles
from skyarm.records.files import (
    PathLike,
    needs_extra,
    require_no_link,
    require_writable,
    sync_folder,
    write_inside,
)
from skyarm.records.files.unpacked import LARGEST, require_size
from skyarm.records.files.writing import LOCK, one_writer
from skyarm.records.immutable import immutable
from skyarm.studies.flights.work import AUTOPILOT, Rows, Work

if TYPE_CHECKING:
    from pyarrow import Array as ArrowArray
    from pyarrow import ChunkedArray, DataType, DictionaryArray
    from pyarrow.parquet import ParquetFile

FILE = re.compile(r"(?P<label>.+)\.(?P<digest>[0-9a-f]{64})\.parquet")

KEY, LABEL, STUDY = b"skyarm.key", b"skyarm.label", b"skyarm.study"
"""Keys of a file's metadata: digest and label of the work; digest of its study."""

MAGIC = b"PAR1"

LONGEST = 120
"""Largest number of characters of a label in a file's name: with both digests and the
suffix it stays below the 255 bytes that file systems allow."""


@cache
def _parquet() -> ModuleType | None:
    """Module pyarrow.parquet; None if it is not installed, in which case results are
    not stored.
    """
    try:
        return import_module("pyarrow.parquet")
    except ImportError:
        return None


def require_parquet() -> None:
    """Raise an error that names the missing optional dependency if results cannot be
    stored.

    Raises:
        ValueError: pyarrow is not installed.
    """
    if _parquet() is None:
        raise ValueError(f"pyarrow: is missing; {needs_extra('sweep')}")


def pack_rows(rows: Rows, metadata: Mapping[bytes, bytes]) -> bytes:
    """Serialise result rows as a Parquet file; without pyarrow as a pickle, which is
    never stored.
    """
    parquet = _parquet()
    if parquet is None:
        return pickle.dumps(rows)
    import pyarrow as pa

    texts = [name for name, column in rows.items() if column.dtype.kind == "U"]
    columns = {
        name: _texts(pa, each) if name in texts else _numbers(pa, each)
        for name, each in rows.items()
    }
    table = pa.table(columns).replace_schema_metadata(metadata)
    sink = io.BytesIO()
    # a few texts stand in many rows, and are written once each; numbers differ
    parquet.write_table(table, sink, compression="zstd", use_dictionary=texts)
    return sink.getvalue()


def _texts(pa: ModuleType, column: Array) -> DictionaryArray:
    different, places = np.unique(column, return_inverse=True)
    texts = [text.encode() for text in different.tolist()]
    # from buffers, since array() would import pandas; Arrow counts bytes in 32 bits
    ends = np.cumsum([0, *map(len, texts)]).astype(np.int32)
    strings = pa.StringArray.from_buffers(
        len(texts), pa.py_buffer(ends), pa.py_buffer(b"".join(texts))
    )
    return pa.DictionaryArray.from_arrays(
        _numbers(pa, places.astype(np.int32)), strings
    )


def _numbers(pa: ModuleType, column: Array) -> ArrowArray:
    if column.dtype.kind not in "fiu":
        return pa.array(column)
    kind = pa.from_numpy_dtype(column.dtype)
    content = pa.py_buffer(np.ascontiguousarray(column))
    # array() would import pandas, 0.2 s
    return pa.Array.from_buffers(kind, len(column), [None, content])


def unpack_rows(content: bytes) -> Rows:
    """Read all columns of a result file, given its content.

    Raises:
        ValueError: it is no such file, would unpack to too much, or has columns that
            rows do not have.
    """
    if _parquet() is None:
        return dict(pickle.loads(content))
    import pyarrow as pa

    try:
        table = open_rows(content).read()
        return {name: _column(table.column(name)) for name in table.column_names}
    except (pa.ArrowException, OSError, UnicodeError) as error:
        raise ValueError(f"must be a Parquet file: {error}") from None


def _column(column: ChunkedArray) -> Array:
    """Convert a column of an Arrow table to an array, in which equal texts share one
    string.
    """
    import pyarrow as pa

    if column.null_count:
        raise ValueError("must have no empty values")
    if not pa.types.is_dictionary(column.type):
        return np.asarray(column.to_numpy())
    whole = column.unify_dictionaries().combine_chunks()
    whole = whole.chunk(0) if isinstance(whole, pa.ChunkedArray) else whole
    texts = np.array(whole.dictionary.to_pylist(), dtype=object)
    return np.asarray(texts[whole.indices.to_numpy()])


def open_rows(content: bytes) -> ParquetFile:
    """Open the content of a Parquet result file, after a check of its columns and of
    its unpacked size.

    Raises:
        ValueError: it is no such file, would unpack to too much, or has columns that
            rows do not have.
    """
    import pyarrow as pa
    from pyarrow.parquet import ParquetFile

    if not content.startswith(MAGIC):
        raise ValueError("must be a Parquet file")
    try:
        file = ParquetFile(io.BytesIO(content), page_checksum_verification=True)
        facts, schema = file.metadata, file.schema_arrow
        groups = [facts.row_group(k) for k in range(facts.num_row_groups)]
        columns = [
            group.column(i) for group in groups for i in range(group.num_columns)
        ]
        sizes = [each.total_uncompressed_size for each in columns]
        counts = [each.num_values for each in columns]
    except (pa.ArrowException, OSError, ValueError) as error:
        raise ValueError(f"must be a Parquet file: {error}") from None
    if min([0, *sizes, *counts]) < 0:
        raise ValueError("must have sizes of at least 0")
    if len({*schema.names}) != len(schema.names) or not all(
        map(_is_of_rows, schema.types)
    ):
        raise ValueError("must have columns of numbers, words and logs, each once")
    logs = {
        name
        for name, kind in zip(schema.names, schema.types, strict=True)
        if pa.types.is_binary(kind)
    }
    if any(
        each.path_in_schema in logs and each.has_dictionary_page for each in columns
    ):
        # a small file could repeat one for ever
        raise ValueError("must have each log by itself")
    # a value may take few bytes in the file and eight once it is unpacked
    require_size(
        max(sum(sizes), 8 * sum(counts), 8 * facts.num_rows * facts.num_columns),
        content,
    )
    return file


def _is_of_rows(kind: DataType) -> bool:
    """True for a column type allowed in result files: numbers, dictionary-encoded text
    or binary logs.
    """
    import pyarrow as pa

    types = pa.types
    is_text = types.is_dictionary(kind) and types.is_string(kind.value_type)
    return bool(
        is_text
        or types.is_floating(kind)
        or types.is_integer(kind)
        or types.is_binary(kind)
    )


def concatenate(files: Iterable[tuple[bytes, Sequence[str]]]) -> bytes:
    """Concatenate chosen columns of several result files into one file, with null where
    a file lacks a column.

    The status is plain text there, as whoever reads that file has always had it.
    """
    import pyarrow as pa
    from pyarrow.parquet import write_table

    tables = [open_rows(content).read().select(list(names)) for content, names in files]
    table = pa.concat_tables(
        tables, promote_options="default"
    ).replace_schema_metadata()
    sink = io.BytesIO()
    place = table.column_names.index("status")
    write_table(table.set_column(place, "status", table["status"].cast("string")), sink)
    return sink.getvalue()


def sound_content(path: Path, *, named: bool = True) -> bytes | None:
    """Read a result file; None if it is unreadable, or if its bytes do not match the
    digest in its name (``named``).
    """
    match = FILE.fullmatch(path.name)
    try:
        with path.open("rb") as file:
            # one byte more tells that a file is too large
            content = file.read(int(LARGEST) + 1)
    except OSError:
        return None
    if len(content) > LARGEST:
        return None
    sound = not named or (
        match is not None and hashlib.sha256(content).hexdigest() == match["digest"]
    )
    return content if sound else None


@immutable
class FileFacts:
    """Metadata and number of rows of a result file."""

    metadata: Mapping[bytes, bytes]
    rows: int


def facts_of(content: bytes, *, whole: bool = False) -> FileFacts:
    """Metadata of a result file, empty if it is damaged or too large; ``whole`` also
    reads all of its data.
    """
    import pyarrow as pa

    try:
        file = open_rows(content)
        if whole:
            file.read()
    except (ValueError, pa.ArrowException, OSError):
        return FileFacts(metadata={}, rows=0)
    return FileFacts(
        metadata=dict(file.metadata.metadata or {}), rows=file.metadata.num_rows
    )


def files_by_label(folder: PathLike) -> dict[str, list[Path]]:
    """Paths of the result files in a folder by the label of their work item, sorted by
    name.

    Raises:
        OSError: the folder cannot be listed.
    """
    files: dict[str, list[Path]] = {}
    if not Path(folder).is_dir():
        return files
    with os.scandir(folder) as entries:
        names = sorted(
            # a link could lead out of the folder
            entry.name
            for entry in entries
            if entry.is_file(follow_symlinks=False)
        )
    for name in names:
        if match := FILE.fullmatch(name):
            files.setdefault(match["label"], []).append(Path(folder) / name)
    return files


WORDS = ("controller", "status")
"""Columns of text; all others are numbers."""


def read_column(files: Sequence[Path], name: str, controller: str) -> Array:
    """Read one column of several result files, optionally of a single controller.

    Raises:
        ValueError: one line: no such column, or not of numbers.
    """
    import pyarrow as pa
    import pyarrow.dataset as ds

    chosen = ds.field("controller") == controller if controller else None
    try:
        table = ds.dataset([str(path) for path in files]).to_table(
            columns=[name], filter=chosen
        )
        column = _column(table.column(0))
        return column if name in WORDS else doubles(column)
    except (pa.ArrowException, OSError, ValueError, TypeError) as error:
        raise ValueError(" ".join(str(error).split())) from None


ROWS = "rows"
"""Name of the folder of row files in the folder of a study's results."""


class Store:
    """Folder of result files, opened for writing.

    Args:
        folder: folder of the results, made if missing; the rows are in ``rows`` below
            it.
        study: digest of the study whose rows it takes.

    Attributes:
        damaged: names of files whose bytes do not fit them. written: names of those
            written since.

    Raises:
        OSError: it cannot be written.
    """

    def __init__(self, folder: PathLike, *, study: str = "") -> None:
        self.folder = require_writable(folder)
        self.study = study
        self.rows = require_writable(require_no_link(self.folder / ROWS))
        self.damaged, self.written = list[str](), set[str]()

    @cached_property
    def _files(self) -> dict[str, list[Path]]:
        """Result files by label, listed at first use, when no other process writes to
        the folder.
        """
        return files_by_label(self.rows)

    @classmethod
    def if_kept(cls, folder: PathLike) -> Store | None:
        """Open the store in a folder; None without pyarrow.

        Raises:
            ValueError: one line: it holds the rows of a sweep.
        """
        if _parquet() is None:
            return None
        every = (
            path
            for paths in files_by_label(Path(folder) / ROWS).values()
            for path in paths
        )
        metadata = (facts_of(sound_content(path) or b"").metadata for path in every)
        if next(filter(None, metadata), {}).get(STUDY):  # of the first that is whole
            raise ValueError(f"{folder}: holds rows of a sweep; choose another --out")
        return cls(folder)

    def alone(self, part: str = "") -> AbstractContextManager[None]:
        """Context manager that excludes other processes from writing to the folder, or
        to a named part of its files.

        Raises:
            TakenError: another process does.
        """
        return one_writer(self.folder, name=f"{LOCK}_{part}" if part else LOCK)

    def get(self, work: Work) -> bytes | None:
        """Content of the stored result file of a work item; None if it must be
        simulated.
        """
        label = name_of(work.label)
        key = work.key.encode()
        for path in self._files.get(label, ()):
            content = sound_content(path)
            stored_key = facts_of(content or b"").metadata.get(KEY)
            if content is not None and stored_key == key and _fits(content, work):
                self._keep_only(label, path)
                return content
            # rows of another work are no damage: they only do not count
            if stored_key in (None, key) and path.exists():
                self.damaged.append(path.name)
        return None

    def metadata(self, work: Work) -> dict[bytes, bytes]:
        """Metadata for the result file of a work item."""
        return {
            KEY: work.key.encode(),
            LABEL: work.label.encode(),
            STUDY: self.study.encode(),
        }

    def put(self, work: Work, content: bytes) -> None:
        """Write the result file of a work item, and remove the files that it replaces.

        Nothing is written where an autopilot's program has failed, which may go better
        another time.

        Raises:
            OSError: it cannot be written.
        """
        if work.alone and any(
            each.startswith(f"{AUTOPILOT}: ") for each in unpack_rows(content)["status"]
        ):
            return
        label = name_of(work.label)
        path = self.rows / f"{label}.{hashlib.sha256(content).hexdigest()}.parquet"
        # the folder's list is flushed once for all files, by close()
        write_inside(path, content, entry=False)
        self._keep_only(label, path)
        self.written.add(path.name)

    def _keep_only(self, label: str, path: Path) -> None:
        """Remove older result files of a label after a new one: in a study's folder
        all, else damaged ones only.
        """
        for other in self._files.get(label, ()):
            if other != path and (self.study or other.name in self.damaged):
                # one that stays does no harm: damaged ones do not count, and of sound
                # ones one does
                with suppress(OSError):
                    other.unlink()
        self._files[label] = [path]

    def close(self) -> None:
        """Flush the folder's list of files to disk."""
        sync_folder(self.rows)


def _fits(content: bytes, work: Work) -> bool:
    """True if a file has the result rows of a work item: all its columns, with the
    right types and lengths.
    """
    try:
        rows = unpack_rows(content)
    except ValueError:
        return False
    # of a joint whose command is a setpoint of its drive a flight by itself has no
    # effort
    asked = (
        [name for name in work.metrics if not (work.alone and is_torque(name))]
        if not work.measure
        else []
    )
    given = [
        "episode",
        *work.fixed,
        *work.columns,
        *row_names(asked, work.scenario.setpoints),
        "status",
        "end_time",
    ]
    if work.alone:
        given = [name for name in given if not is_torque(name)]
    fixed = {name: np.asarray(value).dtype for name, value in work.fixed.items()}
    # texts come back as objects
    kinds = {"episode": np.dtype(np.uint32), "status": np.dtype(object)} | {
        name: np.dtype(object) if kind.kind == "U" else kind
        for name, kind in fixed.items()
    }
    return {*given} <= {*rows} and all(
        len(column) == work.count
        and (name == "log" or column.dtype == kinds.get(name, np.dtype(float)))
        for name, column in rows.items()
    )


def name_of(label: str) -> str:
    """File name stem of a label, with a digest if characters were replaced or cut
    off.
    """
    plain = re.sub(r"[^\w.() -]+", "-", label, flags=re.ASCII)
    if plain == label and len(label) <= LONGEST:
        return label
    # eight digits, chosen, tell labels apart that were cut or mended alike
    return f"{plain[:LONGEST]}-{hashlib.sha256(label.encode()).hexdigest()[:8]}"
