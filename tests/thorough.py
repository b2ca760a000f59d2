"""Cases of which a fixed share is tried in ``make test``, and all in ``make thorough``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest


def sampled(values: Sequence[Any], every: int, *, keep: Sequence[Any] = ()) -> list[Any]:
    """Parameters: each of ``keep`` and the first of ``every`` values plain, the rest marked ``thorough``.

    A value that is a tuple gives several parameters, as ``pytest.mark.parametrize`` takes them.
    """
    found = []
    for place, value in enumerate(values):
        given = value if isinstance(value, tuple) else (value,)
        plain = value in keep or place % every == 0
        found.append(pytest.param(*given, marks=() if plain else pytest.mark.thorough))
    return found
