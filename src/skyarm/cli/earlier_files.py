"""Results of an earlier flight that stand where new ones are to be written: they keep a number, and nothing is lost."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path


def keep_earlier(files: Sequence[Path]) -> list[tuple[Path, Path]]:
    """Rename files that are there: NAME.npz becomes NAME_1.npz, or the first number that none of them has yet.

    The newest flight has the plain name, so that what reads it need not search. Links and devices stay: they are
    written through.

    Returns:
        (name, numbered name) of each that was renamed.

    Raises:
        OSError: one cannot be renamed.
    """
    there = [file for file in files if file.is_file() and not file.is_symlink()]
    if not there:
        return []
    number = next(k for k in count(1) if not any(os.path.lexists(_numbered(file, k)) for file in files))
    renamed = [(file, _numbered(file, number)) for file in there]
    for file, name in renamed:
        file.rename(name)
    return renamed


@contextmanager
def earlier_kept(files: Sequence[Path]) -> Iterator[list[tuple[Path, Path]]]:
    """Rename files that are there for the time that new ones are written; where that fails, those get their names back.

    Yields what :func:`keep_earlier` returns.
    """
    renamed = keep_earlier(files)
    try:
        yield renamed
    except BaseException:
        for file, name in renamed:
            if not os.path.lexists(file):
                name.rename(file)
        raise


def _numbered(file: Path, number: int) -> Path:
    return file.with_name(f"{file.stem}_{number}{file.suffix}")
