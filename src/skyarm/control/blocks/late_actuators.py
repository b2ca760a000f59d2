"""History of modelled rotor speeds and joint efforts, to be read at the varying delay
of the commands.

The motors' lag has no clock of its own: motors that get commands L seconds late turn as
those without a delay turned L seconds ago. So the model's motors run without the delay,
and their past is read at the delay's age, which may vary.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from skyarm.algebra import Scalar, Scalars, differences, inner_product
from skyarm.algebra.scalars import clip, divide, exp, maximum, minimum, mul, sub, where
from skyarm.control.blocks.prediction import Actuation
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data
from skyarm.records.units import Unit
from skyarm.vehicle import Rotor

Rows = tuple[Scalars, ...]

SHORTEST = 1e-9
"""Shortest interval (control periods) over which the past actuation is averaged."""


@immutable
class Past:
    """History of rotor speeds and joint efforts modelled without delay, one row per
    control period, oldest first.

    Ages are at most the number of rows less one.
    """

    squares: Annotated[
        Rows, Unit("(rad/s)^2", "mean squared motor speeds of a past period")
    ]
    speeds: Annotated[
        Rows, Unit("rad/s", "motor speeds at the end of a past period, unsigned")
    ]
    efforts: Annotated[Rows, Unit("N m or N", "joint efforts of a past period")]

    def after(self, model: Model, command: Command, dt: Scalar) -> Past:
        """History of rotor speeds and joint efforts after one more control period under
        a constant command.
        """
        rotors = zip(
            model.vehicle.rotors, self.speeds[-1], command.rotor_speeds, strict=True
        )
        speeds, squares = zip(*(turn(*each, dt) for each in rotors), strict=True)
        rows = (squares, speeds, command.efforts)
        before = (self.squares, self.speeds, self.efforts)
        squares, speeds, efforts = (
            # the newest comes last, and the oldest falls out
            (*old[1:], as_data(new))
            for old, new in zip(before, rows, strict=True)
        )
        return Past(squares=squares, speeds=speeds, efforts=efforts)

    def period(self, age: Scalar) -> Actuation:
        """Modelled rotor speeds and joint efforts in the control period that ended
        ``age`` periods ago.
        """
        parts = self._since(age)
        # what acted since a period earlier is the same of the command after it
        shares = differences((1.0, *parts[:-1]), parts)
        # speeds amid a period are not kept: those at its end stand for them, in drag
        # and in thrust across body z
        speeds = _sums(self.speeds, shares)
        return Actuation(
            squares=_sums(self.squares, shares),
            amid=speeds,
            speeds=speeds,
            efforts=_sums(self.efforts, shares),
        )

    def since(self, age: Scalar) -> Actuation:
        """Means of squared rotor speeds and joint efforts over the last ``age``
        periods, and present rotor speeds.
        """
        inverse = divide(1.0, maximum(age, SHORTEST))
        shares = self._since(age)[:-1]
        now = self.speeds[-1]
        squares, efforts = (
            tuple(mul(each, inverse) for each in _sums(rows[1:], shares))
            for rows in (self.squares, self.efforts)
        )
        return Actuation(squares=squares, amid=now, speeds=now, efforts=efforts)

    def _since(self, age: Scalar) -> list[Scalar]:
        """Share (0 to 1) of each past control period, newest first, that lies within
        the last ``age`` periods.
        """
        # how long each period, newest first, lies within the last age ones
        return [clip(sub(age, float(k)), 0.0, 1.0) for k in range(len(self.squares))]


def turn(
    rotor: Rotor, speed: Scalar, command: Scalar, dt: Scalar
) -> tuple[Scalar, Scalar]:
    """Speed of a rotor (rad/s) after ``dt`` seconds of a held command, and the mean
    square of its speed until then.

    With the lag of :func:`skyarm.dynamics.actuators.speed_after` the speed is c + (w -
    c) e^(-t / tau), whose square is integrated.
    """
    target = minimum(command, rotor.max_speed)
    off = sub(speed, target)
    # both directions are worked out, which costs nothing where the numbers of the
    # vehicle do not vary
    ways = [
        (exp(divide(-dt, tau)), divide(tau, dt))
        for tau in (rotor.time_constant_up, rotor.time_constant_down)
    ]
    left, share = (
        where(target > speed, rising, falling)
        for rising, falling in zip(*ways, strict=True)
    )
    mean = mul(off, share * (1.0 - left))
    return target + off * left, target * target + mean * (
        2.0 * target + (0.5 * off) * (1.0 + left)
    )


def first_past(standing: Command, periods: int) -> Past:
    """History of actuators that have held one command for the given number of control
    periods.
    """
    speeds = standing.rotor_speeds
    squares = tuple(speed * speed for speed in speeds)
    return Past(
        squares=(squares,) * periods,
        speeds=(speeds,) * periods,
        efforts=(standing.efforts,) * periods,
    )


def _sums(rows: Rows, shares: Sequence[Scalar]) -> Scalars:
    """Weighted sum of past actuator values, stored oldest first; the weights are
    ordered newest first.
    """
    return tuple(
        inner_product(shares, column) for column in zip(*rows[::-1], strict=True)
    )
