"""Signals that ask a command to end: Ctrl-C, TERM, and HUP when its terminal closes."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

WORDS = {"SIGINT": "interrupted", "SIGTERM": "ended (SIGTERM)", "SIGHUP": "ended with its terminal (SIGHUP)"}


MOMENT = 0.02
"""s until a signal that was lost is sent again."""


def _send(number: signal.Signals) -> None:
    """Send a signal to the main thread; where threads take signals, one that sleeps or waits there wakes up."""
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, number)
    else:
        _thread.interrupt_main(number)


class Ended(BaseException):
    """A signal asked this process to end. Not an Exception: nothing on the way takes it for its own."""


@contextmanager
def endings() -> Iterator[list[signal.Signals]]:
    """Raise Ended at the signals of ``WORDS``; yields the list of those that came.

    What the caller ignores (``nohup`` ignores HUP) stays ignored.
    """
    came: list[signal.Signals] = []

    def note(number: int, _frame: Any) -> None:
        came.append(signal.Signals(number))
        raise Ended

    def again(lost: Any) -> None:
        """What is raised inside a destructor is dropped by Python: the signal is sent once more, a moment later."""
        if lost.exc_type is not None and issubclass(lost.exc_type, Ended):
            timer = threading.Timer(MOMENT, _send, (came[-1],))
            timer.daemon = True
            timer.start()
        elif not came:  # after a signal, what libraries find half torn down is no news
            dropped(lost)

    dropped, sys.unraisablehook = sys.unraisablehook, again
    usual: dict[signal.Signals, Any] = {}
    if threading.current_thread() is threading.main_thread():
        known = [getattr(signal, name) for name in WORDS if hasattr(signal, name)]
        usual = {each: signal.getsignal(each) for each in known}
        usual = {each: handler for each, handler in usual.items() if handler not in (signal.SIG_IGN, None)}
        for each in usual:
            signal.signal(each, note)
    try:
        yield came
    finally:
        sys.unraisablehook = dropped
        # once a signal is obeyed, another must not cut off its line
        for each, handler in usual.items():
            signal.signal(each, signal.SIG_IGN if came else handler)
