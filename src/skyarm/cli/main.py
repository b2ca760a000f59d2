"""Entry point of the command line, which handles termination signals from the start."""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from types import FrameType

PATIENCE = 200_000
"""Number of new objects before the first garbage collection; imported libraries and
traced programs are many lasting objects."""

BLAS_THREADS = "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"
"""Environment variables of NumPy's linear algebra. Matrices here have at most some
hundred rows, where the busy-waiting threads of BLAS slow eigenvalues down up to tenfold
on shared cores, and never speed them up."""

REPLACEABLE = "llvmlite"
"""Package that may be missing, old or broken; machine code reports it where needed, and
a single flight continues without it."""

WORDS = {
    "SIGINT": "interrupted",
    "SIGTERM": "ended (SIGTERM)",
    "SIGHUP": "ended with its terminal (SIGHUP)",
}


def main() -> None:
    """Execute a command and exit: 0 done, 2 wrong input, 3 not completed, 70 our fault,
    128 + n ended by signal n.
    """
    gc.set_threshold(PATIENCE)
    for name in BLAS_THREADS:  # read when NumPy loads; what the user has set stays
        os.environ.setdefault(name, "1")
    reconfigure = getattr(sys.stdout, "reconfigure", None)
    # a name that the terminal's encoding lacks is written out, as on standard error
    if reconfigure is not None:
        reconfigure(errors="backslashreplace")
    with endings() as came:
        try:
            from skyarm.cli.lines import WRONG_INPUT, say
            from skyarm.records.files.own_sources import begin_command
            from skyarm.records.files.packages import (
                FLOORS,
                RIVAL,
                below_floor,
                installed_versions,
                rival_of_mujoco,
            )

            begin_command()
            # before the libraries load: an old one may fail as it does, or do nothing
            # and exit with 0
            there = installed_versions(
                name for name in (*FLOORS, RIVAL) if name != REPLACEABLE
            )
            short = below_floor(there)
            if sys.argv[1:2] != ["doctor"]:  # which lists it with the rest
                short = short or rival_of_mujoco(there)
            if short:
                code = say(short, WRONG_INPUT)
            else:
                from skyarm.cli.commands import perform

                code = perform()
        except BaseException:
            # a library that a signal cut off while it loaded may have turned it into an
            # error of its own
            if not came:
                raise
    if came:
        from skyarm.cli.lines import say_ended

        # by the rule of a shell, 128 more than the number of the signal
        code = say_ended(WORDS[came[0].name], 128 + came[0])
    flights = sys.modules.get("skyarm.simulate.stored_programs")
    # after a command that went well the programs that are used again are worth
    # optimising
    if code == 0 and flights is not None:
        flights.optimise_repeated()
    # Python would look through a million objects for circles before it ends
    gc.freeze()
    sys.exit(code)


class EndedBySignal(BaseException):
    """Exception raised when a termination signal arrives, not caught by handlers of
    Exception.
    """


@contextmanager
def endings() -> Iterator[list[signal.Signals]]:
    """Context manager that turns termination signals into an exception; yields the
    signals received.

    What the caller ignores (``nohup`` ignores HUP) stays ignored.
    """
    came: list[signal.Signals] = []

    def note(number: int, _frame: FrameType | None) -> None:
        came.append(signal.Signals(number))
        raise EndedBySignal

    def unraisable(lost: sys.UnraisableHookArgs) -> None:
        """Hide errors in destructors after a termination signal interrupted a
        library.
        """
        if not came:
            dropped(lost)

    dropped, sys.unraisablehook = sys.unraisablehook, unraisable
    usual: dict[signal.Signals, Any] = {}
    if threading.current_thread() is threading.main_thread():
        signals = [getattr(signal, name) for name in WORDS if hasattr(signal, name)]
        handlers = zip(signals, map(signal.getsignal, signals), strict=True)
        usual = {
            each: handler
            for each, handler in handlers
            # signals that the caller ignores stay ignored
            if handler not in (signal.SIG_IGN, None)
        }
        for each in usual:
            signal.signal(each, note)
    try:
        yield came
    finally:
        sys.unraisablehook = dropped
        # once a signal is obeyed, another must not cut off its line
        for each, handler in usual.items():
            signal.signal(each, signal.SIG_IGN if came else handler)
