"""Measured quantities of a flight: names, numbers of columns, units and axes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field

from skyarm.records.immutable import positional

GRAVITY = 9.81
"""Gravity (m/s^2) of a flight that states none."""

# the unit by its definition, whatever the gravity at the place of the flight
ONE_G = 9.80665
"""Unit g of accelerometers (m/s^2)."""

ANGLE_RATES = {"rad/s": 1.0, "deg/s": math.pi / 180.0, "mrad/s": 1e-3}
TURNS = {
    "rad/s": 1.0,
    "rpm": math.pi / 30.0,
    "deg/s": math.pi / 180.0,
    "Hz": 2.0 * math.pi,
}
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
SPEEDS = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3}
JOINTS = {"rad": 1.0, "deg": math.pi / 180.0, **LENGTHS}
JOINT_RATES = {**ANGLE_RATES, "rpm": math.pi / 30.0, **SPEEDS}

BODY, WORLD, ATTITUDE, NONE = "body", "world", "attitude", ""
"""Axes of a quantity: base, world, attitude of one in the other, none."""


@positional
class Quantity:
    """Measured quantity: number of columns, units that files may state, axes and
    meaning.

    Attributes:
        width: columns; 0 for one per rotor or joint.
        units: unit -> factor to SI; the first is the unit of a channel.
        axes: BODY (x forward, y left, z up), WORLD (z up), ATTITUDE or NONE.
        meaning: meaning in words.
        held: a value stays until the next one, as that of a command.
    """

    width: int
    units: Mapping[str, float] = field(default_factory=lambda: {"": 1.0})
    axes: str = NONE
    meaning: str = ""
    held: bool = False

    @property
    def unit(self) -> str:
        """Unit in which a measured flight stores this quantity."""
        return next(iter(self.units))


QUANTITIES: Mapping[str, Quantity] = {
    "gyro": Quantity(3, ANGLE_RATES, BODY, "angular rate of the base, base axes"),
    "accelerometer": Quantity(
        3,
        {"m/s^2": 1.0, "g": ONE_G, "mg": 1e-3 * ONE_G},
        BODY,
        "specific force, base axes",
    ),
    "position": Quantity(3, LENGTHS, WORLD, "position of the base, world axes"),
    "velocity": Quantity(3, SPEEDS, WORLD, "velocity of the base, world axes"),
    "quaternion": Quantity(
        4, axes=ATTITUDE, meaning="attitude w, x, y, z, base to world"
    ),
    "rotor_commands": Quantity(
        0,
        meaning="share 0 to 1 of the full signal, in the order of the rotors",
        held=True,
    ),
    "rotor_speed_commands": Quantity(
        0, TURNS, meaning="commanded speeds of the rotors", held=True
    ),
    "rotor_speeds": Quantity(0, TURNS, meaning="measured speeds of the rotors"),
    "voltage": Quantity(1, {"V": 1.0, "mV": 1e-3}, meaning="voltage of the battery"),
    "joint_positions": Quantity(
        0, JOINTS, meaning="measured positions of the joints, rad or m"
    ),
    "joint_rates": Quantity(
        0, JOINT_RATES, meaning="measured rates of the joints, rad/s or m/s"
    ),
    "joint_commands": Quantity(
        0, JOINTS, meaning="commanded positions of the joints, rad or m", held=True
    ),
    "joint_efforts": Quantity(
        0,
        {"N m": 1.0, "mN m": 1e-3, "N": 1.0},
        meaning="efforts of the joints, N m or N",
    ),
}
"""Names of the channels of a measured flight."""
