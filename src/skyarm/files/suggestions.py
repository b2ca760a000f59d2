"""What an unknown word may have meant, said before the list of what is allowed: a long list is cut."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

LIKE = 0.6
"""Likeness from which a name counts as meant, of difflib's ratio from 0 to 1."""


NEAREST = 4
"""Names of a long list that a message shows."""


def did_you_mean(word: Any, known: Iterable[str]) -> str:
    """Words that begin a message, such as ``did you mean 'case3'? ``; empty where nothing is alike."""
    if not isinstance(word, str):
        return ""
    names = [name for name in known if name != word]
    near = difflib.get_close_matches(word, names, n=1, cutoff=LIKE)
    if not near:
        lower = {name.lower(): name for name in names}
        near = [lower[each] for each in difflib.get_close_matches(word.lower(), lower, n=1, cutoff=LIKE)]
    return f"did you mean {near[0]!r}? " if near else ""


def nearest(word: Any, known: Iterable[str]) -> list[str]:
    """``NEAREST`` names: those that are like a word, the most alike first, then the first others."""
    names = list(known)
    near = difflib.get_close_matches(str(word), names, n=NEAREST, cutoff=LIKE)
    return list(dict.fromkeys((*near, *names)))[:NEAREST]


def must_be_one_of(known: Iterable[str], word: Any, see: str = "") -> str:
    """Allowed names in words, after what was perhaps meant.

    Args:
        known: names.
        word: that is none of them.
        see: command that lists all of them: more than ``NEAREST`` are then named no further than the nearest.
    """
    names = list(known)
    if see and len(names) > NEAREST:
        near = ", ".join(nearest(word, names))
        return f"{did_you_mean(word, names)}must be one of {near} ...; {see!r} shows all {len(names)}"
    return f"{did_you_mean(word, names)}must be one of {', '.join(names) or 'none'}"
