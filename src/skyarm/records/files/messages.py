"""Text for messages: one printable line of bounded length, and suggestions for misspelt
names.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

LONGEST = 100
"""Largest number of characters of a value that a message shows."""

LONGEST_LIST = 400
"""Largest number of characters of a list of names in a message."""

LONGEST_LINE = 1000
"""Largest number of characters of a message."""


def printable(text: str) -> str:
    r"""Text with its control characters escaped, so that a name from a file cannot
    control a terminal.

    Written out, as ``\x1b`` or ``\u202e``, is what Unicode counts as control, format
    (the reversal of what is read from right to left among them), line separator,
    surrogate or unassigned; blanks other than the usual one, too.
    """
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode() for c in text
    )


def one_line(text: str) -> str:
    """Shorten a message to one line of bounded length by leaving out its middle."""
    line = printable(" ".join(text.split()))
    if len(line) <= LONGEST_LINE:
        return line
    # the middle is left out: the beginning names the field, the end says what is
    # allowed
    return f"{line[: LONGEST_LINE // 2]} ... {line[-LONGEST_LINE // 2 + 5 :]}"


def comma_list(names: Iterable[object]) -> str:
    """Join names by commas to one line of bounded length, for a message."""
    text = printable(", ".join(map(str, names)))
    return text if len(text) <= LONGEST_LIST else text[: LONGEST_LIST - 3] + "..."


def shown(value: object) -> str:
    """Text of a value for a message, on one line of bounded length; of a path its
    name.
    """
    named = os.fspath(value) if isinstance(value, os.PathLike) else value
    try:
        text = " ".join(repr(named).split())  # an array's text has several lines
    except (ValueError, RecursionError):
        # a whole number of over 4300 digits; lists in lists
        text = f"({type(value).__name__} too large to show)"
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


@contextmanager
def errors_as(
    kind: type[ValueError],
    before: str = "",
    of: type[Exception] | tuple[type[Exception], ...] = ValueError,
) -> Iterator[None]:
    """Context manager that turns errors of one class into another class and puts a
    prefix before their message.
    """
    try:
        yield
    except of as error:
        raise kind(f"{before}{error}") from None


LIKE = 0.6
"""Least similarity (difflib's ratio, 0 to 1) at which a name is suggested for a
misspelt one: difflib's own rule of thumb for words that are close."""


NEAREST = 4
"""Number of names of a long list that a message shows."""


def did_you_mean(word: object, known: Iterable[str]) -> str:
    """Suggestion at the start of a message, such as ``did you mean 'case3'? ``; empty
    if no name is similar.
    """
    near = most_similar(word, known) if isinstance(word, str) else ""
    return f"did you mean {near!r}? " if near else ""


def most_similar(word: str, known: Iterable[str]) -> str:
    """Name that is spelt most similarly to a word and is not the word itself; empty if
    no name is similar.
    """
    names = [name for name in known if name != word]
    near = difflib.get_close_matches(word, names, n=1, cutoff=LIKE)
    if not near:
        # a second try in lower case, because difflib counts case as a difference
        lower = {name.lower(): name for name in names}
        near = [
            lower[each]
            for each in difflib.get_close_matches(word.lower(), lower, n=1, cutoff=LIKE)
        ]
    return near[0] if near else ""


def nearest(word: object, known: Iterable[str]) -> list[str]:
    """Up to ``NEAREST`` names that are spelt most similarly to a word, the most similar
    first.
    """
    return difflib.get_close_matches(str(word), list(known), n=NEAREST, cutoff=0.0)


def must_be_one_of(known: Iterable[str], word: object, see: str = "") -> str:
    """Text of a message that lists the allowed names, after a suggestion for a misspelt
    one.

    Args:
        known: allowed names.
        word: word that is none of them.
        see: command that lists all of them: more than ``NEAREST`` are then named no
            further than the nearest.
    """
    names = list(known)
    if see and len(names) > NEAREST:
        near = ", ".join(nearest(word, names))
        return (
            f"{did_you_mean(word, names)}must be one of {near} ...; {see!r} shows all"
            f" {len(names)}"
        )
    if not names:
        return "must be left out: there is none"
    few = "" if len(names) == 1 else "one of "
    return f"{did_you_mean(word, names)}must be {few}{', '.join(names)}"
