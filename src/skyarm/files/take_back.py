"""Folders and files that a piece of work made and that are taken back where it is refused before it left a result."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def taken_back(*paths: str | os.PathLike[str]) -> Iterator[None]:
    """Remove what the work inside made, where it raises an error that is none of the disk and the last folder is empty.

    Args:
        paths: folders that the work makes, outermost first (with those above them), and files that mean nothing
            without what the folders behind them hold. Those that were there before stay as they are.
    """
    made = [path for path in _with_parents(paths) if not os.path.lexists(path)]
    try:
        yield
    except OSError:  # of the disk, which holds who knows what
        raise
    except Exception:
        with suppress(OSError, ValueError):  # the first that holds a result ends it, and nothing above it is empty
            for path in reversed(made):
                if path.is_dir():
                    path.rmdir()
                else:
                    path.unlink(missing_ok=True)
        raise


def _with_parents(paths: tuple[str | os.PathLike[str], ...]) -> list[Path]:
    """Each path behind the folders that it lies in, once."""
    every = [each for path in paths for each in (*reversed(Path(path).parents), Path(path))]
    return list(dict.fromkeys(every))
