"""Drag by air speed as a law believes it: of the rotors' hubs and of the hull, against air that moves or stands still.

Both act on the base and go with the velocity against the air, v - wind: hub drag in proportion to it and to the rotors'
speeds, drag of the hull with its square (:func:`skyarm.environment.body_drag`). Along a reference the second changes
with d/dt (|u| u) for u = v - wind, which a series in time gives to second order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from skyarm.algebra import ZERO3, Mat3, Vec3
from skyarm.control.model import Model
from skyarm.environment import body_drag
from skyarm.records.units import Unit
from skyarm.scalars.taylor import Taylor


@dataclass(frozen=True, kw_only=True, slots=True)
class BelievedAir:
    """What a law believes of the air.

    Attributes:
        wind: mean velocity of the air, m/s, world axes; structural zeros for air that stands still.
        hull: True counts the drag of the model's hull, False that of the rotors' hubs alone.
    """

    wind: Annotated[Vec3, Unit("m/s", "mean velocity of the air, world axes")]
    hull: bool


def against_air(air: BelievedAir | None, velocity: Vec3) -> Vec3:
    """A velocity (m/s, world axes) against the air that is believed."""
    return velocity if air is None else velocity - air.wind


def hull_drag(model: Model, air: BelievedAir | None, velocity_B: Vec3) -> Vec3:
    """Drag of the hull at a velocity against the air; N and m/s, base axes."""
    return body_drag(model.vehicle.drag, velocity_B) if air is not None and air.hull else ZERO3


def hull_drag_along(model: Model, air: BelievedAir | None, R: Mat3, motion: Sequence[Vec3]) -> list[Vec3]:
    """Drag of the hull along a motion, with two derivatives; N, N/s and N/s^2, world axes.

    Args:
        model: belief.
        air: belief; no drag without one.
        R: R_WB, which is held.
        motion: velocity over ground, acceleration and jerk, world axes.
    """
    if air is None or not air.hull:
        return [ZERO3] * 3
    turned = [R.apply_T(each) for each in (against_air(air, motion[0]), *motion[1:])]
    u = Vec3(*(Taylor.of_derivatives(each) for each in zip(*turned, strict=True)))
    force = hull_drag(model, air, u)
    if not all(isinstance(each, Taylor) for each in force):
        return [ZERO3] * 3  # no drag in the description: structure
    return [R.apply(Vec3(*(each.derivative(k) for each in force))) for k in range(3)]
