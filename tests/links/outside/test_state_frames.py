"""Axes of the wire and ours, and the world of a scenario in an autopilot's local
frame.
"""

import math

import numpy as np
import pytest

from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.frames import to_our_attitude, to_our_axes
from skyarm.control.blocks.geometric import yaw_of
from skyarm.links.joint_port import JointReading
from skyarm.links.outside.state_frames import AutopilotState, WorldFrame

FLIP = np.diag([1.0, -1.0, -1.0])
ARM = JointReading(0.0, (0.1, 0.2), (0.3, 0.4))


def matrix(q):
    return np.array([[float(c) for c in row] for row in q.rotation().rows])


def state(seed, **changes):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=4)
    words = {
        "time": 3.0,
        "position": Vec3(*rng.normal(size=3).tolist()),
        "quaternion": Quaternion(*(q / np.linalg.norm(q)).tolist()),
        "velocity": Vec3(*rng.normal(size=3).tolist()),
        "rate": Vec3(*rng.normal(size=3).tolist()),
    }
    return AutopilotState(**words | changes)


def test_an_attitude_of_the_wire_turns_our_vectors_alike():
    rng = np.random.default_rng(1)
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    wire = matrix(Quaternion(*q.tolist()))
    assert matrix(to_our_attitude(*q)) == pytest.approx(FLIP @ wire @ FLIP, abs=1e-12)
    assert [*to_our_axes(1.0, 2.0, 3.0)] == [1.0, -2.0, -3.0]
    assert [*to_our_attitude(*to_our_attitude(*q))] == pytest.approx(q.tolist())


def test_a_scenario_begins_where_the_vehicle_is():
    at = state(2)
    frame = WorldFrame.at_start(at, (1.0, 2.0, 3.0), 0.4)
    seen = frame.measurement(at, ARM, 7.0)
    assert [*seen.position] == pytest.approx([1.0, 2.0, 3.0])
    assert yaw_of(seen.quaternion) == pytest.approx(0.4)
    assert (seen.time, seen.joints, seen.joint_rates) == (
        7.0,
        ARM.joints,
        ARM.joint_rates,
    )
    assert seen.rate == at.rate
    # the turn is about the vertical: the angle to it stays
    assert matrix(seen.quaternion)[2] == pytest.approx(
        matrix(at.quaternion)[2], abs=1e-12
    )


def test_motion_in_the_local_frame_turns_into_the_world():
    at = state(3)
    frame = WorldFrame.at_start(at, (0.0, 0.0, 0.0), 0.0)
    c, s = math.cos(frame.turn), math.sin(frame.turn)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    moved = state(3, position=at.position + Vec3(0.3, -0.2, 0.1))
    seen = frame.measurement(moved, ARM, 0.0)
    assert [*seen.position] == pytest.approx((R @ [0.3, -0.2, 0.1]).tolist())
    assert [*seen.velocity] == pytest.approx((R @ [*at.velocity]).tolist())
    assert matrix(seen.quaternion) == pytest.approx(
        R @ matrix(at.quaternion), abs=1e-12
    )


def test_the_local_frame_is_the_world_unless_it_is_moved():
    at = state(4)
    seen = WorldFrame().measurement(at, ARM, 0.0)
    assert seen.position == at.position
    assert [*seen.quaternion] == pytest.approx([*at.quaternion])


def test_no_specific_force_is_made_up_where_none_is_sent():
    """Three zeros are no reading to every law; gravity in their place would be a sensor
    that always agrees.
    """
    assert [*WorldFrame().measurement(state(5), ARM, 0.0).specific_force] == [
        0.0,
        0.0,
        0.0,
    ]
    told = state(5, specific_force=Vec3(1.0, 2.0, 3.0))
    assert [*WorldFrame().measurement(told, ARM, 0.0).specific_force] == [1.0, 2.0, 3.0]
