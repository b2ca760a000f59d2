"""Files of a log, by suffix."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from skyarm.files import must_be_one_of, shown
from skyarm.files.code_place import own_code
from skyarm.log.flight_log import Log
from skyarm.registry import RegistryError, find, names
from skyarm.registry.class_signatures import format_mistake

PathLike = str | os.PathLike[str]


@dataclass(frozen=True, slots=True)
class LogFormat:
    """A log format writes a log into a file and reads it back.

    Attributes:
        write: (log, path) -> the path written; the file appears whole or not at all.
        read: path -> log; None for a format that keeps too little.
    """

    write: Callable[[Log, Path], Path]
    read: Callable[[Path], Log] | None = None


NPZ = LogFormat(Log.save_npz, Log.load_npz)
CSV = LogFormat(Log.save_csv)


def require_format(path: PathLike, field: str = "log") -> LogFormat:
    """The format of a log's file, by its suffix.

    Raises:
        RegistryError: no such format; names ``field``, the path and the formats there are.
    """
    suffix = Path(path).suffix.removeprefix(".")
    if suffix not in names("log_format"):
        raise RegistryError(
            f"{field} = {shown(str(path))}: suffix {shown(suffix)}: {must_be_one_of(names('log_format'), suffix)}"
        )
    found: LogFormat = find("log_format", suffix)
    mistake = None if isinstance(found, LogFormat) and own_code(found.write) is None else format_mistake(found)
    if mistake is not None:
        raise RegistryError(f"{mistake[0]}: log_format {suffix!r}: {mistake[1]}")
    return found


def save_log(log: Log, path: PathLike) -> Path:
    """Write a log in the format of the path's suffix.

    Raises:
        RegistryError: no such format. OSError: it cannot be written.
    """
    return require_format(path).write(log, Path(path))


def load_log(path: PathLike) -> Log:
    """Read a log from a file.

    Raises:
        ValueError: the format cannot be read back, or the file is not such a log.
        OSError: the file cannot be read.
    """
    read = require_format(path).read
    if read is None:
        known = {name: name for name in names("log_format") if require_format(f"log.{name}").read is not None}
        raise ValueError(f"file = {shown(str(path))}: cannot be read back; {must_be_one_of(known, None)}")
    return read(Path(path))
