"""Disk cache of compiled object files, which are authenticated by a key of the user
before execution.

An entry carries a code (HMAC-SHA256) of its name and content under its user's key
(:mod:`skyarm.compile.llvm.object_cache`). So neither content written by another user is
trusted, nor another program's entry under this name. Entries that are damaged or not
trusted are built again.

After each new entry those used longest ago go, until all together fit into
``SKYARM_CACHE_SIZE`` MB.
"""

from __future__ import annotations

import hashlib
import hmac
import math
import os
import re
import stat
import sys
import time
import warnings
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from skyarm.records.files import shown
from skyarm.records.files.private import private_folder, read_private, write_private
from skyarm.records.immutable import positional

SIZE = 256.0
"""Default limit (MB) of the total size of the cached object files, used unless
``SKYARM_CACHE_SIZE`` is set."""

MB = 1_000_000

KEY, KEY_BYTES = "object_cache.key", 32


def cache_folder() -> Path | None:
    """Folder of the cache of object files; None for a user without a home folder."""
    named = os.environ.get("SKYARM_CACHE")
    return Path(named) if named else _users_folder("skyarm", "XDG_CACHE_HOME", ".cache")


def state_folder() -> Path | None:
    """Folder of the user's secret key, outside any cache; None for a user without a
    home folder.
    """
    return _users_folder(
        # Windows has one variable for caches and states, so the name must differ
        "skyarm-state" if sys.platform == "win32" else "skyarm",
        "XDG_STATE_HOME",
        ".local/state",
    )


def size_limit() -> int:
    """Largest total size (bytes) of the cached object files; 0 disables the cache.

    Raises:
        ValueError: ``SKYARM_CACHE_SIZE`` is no such number.
    """
    text = os.environ.get("SKYARM_CACHE_SIZE")
    if not text:
        return int(SIZE * MB)
    try:
        size = float(text) * MB
    except ValueError:
        size = math.nan
    if not 0.0 <= size < math.inf:
        raise ValueError(
            f"SKYARM_CACHE_SIZE = {shown(text)}: must be a number of MB, at least 0"
        )
    return int(size)


ENTRY, TEMPORARY = (
    re.compile(r"[0-9a-f]{64}\.o"),
    re.compile(r"\.[0-9a-f]{64}\.o\.[0-9a-f]{12}\.part"),
)
"""File name patterns of cached object files and of files that are still being
written."""


def is_ours(name: str) -> bool:
    """True for a file name that the cache of object files uses."""
    return bool(ENTRY.fullmatch(name) or TEMPORARY.fullmatch(name)) or name.lstrip(
        "."
    ).startswith(KEY)


def unused_reason() -> str:
    """Reason why the cache of object files is disabled, in words; empty if it works.

    Raises:
        ValueError: ``SKYARM_CACHE_SIZE`` is no number.
    """
    folder = cache_folder()
    state = state_folder()
    if not size_limit():
        return "SKYARM_CACHE_SIZE is 0"
    if folder is None or state is None:
        return "there is no home folder"
    for place in (folder, state):
        reason = _why_not(place)
        if reason:
            return f"{place}: {reason}"
    return "" if user_key(make=True) else f"{state}: no key can be written there"


def usable(folder: Path) -> bool:
    """True if only this user may write to a folder; else warn once and return False."""
    try:
        reason = private_folder(folder, is_ours)
    except (OSError, ValueError):
        return False
    if reason:
        _warn(f"{folder}: {reason}; machine code is not kept")
    return not reason


def user_key(*, make: bool) -> bytes | None:
    """Read this user's secret key for the cache; None if there is none.

    Args:
        make: make one if there is none, and replace one that is damaged or that others
            could have read.
    """
    folder = state_folder()
    if folder is None or not usable(folder):
        return None
    file = folder / KEY
    # asked before the key is read, so that what another process makes meanwhile is not
    # taken for damaged
    there = os.path.lexists(file)
    key = _whole_key(file)
    if key is None and make:
        with suppress(OSError):
            # of processes that make the first key at once all take the one that was
            # there first
            write_private(file, os.urandom(KEY_BYTES), replace=there)
        key = _whole_key(file)
    return key


