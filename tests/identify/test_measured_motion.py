"""Measured motions from channels on clocks of their own, and joints in the order of a
vehicle's.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.identify.measured_motion import joints_in_order, measured_motion
from skyarm.log.motion import distance_between
from support.flights import turning


def flight_of(**channels):
    made = {
        name: Channel(
            time=np.asarray(time, dtype=float),
            values=np.asarray(values, dtype=float),
            source=name,
        )
        for name, (time, values) in channels.items()
    }
    return FlightData(name="flight", file="flight.csv", channels=made)


def test_channels_on_other_clocks_are_taken_at_the_times_of_the_positions():
    seen, slow = turning(np.arange(21) / 10.0), turning(np.arange(1, 8) / 4.0)
    flight = flight_of(
        position=(seen.time, seen.position),
        quaternion=(slow.time, slow.quaternion),
        joint_positions=(seen.time[::2], np.repeat(seen.joints[::2], 2, axis=1)),
    )
    found = measured_motion(flight, skyarm.load_vehicle("hummingbird_arm2"))
    np.testing.assert_allclose(found.time, np.arange(3, 18) / 10.0)
    np.testing.assert_allclose(found.joints, np.repeat(found.time[:, None], 2, axis=1))
    _, angle = distance_between(found, turning(found.time))
    assert angle.max() < 1e-3


def test_joints_of_another_vehicle_and_times_that_do_not_meet_are_one_line():
    seen = turning([0.0, 1.0])
    pose = {
        "position": (seen.time, seen.position),
        "quaternion": (seen.time, seen.quaternion),
    }
    with pytest.raises(
        ValueError,
        match="joint_positions: 1 columns, vehicle 'hummingbird_arm2' has 2 joints",
    ):
        measured_motion(
            flight_of(**pose, joint_positions=(seen.time, seen.joints)),
            skyarm.load_vehicle("hummingbird_arm2"),
        )
    pose["quaternion"] = (seen.time + 5.0, seen.quaternion)
    with pytest.raises(ValueError, match="must be measured at the same time"):
        measured_motion(flight_of(**pose), skyarm.load_vehicle("hummingbird"))
    pose["quaternion"] = (seen.time[:0], seen.quaternion[:0])
    with pytest.raises(ValueError, match="must be measured at the same time"):
        measured_motion(flight_of(**pose), skyarm.load_vehicle("hummingbird"))


def test_joints_get_the_order_of_the_vehicle_where_the_file_names_all_of_them():
    vehicle, seen = skyarm.load_vehicle("hummingbird_arm2"), turning([0.0, 1.0, 2.0])
    names = [link.joint.name for link in vehicle.links]
    angles = np.array([[0.1, 0.2, 0.3], [1.1, 1.2, 1.3], [2.1, 2.2, 2.3]])
    given = flight_of(
        joint_positions=(seen.time, angles), joint_efforts=(seen.time, angles[:, :2])
    )

    def named(channel, order):
        channel = dataclasses.replace(given[channel], names=tuple(order))
        return joints_in_order(given.with_channels({channel.source: channel}), vehicle)

    found = named("joint_positions", [names[1], "gripper", names[0]])["joint_positions"]
    np.testing.assert_array_equal(found.values, angles[:, [2, 0]])
    assert found.names == tuple(names)
    assert (
        named("joint_efforts", names[::-1])["joint_efforts"].values.tolist()
        == angles[:, [1, 0]].tolist()
    )
    kept = named("joint_positions", [names[1], "gripper", "other"])["joint_positions"]
    np.testing.assert_array_equal(kept.values, angles)
    np.testing.assert_array_equal(
        joints_in_order(given, vehicle)["joint_positions"].values, angles
    )
