"""The launch stand: weight at rest, one-sided push, grip by its share, torque by
SciPy's rotations.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm import load_vehicle
from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.records.coerce import RecordError
from skyarm.world.launch_stand import LaunchStand

MASS, INERTIA, GRAVITY, W = 2.0, 0.01, 9.81, 30.0
STAND = LaunchStand(
    place=Vec3(1.0, 2.0, 3.0),
    yaw=0.5,
    mass=MASS,
    inertia=INERTIA,
    gravity=GRAVITY,
    frequency=W,
)
TOP = np.array([1.0, 2.0, 3.0])
LOW = 3.0 - GRAVITY / W**2
HELD = Rotation.from_euler("z", 0.5)


def pushed(
    position: object,
    velocity: object = (0.0, 0.0, 0.0),
    attitude: Rotation = HELD,
    rate: object = (0.0, 0.0, 0.0),
    sign: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Force and torque of the stand, world axes."""
    x, y, z, w = (sign * attitude.as_quat(canonical=True)).tolist()
    state = State(
        position=Vec3(*position),
        quaternion=Quaternion(w, x, y, z),
        velocity=Vec3(*velocity),
        rate=Vec3(*rate),
        joints=(),
        joint_rates=(),
        rotor_speeds=(),
    )
    (wrench,) = STAND.wrenches(
        (), 0.0, PointMotion(load_vehicle("hummingbird"), state), ()
    )
    return np.array([*map(float, wrench.force_W)]), np.array(
        [*map(float, wrench.torque_W)]
    )


def test_the_stand_carries_the_weight_where_the_vehicle_rests() -> None:
    assert tuple(map(float, STAND.rest)) == pytest.approx((1.0, 2.0, LOW), abs=1e-15)
    force, torque = pushed((1.0, 2.0, LOW))
    np.testing.assert_allclose(force, [0.0, 0.0, MASS * GRAVITY], atol=1e-9)
    np.testing.assert_allclose(torque, 0.0, atol=1e-12)


def test_the_stand_only_pushes_up_and_lets_go_above() -> None:
    for position, velocity in (
        ((1.1, 2.0, 3.0001), (1, 1, -5)),
        ((1.0, 2.0, 2.9999), (0, 0, 5.0)),
    ):
        force, torque = pushed(position, velocity, Rotation.identity())
        assert not force.any()
        assert not torque.any()


@pytest.mark.parametrize("seed", range(6))
def test_the_push_is_a_critically_damped_spring_and_the_grip_its_share_of_the_weight(
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    gap, velocity = rng.uniform(-0.02, 0.0, 3), rng.uniform(-0.1, 0.02, 3)
    gap[:2] *= rng.choice([-1.0, 1.0], 2)
    turn, rate = (
        Rotation.from_rotvec(rng.uniform(-0.01, 0.01, 3)),
        rng.uniform(-0.3, 0.3, 3),
    )
    force, torque = pushed(TOP + gap, velocity, HELD * turn, rate)
    lift = -(W**2) * gap - 2.0 * W * velocity
    share = min(max(lift[2], 0.0) / GRAVITY, 1.0)
    np.testing.assert_allclose(
        force,
        MASS * np.array([share, share, 1.0]) * np.array([*lift[:2], max(lift[2], 0.0)]),
    )
    # in base axes, for a turn so small that twice the vector part of its quaternion is
    # its rotation vector
    grip = -share * INERTIA * (W**2 * turn.as_rotvec() + 2.0 * W * rate)
    np.testing.assert_allclose(torque, (HELD * turn).apply(grip), rtol=1e-4, atol=1e-9)


def test_half_the_weight_has_half_the_grip() -> None:
    half = 3.0 - 0.5 * GRAVITY / W**2
    assert pushed((1.01, 2.0, half))[0][0] == pytest.approx(-MASS * 0.5 * W**2 * 0.01)
    deep = pushed((1.01, 2.0, 3.0 - 3.0 * GRAVITY / W**2))[0]
    assert deep[0] == pytest.approx(-MASS * W**2 * 0.01)
    assert deep[2] == pytest.approx(3.0 * MASS * GRAVITY)


def test_both_quaternions_of_an_attitude_are_held_and_return_alike() -> None:
    for angle in (0.4, -2.5, 3.0):
        turned = HELD * Rotation.from_euler("z", angle)
        one, other = (
            pushed((1.0, 2.0, LOW), attitude=turned, sign=sign)[1]
            for sign in (1.0, -1.0)
        )
        np.testing.assert_allclose(one, other, atol=1e-12)
        assert one[2] == pytest.approx(-INERTIA * W**2 * 2.0 * math.sin(0.5 * angle))


def test_a_step_is_half_a_radian_of_its_own_motion() -> None:
    assert STAND.largest_step == pytest.approx(0.5 / W)


@pytest.mark.parametrize("field", ["mass", "inertia", "frequency", "gravity"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_a_stand_that_cannot_be_is_refused(field: str, value: float) -> None:
    given = {"mass": 1.0, "inertia": 0.01, field: value}
    with pytest.raises(
        RecordError, match=rf"launch_stand\.{field} = {value}"
    ) as refused:
        LaunchStand(place=Vec3(0.0, 0.0, 0.0), **given)
    assert "\n" not in str(refused.value)