def _users_folder(name: str, variable: str, usual: str) -> Path | None:
    """Folder of this library below the user's cache or state folder."""
    home = Path(
        os.environ.get("LOCALAPPDATA" if sys.platform == "win32" else variable, "")
    )
    try:
        # a relative path is to be ignored, says the XDG Base Directory Specification
        # 0.8
        return (home if home.is_absolute() else Path.home() / usual) / name
    # Path.home() finds no home folder
    except RuntimeError:
        return None


def _whole_key(file: Path) -> bytes | None:
    key = read_private(file, KEY_BYTES, secret=True)
    return key if key is not None and len(key) == KEY_BYTES else None


def _why_not(folder: Path) -> str:
    try:
        return private_folder(folder, is_ours)
    except (OSError, ValueError) as error:
        return f"must be writable ({getattr(error, 'strerror', None) or error})"


# once a line, and not for each program that is stored; 8 is chosen
@lru_cache(maxsize=8)
def _warn(line: str) -> None:
    warnings.warn(line, RuntimeWarning, stacklevel=2)


CODE_BYTES = 32
"""Length (bytes) of an authentication code, a SHA-256."""

MOMENT = 60.0
"""Time (s) within which a repeated use of a cached file is not recorded again, so that
most uses write nothing."""

FORGOTTEN = 3600.0
"""Age (s) above which a temporary file counts as abandoned by its writer."""


@positional
class Contents:
    """Number and total size (bytes) of the cached object files."""

    entries: int
    size: int


@positional
class _Entry:
    """Cached object file: time of last use (s), size (bytes), path."""

    used: float
    size: int
    path: Path


def load(identity: str) -> bytes | None:
    """Load the cached object code of an identifying text; None if it is not cached.

    Raises:
        ValueError: ``SKYARM_CACHE_SIZE`` is no number.
    """
    folder = cache_folder()
    limit = size_limit()
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
    """Cache object code under an identifying text; remove the least recently used files
    beyond the size limit.

    A cache that cannot be written is no error; one that others could write causes a
    warning, and is not used.

    Raises:
        ValueError: ``SKYARM_CACHE_SIZE`` is no number.
    """
    folder = cache_folder()
    limit = size_limit()
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
    """Count the cached object files and their total size."""
    entries = _entries(cache_folder())
    return Contents(entries=len(entries), size=sum(entry.size for entry in entries))


def clear() -> Contents:
    """Remove all cached object files; return their number and total size."""
    folder = cache_folder()
    removed = [entry for entry in _entries(folder) if _remove(entry.path)]
    for entry in _entries(folder, TEMPORARY):
        _remove(entry.path)
    return Contents(entries=len(removed), size=sum(entry.size for entry in removed))


def _name(identity: str) -> str:
    return f"{hashlib.sha256(identity.encode()).hexdigest()}.o"


def _code(key: bytes, name: str, content: bytes) -> bytes:
    """Authentication code (HMAC) of a cached file's name and content by the user's
    secret key.
    """
    return hmac.digest(key, name.encode() + b"\0" + content, "sha256")


def _note_use(entry: Path) -> None:
    """Set the time of last use of a cached file to now."""
    with suppress(OSError):  # another process may have removed it
        if abs(time.time() - entry.stat().st_mtime) > MOMENT:
            os.utime(entry)


def _entries(folder: Path | None, pattern: re.Pattern[str] = ENTRY) -> list[_Entry]:
    """List the cached object files, most recently used first."""
    entries = []
    try:
        files = (
            []
            if folder is None
            else [each for each in folder.iterdir() if pattern.fullmatch(each.name)]
        )
    # a name with a zero byte is a ValueError
    except (OSError, ValueError):
        files = []
    for path in files:
        with suppress(OSError):  # another process may have removed it
            status = path.lstat()
            if not stat.S_ISDIR(status.st_mode):
                entries.append(
                    _Entry(used=status.st_mtime, size=status.st_size, path=path)
                )
    return sorted(entries, key=lambda entry: entry.used, reverse=True)


def _prune(folder: Path, limit: int) -> None:
    """Remove the least recently used object files beyond the size limit.

    Processes may do so at once: what one has read is its own, and what one has removed
    is no error to another.
    """
    total = 0
    for entry in _entries(folder):
        total += entry.size
        if total > limit:
            _remove(entry.path)
    for entry in _entries(folder, TEMPORARY):
        if time.time() - entry.used > FORGOTTEN:
            _remove(entry.path)


def _remove(path: Path) -> bool:
    """Remove a file; True if this call removed it."""
    try:
        path.unlink()
    except OSError:
        return False
    return True
