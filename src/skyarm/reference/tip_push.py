"""A wanted contact of the tip: the force with which it presses, and what is believed of the surface.

The belief, not the truth: the surface itself stands in ``[world]`` and may lie elsewhere and turned. As long as
``force`` is above 0 a law that can press leads the tip against the normal until something pushes back, and holds the
force; across the normal the tip stays on its reference.

A tip that grips (``grip`` above 0.5) is held by what it grips, a handle or a lever: nothing is touched and nothing can
be lost, and the force along the normal may have either sign; 0 of it is what a handle asks for that goes its own way.
With a ``pivot`` the normal is the direction from an axis through it to the tip: that of a door or a valve.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.records.field_rules import accept_fields
from skyarm.records.plain import WRITTEN_IF_ANY
from skyarm.records.units import Unit
from skyarm.reference.signals import Signal
from skyarm.scalars import Scalar, divide, sqrt, where

SPEED = 0.1
"""m/s, with which the tip comes where nothing is said: an arm of 0.1 kg then meets 5000 N/m with 2 N."""

FASTEST = 10.0
"""m/s, with which a tip may come at most."""

STRONGEST = 1e4
"""N, that a tip may be asked to press with at most: far beyond what multirotors have."""

UPRIGHT = (0.0, 0.0, 1.0)
"""The axis of a door."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TipPush:
    """A wanted contact of the tip: force along a believed normal, or along the radius of a believed arc."""

    force: Annotated[Signal, Unit("N", "that the tip presses with; 0 asks for no contact")]
    normal: Annotated[tuple[Scalar, Scalar, Scalar], Unit("", "out of the believed surface, world axes")]
    speed: Annotated[Scalar, Unit("m/s", "with which the tip comes", low=0.0)] = SPEED
    grip: Annotated[Signal | None, Unit("", "above 0.5 while the tip is held by what it grips")] = field(
        default=None, metadata=WRITTEN_IF_ANY
    )
    pivot: Annotated[tuple[Scalar, Scalar, Scalar] | None, Unit("m", "on the axis that the tip goes about")] = field(
        default=None, metadata=WRITTEN_IF_ANY
    )
    axis: Annotated[tuple[Scalar, Scalar, Scalar], Unit("", "through the pivot, world axes")] = field(
        default=UPRIGHT, metadata=WRITTEN_IF_ANY
    )

    def __post_init__(self) -> None:
        accept_fields(self, "reference.push")

    def at(self, t: Any) -> tuple[Any, ...]:
        """The field ``push`` of a reference at time t (s).

        Force (N), speed (m/s) and unit normal; where the tip may grip, also that (0 to 1), and where it goes about an
        axis, pivot (m) and unit vector of the axis.
        """
        found: tuple[Any, ...] = (self.force.derivatives(t)[0], self.speed, *_unit(self.normal))
        if self.grip is None:
            return found
        found = (*found, self.grip.derivatives(t)[0])
        return found if self.pivot is None else (*found, *self.pivot, *_unit(self.axis))

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Those of its fields that change."""
        return (self.force,) if self.grip is None else (self.force, self.grip)

    def with_signals(self, change: Callable[[Signal], Signal]) -> TipPush:
        """The same contact with each signal changed."""
        grip = None if self.grip is None else change(self.grip)
        return dataclasses.replace(self, force=change(self.force), grip=grip)

    def across(self, away: Vec3, t: Any) -> Vec3:
        """What of an error of the tip counts: all of it, and only what is across the normal while it shall press.

        Args:
            away: m, world axes.
            t: s.
        """
        force, _, *normal = self.at(t)[:5]
        n = Vec3(*normal)
        along = n * away.dot(n)
        return Vec3(*(a - where(force > 0.0, b, 0.0) for a, b in zip(away, along, strict=True)))


def _unit(v: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
    x, y, z = v
    length = divide(1.0, sqrt(x * x + y * y + z * z))
    return x * length, y * length, z * length
