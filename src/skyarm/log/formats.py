"""Files of a log, by suffix."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from skyarm.files import must_be_one_of, shown
from skyarm.files.code_place import own_code
from skyarm.log.array_file import read_npz, write_npz
from skyarm.log.csv_file import write_csv
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


def _write_mcap(log: Log, path: Path) -> Path:
    from skyarm.log.mcap.flight_file import write_mcap

    return write_mcap(log, path)


def _read_mcap(path: Path) -> Log:
    from skyarm.log.mcap.flight_file import read_mcap

    return read_mcap(path)


def _write_parquet(log: Log, path: Path) -> Path:
    from skyarm.log.parquet_file import write_parquet

    return write_parquet(log, path)


def _read_parquet(path: Path) -> Log:
    from skyarm.log.parquet_file import read_parquet

    return read_parquet(path)


def _write_bag(log: Log, path: Path) -> Path:
    from skyarm.log.ros.bag_file import write_bag

    return write_bag(log, path)


NPZ = LogFormat(write_npz, read_npz)
CSV = LogFormat(write_csv)
MCAP = LogFormat(_write_mcap, _read_mcap)
PARQUET = LogFormat(_write_parquet, _read_parquet)
BAG = LogFormat(_write_bag)


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
    """Write a log in the format of the path's suffix; where that fails, no file of it is left.

    Raises:
        RegistryError: no such format. OSError: it cannot be written.
    """
    chosen, target = require_format(path), Path(path)
    if own_code(chosen.write) is None or (target.exists() and not target.is_file()):
        return chosen.write(log, target)
    return _written_aside(chosen.write, log, target)


def _written_aside(write: Callable[[Log, Path], Path], log: Log, path: Path) -> Path:
    """Let someone's own code write into a folder beside the target; what it wrote gets its place once it is whole."""
    target = Path(os.path.realpath(path))
    target.parent.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent))
    try:
        write(log, folder / target.name)
        if not (folder / target.name).is_file():
            raise ValueError(f"log = {shown(str(path))}: must be written by its format, which wrote no such file")
        for file in sorted(folder.iterdir()):
            file.replace(target.parent / file.name)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return path


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
