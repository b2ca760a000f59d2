"""Instructions by which a law shares a load: wrench of the load on the tip, and shift
of the tip's reference.

A reference holds it as a tuple of numbers, empty where nothing is carried
(:attr:`skyarm.reference.Reference.carry`).
"""

from __future__ import annotations

from typing import Annotated

from skyarm.algebra import ZERO3, Scalar, Scalars, Vec3
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data, leaves, rebuild
from skyarm.records.units import Unit


@immutable
class Carry:
    """Instructions to a law whose tip holds a part of a load, world axes; an absent
    load is all zeros.
    """

    held: Annotated[
        Scalar,
        Unit("", "1 while the tip holds the load, also where that stands; else 0"),
    ] = 0.0
    force: Annotated[
        Vec3, Unit("N", "force of the load on the tip that is known in advance")
    ] = ZERO3
    moment: Annotated[
        Vec3, Unit("N m", "moment of the load on the tip that is known in advance")
    ] = ZERO3
    forgotten_force: Annotated[
        Vec3, Unit("N/s", "rate at which the observer forgets a force on the tip")
    ] = ZERO3
    forgotten_moment: Annotated[
        Vec3, Unit("N m/s", "rate at which the observer forgets a moment on the tip")
    ] = ZERO3
    offset: Annotated[Vec3, Unit("m", "shift of the tip's reference")] = ZERO3
    offset_rate: Annotated[Vec3, Unit("m/s", "rate of that shift")] = ZERO3
    offset_acceleration: Annotated[
        Vec3, Unit("m/s^2", "acceleration of that shift")
    ] = ZERO3
    heading: Annotated[
        Vec3,
        Unit(
            "rad",
            "turn of the reference's heading about the tip, its rate and acceleration",
        ),
    ] = ZERO3
    settling: Annotated[
        Scalar,
        Unit(
            "rad/s",
            "bandwidth at which the shift settles: its rate dies out so in the preview",
        ),
    ] = 0.0
    mass: Annotated[
        Scalar, Unit("kg", "part of the load's mass that this tip moves")
    ] = 0.0

    @property
    def numbers(self) -> Scalars:
        """All numbers in order, as a reference holds them: data, zeros too."""
        return tuple(leaves(as_data(self)))

    @classmethod
    def of(cls, numbers: Scalars) -> Carry:
        """Instructions from the numbers that a reference holds."""
        return rebuild(cls.none(), iter(numbers))

    @classmethod
    def none(cls) -> Carry:
        """Instructions of a tip that holds nothing, whose numbers are data."""
        return as_data(cls())
