"""Motion of a vehicle over time: measured poses of base and joints, and predictions of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from skyarm.algebra.frames import unit_rows
from skyarm.flight_data.flight_data import FlightData
from skyarm.flight_data.series import attitude_at, continuous, values_at
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.vehicle.vehicle_records import Vehicle


@immutable(eq=False)
class PoseSeries:
    """Poses of the base and positions of the joints over time.

    Attributes:
        time: (N,) s, not falling; of two rows at one time the later one holds from there on.
        position: (N, 3) m, world axes. quaternion: (N, 4) w x y z, base to world.
        joints: (N, n) rad or m. Rows of NaN are times without a known pose.
    """

    time: Array
    position: Array
    quaternion: Array
    joints: Array

    def at(self, time: Array) -> PoseSeries:
        """Motion at given times (K,), s, linear between its rows; NaN outside of them."""
        rows = np.clip(np.searchsorted(self.time, time, "right") - 1, 0, max(len(self.time) - 2, 0))
        after = np.minimum(rows + 1, len(self.time) - 1)
        step = self.time[after] - self.time[rows]
        share = np.where(step > 0.0, (time - self.time[rows]) / np.where(step > 0.0, step, 1.0), 1.0)[:, None]
        outside = (time < self.time[0]) | (time > self.time[-1])

        def interpolate(values: Array) -> Array:
            # the row itself at its own time, whatever follows it
            mixed = np.where(share > 0.0, values[rows] + share * (values[after] - values[rows]), values[rows])
            mixed[outside] = np.nan
            return np.asarray(mixed)

        return PoseSeries(
            time=time,
            position=interpolate(self.position),
            quaternion=unit_rows(interpolate(continuous(self.quaternion))),
            joints=interpolate(self.joints),
        )


@immutable(eq=False)
class PredictedMotion:
    """Predictions of a measured motion, set back to the measured state at the same instants.

    Attributes:
        model: motion of a vehicle's model under the recorded commands.
        held: motion with the velocity and rate that were measured when it was set back.
        begins: (K,) s, instants at which both are set back, rising.
    """

    model: PoseSeries
    held: PoseSeries
    begins: Array


def join_motions(motions: Sequence[PoseSeries]) -> PoseSeries:
    """One motion of several that follow each other, with no known pose between them."""
    parts = {name: list[Array]() for name in ("time", "position", "quaternion", "joints")}
    for motion in motions:
        for name, pieces in parts.items():
            values: Array = getattr(motion, name)
            pieces += [values, values[-1:] if name == "time" else np.full((1, values.shape[1]), np.nan)]
    return PoseSeries(**{name: np.concatenate(pieces) for name, pieces in parts.items()})


def distance_between(one: PoseSeries, other: PoseSeries) -> tuple[Array, Array]:
    """Distance of the bases (K,), m, and angle of the rotation between them (K,), rad, of motions at the same times."""
    apart = np.linalg.norm(one.position - other.position, axis=1)
    same = np.abs((one.quaternion * other.quaternion).sum(axis=1))
    return apart, 2.0 * np.arccos(np.minimum(same, 1.0))


JOINTS = ("joint_positions", "joint_rates", "joint_commands", "joint_efforts")


def joints_in_order(flight: FlightData, vehicle: Vehicle) -> FlightData:
    """Flight whose joints stand in the order of the vehicle's, where its file names all of these."""
    order = [link.joint.name for link in vehicle.links]
    changed = {}
    for name in JOINTS:
        if name in flight and order and set(order) <= set(flight[name].names):
            channel = flight[name]
            values = channel.values[:, [channel.names.index(each) for each in order]]
            changed[name] = replace(channel, values=values, names=tuple(order))
    return flight.with_channels(changed)


def measured_motion(flight: FlightData, vehicle: Vehicle) -> PoseSeries:
    """Measured motion of a vehicle in a flight, at the times of its positions.

    Args:
        flight: flight with position and quaternion, and joint positions of a vehicle with joints.
        vehicle: vehicle with these joints.

    Raises:
        ValueError: one line: what is missing, or another number of joints than the vehicle has.
    """
    place, attitude = flight["position"], flight["quaternion"]
    first, last = (attitude.time[0], attitude.time[-1]) if attitude.time.size else (np.inf, -np.inf)
    time = place.time[(place.time >= first) & (place.time <= last)]
    if len(time) < 2:
        raise ValueError(f"{flight.name}: position and quaternion: must be measured at the same time")
    joints = np.zeros((len(time), 0))
    if vehicle.n:
        angles = flight["joint_positions"]
        if angles.values.shape[1] != vehicle.n:
            raise ValueError(
                f"{flight.name}: joint_positions: {angles.values.shape[1]} columns, vehicle '{vehicle.name}' has "
                f"{vehicle.n} joints"
            )
        joints = values_at(angles, time)
    return PoseSeries(
        time=time,
        position=values_at(place, time),
        quaternion=attitude_at(attitude, time),
        joints=joints,
    )
