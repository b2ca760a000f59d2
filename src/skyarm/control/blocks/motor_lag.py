"""Rotor commands that undo the motors' lag."""

from __future__ import annotations

from typing import Any

from skyarm.scalars import clip, divide, exp, minimum, where
from skyarm.vehicle.vehicle_records import Rotor


def command_for(rotor: Rotor, speed: Any, wanted: Any, dt: Any, share: Any) -> Any:
    """Speed command (rad/s) after which the rotor turns with ``wanted`` at the end of the period.

    Args:
        rotor: with its two time constants.
        speed: now, rad/s.
        wanted: rad/s.
        dt: control period, s.
        share: 1 inverts the lag (:func:`skyarm.actuation.speed_after`) exactly, 0 sends ``wanted`` itself.

    Without the inversion noise through two time constants rectifies into thrust.
    """
    target = minimum(wanted, rotor.max_speed)
    change = target - speed
    rise, fall = (
        divide(1.0, 1.0 - exp(divide(-dt, tau))) - 1.0 for tau in (rotor.time_constant_up, rotor.time_constant_down)
    )
    return clip(target + change * (share * where(change > 0.0, rise, fall)), 0.0, rotor.max_speed)
