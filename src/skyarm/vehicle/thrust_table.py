"""Measured rotor data: thrust, drag torque and current against speed, from a data sheet
or test stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.monotone_curve import curve, inverse_curve
from skyarm.algebra.scalars import divide, maximum, sqrt
from skyarm.records.coerce import concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.immutable import immutable
from skyarm.records.units import nonnegative
from skyarm.vehicle.check import VehicleError, refuse, rising

COLUMNS = ("speed", "thrust", "torque", "current")


@immutable
class ThrustTable:
    """Rotor performance in still air against steady speed, at the voltage of the
    measurement.

    Between its rows a monotone cubic runs over the squared speed, on which thrust and
    torque depend almost linearly. Before the first row it begins at zero thrust and
    torque at rest; beyond the last one it goes straight on. The two coefficients are
    those of the parabolas nearest to it (least squares): what laws know a rotor by.

    Attributes:
        speed: rising speeds. thrust, torque, current: values that rise with it; torque
            and current may be left out.
        thrust_coefficient, moment_coefficient: coefficients of the parabolas; 0 where
            they follow from the columns.
    """

    speed: Annotated[Scalars, nonnegative("rad/s", "rotor speeds of the table, rising")]
    thrust: Annotated[Scalars, nonnegative("N", "thrust at each speed, rising")]
    torque: Annotated[
        Scalars,
        nonnegative("N m", "drag torque at each speed, rising; may be left out"),
    ] = ()
    current: Annotated[
        Scalars,
        nonnegative(
            "A",
            "current of one rotor at each speed, rising; may be left out",
            usual=500.0,
        ),
    ] = ()
    thrust_coefficient: Annotated[
        Scalar,
        nonnegative(
            "N s^2/rad^2",
            "coefficient of the fitted parabola of the thrust; 0: fitted to the"
            " columns",
        ),
    ] = 0
    moment_coefficient: Annotated[
        Scalar,
        nonnegative("m", "fitted drag torque per thrust; 0: fitted to the columns"),
    ] = 0

    def __post_init__(self) -> None:
        accept_fields(self, "thrust_table", VehicleError)
        for name in COLUMNS:
            self._check(name, getattr(self, name))
        squares = [w * w for w in self.speed]
        # an int marks a coefficient that nobody stated; a float is kept, also 0.0
        if type(self.thrust_coefficient) is int:
            object.__setattr__(self, "thrust_coefficient", _fit(squares, self.thrust))
        if type(self.moment_coefficient) is int and self.torque:
            object.__setattr__(
                self, "moment_coefficient", _fit(self.thrust, self.torque)
            )

    def _check(self, name: str, column: Sequence[Scalar]) -> None:
        """Check the length of a column of the table, that it rises, and its begin."""
        if name in ("speed", "thrust") and len(column) < 2:
            refuse(f"thrust_table.{name}", column, "must be at least two numbers")
        if column and len(column) != len(self.speed):
            refuse(
                f"thrust_table.{name}",
                column,
                f"must be {len(self.speed)} numbers, as many as speeds",
            )
        rising(f"thrust_table.{name}", column, ": a column rises")
        first, speed = column[0] if column else 0.0, self.speed[0]
        if (
            name in ("thrust", "torque")
            and column
            and concrete(first, speed)
            # a column that is zero at a speed, or not zero at rest, has no parabola
            # through the origin
            and (first == 0.0) != (speed == 0.0)
        ):
            refuse(
                f"thrust_table.{name}[0]",
                first,
                "must be 0 at rest and above 0 at a speed",
            )

    def push(self, speed: Scalar) -> Scalar:
        """Thrust at a speed divided by the thrust coefficient, (rad/s)^2; the squared
        speed for a quadratic rotor.
        """
        return divide(
            curve(speed * speed, *self._points(self.thrust)), self.thrust_coefficient
        )

    def twist(self, speed: Scalar) -> Scalar:
        """Drag torque at a speed over thrust and moment coefficients, (rad/s)^2;
        ``push`` without torque data.
        """
        # without torque data drag torque is taken proportional to thrust
        if not self.torque:
            return self.push(speed)
        scale = self.thrust_coefficient * self.moment_coefficient
        return divide(curve(speed * speed, *self._points(self.torque)), scale)

    def speed_of_push(self, push: Scalar) -> Scalar:
        """Rotor speed (rad/s) at a given ratio of thrust to thrust coefficient,
        (rad/s)^2: the inverse of ``push``.
        """
        square = inverse_curve(
            push * self.thrust_coefficient, *self._points(self.thrust)
        )
        # rounding may leave a square below zero near rest
        return sqrt(maximum(square, 0.0))

    def current_at(self, speed: Scalar) -> Scalar:
        """Rotor current at a steady speed and the table's voltage, A."""
        return curve(speed * speed, *self._points(self.current))

    def _points(self, column: Sequence[Scalar]) -> tuple[list[Scalar], list[Scalar]]:
        """Points (squared speed, value) of a table column for interpolation, with a
        point at zero speed.
        """
        squares = [w * w for w in self.speed]
        # a first row at rest is the point itself; twice the same abscissa would break
        # the cubic
        if concrete(self.speed[0]) and self.speed[0] == 0.0:
            return squares, list(column)
        return [0.0, *squares], [0.0, *column]


def _fit(xs: Sequence[Scalar], ys: Sequence[Scalar]) -> Scalar:
    """Slope k of the least-squares line y = k x through points."""
    return divide(
        sum(x * y for x, y in zip(xs, ys, strict=True)), sum(x * x for x in xs)
    )
