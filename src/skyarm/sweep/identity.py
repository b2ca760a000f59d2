"""What a scenario is, as text: to see that rows in a folder belong to the scenario of today."""

from __future__ import annotations

import dataclasses
import hashlib
from typing import Any


def identity(record: Any) -> str:
    """Digest of a record: names of its fields, its numbers to the last bit, functions by their names."""
    return hashlib.sha256(_text(record).encode()).hexdigest()


def _text(record: Any) -> str:
    if dataclasses.is_dataclass(record) and not isinstance(record, type):
        # titles and sources are for people
        names = [f.name for f in dataclasses.fields(record) if f.name not in ("title", "sources")]
        return f"{type(record).__name__}({', '.join(f'{name}={_text(getattr(record, name))}' for name in names)})"
    if isinstance(record, (tuple, list)):
        return f"({', '.join(map(_text, record))})"
    if callable(record):
        return f"{getattr(record, '__module__', '')}.{getattr(record, '__qualname__', type(record).__name__)}"
    return repr(record)
