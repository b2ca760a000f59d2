"""The force sensor at the tip: what of it the law is told, and the check that one is there for a law that needs it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Mat3, Vec3
from skyarm.control.controller import senses_force
from skyarm.files import did_you_mean, shown
from skyarm.reference.trajectory import Trajectory
from skyarm.sensors.sensor import Sensor
from skyarm.sensors.sensor_kinds import ForceTorque, TactileSwitch
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


def sensor_offset(sensors: Sequence[tuple[str, Sensor]], vehicle: Vehicle) -> Vec3:
    """Where that sensor is, m from the tip in its axes: its torque is one about this place."""
    tip = vehicle.frame()
    own = next(s for _, s in sensors if isinstance(s, ForceTorque) and vehicle.frame(s.frame or None).link == tip.link)
    return tip.rotation.apply_T(vehicle.frame(own.frame or None).position - tip.position)


def require_tip_sensor(par: Any, sensors: Sequence[tuple[str, Sensor]], vehicle: Vehicle) -> None:
    """Refuse a law that is to be told by a force sensor where there is none.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if senses_force(par) and tip_sensor(sensors, vehicle) is None:
        needed = "a sensor of kind 'force_torque' on the link of the tip"
        raise ValueError(f"controller.force_sensor = true: must be false without {needed} ([sensors.NAME])")


def require_guard_sensors(trajectory: Trajectory, sensors: Sequence[tuple[str, Sensor]], vehicle: Vehicle) -> None:
    """Refuse phases that wait for what no sensor of the vehicle says.

    Raises:
        ValueError: one line with phase, field, value and what is allowed.
    """
    switches = [name for name, sensor in sensors if isinstance(sensor, TactileSwitch)]
    for guard in trajectory.guards:
        named = trajectory.phases[guard.phase].name if guard.phase < len(trajectory.phases) else "guard"
        at = f"reference: phase {guard.phase} '{named}': until"
        if guard.sensed and tip_sensor(sensors, vehicle) is None:
            needed = "a sensor of kind 'force_torque' on the link of the tip"
            raise ValueError(f"{at}.force_sensor = true: must be false without {needed} ([sensors.NAME])")
        for word in ("closed", "open"):
            name = getattr(guard, word)
            if name and name not in switches:
                near, there = did_you_mean(name, switches), ", ".join(switches) or "none"
                allowed = f"{near}must be the name of a sensor of kind 'tactile_switch'; there are {there}"
                raise ValueError(f"{at}.{word} = {shown(name)}: {allowed}")
