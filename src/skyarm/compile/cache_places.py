"""Where object code is kept, how much of it, and the key of its user.

The folder is ``SKYARM_CACHE`` if set, else the user's cache folder. The key lies outside of it, in the user's state
folder; where there is no place for it nothing is kept. Both folders are closed to others
if they hold nothing else, or not used where others may write.
"""

from __future__ import annotations

import contextlib
import math
import os
import re
import sys
import warnings
from functools import lru_cache
from pathlib import Path

from skyarm.files import shown
from skyarm.files.private import private_folder, read_private, write_private

SIZE = 256.0
"""MB that the entries may take together, if ``SKYARM_CACHE_SIZE`` does not say otherwise."""

MB = 1_000_000

KEY, KEY_BYTES = "object_cache.key", 32


def cache_folder() -> Path | None:
    """Where object files are kept; None for a user without a home."""
    named = os.environ.get("SKYARM_CACHE")
    return Path(named) if named else _users_folder("skyarm", "XDG_CACHE_HOME", ".cache")


def state_folder() -> Path | None:
    """Where the key lies, outside any cache; None for a user without a home."""
    return _users_folder("skyarm-state" if sys.platform == "win32" else "skyarm", "XDG_STATE_HOME", ".local/state")


def size_limit() -> int:
    """Bytes that all entries together may take; 0 keeps none.

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
        raise ValueError(f"SKYARM_CACHE_SIZE = {shown(text)}: must be a number of MB, at least 0")
    return int(size)


ENTRY, TEMPORARY = re.compile(r"[0-9a-f]{64}\.o"), re.compile(r"\.[0-9a-f]{64}\.o\.[0-9a-f]{12}\.part")
"""Names of entries, and of what is being written."""


def is_ours(name: str) -> bool:
    """Whether a file of this name belongs into the cache or the state folder."""
    return bool(ENTRY.fullmatch(name) or TEMPORARY.fullmatch(name)) or name.lstrip(".").startswith(KEY)


def unused_reason() -> str:
    """Why nothing is kept, in words; empty if the cache is in use. Makes its folder and its key, as a first use does.

    Raises:
        ValueError: ``SKYARM_CACHE_SIZE`` is no number.
    """
    folder, state = cache_folder(), state_folder()
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
    """True for a folder that is this user's alone; one that belongs to others is told once."""
    try:
        reason = private_folder(folder, is_ours)
    except (OSError, ValueError):
        return False
    if reason:
        _warn(f"{folder}: {reason}; machine code is not kept")
    return not reason


def user_key(*, make: bool) -> bytes | None:
    """Key of this user, None where there is none.

    Args:
        make: make one if there is none, and replace one that is damaged or that others could have read.
    """
    folder = state_folder()
    if folder is None or not usable(folder):
        return None
    file = folder / KEY
    # asked before the key is read, so that what another process makes meanwhile is not taken for damaged
    there = os.path.lexists(file)
    found = _whole_key(file)
    if found is None and make:
        with contextlib.suppress(OSError):
            # of processes that make the first key at once all take the one that was there first
            write_private(file, os.urandom(KEY_BYTES), replace=there)
        found = _whole_key(file)
    return found


def _users_folder(name: str, variable: str, usual: str) -> Path | None:
    """A folder of ours among those that the user's system has for a purpose."""
    home = Path(os.environ.get("LOCALAPPDATA" if sys.platform == "win32" else variable, ""))
    try:
        # a relative path is to be ignored, says the XDG Base Directory Specification 0.8
        return (home if home.is_absolute() else Path.home() / usual) / name
    except RuntimeError:
        return None


def _whole_key(file: Path) -> bytes | None:
    found = read_private(file, KEY_BYTES, secret=True)
    return found if found is not None and len(found) == KEY_BYTES else None


def _why_not(folder: Path) -> str:
    try:
        return private_folder(folder, is_ours)
    except (OSError, ValueError) as error:
        return f"must be writable ({getattr(error, 'strerror', None) or error})"


@lru_cache(maxsize=8)
def _warn(line: str) -> None:
    warnings.warn(line, RuntimeWarning, stacklevel=2)
