"""Text of a file as messages show it: on one line of bounded length, with nothing in it that a terminal would obey."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

LONGEST = 100
"""Characters of a value that a message shows."""

LONGEST_LIST = 400
"""Characters of a list of names."""

LONGEST_LINE = 1000
"""Characters of a message."""


def printable(text: str) -> str:
    r"""Text whose control characters are written out, so that a name in a file is no command of a terminal.

    Written out, as ``\x1b`` or ``\u202e``, is what Unicode counts as control, format (the reversal of what is read from
    right to left among them), line separator, surrogate or unassigned; blanks other than the usual one, too.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def one_line(text: str) -> str:
    """A message on one line, its middle left out where it is too long."""
    line = printable(" ".join(text.split()))
    if len(line) <= LONGEST_LINE:
        return line
    return f"{line[: LONGEST_LINE // 2]} ... {line[-LONGEST_LINE // 2 + 5 :]}"


def listed(names: Iterable[Any]) -> str:
    """Names as messages list them: parted by commas, on one line of bounded length."""
    text = printable(", ".join(map(str, names)))
    return text if len(text) <= LONGEST_LIST else text[: LONGEST_LIST - 3] + "..."


def shown(value: Any) -> str:
    """A value as messages show it: on one line, not for pages."""
    try:
        text = " ".join(repr(value).split())  # an array's text has several lines
    except (ValueError, RecursionError):  # a whole number of over 4300 digits; lists in lists
        text = f"({type(value).__name__} too large to show)"
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."
