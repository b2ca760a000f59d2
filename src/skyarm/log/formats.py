"""File formats of a log, by suffix."""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import IO

import numpy as np
import orjson

from skyarm.log.contents import log_info, log_of
from skyarm.log.flight_log import PIECE, Log, rows_of
from skyarm.log.log_columns import columns
from skyarm.records.files import (
    PathLike,
    must_be_one_of,
    require_file,
    shown,
    taken_back,
    unreadable,
)
from skyarm.records.files.own_inputs import stamp_of
from skyarm.records.files.unpacked import TooLargeError, npz_arrays
from skyarm.records.files.user_code import require_result
from skyarm.records.files.writing import writing_atomically
from skyarm.records.immutable import positional
from skyarm.records.registry import RegistryError, find, names
from skyarm.records.registry.contract import kind_mistake, refuse_mistake


@positional
class LogFormat:
    """File format of a log: a function that writes it and one that reads it.

    Attributes:
        write: (log, path) -> the path written; the file appears whole or not at all.
        read: path -> log; None for a format that keeps too little.
    """

    write: Callable[[Log, Path], Path]
    read: Callable[[Path], Log] | None = None


def _ros_files() -> ModuleType:
    """Import the module of MCAP files at its first use; an earlier import would be
    circular.
    """
    return import_module("skyarm.log.ros.files")


def write_npz(log: Log, path: PathLike) -> Path:
    """Write the complete arrays and the metadata of a log as an npz file."""
    with writing_atomically(path) as stream:
        write_npz_into(stream, log)
    return Path(path)


def npz_content(log: Log) -> bytes:
    """Content of a log's npz file as bytes."""
    buffer = io.BytesIO()
    write_npz_into(buffer, log)
    return buffer.getvalue()


def write_npz_into(stream: IO[bytes], log: Log) -> None:
    """Write the content of a log's npz file into a stream, an array at a time."""
    # as np.savez_compressed, in half its time: of noise and flight a higher level makes
    # files one percent smaller
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        info = np.array(json.dumps(log_info(log)))
        for name in (*log.arrays(), "info"):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                array = info if name == "info" else np.asanyarray(log[name])
                np.lib.format.write_array(member, array, allow_pickle=False)


WRITTEN_BY = "'skyarm run SCENARIO --log FILE'"
"""Command that writes logs, for a message about a file that is none."""


def read_npz(path: PathLike) -> Log:
    """Read a log from an npz file.

    Raises:
        OSError: the file cannot be read. ValueError: it is no log.
    """
    return log_from_npz(Path(path).read_bytes(), f"log = {shown(path)}")


def log_from_npz(file: bytes, name: str) -> Log:
    """Read a log from the bytes of an npz file.

    Raises:
        ValueError: it is no log.
    """
    try:
        content = npz_arrays(file)
        info = json.loads(str(content.pop("info")))
    except TooLargeError as error:
        raise ValueError(f"{name}: {error}") from None
    except Exception:
        # archive, header, numbers and JSON have readers of their own, each with its own
        # errors
        raise ValueError(
            f"{name}: must be a log that save_npz wrote; {WRITTEN_BY} writes one"
        ) from None
    try:
        return log_of(content, info)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def write_csv(log: Log, path: PathLike) -> Path:
    """Write a log as CSV: a column for each number, in the shortest text that is read
    back exactly.
    """
    every = columns(log)
    heads = ",".join(
        f"{each.name} [{each.unit}]" if each.unit else each.name for each in every
    )
    # of the whole log, because one head and one form serve all pieces
    finite = all(
        np.isfinite(log[name]).all() for name in {each.array for each in every}
    )
    with writing_atomically(path) as stream:
        stream.write(f"{heads}\n".encode())
        # in pieces, since the text of a long log takes more memory than its numbers
        for begin in range(0, log.time.size, PIECE):
            piece = rows_of(log, slice(begin, begin + PIECE))
            table = np.column_stack([each.of(piece) for each in every])
            if finite:
                # a tenth of the time of repr, which was a fifth of a first command; cut
                # off are the brackets around the rows
                rows = orjson.dumps(table, option=orjson.OPT_SERIALIZE_NUMPY)[
                    2:-2
                ].replace(b"],[", b"\n")
            else:  # JSON has neither infinity nor "not a number"
                rows = "\n".join(
                    ",".join(map(repr, row)) for row in table.tolist()
                ).encode()
            stream.write(rows + b"\n")
    return Path(path)


NPZ = LogFormat(write_npz, read_npz)
CSV = LogFormat(write_csv)
MCAP = LogFormat(
    lambda log, path: _ros_files().write_mcap(log, path),
    lambda path: _ros_files().read_mcap(path),
)


def require_format(path: PathLike, field: str = "log") -> LogFormat:
    """Return the file format of a log by its suffix, or raise an error.

    Raises:
        RegistryError: no such format; names ``field``, the path and the formats there
            are.
    """
    return _format(
        Path(path).suffix.removeprefix("."),
        f"{field} = {shown(path)}",
        names("log_format"),
    )


def require_readable(path: PathLike, field: str = "log") -> Callable[[Path], Log]:
    """Return the function that reads a log file with a given suffix, or raise an error.

    Raises:
        RegistryError: no such format, or one that keeps too little; names the formats
            that can be read.
    """
    suffix, at = Path(path).suffix.removeprefix("."), f"{field} = {shown(path)}"
    readable = [
        name
        for name in names("log_format")
        # a format that only writes cannot be read back
        if _format(name, at, [name]).read is not None
    ]
    reader = _format(
        suffix,
        f"{at}: cannot be read back" if suffix in names("log_format") else at,
        readable,
    ).read
    assert reader is not None
    return reader


def _format(suffix: str, at: str, allowed: Sequence[str]) -> LogFormat:
    if suffix not in allowed:
        raise RegistryError(
            f"{at}: suffix {shown(suffix)}: {must_be_one_of(allowed, suffix)}"
        )
    log_format: LogFormat = find("log_format", suffix)
    refuse_mistake(kind_mistake("log_format", log_format), "log_format", suffix)
    return log_format


def save_log(log: Log, path: PathLike) -> Path:
    """Write a log to a file in the format of the file's suffix.

    Args:
        log: log of a flight.
        path: path of the file: .npz, .csv, .mcap or a registered suffix.

    Raises:
        RegistryError: no such format. OSError: it cannot be written. ValueError: the
            format wrote no file.
    """
    write, file = require_format(path).write, Path(path)
    before = stamp_of(file)
    with taken_back(file):
        written = write(log, file)
    # a format may write elsewhere than it was told, and then returns that path
    named = Path(str(written or file)) if stamp_of(file) == before else file
    require_result(
        write, written, os.path.lexists(named), "the path of the written file"
    )
    return named


def as_log(given: Log | PathLike) -> Log:
    """Return a given log unchanged, or read it from a file path.

    Raises:
        ValueError: one line.
    """
    if isinstance(given, Log):
        return given
    if not isinstance(given, (str, os.PathLike)):
        raise ValueError(
            f"log = {shown(given)}: must be a Log or the path of one's file"
        )
    require_file(given, f"log = {shown(given)}")
    return load_log(given)


def load_log(path: PathLike) -> Log:
    """Read a log from a file.

    Args:
        path: path of an .npz or .mcap file, or of a registered format that can be read.

    Raises:
        ValueError: the format cannot be read back, or the file is not such a log.
        OSError: the file cannot be read.
    """
    read = require_readable(path)
    # an input of the running command; the reader says why it is none
    unreadable(Path(path))
    log = read(Path(path))
    require_result(read, log, isinstance(log, Log), "a skyarm.Log")
    return log
