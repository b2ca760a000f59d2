"""Warnings and errors as lines on standard error, without terminal control
characters.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from skyarm.records.files import one_line

if TYPE_CHECKING:
    from skyarm.scenario.scenario_record import Scenario

WRONG_INPUT, NOT_COMPLETED, DIFFERENT, OUR_FAULT, INTERRUPTED = 2, 3, 1, 70, 130
"""Exit codes: wrong input; flight that ended early; difference or fault found; an error
of skyarm itself (EX_SOFTWARE of sysexits.h); Ctrl-C as shells report it (128 and the
signal's number)."""

PIPE_CLOSED = 141
"""Exit code if nobody reads the output any more: 128 and the number of SIGPIPE."""

MOST_WARNINGS = 8
"""Largest number of warnings about one file."""


def say(message: str, code: int = 0) -> int:
    """Print one line to standard error; returns the given exit code."""
    with contextlib.suppress(OSError):  # the terminal may be gone
        print(one_line(f"skyarm: {message}"), file=sys.stderr, flush=True)
    return code


RESUMED = ("tune", "compare", "sweep", "reproduce")
"""Commands that go on where they were interrupted."""


def say_ended(what: str, code: int) -> int:
    """Print that the command was ended from outside, and what then becomes of its
    files; returns the exit code.
    """
    again = (
        "; the same command goes on"
        if any(word in RESUMED for word in sys.argv[1:2])
        else ""
    )
    return say(f"{what}; finished files are whole{again}", code)


_said: set[str] = set()
"""Python warnings that were already printed; no command repeats them."""


def say_unlikely(name: str, lines: Sequence[str]) -> None:
    """Print warnings about suspicious values in a file, such as ones in wrong units."""
    lines = [line for line in lines if f"{name}: {line}" not in _said]
    for line in lines[:MOST_WARNINGS]:
        say(f"warning: {name}: {line}")
    if len(lines) > MOST_WARNINGS:
        say(f"warning: {name}: {len(lines) - MOST_WARNINGS} more numbers are unlikely")


def say_suspicious(scenario: Scenario) -> None:
    """Print the warnings about a scenario that can be found before it is flown."""
    from skyarm.studies.assess.before_flight import warnings_before_flight

    say_unlikely(scenario.name, warnings_before_flight(scenario))


def say_warning(
    message: Warning | str, category: type[Warning], *_where: object, **_more: object
) -> None:
    """Print a Python warning on one line, without its source location."""
    _said.add(str(message))
    usual = issubclass(category, RuntimeWarning | UserWarning)
    say(f"{'warning' if usual else category.__name__}: {message}")
