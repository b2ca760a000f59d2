"""Old names in users' files: accepted for one minor version, with a warning that states the new name."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

LAST = "0.3"
"""The last minor version that knows the old names."""


class OldNameWarning(DeprecationWarning):
    """Warning that an old name was used; the next minor version removes it."""


def warn_of_old_name(old: str, new: str, *, stacklevel: int = 2) -> None:
    """Warn that the name ``old`` was replaced by ``new``.

    Args:
        old: the name that was used, with what it is ("law 'a'").
        new: the name to use.
        stacklevel: as :func:`warnings.warn` counts it, from the caller of this function.
    """
    line = f"{old} is an old name: use {new}; the old one works in {LAST} and goes with the next minor version"
    warnings.warn(line, OldNameWarning, stacklevel=stacklevel + 1)


def present_name(where: str, value: object, old_names: Mapping[str, str]) -> Any:
    """New name for an old name, with a warning; any other value unchanged.

    Args:
        where: the field, for the warning.
        value: as it was given.
        old_names: old value -> new value.
    """
    if not isinstance(value, str) or value not in old_names:
        return value
    new = old_names[value]
    warn_of_old_name(f"{where} = {value!r}", repr(new), stacklevel=3)
    return new
