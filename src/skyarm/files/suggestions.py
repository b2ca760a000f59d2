"""What an unknown word may have meant, said before the list of what is allowed: a long list is cut."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

LIKE = 0.6
"""Likeness from which a name counts as meant, of difflib's ratio from 0 to 1."""


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


def must_be_one_of(known: Iterable[str], word: Any) -> str:
    """What is allowed, in words, after what was perhaps meant."""
    names = list(known)
    return f"{did_you_mean(word, names)}must be one of {', '.join(names) or 'none'}"
