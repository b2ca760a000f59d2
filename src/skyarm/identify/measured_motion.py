"""Measured motion of a vehicle in a flight, with its joints in the vehicle's order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skyarm.flight_data.flight_data import FlightData
from skyarm.flight_data.series import attitude_at, values_at
from skyarm.log.motion import PoseSeries
from skyarm.vehicle import Vehicle

JOINTS = ("joint_positions", "joint_rates", "joint_commands", "joint_efforts")


def joints_in_order(flight: FlightData, vehicle: Vehicle) -> FlightData:
    """Flight with joints reordered as in a vehicle, if its file names all of the
    vehicle's joints.
    """
    order = vehicle.joint_names
    changed = {}
    for name in JOINTS:
        # a file that names other joints, or none, has them in its own order
        if name in flight and order and set(order) <= set(flight[name].names):
            channel = flight[name]
            values = channel.values[:, [channel.names.index(each) for each in order]]
            changed[name] = replace(channel, values=values, names=tuple(order))
    return flight.with_channels(changed)


def measured_motion(flight: FlightData, vehicle: Vehicle) -> PoseSeries:
    """Measured motion of a vehicle in a flight, at the times of its positions.

    Args:
        flight: flight with position and quaternion, and joint positions of a vehicle
            with joints.
        vehicle: vehicle with these joints.

    Raises:
        ValueError: one line: what is missing, or another number of joints than the
            vehicle has.
    """
    place, attitude = flight["position"], flight["quaternion"]
    first, last = (
        (attitude.time[0], attitude.time[-1])
        if attitude.time.size
        else (np.inf, -np.inf)
    )
    time = place.time[(place.time >= first) & (place.time <= last)]
    if len(time) < 2:
        raise ValueError(
            f"{flight.name}: position and quaternion: must be measured at the same time"
        )
    joints = np.zeros((len(time), 0))
    if vehicle.n:
        angles = flight["joint_positions"]
        if angles.values.shape[1] != vehicle.n:
            raise ValueError(
                f"{flight.name}: joint_positions: {angles.values.shape[1]} columns,"
                f" vehicle '{vehicle.name}' has {vehicle.n} joints"
            )
        joints = values_at(angles, time)
    return PoseSeries(
        time=time,
        position=values_at(place, time),
        quaternion=attitude_at(attitude, time),
        joints=joints,
    )
