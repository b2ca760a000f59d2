"""Base class of user-defined metrics, computed during a flight or from a log by the same functions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from skyarm.log.metrics.accumulate import Instant


class Metric:
    """Base class of user-defined metrics: one number per flight, accumulated over the control instants.

    A subclass is a frozen dataclass whose fields all have defaults. ``count`` is pure, over any scalar, and called at
    every control instant in the window while the episode lives; ``result`` gets the last memory, whose scalars are
    arrays over the episodes of a batch. ``words`` and ``unit`` describe it on axes and in tables.
    """

    __slots__ = ()
    words: ClassVar[str] = ""
    unit: ClassVar[str] = ""

    @property
    def window(self) -> str:
        """Name of the time window in which the metric counts, such as "steady" or "whole"."""
        return "whole"

    def start(self) -> Any:
        """Return the initial accumulator of the metric: a dataclass or tuple of scalars, such as sums."""
        raise NotImplementedError(f"{type(self).__name__} must define start()")

    def count(self, memory: Any, now: Instant) -> Any:
        """Return the accumulator of the metric after one more control instant."""
        raise NotImplementedError(f"{type(self).__name__} must define count()")

    def result(self, memory: Any, instants: Any, period: float) -> Any:
        """Compute the metric from the final accumulator.

        Args:
            memory: the last one.
            instants: number of counted instants.
            period: between them, s.
        """
        raise NotImplementedError(f"{type(self).__name__} must define result()")
