"""What a controller asks of the actuators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.scalars import Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class Command:
    """A command holds rotor speeds (rad/s, unsigned) and joint torques or forces (N m or N)."""

    rotor_speeds: Annotated[tuple[Scalar, ...], Unit("rad/s", "unsigned, in the order of the rotors above")] = ()
    efforts: Annotated[tuple[Scalar, ...], Unit("N m or N", "in the order of the joints above")] = ()

    def __post_init__(self) -> None:
        # made in every period: what holds tuples already is not looked at
        if not (type(self.rotor_speeds) is type(self.efforts) is tuple):
            accept_fields(self, "command")
