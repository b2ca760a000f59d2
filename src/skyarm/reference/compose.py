"""Signals made of signals: windows, shifts, sums, sequences of ramps and holds."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.reference.signals import Constant, Derivatives, Ramp, Signal
from skyarm.scalars import Scalar, add, where


@dataclass(frozen=True, slots=True)
class Windowed(Signal):
    """A signal within [start, stop), zero outside."""

    signal: Signal
    start: Annotated[Scalar, Unit("s", infinite=True)] = -math.inf
    stop: Annotated[Scalar, Unit("s", infinite=True)] = math.inf

    def __post_init__(self) -> None:
        accept_fields(self, "windowed")
        concrete = isinstance(self.start, (int, float)) and isinstance(self.stop, (int, float))
        if concrete and not self.start < self.stop:
            raise ValueError(f"windowed.stop = {self.stop!r}: must be after start = {self.start!r}")

    def derivatives(self, t: Any) -> Derivatives:
        """Those of the signal inside, zero outside; structural zeros stay structure."""
        d0, d1, d2, d3, d4 = (self._inside(t, value) for value in self.signal.derivatives(t))
        return d0, d1, d2, d3, d4

    def _inside(self, t: Any, value: Any) -> Any:
        if type(value) is int and value == 0:
            return 0
        return where(t < self.start, 0.0, where(t < self.stop, value, 0.0))

    def switch_times(self) -> tuple[float, ...]:
        """Both ends and the signal's own times between them."""
        first, last = float(self.start), float(self.stop)
        inner = [s for s in self.signal.switch_times() if first < s < last]
        return tuple(s for s in (first, *inner, last) if math.isfinite(s))


@dataclass(frozen=True, slots=True)
class Shifted(Signal):
    """A signal that comes ``delay`` seconds later."""

    signal: Signal
    delay: Annotated[Scalar, Unit("s")]

    def __post_init__(self) -> None:
        accept_fields(self, "shifted")

    def derivatives(self, t: Any) -> Derivatives:
        """Those of the signal at t - delay."""
        return self.signal.derivatives(t - self.delay)

    def switch_times(self) -> tuple[float, ...]:
        """List the times of the signal, later."""
        return tuple(s + float(self.delay) for s in self.signal.switch_times())


@dataclass(frozen=True, slots=True)
class Sum(Signal):
    """Several signals at once; an empty sum is a structural zero."""

    signals: tuple[Signal, ...]

    def __post_init__(self) -> None:
        accept_fields(self, "sum")

    def derivatives(self, t: Any) -> Derivatives:
        """Sum, term by term."""
        total: Derivatives = (0, 0, 0, 0, 0)
        for signal in self.signals:
            d0, d1, d2, d3, d4 = (add(a, b) for a, b in zip(total, signal.derivatives(t), strict=True))
            total = d0, d1, d2, d3, d4
        return total

    def switch_times(self) -> tuple[float, ...]:
        """All of them, each once."""
        return tuple(sorted({s for signal in self.signals for s in signal.switch_times()}))


def sequence(start: Any, segments: Iterable[tuple[Any, Any]], *, initial: Any = 0.0, shape: str = "linear") -> Signal:
    """Ramps and holds one after another; the last value is held.

    Args:
        start: begin of the first segment, s.
        segments: (duration in s, value at its end); a segment that ends where it begins is a hold.
        initial: value before ``start``.
        shape: of every ramp, "linear" or "quintic".
    """
    signals: list[Signal] = [Constant(initial)]
    t, value = start, initial
    for duration, target in segments:
        if isinstance(duration, (int, float)) and not duration > 0.0:
            raise ValueError(f"sequence: a segment lasts {duration!r} s: must be above 0 s")
        if target is not value and not _equal(target, value):
            signals.append(Ramp(start=t, duration=duration, height=target - value, shape=shape))
        t, value = t + duration, target
    return Sum(tuple(signals))


def _equal(a: Any, b: Any) -> bool:
    """Known to be equal: concrete and the same number."""
    return isinstance(a, (int, float)) and isinstance(b, (int, float)) and a == b
