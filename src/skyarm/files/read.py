"""Files that are read: their names, and why one cannot be read."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import Any

from skyarm.files.one_line import shown

NO_FILE = "no such file"
NOT_THERE = (errno.ENOENT, errno.ENOTDIR, errno.ELOOP)
"""Reasons that are no more than that."""


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
    # not path.is_file(), which keeps the reason to itself since Python 3.14
    try:
        mode = os.stat(path).st_mode
    except OSError as error:
        return NO_FILE if error.errno in NOT_THERE else error.strerror or str(error)
    except ValueError:  # a NUL in it
        return NO_FILE
    if stat.S_ISDIR(mode):
        return "is a folder"
    return "" if stat.S_ISREG(mode) else NO_FILE
