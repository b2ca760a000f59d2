"""What a scenario is, as a digest: to see that rows in a folder belong to the scenario of today."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.records.own_files import all_files
from skyarm.records.plain import digest, plain

FOR_PEOPLE = ("title", "sources", "notes")
"""Fields that change no flight."""


def identity(record: Any) -> str:
    """Digest of a record's plain data, without titles and sources.

    Where plugins are loaded, or code of the record is someone's own, their files are part of it: a file that has
    changed flies something else.
    """
    content, files = _without(plain(record)), all_files(record)
    return digest({"record": content, "plugins": files} if files else content)


def log_digest(written: Any, files: Mapping[str, str]) -> str:
    """Digest of what a log says was flown.

    Args:
        written: plain data of the scenario, titles included.
        files: name -> identity of the files of someone's own code in it (:func:`own_files`).
    """
    return digest({"record": written, "code": dict(files)} if files else written)


def _without(data: Any) -> Any:
    """Plain data without the fields that are for people."""
    if isinstance(data, dict):
        return {key: _without(value) for key, value in data.items() if key not in FOR_PEOPLE}
    return [_without(each) for each in data] if isinstance(data, list) else data
