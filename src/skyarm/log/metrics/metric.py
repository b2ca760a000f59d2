"""Base class of user-defined metrics, computed during a flight or from a log by the same functions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from skyarm.log.metrics.accumulate import Instant


class Metric:
    """User-defined metric: one number of a flight. A subclass is a frozen dataclass whose fields all have defaults.

    ``count`` is pure, over any scalar, and is asked at every control instant in the window while the episode lives;
    ``result`` gets the last memory, whose scalars are arrays over the lanes of a batch.
    """

    __slots__ = ()

    @property
    def window(self) -> str:
        """Name of a window of :class:`skyarm.log.metrics.windows.Windows`, or "whole" for the whole flight."""
        return "whole"

    def start(self) -> Any:
        """Initial state of the metric's accumulation: a record or tuple of scalars, such as running sums."""
        raise NotImplementedError(f"{type(self).__name__} must define start()")

    def count(self, memory: Any, now: Instant) -> Any:
        """Updated state of the metric's accumulation after one more control instant."""
        raise NotImplementedError(f"{type(self).__name__} must define count()")

    def result(self, memory: Any, instants: Any, period: float) -> Any:
        """Value of the metric from the final state of its accumulation.

        Args:
            memory: the last one.
            instants: number of counted instants.
            period: between them, s.
        """
        raise NotImplementedError(f"{type(self).__name__} must define result()")
