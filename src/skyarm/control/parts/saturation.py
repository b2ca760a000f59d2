"""Whether actuators do what they are told: integrators and observers stand still while they do not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.actuation import Mixer
from skyarm.scalars import absolute, logical_and
from skyarm.vehicle.records import Vehicle


def rotors_follow(mixer: Mixer, squares: Sequence[Any]) -> Any:
    """True while every squared rotor speed that the mixer asks for lies within the rotor's limits."""
    inside: Any = True
    for square, top in zip(squares, mixer.highest, strict=True):
        fits = logical_and(square >= 0.0, square <= top)
        inside = fits if inside is True else logical_and(inside, fits)
    return inside


def all_follow(obeyed: Sequence[Any]) -> Any:
    """True while no command was changed on its way (:func:`skyarm.control.controller.informed`).

    One for all: through the coupled dynamics what one actuator does not do is missing from every acceleration.
    """
    found: Any = True
    for each in obeyed:
        found = logical_and(found, each > 0.5)
    return found


def joints_follow(vehicle: Vehicle, efforts: Sequence[Any]) -> list[Any]:
    """For each joint, True while its wanted effort lies within its limit."""
    return [absolute(e) <= link.joint.effort_limit for e, link in zip(efforts, vehicle.links, strict=True)]
