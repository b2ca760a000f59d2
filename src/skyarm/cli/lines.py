"""Lines for people: one on standard error, and nothing in them that a terminal would obey."""

from __future__ import annotations

import contextlib
import sys

WRONG_INPUT, INTERRUPTED = 2, 130
"""Exit codes: for wrong input, and after Ctrl-C as shells count it (128 and the signal's number)."""


def printable(text: str) -> str:
    """Text whose control characters are written out: a name in a file may hold a terminal's commands."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def say(message: str, code: int) -> int:
    """One line on standard error; returns the exit code."""
    with contextlib.suppress(OSError):  # the terminal may be gone
        print(f"skyarm: {printable(' '.join(message.split()))}", file=sys.stderr, flush=True)
    return code
