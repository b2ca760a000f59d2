"""Gust: an additional force or air velocity in [start, start + duration)."""

from __future__ import annotations

import math
from typing import Annotated

from skyarm.algebra import ZERO3, Scalar, Vec3
from skyarm.algebra.scalars import cos, mul, where
from skyarm.records.coerce import absent, concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.immutable import immutable
from skyarm.records.path_names import Names, field_paths
from skyarm.records.units import Unit

SHAPES = ("step", "one_minus_cosine")


@immutable
class Gust:
    """Gust of a wind model: an additional force or air velocity during a time interval.

    Attributes:
        start, duration: the window [start, start + duration), half-open.
        shape: "step", or "one_minus_cosine" = peak/2 (1 - cos(2 pi (t -
            start)/duration)), smooth at both ends.
    """

    peak: Annotated[
        Vec3,
        Unit(
            "N or m/s",
            "largest force (force wind) or air velocity (moving air) of the gust, world"
            " axes",
            folds=True,
        ),
    ] = ZERO3
    start: Annotated[Scalar, Unit("s", "time at which the gust begins")] = 0.0
    duration: Annotated[Scalar, Unit("s", "duration of the gust")] = 0.0
    shape: str = "step"

    def path_names(self) -> Names:
        """Parameter paths of a gust's fields, with ``force`` and ``velocity`` as
        aliases of ``peak``.
        """
        return field_paths(self) | {"force": (("peak",),), "velocity": (("peak",),)}

    def __post_init__(self) -> None:
        accept_fields(self, "gust")
        if self.shape not in SHAPES:
            raise ValueError(
                f"gust.shape = {self.shape!r}: must be one of {', '.join(SHAPES)}"
            )
        if concrete(self.duration):
            # one minus cosine divides by the duration
            strict = self.shape != "step"
            if not (self.duration > 0.0 if strict else self.duration >= 0.0):
                raise ValueError(
                    f"gust.duration = {self.duration!r}: must be"
                    f" {'above' if strict else 'at least'} 0 s"
                )

    def at(self, t: Scalar) -> Vec3:
        """Force (N) or air velocity (m/s) of the gust at time t (s), world axes.

        Source: step as RotorS, gazebo_wind_plugin.cpp (gust window); one minus cosine
        as CS 25.341(a)(2).
        """
        since = t - self.start
        shape: Scalar = 1
        if self.shape == "one_minus_cosine":
            shape = 0.5 * (1.0 - cos(2.0 * math.pi * since / self.duration))
        ends = self.start + self.duration
        return Vec3(
            *(
                # a direction without a gust stays structure
                0
                if absent(value)
                else where(t < self.start, 0.0, where(t < ends, value, 0.0))
                for value in (mul(peak, shape) for peak in self.peak)
            )
        )
