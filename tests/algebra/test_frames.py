"""Axes of messages in ours, by what the specifications of the messages say of examples,
and by SciPy's rotations.
"""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.frames import (
    continuous,
    of_euler_angles,
    to_base,
    to_our_attitude,
    to_our_axes,
    turn_vectors,
    unit_rows,
)

Rotation = pytest.importorskip("scipy.spatial.transform").Rotation
HALF = 0.5**0.5
FORWARD, LEFT, UP = Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0)
NORTH, EAST, WEST, ABOVE, BELOW = (
    [1, 0, 0],
    [0, -1, 0],
    [0, 1, 0],
    [0, 0, 1],
    [0, 0, -1],
)
HALF_TURN = np.diag([1.0, -1.0, -1.0])


def units(seed: int, count: int = 40) -> np.ndarray:
    q = np.random.default_rng(seed).normal(size=(count, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


@pytest.mark.parametrize(
    ("wire", "nose", "left", "up"),
    [
        # MAVLink: "a zero rotation would be expressed as (1 0 0 0)"
        ((1.0, 0.0, 0.0, 0.0), NORTH, WEST, ABOVE),
        # a quarter about down: clockwise from above
        ((HALF, 0.0, 0.0, HALF), EAST, NORTH, ABOVE),
        # about forward: the right side goes down
        ((HALF, HALF, 0.0, 0.0), NORTH, ABOVE, EAST),
        # about right: the nose goes up
        ((HALF, 0.0, HALF, 0.0), ABOVE, WEST, [-1, 0, 0]),
    ],
)
def test_an_attitude_of_px4_and_mavlink_is_w_x_y_z_from_frd_to_ned_axes(
    wire: tuple[float, ...], nose: list[int], left: list[int], up: list[int]
) -> None:
    """PX4's VehicleAttitude: Hamilton, w x y z, from FRD body to NED earth; MAVLink:
    Z-down, X-front, Y-right.
    """
    R = to_our_attitude(*wire).rotation()
    for axis, wanted in ((FORWARD, nose), (LEFT, left), (UP, up)):
        np.testing.assert_allclose([*R.apply(axis)], wanted, atol=1e-12)


def test_a_local_position_is_north_east_down() -> None:
    """MAVLink's LOCAL_POSITION_NED, PX4's VehicleLocalPosition: 3 m to the north, 2 m
    to the east, 5 m above ground.
    """
    north, east, down = 3.0, 2.0, -5.0
    assert [*to_our_axes(north, east, down)] == [3.0, -2.0, 5.0]
    assert [*to_our_axes(*to_our_axes(north, east, down))] == [north, east, down]


@pytest.mark.parametrize(("yaw", "nose"), [(0.0, [1, 0, 0]), (0.5 * np.pi, [0, 1, 0])])
def test_an_attitude_of_ros_stays(yaw: float, nose: list[int]) -> None:
    """REP 103: x forward, y left, z up; x east, y north, z up; yaw is 0 to the east and
    grows counter-clockwise.
    """
    x, y, z, w = Rotation.from_euler("z", yaw).as_quat()
    R = to_our_attitude(w, x, y, z, "FLU", "z up").rotation()
    np.testing.assert_allclose([*R.apply(FORWARD)], nose, atol=1e-12)
    np.testing.assert_allclose([*R.apply(UP)], ABOVE, atol=1e-12)


@pytest.mark.parametrize("frame", ["FLU", "FRD"])
@pytest.mark.parametrize("world", ["z up", "NED"])
def test_axes_of_base_and_world_turn_by_themselves(frame: str, world: str) -> None:
    wire = units(1)
    found = np.stack([*to_our_attitude(*wire.T, frame, world)], axis=1)
    given = Rotation.from_quat(wire[:, [1, 2, 3, 0]]).as_matrix()
    before, after = (
        HALF_TURN if world == "NED" else np.eye(3),
        (HALF_TURN if frame == "FRD" else np.eye(3)),
    )
    turned = Rotation.from_quat(found[:, [1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(turned, before @ given @ after, atol=1e-12)


def test_an_attitude_of_the_wire_returns_to_itself() -> None:
    wire = units(2)
    once = to_our_attitude(*wire.T)
    np.testing.assert_array_equal(np.stack([*to_our_attitude(*once)], axis=1), wire)


def test_euler_angles_turn_by_yaw_then_pitch_then_roll() -> None:
    angles = np.random.default_rng(3).uniform(-3, 3, (40, 3))
    found = np.stack([*of_euler_angles(*angles.T)], axis=1)[:, [1, 2, 3, 0]]
    wanted = Rotation.from_euler("ZYX", angles[:, ::-1])
    np.testing.assert_allclose(
        Rotation.from_quat(found).as_matrix(), wanted.as_matrix(), atol=1e-12
    )


def test_rows_of_unit_length_keep_their_directions() -> None:
    rows = np.random.default_rng(5).normal(size=(40, 4))
    np.testing.assert_allclose(
        Rotation.from_quat(rows).as_quat(), unit_rows(rows), atol=1e-12
    )
    np.testing.assert_array_equal(
        unit_rows(np.array([[3.0, 0.0, -4.0]])), [[0.6, 0.0, -0.8]]
    )


def test_the_conjugate_is_the_inverse_rotation() -> None:
    q = units(6)
    found = np.stack([*Quaternion(*q.T).conjugate()], axis=1)
    wanted = Rotation.from_quat(q[:, [1, 2, 3, 0]]).inv().as_matrix()
    np.testing.assert_allclose(
        Rotation.from_quat(found[:, [1, 2, 3, 0]]).as_matrix(), wanted, atol=1e-12
    )


def test_vectors_turn_into_the_world_and_back() -> None:
    q, v = units(4), np.random.default_rng(4).normal(size=(40, 3))
    turned = turn_vectors(q, v)
    np.testing.assert_allclose(
        turned, Rotation.from_quat(q[:, [1, 2, 3, 0]]).apply(v), atol=1e-12
    )
    np.testing.assert_allclose(to_base(q, turned), v, atol=1e-12)
    assert isinstance(to_our_attitude(*q.T), Quaternion)


def test_a_turn_that_is_written_with_either_sign_has_those_of_one_without_jumps() -> (
    None
):
    """Two turns about an oblique axis, whose quaternion cos(a / 2), n sin(a / 2) passes
    through all signs.
    """
    half, n = np.linspace(0.0, 2.0 * np.pi, 60)[:, None], np.array([0.6, -0.48, -0.64])
    steady = np.hstack([np.cos(half), n * np.sin(half)])
    jumping = steady * np.random.default_rng(5).choice([-1.0, 1.0], (60, 1))
    np.testing.assert_array_equal(
        continuous(jumping), steady * np.sign(jumping[0] @ steady[0])
    )
