"""File names: readable files, names that are portable between systems, and the kind of
a TOML file.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Mapping, Sequence
from importlib.resources.abc import Traversable
from itertools import islice
from pathlib import Path

from skyarm.records.files.messages import (
    did_you_mean,
    errors_as,
    most_similar,
    must_be_one_of,
    printable,
    shown,
)
from skyarm.records.files.own_inputs import note_input
from skyarm.records.files.paths import PathLike
from skyarm.records.files.toml import Entry, read_toml
from skyarm.records.files.writing import output_file
from skyarm.records.immutable import memoize

NO_FILE = "no such file"
# a path through a file, or a ring of links, is no file either
NOT_THERE = (errno.ENOENT, errno.ENOTDIR, errno.ELOOP)
"""Error numbers of a file that does not exist, in contrast to one that cannot be
read."""


def file_name(value: object, field: str) -> str:
    """Convert a file name or path to text.

    Raises:
        ValueError: it is neither text nor a path.
    """
    text = os.fspath(value) if isinstance(value, (str, os.PathLike)) else None
    if not isinstance(text, str):
        raise ValueError(f"{field} = {shown(value)}: must be a name or a path")
    return text


def unreadable(path: Path) -> str:
    """Reason why no file can be read at a path; empty if one can, which is recorded as
    input of the running command.
    """
    # not path.is_file(), which keeps the reason to itself since Python 3.14
    try:
        status = os.stat(path)
    except OSError as error:
        if error.errno in NOT_THERE:
            return f"{near_file(path)}{NO_FILE}"
        return error.strerror or str(error)
    except ValueError:  # a NUL in it
        return NO_FILE
    if stat.S_ISDIR(status.st_mode):
        return "is a folder"
    # sockets and devices cannot be read as files; reading a pipe would wait for ever
    if not stat.S_ISREG(status.st_mode):
        return NO_FILE
    note_input(path)
    return ""


MOST_FILES = 1000
"""Largest number of entries of a folder that are compared with a misspelt file name,
which takes a sixtieth of a second."""


def near_file(path: Path) -> str:
    """Suggestion at the start of a message about a file that does not exist; empty if
    there is none.

    It is the file of that folder and suffix with the most similar name.
    """
    try:
        there = {
            each.stem: each.name
            for each in islice(path.parent.iterdir(), MOST_FILES)
            if each.suffix.lower() == path.suffix.lower() and each.is_file()
        }
    except (OSError, ValueError):
        return ""
    # stems alone: a suffix that both have makes short names alike
    near = most_similar(path.stem, there)
    if not near:
        return ""
    return f"did you mean {shown(path.with_name(there[near]))}? "


def require_file(path: PathLike, at: str) -> None:
    """Raise an error that begins with ``at`` if no file can be read at a path; see
    :func:`unreadable`.

    Raises:
        ValueError: one line.
    """
    if reason := unreadable(Path(path)):
        raise ValueError(f"{at}: {reason}")


LONGEST_NAME, LONGEST_BYTES = 100, 200
"""Largest number of characters, and of bytes in UTF-8, of a file name; prefixes and
suffixes need the rest of 255."""

FORBIDDEN = '/\\:*?"<>|'
"""Characters that are not allowed in file names on at least one operating system."""

DEVICES = {
    "con",
    "prn",
    "aux",
    "nul",
    *(f"{port}{k}" for port in ("com", "lpt") for k in range(1, 10)),
}
"""File names that Windows reserves for devices, with any suffix."""

ALLOWED = (
    f"must be 1 to {LONGEST_NAME} letters, digits and other printable characters"
    f" without any of {' '.join(FORBIDDEN)}; it must not begin with '.', '-' or a"
    " blank, end with '.' or a blank, or be a device of Windows"
)


def is_result_name(name: object) -> bool:
    """True if a name is valid for a file on Linux, macOS and Windows."""
    return (
        isinstance(name, str)
        and 0 < len(name) <= LONGEST_NAME
        and printable(name) == name
        and len(name.encode()) <= LONGEST_BYTES
        and not any(character in FORBIDDEN for character in name)
        and name[0] not in ".- "
        and name[-1] not in ". "
        and name.split(".")[0].strip().lower() not in DEVICES
    )


SUFFIXES = ("png", "svg", "pdf")


def picture_file(name: str, field: str) -> Path:
    """Path of a picture to be written, checked before any computation.

    Raises:
        ValueError: another suffix; one line with those there are. OSError: it cannot be
            written.
    """
    if name:
        require_suffix(Path(name), field)
    return output_file(name, field)


def require_suffix(path: Path, field: str = "file") -> str:
    """Suffix of a picture file without its dot, after a check that the format is
    supported.

    Raises:
        ValueError: one line.
    """
    suffix = path.suffix.removeprefix(".").lower()
    if suffix not in SUFFIXES:
        raise ValueError(
            f"{field} = {shown(path)}: suffix {shown(suffix)}:"
            f" {must_be_one_of(SUFFIXES, suffix)}"
        )
    return suffix


VEHICLES = ("rotors", "base", "urdf", "mjcf", "airframe", "attach")
"""Keys of a vehicle file by which it is recognised among TOML files."""

READS = {
    "vehicle": "skyarm show",
    "scenario": "skyarm run",
    "study": "skyarm sweep",
    "task": "skyarm plan",
    "gains": "skyarm run SCENARIO --laws",
    "suite": "skyarm compare",
}
"""Kind of a TOML file -> a command that reads it."""


def kind_of(document: Mapping[str, object]) -> str:
    """Kind of a TOML file, a key of ``READS``, by its tables; empty if they fit no
    kind.
    """
    # in this order, because a study also holds a scenario's keys and a suite those of
    # both
    if "suite" in document:
        return "suite"
    if "scenario" in document and (
        "vary" in document or "episodes" in document or "design" in document
    ):
        return "study"
    if "gains" in document and "law" in document:
        return "gains"
    if any(word in document for word in ("plant", "controller", "agents")):
        return "scenario"
    if "phases" in document:
        return "task"
    if "trials" in document:  # of a suite whose first table is spelt wrongly
        return "suite"
    return "vehicle" if any(word in document for word in VEHICLES) else ""


def require_kind(document: object, expected: str) -> None:
    """Raise an error if a TOML file is of another kind than expected.

    Raises:
        ValueError: one line.
    """
    stated = kind_of(document) if isinstance(document, Mapping) else ""
    if stated and stated != expected:
        required, given = (
            "file of gains" if kind == "gains" else f"{kind} file"
            for kind in (expected, stated)
        )
        raise ValueError(
            f"{expected}: must be a {required}, and this is a {given}, for"
            f" '{READS[stated]}'"
        )


@memoize
def names_in(library: Traversable) -> tuple[str, ...]:
    """Names of the files that the library ships in a folder, looked up once per
    process.
    """
    return tuple(
        sorted(
            Path(entry.name).stem
            for entry in library.iterdir()
            if entry.name.endswith(".toml")
        )
    )


def read_named(
    text: str, kind: str, library: Traversable, others: str = ""
) -> tuple[dict[str, Entry], Path]:
    """Read a shipped file by name, or any file by path; return its tables and the base
    folder for relative paths.

    Args:
        text: name or path.
        kind: kind of the file, a key of ``READS``.
        library: folder of the shipped files.
        others: other allowed inputs, for messages.

    Raises:
        ValueError: one line that begins with the kind, or with the file.
    """
    names, path = names_in(library), Path(text)
    field = f"{kind} = {shown(text)}"
    plural = "studies" if kind == "study" else f"{kind}s"
    shipped = f"shipped {plural} are {', '.join(names)}"
    if text in names:
        content, folder = (library / f"{text}.toml").read_bytes(), Path()
    elif path.suffix != ".toml":
        allowed = (
            f"{did_you_mean(text, names)}must be the path of a .toml"
            f" file{others or ' or a name'}"
        )
        raise ValueError(f"{field}: {allowed}; {shipped}")
    elif reason := unreadable(path):
        raise ValueError(f"{field}: {reason}; {shipped}")
    else:
        # readable when it was looked at, and gone or closed since
        try:
            content, folder = path.read_bytes(), path.parent
        except OSError as error:
            raise ValueError(
                f"{field}: must be readable ({error.strerror}); {shipped}"
            ) from None
    with errors_as(ValueError, f"{text}: "):
        document = read_toml(content)
        require_kind(document, kind)
    return document, folder


def distinct(names: Sequence[str]) -> list[str]:
    """Make names unique: repeated ones get a number appended."""
    distinct_names: list[str] = []
    for name in names:
        unique, k = name, 2
        # a name with a number may be the own name of another
        while unique in distinct_names or (unique != name and unique in names):
            unique, k = f"{name}_{k}", k + 1
        distinct_names.append(unique)
    return distinct_names
