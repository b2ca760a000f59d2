"""Thrust and yaw torque that rotors give beside a torque about roll and pitch.

Rotor i asks for 0 <= t_i + p_i f + y_i u <= top_i: t_i the squared speed that roll and pitch take, f the thrust, u the
yaw torque. Each is a lower and an upper bound of u, linear in f; u besides stays between nothing and what is wanted, or
goes ``slack`` beyond. Where every lower bound is below every upper one there is a yaw torque (Fourier-Motzkin
elimination): that is an interval of f. It is never empty if the thrust alone can make room for roll and pitch, because
then u = 0 will do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.scalars import absolute, add, divide, maximum, minimum, mul, sub, where

SMALL = 1e-9
"""Of the largest: the least squared speed per N m of yaw that is reckoned with."""

ENDLESS = 1e100
"""N: no bound of the thrust."""


@dataclass(frozen=True, slots=True)
class Bound:
    """Bounds of the yaw torque, N m: from ``low`` + ``slope`` f to ``high`` + ``slope`` f, f the thrust in N."""

    low: Any
    high: Any
    slope: Any


def bounds(
    taken: Sequence[Any],
    per_newton: Sequence[Any],
    per_turn: Sequence[Any],
    highest: Sequence[Any],
    wanted: Any,
    slack: Any,
) -> list[Bound]:
    """Bounds of the wanted yaw torque and of each rotor.

    Args:
        taken: squared speeds for roll and pitch, (rad/s)^2.
        per_newton: of each rotor, per N of thrust.
        per_turn: per N m of yaw torque.
        highest: squared speeds.
        wanted: yaw torque, N m.
        slack: N m, by which it may be missed beyond nothing.
    """
    largest: Any = 0.0
    for each in per_turn:
        largest = maximum(largest, absolute(each))
    least = mul(SMALL, largest)
    found = [Bound(minimum(0.0, sub(wanted, slack)), maximum(0.0, add(wanted, slack)), 0.0)]
    for value, slope, turning, top in zip(taken, per_newton, per_turn, highest, strict=True):
        by = where(absolute(turning) > least, turning, least)
        a, b = divide(0.0 - value, by), divide(top - value, by)
        found.append(Bound(minimum(a, b), maximum(a, b), 0.0 - divide(slope, by)))
    return found


def nearest_thrust(bounds: Sequence[Bound], wanted: Any) -> Any:
    """The thrust nearest to the wanted one, N, for which some yaw torque keeps all bounds."""
    low: Any = -ENDLESS
    high: Any = ENDLESS
    for i, under in enumerate(bounds):
        for j, over in enumerate(bounds):
            if i == j:
                continue
            # under.low + under.slope f <= over.high + over.slope f
            steeper, room = sub(under.slope, over.slope), sub(over.high, under.low)
            edge = divide(room, where(absolute(steeper) > 0.0, steeper, 1.0))
            high = minimum(high, where(steeper > 0.0, edge, high))
            low = maximum(low, where(steeper < 0.0, edge, low))
    return minimum(maximum(wanted, low), high)


def nearest_yaw(bounds: Sequence[Bound], thrust: Any, wanted: Any) -> Any:
    """The yaw torque nearest to the wanted one, N m, within all bounds at this thrust."""
    for each in bounds:
        moved = mul(each.slope, thrust)
        wanted = minimum(maximum(wanted, add(each.low, moved)), add(each.high, moved))
    return wanted
