"""Files of ours in a folder that a stranger may have made: names that are file names, and no way out through a link."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from skyarm.files.atomic import write_atomically
from skyarm.files.one_line import shown

LONGEST_NAME = 80
"""Characters of a label that its file's name keeps."""


def file_names(labels: Iterable[str], before: str, after: str) -> dict[str, str]:
    """A file's name for each label: letters, digits, ``.``, ``_`` and ``-`` are kept, and no two names are alike.

    Args:
        labels: any texts, each once.
        before: beginning of every name.
        after: its end.

    Returns:
        Label -> name; names differ also where a file system takes capitals and small letters for the same.
    """
    found: dict[str, str] = {}
    taken: set[str] = set()
    for label in labels:
        plain = re.sub(r"[^A-Za-z0-9._-]+", "_", label)[:LONGEST_NAME]
        name, count = f"{before}{plain}{after}", 1
        while name.lower() in taken:
            count += 1
            name = f"{before}{plain}_{count}{after}"
        taken.add(name.lower())
        found[label] = name
    return found


def require_no_link(path: Path) -> Path:
    """Refuse a link where a file or a folder of our own must be: it may lead anywhere.

    Raises:
        OSError: with one line that names it.
    """
    if path.is_symlink():
        raise OSError(f"file = {shown(str(path))}: must not be a link")
    return path


def write_inside(path: Path, content: bytes, *, entry: bool = True) -> Path:
    """Write a file as :func:`write_atomically` does, but through no link and into no pipe or device.

    Raises:
        OSError: with one line that names the file.
    """
    require_no_link(path)
    if path.exists() and not path.is_file():
        raise OSError(f"file = {shown(str(path))}: must be writable (there is something else of this name)")
    return write_atomically(path, content, entry=entry)
