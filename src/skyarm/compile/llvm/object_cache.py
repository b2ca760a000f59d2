"""A cache of object files: machine code that need not be built again, executed only if its own user put it there.

An entry carries a code (HMAC-SHA256) of its name and content under its user's key
(:mod:`skyarm.compile.cache_places`). So neither what somebody else wrote into the cache is believed, nor another
program's entry under this name. Entries that are damaged or not believed are built again.

After each new entry those used longest ago go, until all together fit into ``SKYARM_CACHE_SIZE`` MB.
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import os
import re
import stat
import time
from dataclasses import dataclass
from pathlib import Path

from skyarm.compile.cache_places import ENTRY, TEMPORARY, cache_folder, size_limit, usable, user_key
from skyarm.files.private import read_private, write_private

CODE_BYTES = 32

MOMENT = 60.0
"""s: a use so soon after the last one noted is not noted again, so that most uses write nothing."""

FORGOTTEN = 3600.0
"""s: a temporary file this old has no writer any more."""


@dataclass(frozen=True, slots=True)
class Contents:
    """What the cache holds: entries, and the bytes they take."""

    entries: int
    size: int


@dataclass(frozen=True, slots=True)
class _Entry:
    """A file of the cache: when it was used last, in s, and its size in bytes."""

    used: float
    size: int
    path: Path


def load(identity: str) -> bytes | None:
    """Object code kept for what is described by a text; None where it must be built.

    Raises:
        ValueError: ``SKYARM_CACHE_SIZE`` is no number.
    """
    folder, limit = cache_folder(), size_limit()
    if folder is None or not limit:
        return None
    entry = folder / _name(identity)
    stored = read_private(entry, limit + CODE_BYTES)
    if stored is None or not usable(folder):
        return None
    key = user_key(make=False)
    code, content = stored[:CODE_BYTES], stored[CODE_BYTES:]
    if key is None or not hmac.compare_digest(code, _code(key, entry.name, content)):
        return None
    _note_use(entry)
    return content


def store(identity: str, content: bytes) -> None:
    """Keep object code under a text that describes it, and forget what is beyond the limit.

    A cache that cannot be written is no error; one that others could write is said in a warning, and not used.

    Raises:
        ValueError: ``SKYARM_CACHE_SIZE`` is no number.
    """
    folder, limit = cache_folder(), size_limit()
    if folder is None or not limit or not usable(folder):
        return
    key = user_key(make=True)
    if key is None:
        return
    entry = folder / _name(identity)
    try:
        write_private(entry, _code(key, entry.name, content) + content)
    except OSError:
        return
    _prune(folder, limit)


def contents() -> Contents:
    """Count the entries of the cache."""
    entries = _entries(cache_folder())
    return Contents(entries=len(entries), size=sum(entry.size for entry in entries))


def clear() -> Contents:
    """Remove all entries and temporary files of the cache, nothing else; returns what was removed."""
    folder = cache_folder()
    removed = [entry for entry in _entries(folder) if _removed(entry.path)]
    for entry in _entries(folder, TEMPORARY):
        _removed(entry.path)
    return Contents(entries=len(removed), size=sum(entry.size for entry in removed))


def _name(identity: str) -> str:
    return f"{hashlib.sha256(identity.encode()).hexdigest()}.o"


def _code(key: bytes, name: str, content: bytes) -> bytes:
    """What proves that a holder of the key kept this content under this name."""
    return hmac.digest(key, name.encode() + b"\0" + content, "sha256")


def _note_use(entry: Path) -> None:
    """Set an entry's time to now, by which those used longest ago are found."""
    with contextlib.suppress(OSError):  # another process may have removed it
        if abs(time.time() - entry.stat().st_mtime) > MOMENT:
            os.utime(entry)


def _entries(folder: Path | None, pattern: re.Pattern[str] = ENTRY) -> list[_Entry]:
    """Files of the cache by their names, those used last first."""
    found = []
    try:
        files = [] if folder is None else [each for each in folder.iterdir() if pattern.fullmatch(each.name)]
    except (OSError, ValueError):
        files = []
    for path in files:
        with contextlib.suppress(OSError):  # another process may have removed it
            status = path.lstat()
            if not stat.S_ISDIR(status.st_mode):
                found.append(_Entry(used=status.st_mtime, size=status.st_size, path=path))
    return sorted(found, key=lambda entry: entry.used, reverse=True)


def _prune(folder: Path, limit: int) -> None:
    """Remove what was used longest ago until the rest fits, and temporary files that nobody writes any more.

    Processes may do so at once: what one has read is its own, and what one has removed is no error to another.
    """
    total = 0
    for entry in _entries(folder):
        total += entry.size
        if total > limit:
            _removed(entry.path)
    for entry in _entries(folder, TEMPORARY):
        if time.time() - entry.used > FORGOTTEN:
            _removed(entry.path)


def _removed(path: Path) -> bool:
    """True if this call removed a file."""
    try:
        path.unlink()
    except OSError:
        return False
    return True
