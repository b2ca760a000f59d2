"""One of two records, leaf by leaf, where a condition decides that may be traced."""

from __future__ import annotations

from typing import Any

from skyarm.records.leaves import leaves, rebuild
from skyarm.scalars import where


def blend(condition: Any, new: Any, old: Any) -> Any:
    """``new`` where the condition holds, else ``old``, leaf by leaf; structure is the old record's."""
    values = (where(condition, a, b) for a, b in zip(leaves(new), leaves(old), strict=True))
    return rebuild(old, values)
