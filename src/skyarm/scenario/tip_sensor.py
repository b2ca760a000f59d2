"""The force sensor at the tip: what of it the law is told, and the check that one is there for a law that needs it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Mat3
from skyarm.control.controller import senses_force
from skyarm.sensors.force_sensors import ForceTorque
from skyarm.sensors.sensor import Sensor
from skyarm.vehicle.vehicle_records import Vehicle


def tip_sensor(sensors: Sequence[tuple[str, Sensor]], vehicle: Vehicle) -> tuple[str, Mat3] | None:
    """Name of the first force-torque sensor on the tip's link, and the rotation of its axes to those of the tip."""
    if not vehicle.end_effector:
        return None
    tip = vehicle.frame()
    for name, sensor in sensors:
        if isinstance(sensor, ForceTorque):
            frame = vehicle.frame(sensor.frame or None)
            if frame.link == tip.link:
                return name, tip.rotation.T @ frame.rotation
    return None


def require_tip_sensor(par: Any, sensors: Sequence[tuple[str, Sensor]], vehicle: Vehicle) -> None:
    """Refuse a law that is to be told by a force sensor where there is none.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if senses_force(par) and tip_sensor(sensors, vehicle) is None:
        needed = "a sensor of kind 'force_torque' on the link of the tip"
        raise ValueError(f"controller.force_sensor = true: must be false without {needed} ([sensors.NAME])")
