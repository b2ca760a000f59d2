"""Vehicles: dataclasses of airframe, arm and rotors, their checks, and the files that describe them."""

from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.linkage import Body, Joint, Link
from skyarm.vehicle.vehicle_records import BodyDrag, Frame, Rotor, Vehicle

__all__ = ["Body", "BodyDrag", "Frame", "Joint", "Link", "Rotor", "Vehicle", "VehicleError"]
