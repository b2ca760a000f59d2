"""Command of a controller to the actuators."""

from __future__ import annotations

from typing import Annotated

from skyarm.algebra import Scalars
from skyarm.algebra.scalars import data
from skyarm.records.field_rules import checked
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.units import Unit


@immutable
@checked("command", often=True)
class Command:
    """Command to the actuators: rotor speeds (rad/s), joint setpoints, angles of
    tilting rotors.

    A rotor speed is negative only of a reversible rotor. ``tilts`` may be left out:
    then every rotor stays in the middle, at angle 0.
    """

    rotor_speeds: Annotated[
        Scalars,
        Unit("rad/s", "commanded rotor speeds, in the order of the vehicle's rotors"),
    ] = ()
    efforts: Annotated[
        Scalars,
        Unit(
            "N m or N", "commanded joint efforts, in the order of the vehicle's joints"
        ),
    ] = ()
    tilts: Annotated[Scalars, Unit("rad", "commanded angles of the tilting rotors")] = (
        field_if_any(default=())
    )

    def dense(self) -> Command:
        """Command with integers converted to floats, which compiled code keeps as
        variables, not as constants.
        """
        rows = (
            [data(value) for value in row]
            for row in (self.rotor_speeds, self.efforts, self.tilts)
        )
        rotor_speeds, efforts, tilts = map(tuple, rows)
        return Command(rotor_speeds=rotor_speeds, efforts=efforts, tilts=tilts)
