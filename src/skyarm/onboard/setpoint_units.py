"""What an exported law's command is to the joints: torques, or setpoints of the drives that they carry."""

from __future__ import annotations

from typing import Any

from skyarm.actuation.drive import TorqueDrive
from skyarm.actuation.servo import PositionServo, VelocityServo
from skyarm.compile.c.c_struct import Units
from skyarm.records.units import Unit
from skyarm.vehicle.linkage import Joint
from skyarm.vehicle.vehicle_records import Vehicle

UNITS = {"revolute": "revolute, rad, N m", "prismatic": "prismatic, m, N"}
LENGTHS = {"revolute": "rad", "prismatic": "m"}

SETPOINTS = {"efforts": Unit("", "of each joint what its line above says, in that order")}
"""Of a command some of whose numbers are setpoints."""

SPEEDS = {"rotor_speeds": Unit("rad/s", "unsigned, in the order of the rotors above")}


def units_of(joint: Joint, vehicle: Vehicle) -> str:
    """Kind, unit of the position, and what the command is: an effort, or a setpoint in its unit."""
    kind, effort = UNITS[joint.kind].rsplit(", ", 1)
    return f"{kind}, {_setpoint(joint, vehicle) or effort}"


def _setpoint(joint: Joint, vehicle: Vehicle) -> str:
    """Empty for a joint that takes its torque."""
    drive = drives_of(vehicle).get(joint.name)
    if drive is None:
        return ""
    length = LENGTHS[joint.kind]
    if isinstance(drive, PositionServo):
        return f"setpoint of its position servo in {length}"
    if isinstance(drive, VelocityServo):
        return f"setpoint of its velocity servo in {length}/s"
    return f"setpoint as its drive {type(drive).__name__} takes it"


def drives_of(vehicle: Vehicle) -> dict[str, Any]:
    """Drives by joint whose setpoint is no torque."""
    return {each.name: each.drive for each in vehicle.drives if not isinstance(each.drive, TorqueDrive)}


def command_units(vehicle: Vehicle, *place: str) -> Units:
    """Units of the command that stands at a place, where it holds setpoints."""
    return {place: SPEEDS | SETPOINTS} if drives_of(vehicle) else {}
