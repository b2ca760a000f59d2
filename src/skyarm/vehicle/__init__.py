"""Vehicles: dataclasses of airframe, arm and rotors, their checks, and the files that
describe them.
"""

from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.linkage import BASE, Body, Joint, Link
from skyarm.vehicle.vehicle_records import BodyDrag, Frame, MountedDrive, Rotor, Vehicle

__all__ = [
    "BASE",
    "Body",
    "BodyDrag",
    "Frame",
    "Joint",
    "Link",
    "MountedDrive",
    "Rotor",
    "Vehicle",
    "VehicleError",
]
