"""Motions between their rows, at their gaps, and distances between two."""

from __future__ import annotations

import math

import numpy as np

from skyarm.log.motion import PoseSeries, distance_between, join_motions
from support.flights import turning


def test_between_rows_a_motion_goes_straight_and_turns_the_short_way():
    found = turning(np.arange(11) / 10.0).at(np.array([0.0, 0.25, 1.0]))
    np.testing.assert_allclose(found.position[:, 0], [0.0, 0.5, 2.0])
    np.testing.assert_allclose(found.joints[:, 0], [0.0, 0.25, 1.0])
    np.testing.assert_allclose(
        np.abs(found.quaternion[1]), [math.cos(0.1), 0.0, 0.0, math.sin(0.1)], atol=1e-6
    )


def test_outside_and_between_joined_motions_nothing_is_known():
    joined = join_motions(
        [turning([0.0, 1.0]), turning([1.0, 2.0], speed=5.0), turning([3.0, 4.0])]
    )
    found = joined.at(
        np.array([-0.1, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.9, 4.1])
    ).position[:, 0]
    np.testing.assert_allclose(
        found, [np.nan, 1.0, 5.0, 7.5, np.nan, np.nan, 6.0, 7.8, np.nan]
    )


def test_a_motion_of_one_row_is_known_at_its_time_alone():
    found = turning([0.5]).at(np.array([0.4, 0.5, 0.6]))
    np.testing.assert_allclose(found.position[:, 0], [np.nan, 1.0, np.nan])
    np.testing.assert_allclose(found.joints[:, 0], [np.nan, 0.5, np.nan])
    np.testing.assert_allclose(
        found.quaternion[1], [math.cos(0.2), 0.0, 0.0, math.sin(0.2)]
    )


def test_distance_and_angle_are_those_of_geometry_whatever_the_sign():
    one, other = (
        turning([0.0, 1.0, 2.0]),
        turning([0.0, 1.0, 2.0], rate=-0.4, speed=1.5),
    )
    apart, angle = distance_between(one, other)
    np.testing.assert_allclose(apart, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(angle, [0.0, 1.2, 2.4], atol=1e-7)


def test_the_angle_between_equal_attitudes_is_none_however_they_are_rounded():
    """Products of unit quaternions with themselves are by rounding above 1 in some rows
    and below in others.
    """
    rows = np.random.default_rng(0).normal(size=(200, 4))
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    assert ((rows**2).sum(axis=1) > 1.0).any()
    seen = PoseSeries(
        time=np.arange(200.0),
        position=np.zeros((200, 3)),
        quaternion=rows,
        joints=np.zeros((200, 0)),
    )
    assert distance_between(seen, seen)[1].max() < 1e-7
