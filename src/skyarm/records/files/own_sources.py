"""Digest of the library's own source files, under which a command stores what their
code has made.
"""

from __future__ import annotations

import hashlib
import os
import sys
import time
from collections.abc import Iterator
from functools import cache

from skyarm.records.files.user_code import PACKAGE

MARGIN = 2.0
"""Time (s) before the command within which a changed file may have been loaded in an
older state; the time stamps of some file systems are as coarse."""

LOADED = "skyarm.algebra"
"""Module that all modules load whose code could take part in a flight."""

_begun = list[float]()


def begin_command() -> None:
    """Note that this process was started for a command: apart from plugins, no code but
    the library's runs in it.

    Where modules of the library are loaded already, somebody else calls the command,
    and may have replaced functions.
    """
    if LOADED not in sys.modules:
        _begun[:] = [time.time()]


def sources_stamp() -> str:
    """SHA-256 of size, time stamp and inode of all files of the library; one of other
    content has another.

    Empty where the code in this process may be other: outside a command, where
    functions can be replaced, and where a file has changed since the command began.
    """
    return _stamp(_begun[0]) if _begun else ""


def sources_digest() -> str:
    """SHA-256 of the content of all files of the library."""
    digest = hashlib.sha256()
    for path in _files():
        with open(path, "rb") as file:
            content = file.read()
        digest.update(
            f"{path.removeprefix(PACKAGE)}\0{len(content)}\0".encode() + content
        )
    return digest.hexdigest()


@cache
def _stamp(begun: float) -> str:
    states = [(path.removeprefix(PACKAGE), os.stat(path)) for path in _files()]
    # of a file that was changed since the start nobody knows which content was loaded
    if any(state.st_mtime > begun - MARGIN for _, state in states):
        return ""
    rows = [
        f"{name}\0{state.st_size}\0{state.st_mtime_ns}\0{state.st_ino}"
        for name, state in states
    ]
    return hashlib.sha256("\n".join(rows).encode()).hexdigest()


def _files() -> Iterator[str]:
    """Paths of all files of the library."""
    for folder, folders, names in os.walk(PACKAGE):
        folders[:] = sorted(each for each in folders if each != "__pycache__")
        yield from (os.path.join(folder, name) for name in sorted(names))
