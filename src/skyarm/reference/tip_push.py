"""A wanted contact of the tip: the force with which it presses, and what is believed of the surface.

The belief, not the truth: the surface itself stands in ``[world]`` and may lie elsewhere and turned. As long as
``force`` is above 0 a law that can press leads the tip against the normal until something pushes back, and holds the
force; across the normal the tip stays on its reference.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.reference.signals import Signal
from skyarm.scalars import Scalar, divide, sqrt, where

SPEED = 0.1
"""m/s, with which the tip comes where nothing is said: an arm of 0.1 kg then meets 5000 N/m with 2 N."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TipPush:
    """A wanted contact of the tip: force along a believed normal."""

    force: Annotated[Signal, Unit("N", "that the tip presses with; 0 asks for no contact")]
    normal: Annotated[tuple[Scalar, Scalar, Scalar], Unit("", "out of the believed surface, world axes")]
    speed: Annotated[Scalar, Unit("m/s", "with which the tip comes", low=0.0)] = SPEED

    def __post_init__(self) -> None:
        accept_fields(self, "reference.push")

    def at(self, t: Any) -> tuple[Any, ...]:
        """Force (N), speed (m/s) and unit normal at time t (s): the field ``push`` of a reference."""
        x, y, z = self.normal
        length = divide(1.0, sqrt(x * x + y * y + z * z))
        return self.force.derivatives(t)[0], self.speed, x * length, y * length, z * length

    def across(self, away: Vec3, t: Any) -> Vec3:
        """What of an error of the tip counts: all of it, and only what is across the normal while it shall press.

        Args:
            away: m, world axes.
            t: s.
        """
        force, _, *normal = self.at(t)
        n = Vec3(*normal)
        along = n * away.dot(n)
        return Vec3(*(a - where(force > 0.0, b, 0.0) for a, b in zip(away, along, strict=True)))
