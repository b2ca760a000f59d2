"""Allocation of torque and thrust to rotor speeds: matrix, pseudo-inverse, RotorS's
clip, refused layouts.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from rotor_layouts import ARM, HIGHEST, HUMMINGBIRD, K_F, K_M, LAYOUTS, layout, ring

from skyarm.algebra import Vec3
from skyarm.compile import trace
from skyarm.dynamics.actuators import (
    AllocationError,
    allocation_matrix,
    make_mixer,
    mix,
)

# the spec prints eight or nine digits
PRINTED = 1e-7
J = (0.007, 0.007, 0.012)


def matrix(vehicle):
    return np.array([[float(v) for v in row] for row in allocation_matrix(vehicle)])


def inverse(vehicle):
    return np.array([[float(v) for v in row] for row in make_mixer(vehicle).inverse])


def test_the_hummingbird_matrix_is_that_of_rotors():
    expected = [
        [0.0, 1.4532586e-6, 0.0, -1.4532586e-6],
        [-1.4532586e-6, 0.0, 1.4532586e-6, 0.0],
        [1.3677728e-7, -1.3677728e-7, 1.3677728e-7, -1.3677728e-7],
        [8.54858e-6] * 4,
    ]
    np.testing.assert_allclose(matrix(HUMMINGBIRD), expected, rtol=PRINTED, atol=1e-21)


def test_the_hummingbird_inverse_times_inertia_is_that_of_rotors():
    a, b, c = 2408.38072, 21933.4673, 29244.6231
    expected = [[0.0, -a, b, c], [a, 0.0, -b, c], [0.0, a, b, c], [-a, 0.0, -b, c]]
    np.testing.assert_allclose(
        inverse(HUMMINGBIRD) * [*J, 1.0], expected, rtol=PRINTED, atol=1e-9
    )


@pytest.mark.parametrize("name", sorted(LAYOUTS))
def test_the_inverse_is_the_pseudo_inverse(name):
    vehicle = LAYOUTS[name]
    A, inv = matrix(vehicle), inverse(vehicle)
    # relative to the largest entry of each column; the normal equations square a
    # condition number of about 100
    expected = np.linalg.pinv(A)
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(inv / scale, expected / scale, rtol=0, atol=1e-11)
    np.testing.assert_allclose(A @ inv, np.eye(4), rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", sorted(LAYOUTS))
def test_the_matrix_is_force_and_moment_of_each_rotor(name):
    vehicle = LAYOUTS[name]
    for column, rotor in zip(matrix(vehicle).T, vehicle.rotors, strict=True):
        r, n = (
            np.array(tuple(rotor.position), float),
            np.array(tuple(rotor.axis), float),
        )
        torque = np.cross(r, K_F * n) - rotor.direction * K_M * K_F * n
        np.testing.assert_allclose(
            column, [*torque, K_F * n[2]], rtol=1e-13, atol=1e-20
        )


@pytest.mark.parametrize("name", sorted(LAYOUTS))
def test_mixed_speeds_make_the_wanted_torque_and_thrust(name):
    vehicle = LAYOUTS[name]
    wanted = np.array([0.02, -0.03, 0.004, 8.0])
    speeds, raw = mix(make_mixer(vehicle), Vec3(*wanted[:3].tolist()), float(wanted[3]))
    np.testing.assert_allclose(np.square(speeds), raw, rtol=1e-14)
    np.testing.assert_allclose(matrix(vehicle) @ np.square(speeds), wanted, rtol=1e-11)


def test_hover_speed_is_that_of_the_weight():
    speeds, _ = mix(make_mixer(HUMMINGBIRD), Vec3(0.0, 0.0, 0.0), 0.82103 * 9.8)
    assert speeds == pytest.approx([485.08] * 4, abs=0.005)


def test_a_roll_to_the_left_speeds_up_the_left_rotor_less_than_the_right_one():
    """Positive torque about x lifts +y (left), negative roll lifts the right."""
    speeds, _ = mix(make_mixer(HUMMINGBIRD), Vec3(0.05, 0.0, 0.0), 8.0)
    assert speeds[1] > speeds[0] > speeds[3]
    speeds, _ = mix(make_mixer(HUMMINGBIRD), Vec3(0.0, 0.05, 0.0), 8.0)
    assert speeds[2] > speeds[1] > speeds[0]
    speeds, _ = mix(make_mixer(HUMMINGBIRD), Vec3(0.0, 0.0, 0.01), 8.0)
    assert speeds[0] == pytest.approx(speeds[2])
    assert speeds[0] > speeds[1]


def test_the_clip_policy_has_a_floor_and_no_ceiling():
    mixer = make_mixer(HUMMINGBIRD, "clip")
    speeds, raw = mix(mixer, Vec3(2.0, 0.0, 0.0), 8.0)
    half = 2.0 / (2.0 * ARM * K_F)
    assert raw[1] == pytest.approx(8.0 / (4.0 * K_F) + half, rel=1e-12)
    assert raw[3] == pytest.approx(8.0 / (4.0 * K_F) - half, rel=1e-12)
    assert raw[3] < 0.0
    assert speeds[3] == 0.0
    assert speeds[1] == pytest.approx(math.sqrt(raw[1]), rel=1e-15)
    assert speeds[1] > HIGHEST


def test_zero_command_is_zero_speed():
    for policy in ("clip", "priority"):
        speeds, _ = mix(make_mixer(HUMMINGBIRD, policy), Vec3(0.0, 0.0, 0.0), 0.0)
        assert speeds == (0.0,) * 4


@pytest.mark.parametrize(
    ("rotors", "rank"),
    [
        ([], 0),
        ([(x, 0.0, 0.0, s, 0.0, 0.0) for x, s in ((-0.2, 1), (0.0, -1), (0.2, 1))], 3),
        (
            [
                (x, y, 0.0, 1, 0.0, 0.0)
                for x, y in ((0.2, 0.0), (0.0, 0.2), (-0.2, 0.0), (0.0, -0.2))
            ],
            3,
        ),
        ([(0.0, 0.0, 0.0, 1, 0.0, 0.0)], 1),
    ],
    ids=["none", "three in line", "all ccw", "one"],
)
def test_a_layout_without_full_rank_is_refused_by_name(rotors, rank):
    with pytest.raises(
        AllocationError,
        match=rf"vehicle 'poor': allocation of {len(rotors)} rotors has rank {rank}: ",
    ):
        make_mixer(layout("poor", rotors))


def test_an_unknown_policy_lists_the_policies():
    with pytest.raises(
        AllocationError,
        match=(
            r"mixer policy = 'fair': must be one of \['clip', 'priority',"
            r" 'thrust_before_yaw'\]"
        ),
    ):
        make_mixer(HUMMINGBIRD, "fair")


@pytest.mark.parametrize("policy", ["clip", "priority", "thrust_before_yaw"])
def test_a_batch_is_a_loop_of_singles(policy):
    mixer = make_mixer(LAYOUTS["lopsided"], policy)
    rng = np.random.default_rng(3)
    torques, thrusts = (
        rng.normal(size=(64, 3)) * [1.0, 1.0, 0.1],
        rng.uniform(-2.0, 30.0, size=64),
    )
    speeds, _ = mix(mixer, Vec3(*torques.T), thrusts)
    for lane in range(64):
        single, _ = mix(mixer, Vec3(*torques[lane].tolist()), float(thrusts[lane]))
        # NumPy's sqrt and ours are both correctly rounded; nothing else differs
        np.testing.assert_array_equal([s[lane] for s in speeds], single)


@pytest.mark.parametrize("policy", ["clip", "priority", "thrust_before_yaw"])
def test_a_traced_mixer_gives_the_same_bits(policy):
    mixer = make_mixer(LAYOUTS["hexa"], policy)
    program = trace(
        lambda torque, thrust: mix(mixer, torque, thrust), Vec3(0.0, 0.0, 0.0), 0.0
    )
    for torque, thrust in (
        ((0.1, -0.2, 0.05), 9.0),
        ((3.0, 1.0, 1.0), 9.0),
        ((0.0, 0.0, 9.0), 40.0),
    ):
        assert program(Vec3(*torque), thrust) == mix(mixer, Vec3(*torque), thrust)


def test_nan_in_is_nan_out():
    """A limit must not hide a crash."""
    for policy in ("clip", "priority"):
        speeds, _ = mix(
            make_mixer(LAYOUTS["hexa"], policy), Vec3(math.nan, 0.0, 0.0), 8.0
        )
        assert any(math.isnan(speed) for speed in speeds)
        speeds, _ = mix(make_mixer(HUMMINGBIRD, policy), Vec3(0.0, 0.0, 0.0), math.nan)
        assert all(math.isnan(speed) for speed in speeds)


def test_the_ring_is_the_hummingbird_of_the_spec():
    """Front cw, left ccw, back cw, right ccw."""
    assert [(round(x, 12), round(y, 12), s) for x, y, _, s, _, _ in ring(4)] == [
        (0.17, 0.0, -1),
        (0.0, 0.17, 1),
        (-0.17, 0.0, -1),
        (0.0, -0.17, 1),
    ]
