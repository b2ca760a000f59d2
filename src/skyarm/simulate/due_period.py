"""Which control periods a slower clock ticks in: that of the reference, or of a sensor."""

from __future__ import annotations

from typing import Any

from skyarm.scalars import floor


def due(ticks: Any, every: int) -> Any:
    """Whether a period is one of each ``every``; half a period of slack, since a quotient may be rounded."""
    return ticks - floor(ticks / float(every) + 0.5 / every) * float(every) < 0.5
