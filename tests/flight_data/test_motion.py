"""Motions between their rows, at their gaps, and from channels on clocks of their own."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.motion import PoseSeries, distance_between, join_motions, joints_in_order, measured_motion


def turning(time, rate=0.8, speed=2.0):
    """Motion along x that turns about z, with quaternions of alternating sign."""
    time = np.asarray(time, dtype=float)
    zero, half = 0.0 * time, 0.5 * rate * time
    signs = np.where(np.arange(len(time)) % 2, -1.0, 1.0)[:, None]
    return PoseSeries(
        time=time,
        position=np.stack([speed * time, zero, zero], axis=1),
        quaternion=signs * np.stack([np.cos(half), zero, zero, np.sin(half)], axis=1),
        joints=time[:, None],
    )


def test_between_rows_a_motion_goes_straight_and_turns_the_short_way():
    found = turning(np.arange(11) / 10.0).at(np.array([0.0, 0.25, 1.0]))
    np.testing.assert_allclose(found.position[:, 0], [0.0, 0.5, 2.0])
    np.testing.assert_allclose(found.joints[:, 0], [0.0, 0.25, 1.0])
    np.testing.assert_allclose(np.abs(found.quaternion[1]), [math.cos(0.1), 0.0, 0.0, math.sin(0.1)], atol=1e-6)


def test_outside_and_between_joined_motions_nothing_is_known():
    joined = join_motions([turning([0.0, 1.0]), turning([1.0, 2.0], speed=5.0), turning([3.0, 4.0])])
    found = joined.at(np.array([-0.1, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.9, 4.1])).position[:, 0]
    np.testing.assert_allclose(found, [np.nan, 1.0, 5.0, 7.5, np.nan, np.nan, 6.0, 7.8, np.nan])


def test_a_motion_of_one_row_is_known_at_its_time_alone():
    found = turning([0.5]).at(np.array([0.4, 0.5, 0.6]))
    np.testing.assert_allclose(found.position[:, 0], [np.nan, 1.0, np.nan])
    np.testing.assert_allclose(found.joints[:, 0], [np.nan, 0.5, np.nan])
    np.testing.assert_allclose(found.quaternion[1], [math.cos(0.2), 0.0, 0.0, math.sin(0.2)])


def test_distance_and_angle_are_those_of_geometry_whatever_the_sign():
    one, other = turning([0.0, 1.0, 2.0]), turning([0.0, 1.0, 2.0], rate=-0.4, speed=1.5)
    apart, angle = distance_between(one, other)
    np.testing.assert_allclose(apart, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(angle, [0.0, 1.2, 2.4], atol=1e-7)


def test_the_angle_between_equal_attitudes_is_none_however_they_are_rounded():
    """Products of unit quaternions with themselves are by rounding above 1 in some rows and below in others."""
    rows = np.random.default_rng(0).normal(size=(200, 4))
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    assert ((rows**2).sum(axis=1) > 1.0).any()
    seen = PoseSeries(time=np.arange(200.0), position=np.zeros((200, 3)), quaternion=rows, joints=np.zeros((200, 0)))
    assert distance_between(seen, seen)[1].max() < 1e-7


def flight_of(**channels):
    made = {
        name: Channel(time=np.asarray(time, dtype=float), values=np.asarray(values, dtype=float), source=name)
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
    pose = {"position": (seen.time, seen.position), "quaternion": (seen.time, seen.quaternion)}
    with pytest.raises(ValueError, match="joint_positions: 1 columns, vehicle 'hummingbird_arm2' has 2 joints"):
        measured_motion(
            flight_of(**pose, joint_positions=(seen.time, seen.joints)), skyarm.load_vehicle("hummingbird_arm2")
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
    given = flight_of(joint_positions=(seen.time, angles), joint_efforts=(seen.time, angles[:, :2]))

    def named(channel, order):
        channel = dataclasses.replace(given[channel], names=tuple(order))
        return joints_in_order(given.with_channels({channel.source: channel}), vehicle)

    found = named("joint_positions", [names[1], "gripper", names[0]])["joint_positions"]
    np.testing.assert_array_equal(found.values, angles[:, [2, 0]])
    assert found.names == tuple(names)
    assert named("joint_efforts", names[::-1])["joint_efforts"].values.tolist() == angles[:, [1, 0]].tolist()
    kept = named("joint_positions", [names[1], "gripper", "other"])["joint_positions"]
    np.testing.assert_array_equal(kept.values, angles)
    np.testing.assert_array_equal(joints_in_order(given, vehicle)["joint_positions"].values, angles)
