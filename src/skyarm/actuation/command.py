"""What a controller asks of the actuators."""

from __future__ import annotations

from dataclasses import dataclass

from skyarm.scalars import Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class Command:
    """Rotor speeds (rad/s, unsigned) and joint torques or forces (N m or N)."""

    rotor_speeds: tuple[Scalar, ...] = ()
    efforts: tuple[Scalar, ...] = ()
