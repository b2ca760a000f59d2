"""Progress of anything that takes over a second: a bar, or now and then a line where there is no terminal.

Nothing of it is shown with ``--quiet``.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.text import Text

from skyarm.cli.lines import say
from skyarm.cli.machine_output import is_quiet
from skyarm.cli.terminal import Terminal

Advance = Callable[[int, int, str], None]
"""(done, total, last)."""

PAUSE = 10.0
"""s between two lines at least, and before the first."""


@contextmanager
def bar(title: str, console: Console, pause: float = PAUSE) -> Iterator[Advance]:
    """A bar and the function (done, total, last) that moves it.

    It stands where the console writes, or on standard error where only that is a terminal. Without a terminal that
    function writes plain lines on standard error, at most one in ``pause`` s: who waits for a log file sees that
    something goes on.
    """
    if is_quiet():
        yield lambda _done, _total, _last: None
        return
    shown = _terminal(console)
    if shown is None:
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
    with Progress(*columns, console=shown, transient=True) as progress:
        task = progress.add_task(title, total=None, last="")

        def advance(done: int, total: int, last: str) -> None:
            progress.update(task, completed=done, total=total, last=last)

        yield advance


@contextmanager
def waiting(title: str, console: Console, pause: float = PAUSE) -> Iterator[Callable[[str], None]]:
    """Say that something goes on whose steps cannot be counted, and yield the function that says what it is at.

    A title that moves on a terminal; elsewhere a line after ``pause`` s, and again at steps that are as far apart.
    """
    if is_quiet():
        yield lambda _at: None
        return
    shown = _terminal(console)
    if shown is not None:
        with shown.status(Text(title)) as status:
            yield lambda at: status.update(Text(f"{title}: {at}"))
        return
    lines = _lines(title, pause)
    timer = threading.Timer(pause, say, (f"{title} ...",))
    timer.daemon = True
    timer.start()

    def advance(at: str) -> None:
        timer.cancel()
        lines(0, 0, at)

    try:
        yield advance
    finally:
        timer.cancel()


def _terminal(console: Console) -> Console | None:
    """Where progress can move: the console, or standard error; None where neither is a terminal."""
    if console.is_terminal:
        return console
    errors = Terminal(stderr=True, markup=False, highlight=False, emoji=False)
    return errors if sys.stderr.isatty() else None


def _lines(title: str, pause: float) -> Advance:
    """A function that writes a line if the last is long enough ago."""
    told = [time.monotonic()]

    def advance(done: int, total: int, last: str) -> None:
        now = time.monotonic()
        if now - told[0] < pause:
            return
        told[0] = now
        say(f"{title}: {done} of {total} {last}" if total else f"{title}: {last}")

    return advance
