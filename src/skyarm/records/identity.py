"""What a scenario is, as a digest: to see that rows in a folder belong to the scenario of today."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.records.own_files import all_files
from skyarm.records.plain import digest, plain

DRAWN = ("mesh", "looks", "notes")
"""Fields on files that are drawn, and notes on files as they were read: where these lie changes no flight."""

FOR_PEOPLE = ("title", "sources", *DRAWN)
"""Fields that change no flight."""


def identity(record: Any) -> str:
    """Digest of a record's plain data, without titles and sources.

    Where plugins are loaded, or code of the record is someone's own, their files are part of it: a file that has
    changed flies something else.
    """
    content, files = _without(plain(record), FOR_PEOPLE), all_files(record)
    return digest({"record": content, "plugins": files} if files else content)


def log_digest(written: Any, files: Mapping[str, str]) -> str:
    """Digest of what a log says was flown.

    Args:
        written: plain data of the scenario, titles included; paths of meshes and notes are left out of the digest.
        files: name -> identity of the files of someone's own code in it (:func:`own_files`).
    """
    flown = _without(written, DRAWN)
    return digest({"record": flown, "code": dict(files)} if files else flown)


def _without(data: Any, names: tuple[str, ...]) -> Any:
    """Plain data without the fields of these names."""
    if isinstance(data, dict):
        return {key: _without(value, names) for key, value in data.items() if key not in names}
    return [_without(each, names) for each in data] if isinstance(data, list) else data
