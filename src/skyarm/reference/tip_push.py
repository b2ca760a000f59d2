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
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.records.field_rules import accept_fields
from skyarm.records.plain import WRITTEN_IF_ANY
from skyarm.records.units import Unit
from skyarm.reference.signals import Signal
from skyarm.scalars import Scalar, data, divide, logical_and, logical_or, sqrt, where

SPEED = 0.1
"""m/s, with which the tip comes where nothing is said: an arm of 0.1 kg then meets 5000 N/m with 2 N."""

FASTEST = 10.0
"""m/s, with which a tip may come at most."""

STRONGEST = 1e4
"""N, that a tip may be asked to press with at most: far beyond what multirotors have."""

NEAREST = 1e-3
"""m from an axis within which no direction out of it is known."""

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

    def across(self, away: Vec3, t: Any, tip: Vec3) -> Vec3:
        """What of an error of the tip (m, world axes) counts at time t (s): see :func:`counted_error`."""
        return counted_error(away, self.at(t), tip)


def counted_error(away: Vec3, push: Sequence[Any], tip: Vec3) -> Vec3:
    """What of an error of the tip counts: all of it; only what is across the normal while it shall press or grips.

    Along the normal a force is held there, not a place.

    Args:
        away: m, world axes, the tip from its reference.
        push: field of the reference; () where no contact is ever asked for.
        tip: m, world axes.
    """
    if not push:
        return away
    force, _, *normal = push[:5]
    n, held = Vec3(*normal), force > 0.0
    if len(push) > 5:
        held = logical_or(held, push[5] > 0.5)
    if len(push) > 6:
        n = out_of_axis(tip, Vec3(*push[6:9]), Vec3(*push[9:]), push[5] > 0.5, n)
    counted: Vec3 = away - n * where(held, n.dot(away), 0.0)
    return counted


def out_of_axis(tip: Vec3, pivot: Vec3, axis: Vec3, grips: Any, normal: Vec3) -> Vec3:
    """Unit vector out of an axis to the tip while it grips, else the normal as told.

    Args:
        tip: m, world axes.
        pivot: m, on the axis.
        axis: its unit vector.
        grips: condition.
        normal: also where the tip is within ``NEAREST`` of the axis.
    """
    arm = tip - pivot
    out = arm - axis * axis.dot(arm)
    size = out.dot(out)
    turns = logical_and(grips, size * axis.dot(axis) > NEAREST * NEAREST)
    unit = out * divide(1.0, sqrt(size + 1e-12))
    return Vec3(*(where(turns, data(a), data(b)) for a, b in zip(unit, normal, strict=True)))


def _unit(v: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
    x, y, z = v
    length = divide(1.0, sqrt(x * x + y * y + z * z))
    return x * length, y * length, z * length
