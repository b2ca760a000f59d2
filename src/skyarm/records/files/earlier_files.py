"""Names of files in a folder of results: an earlier file gets a number, and the newest
has the plain name.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import count
from pathlib import Path

from skyarm.records.files.writing import one_writer

NAMING, PATIENCE = ".naming", 60.0
"""Name of the lock file under which files get their names, and time (s) to wait for
it."""


@contextmanager
def naming(folder: Path) -> Iterator[None]:
    """Context manager in which no other process names files in a folder.

    Raises:
        TakenError: another process does so for longer than a minute.
    """
    with one_writer(folder, name=NAMING, patience=PATIENCE):
        yield


@contextmanager
def earlier_kept(
    files: Sequence[Path], *, replace: bool = False
) -> Iterator[list[Path]]:
    """Context manager that renames existing files NAME.npz to NAME_1.npz while new ones
    are written.

    The newest flight has the plain name, so that what reads it need not search. Links
    and devices stay: they are written through. Where the writing fails, the files get
    their names back. Yields the numbered names. From the look at the names to the last
    file's end no other process names logs in these folders.

    Args:
        files: files of one flight.
        replace: rename none.

    Raises:
        TakenError: another process writes its logs there for longer than a minute.
        OSError: one cannot be renamed.
    """
    with ExitStack() as locks:
        # in one order everywhere, so that no two processes wait for each other
        for folder in sorted(
            {
                Path(os.path.realpath(file)).parent
                for file in files
                if not _is_device(file)
            }
        ):
            # a flight that failed beside may have taken it back
            folder.mkdir(parents=True, exist_ok=True)
            locks.enter_context(naming(folder))
        there = (
            []
            if replace
            else [file for file in files if file.is_file() and not file.is_symlink()]
        )
        renamed = {
            file: file.rename(free)
            for file, free in zip(files, free_names(files), strict=True)
            if file in there
        }
        # also for an interrupt: the plain name must not be lost to a half-written
        # flight
        try:
            yield list(renamed.values())
        except BaseException:
            for file, name in renamed.items():
                if not os.path.lexists(file):
                    name.rename(file)
            raise


def kept_lines(earlier: Sequence[Path]) -> list[str]:
    """Line that names the earlier files which got a number; none without any."""
    return (
        [f"what was there is kept: {', '.join(map(str, earlier))}"] if earlier else []
    )


def _is_device(file: Path) -> bool:
    return file.exists() and not file.is_file()


def free_names(files: Sequence[Path], least: int = 1) -> list[Path]:
    """Numbered file names NAME_1.npz with the lowest number that is free for all files;
    devices keep their names.
    """
    every = (
        [
            (
                file
                if _is_device(file)
                else file.with_name(f"{file.stem}_{k}{file.suffix}")
            )
            for file in files
        ]
        for k in count(least)
    )
    return next(
        # a name among the files themselves is free, because that file is about to move
        names
        for names in every
        if not any(map(os.path.lexists, {*names} - {*files}))
    )


@contextmanager
def edits_kept(file: Path) -> Iterator[None]:
    """Context manager that numbers an earlier file which people may have edited while
    it is written anew.

    One that is written anew byte for byte leaves no copy.
    """
    with earlier_kept([file]) as earlier:
        yield
        for each in earlier:
            # written anew with the same content, the earlier one need not be kept
            if file.is_file() and file.read_bytes() == each.read_bytes():
                each.unlink()
