"""Progress of anything that takes over a second: a bar, or now and then a line where there is no terminal."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from skyarm.cli.lines import say

Advance = Callable[[int, int, str], None]
"""(done, total, last)."""

PAUSE = 10.0
"""s between two lines at least, and before the first."""


@contextmanager
def bar(title: str, console: Console, pause: float = PAUSE) -> Iterator[Advance]:
    """A bar and the function (done, total, last) that moves it.

    Where standard output is not a terminal that function writes plain lines on standard error, at most one in
    ``pause`` s: who waits for a log file sees that something goes on.
    """
    if not console.is_terminal:
        yield _lines(title, pause)
        return
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[last]}", style="dim", markup=False),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(title, total=None, last="")

        def advance(done: int, total: int, last: str) -> None:
            progress.update(task, completed=done, total=total, last=last)

        yield advance


def _lines(title: str, pause: float) -> Advance:
    """A function that writes a line if the last is long enough ago."""
    told = [time.monotonic()]

    def advance(done: int, total: int, last: str) -> None:
        now = time.monotonic()
        if now - told[0] < pause:
            return
        told[0] = now
        say(f"{title}: {done} of {total} {last}")

    return advance
