"""Motions about an axis as signals: arcs and spirals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.reference.signals import Derivatives, Signal
from skyarm.scalars import Scalar, cos, sin
from skyarm.scalars.taylor import Taylor


@dataclass(frozen=True, kw_only=True, slots=True)
class Turning(Signal):
    """One coordinate of a point that turns about an axis, counted from where it begins.

    The point is (radius + growth a) (u cos a + w sin a) from the axis, a the angle: an arc, or with a growth an
    Archimedean spiral.
    """

    angle: Annotated[Signal, Unit("rad", "from 0")]
    radius: Annotated[Scalar, Unit("m", "at the beginning")]
    growth: Annotated[Scalar, Unit("m/rad", "of the radius")] = 0.0
    u: Annotated[Scalar, Unit("", "this coordinate of the direction at the beginning")]
    w: Annotated[Scalar, Unit("", "the same a quarter of a turn later")]

    def __post_init__(self) -> None:
        accept_fields(self, "turning")

    def derivatives(self, t: Any) -> Derivatives:
        """Value and derivatives, exactly."""
        a = Taylor.of_derivatives(self.angle.derivatives(t))
        place = (a * self.growth + self.radius) * (cos(a) * self.u + sin(a) * self.w) - self.radius * self.u
        d0, d1, d2, d3, d4 = (place.derivative(k) for k in range(5))
        return d0, d1, d2, d3, d4

    def switch_times(self) -> tuple[float, ...]:
        """Those of the angle."""
        return self.angle.switch_times()
