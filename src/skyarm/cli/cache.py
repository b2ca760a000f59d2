"""``skyarm cache``: where machine code is kept, how much of it, and how to be rid of it."""

from __future__ import annotations

from collections.abc import Callable

from skyarm.cli.machine_output import give
from skyarm.compile.cache_places import MB, cache_folder, size_limit, unused_reason
from skyarm.compile.llvm import object_cache


def cache(clear: bool, tell: Callable[[str], None]) -> None:
    """Tell, line by line, of folder, entries, size and limit; remove the entries first if asked.

    Raises:
        ValueError: ``SKYARM_CACHE_SIZE`` is no number.
    """
    folder, limit, reason = cache_folder(), size_limit(), unused_reason()
    if clear:
        removed = object_cache.clear()
        tell(f"removed: {removed.entries} entries, {removed.size / MB:.1f} MB")
        give(removed={"entries": removed.entries, "bytes": removed.size})
    found = object_cache.contents()
    give(folder=folder, entries=found.entries, bytes=found.size, most_bytes=limit, unused=reason or None)
    tell(f"folder: {folder or 'none'}")
    tell(f"entries: {found.entries}")
    tell(f"size: {found.size / MB:.1f} MB of at most {limit / MB:g} MB (SKYARM_CACHE_SIZE)")
    if reason:
        tell(f"not in use: {reason}")
