"""Saturation of actuators, during which integrators and observers stand still."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.actuation import Mixer
from skyarm.control.model import Parameters
from skyarm.scalars import absolute, clip, logical_and
from skyarm.vehicle.vehicle_records import Vehicle


def rotors_follow(mixer: Mixer, squares: Sequence[Any]) -> Any:
    """True while every squared rotor speed that the mixer asks for lies within the rotor's limits."""
    inside: Any = True
    for square, top in zip(squares, mixer.highest, strict=True):
        fits = logical_and(square >= 0.0, square <= top)
        inside = fits if inside is True else logical_and(inside, fits)
    return inside


def all_follow(applied: Sequence[Any]) -> Any:
    """True while no command was changed on its way (:func:`skyarm.control.controller.with_applied_command`).

    One for all: through the coupled dynamics what one actuator does not do is missing from every acceleration.
    """
    found: Any = True
    for each in applied:
        found = logical_and(found, each > 0.5)
    return found


def joints_follow(vehicle: Vehicle, efforts: Sequence[Any]) -> list[Any]:
    """For each joint, True while its wanted effort lies within its limit."""
    return [absolute(e) <= link.joint.effort_limit for e, link in zip(efforts, vehicle.links, strict=True)]


def limit_efforts(par: Parameters, efforts: Any) -> tuple[Any, ...]:
    """Joint torques within the model's effort limits."""
    limits = [link.joint.effort_limit for link in par.model.vehicle.links]
    return tuple(clip(effort, -limit, limit) for effort, limit in zip(efforts, limits, strict=True))
