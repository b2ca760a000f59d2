"""Files that are read: their names, and why one cannot be read."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from skyarm.files.fields import shown


def file_name(value: Any, field: str) -> str:
    """A name or path that was given, as text.

    Raises:
        ValueError: it is neither.
    """
    text = os.fspath(value) if isinstance(value, (str, os.PathLike)) else None
    if not isinstance(text, str):
        raise ValueError(f"{field} = {shown(value)}: must be a name or a path")
    return text


def unreadable(path: Path) -> str:
    """Why there is no file to read at a path, in words; empty if there is one."""
    try:
        if path.is_dir():
            return "is a folder"
        return "" if path.is_file() else "no such file"
    except (OSError, ValueError) as error:  # too long a name; a NUL in it
        return getattr(error, "strerror", None) or str(error)
