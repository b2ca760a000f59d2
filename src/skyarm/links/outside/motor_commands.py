"""Motor set points by which an autopilot applies the rotor speeds of a control law, as fractions of the highest thrust.

The autopilot keeps its thrust curve, motor order and limits, and none of its loops: the law's own bandwidth counts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

from skyarm.algebra import Scalars, Vec3
from skyarm.algebra.scalars import clip
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.rotor import push
from skyarm.links.outside.px4_topics import MOST_MOTORS
from skyarm.links.outside.rate_commands import RateCommand
from skyarm.records.coerce import refuse
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle import Vehicle


@immutable
class MotorCommand:
    """Set point for an autopilot: thrust of each rotor as a fraction of its highest, in the vehicle's order."""

    thrusts: Annotated[Scalars, Unit("", "normalized thrust set point of each motor, 0 to 1")]


SetPoint = RateCommand | MotorCommand


@immutable
class MotorSettings:
    """Settings of the loop around a control law whose rotor commands go directly to the motors."""

    period: Annotated[float, Unit("s", "control period of the law", low=0.0, strict=True)]

    def begin(self, vehicle: Vehicle, speeds: Sequence[float]) -> Vec3:
        """Zero integral torque, since motor set points bypass the autopilot's rate loop."""
        return Vec3(0.0, 0.0, 0.0)

    def set_point(
        self, model: Model, integral: Vec3, measurement: Measurement, reference: Reference, command: Command
    ) -> tuple[Vec3, MotorCommand]:
        """Rotor thrusts as fractions of the highest, for a law's commanded rotor speeds; integral torque unchanged."""
        pairs = zip(model.vehicle.rotors, command.rotor_speeds, strict=True)
        shares = (clip(push(rotor, speed) / push(rotor, rotor.max_speed), 0.0, 1.0) for rotor, speed in pairs)
        return integral, MotorCommand(thrusts=tuple(shares))


def require_full_thrust(vehicle: Vehicle) -> None:
    """Raise an error for rotors without a maximum speed, or for more rotors than a set point has motors.

    Raises:
        RecordError: a rotor whose ``max_speed`` is infinite, or too many of them.
    """
    if len(vehicle.rotors) > MOST_MOTORS:
        refuse("model.vehicle.rotors", len(vehicle.rotors), f"must be at most {MOST_MOTORS}, for motor set points")
    for i, rotor in enumerate(vehicle.rotors):
        if not math.isfinite(rotor.max_speed):
            refuse(f"model.vehicle.rotors[{i}].max_speed", rotor.max_speed, "must be finite, for motor set points")
