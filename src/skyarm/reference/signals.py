"""Signals: a scalar of time with its first four derivatives.

``derivatives(t)`` gives (value, d1, d2, d3, d4) for any scalar t: float, NumPy array (a whole table), traced time.
At a switch time the right-hand limit holds, in value and in every derivative; ``switch_times()`` lists those times.
Derivatives are those of the smooth pieces: the impulse of a jump is not represented.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, cos, sin, where

Derivatives = tuple[Any, Any, Any, Any, Any]

SHAPES = ("linear", "quintic")


class Signal(ABC):
    """A scalar of time; signals add."""

    __slots__ = ()

    @abstractmethod
    def derivatives(self, t: Any) -> Derivatives:
        """Value and derivatives one to four at time t (s)."""

    @abstractmethod
    def switch_times(self) -> tuple[float, ...]:
        """List the times (s), in order, at which the value or a derivative may jump."""

    def __add__(self, other: Signal) -> Signal:
        """Sum."""
        from skyarm.reference.compose import Sum

        return Sum((self, other))


@dataclass(frozen=True, slots=True)
class Constant(Signal):
    """A constant signal has the same value at all times; its derivatives are structural zeros."""

    value: Annotated[Scalar, Unit("", "in the unit of the signal")] = 0.0

    def __post_init__(self) -> None:
        accept_fields(self, "constant")

    def derivatives(self, t: Any) -> Derivatives:
        """Value, 0, 0, 0, 0."""
        return self.value, 0, 0, 0, 0

    def switch_times(self) -> tuple[float, ...]:
        """None."""
        return ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Ramp(Signal):
    """A ramp signal goes from 0 to ``height`` within ``duration``; it is 0 before and ``height`` after.

    Attributes:
        shape: "linear", or "quintic" = 10 u^3 - 15 u^4 + 6 u^5 with u = (t - start)/duration, at rest at both ends.
    """

    start: Annotated[Scalar, Unit("s")]
    duration: Annotated[Scalar, Unit("s", "above 0")]
    height: Annotated[Scalar, Unit("", "in the unit of the signal")]
    shape: str = "linear"

    def __post_init__(self) -> None:
        accept_fields(self, "ramp")
        if isinstance(self.duration, (int, float)) and not self.duration > 0.0:
            raise ValueError(f"ramp.duration = {self.duration!r}: must be above 0 s")
        check_shape("ramp.shape", self.shape)

    def derivatives(self, t: Any) -> Derivatives:
        """Value and derivatives.

        Source: the quintic is the rest-to-rest motion of least jerk, Flash, Hogan 1985.
        """
        rate = 1.0 / self.duration
        blend = _quintic if self.shape == "quintic" else _linear
        pieces = []
        scale = self.height
        for order, piece in enumerate(blend((t - self.start) * rate)):
            after = self.height if order == 0 else 0.0
            pieces.append(self._joined(t, piece * scale, after) if type(piece) is not int else 0)
            scale = scale * rate
        d0, d1, d2, d3, d4 = pieces
        return d0, d1, d2, d3, d4

    def _joined(self, t: Any, inside: Any, after: Any) -> Any:
        return where(t < self.start, 0.0, where(t < self.start + self.duration, inside, after))

    def switch_times(self) -> tuple[float, ...]:
        """Both ends."""
        return float(self.start), float(self.start + self.duration)


def _linear(u: Any) -> Derivatives:
    """Straight line u and its derivatives by u."""
    return u, 1.0, 0, 0, 0


def _quintic(u: Any) -> Derivatives:
    """Blend 10 u^3 - 15 u^4 + 6 u^5 and its derivatives by u."""
    u2 = u * u
    return (
        u2 * u * (10.0 + u * (6.0 * u - 15.0)),
        30.0 * u2 * (1.0 + u * (u - 2.0)),
        60.0 * u * (1.0 + u * (2.0 * u - 3.0)),
        60.0 + 360.0 * u * (u - 1.0),
        720.0 * u - 360.0,
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class Sine(Signal):
    """A sine signal: amplitude sin(2 pi frequency_hz t + phase)."""

    amplitude: Annotated[Scalar, Unit("", "in the unit of the signal")]
    frequency_hz: Annotated[Scalar, Unit("Hz")]
    phase: Annotated[Scalar, Unit("rad")] = 0.0

    def __post_init__(self) -> None:
        accept_fields(self, "sine")

    def derivatives(self, t: Any) -> Derivatives:
        """Value and derivatives: each turns the sine by a quarter and multiplies it by w."""
        w = 2.0 * math.pi * self.frequency_hz
        angle = w * t + self.phase
        s, c = self.amplitude * sin(angle), self.amplitude * cos(angle)
        return s, w * c, -(w * w) * s, -(w * w * w) * c, (w * w * w * w) * s

    def switch_times(self) -> tuple[float, ...]:
        """None."""
        return ()


def check_shape(field: str, value: str) -> None:
    """Refuse an unknown shape of ramps."""
    if value not in SHAPES:
        raise ValueError(f"{field} = {value!r}: must be one of {', '.join(SHAPES)}")
