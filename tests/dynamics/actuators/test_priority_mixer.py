"""The mixer that keeps roll and pitch, then thrust, then yaw: hand numbers, and linear
programs as oracle.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rotor_layouts import (
    ARM,
    HIGHEST,
    K_F,
    K_M,
    LAYOUTS,
    hummingbird_rotor,
    layout,
    ring,
)

from skyarm.algebra import Vec3
from skyarm.dynamics.actuators import (
    AllocationError,
    allocation_matrix,
    make_mixer,
    mix,
)
from skyarm.dynamics.actuators.mixer import _largest_share
from skyarm.vehicle.vehicle_records import Vehicle

TOP = HIGHEST**2
FULL = 4.0 * K_F * TOP
"""N, all four rotors at their highest speed: 24.01."""
# rounding of a dozen operations on numbers of the size of the full command
TOLERANCE = 1e-9


def wrench(vehicle, speeds):
    A = np.array([[float(v) for v in row] for row in allocation_matrix(vehicle)])
    return A @ np.square(speeds)


def priority(vehicle, torque, thrust):
    speeds, raw = mix(
        make_mixer(vehicle, "priority"), Vec3(*map(float, torque)), float(thrust)
    )
    return np.array(speeds), np.array(raw)


def test_a_feasible_command_is_not_touched():
    for vehicle in LAYOUTS.values():
        speeds, raw = priority(vehicle, (0.05, -0.04, 0.005), 9.0)
        assert raw.min() > 0.0
        assert raw.max() < TOP
        np.testing.assert_allclose(np.square(speeds), raw, rtol=1e-12)


def test_only_yaw_gives_way_when_only_yaw_saturates():
    quad = LAYOUTS["hummingbird"]
    # with 22 N of 24.01 a rotor has 0.5 N left; yaw per newton of a rotor is 0.016,
    # over four rotors
    speeds, raw = priority(quad, (0.0, 0.0, 1.0), 22.0)
    assert raw.max() > TOP
    left = (FULL - 22.0) / 4.0
    np.testing.assert_allclose(
        wrench(quad, speeds), [0.0, 0.0, 4.0 * K_M * left, 22.0], atol=TOLERANCE
    )
    # the same at the floor, and with the other sign
    speeds, _ = priority(quad, (0.0, 0.0, -1.0), 2.0)
    np.testing.assert_allclose(
        wrench(quad, speeds), [0.0, 0.0, -4.0 * K_M * 0.5, 2.0], atol=TOLERANCE
    )


def test_roll_and_pitch_are_kept_beside_a_saturated_yaw():
    quad = LAYOUTS["hummingbird"]
    speeds, _ = priority(quad, (0.2, -0.1, 3.0), 12.0)
    tx, ty, tz, thrust = wrench(quad, speeds)
    assert (tx, ty, thrust) == pytest.approx((0.2, -0.1, 12.0), abs=TOLERANCE)
    assert 0.0 < tz < 3.0


def test_thrust_gives_way_to_roll_at_the_ceiling():
    quad = LAYOUTS["hummingbird"]
    # a roll of 0.34 N m is 1 N more on the left and 1 N less on the right: thrust must
    # leave 1 N a rotor the left rotor, at its limit, turns ccw: yaw to the right would
    # need more of it
    speeds, _ = priority(quad, (2.0 * ARM, 0.0, -0.2), 24.0)
    np.testing.assert_allclose(
        wrench(quad, speeds), [2.0 * ARM, 0.0, 0.0, FULL - 4.0], atol=TOLERANCE
    )
    assert max(speeds) == pytest.approx(HIGHEST, rel=1e-12)


def test_thrust_rises_for_roll_at_the_floor():
    quad = LAYOUTS["hummingbird"]
    speeds, _ = priority(quad, (2.0 * ARM, 0.0, 0.2), 1.0)
    np.testing.assert_allclose(
        wrench(quad, speeds), [2.0 * ARM, 0.0, 0.0, 4.0], atol=TOLERANCE
    )
    assert min(speeds) == pytest.approx(0.0, abs=1e-3)


def test_an_impossible_roll_and_pitch_keep_their_direction():
    quad = LAYOUTS["hummingbird"]
    speeds, _ = priority(quad, (6.0, 2.0, 1.0), 8.0)
    # the left rotor at its highest and the right one at rest
    tx = ARM * K_F * TOP
    np.testing.assert_allclose(wrench(quad, speeds)[:2], [tx, tx / 3.0], rtol=1e-9)
    assert wrench(quad, speeds)[3] == pytest.approx(FULL / 2.0, rel=1e-9)


def test_a_rotor_without_a_share_in_thrust_is_refused_by_name():
    tail = hummingbird_rotor(name="tail", position=Vec3(-0.5, 0, 0), axis=Vec3(0, 1, 0))
    quad = LAYOUTS["hummingbird"]
    helicopter = Vehicle(name="helicopter", base=quad.base, rotors=(*quad.rotors, tail))
    make_mixer(helicopter, "clip")
    with pytest.raises(
        AllocationError,
        match=r"vehicle 'helicopter': rotors\[tail\] takes .* must be positive",
    ):
        make_mixer(helicopter, "priority")


def test_rotors_without_a_ceiling_keep_every_torque():
    quad = LAYOUTS["hummingbird"]
    free = Vehicle(
        name="free",
        base=quad.base,
        rotors=tuple(
            hummingbird_rotor(
                name=r.name,
                position=r.position,
                direction=r.direction,
                max_speed=math.inf,
            )
            for r in quad.rotors
        ),
    )
    speeds, _ = priority(free, (6.0, 2.0, 0.0), 8.0)
    np.testing.assert_allclose(wrench(free, speeds)[:2], [6.0, 2.0], rtol=1e-12)


def largest_tilt_share(inverse, torque):
    """Linear program in (share, thrust)."""
    from scipy.optimize import linprog

    tilt = inverse[:, :2] @ np.array(torque[:2])
    rows = np.column_stack([tilt, inverse[:, 3]]) / TOP
    limits = np.concatenate([np.ones(len(rows)), np.zeros(len(rows))])
    found = linprog(
        [-1.0, 0.0],
        A_ub=np.vstack([rows, -rows]),
        b_ub=limits,
        bounds=[(0.0, 1.0), (None, None)],
    )
    assert found.success
    return found.x[0]


def nearest_thrust(inverse, tilt, thrust):
    """Linear program in (moved thrust, |distance|)."""
    from scipy.optimize import linprog

    rows = inverse[:, 3:] / TOP
    upper = np.vstack(
        [
            np.hstack([rows, 0 * rows]),
            np.hstack([-rows, 0 * rows]),
            [[1.0, -1.0], [-1.0, -1.0]],
        ]
    )
    slack = 1e-12  # the share above is exact to rounding only
    limits = np.concatenate(
        [1.0 - tilt / TOP + slack, tilt / TOP + slack, [thrust, -thrust]]
    )
    found = linprog(
        [0.0, 1.0], A_ub=upper, b_ub=limits, bounds=[(None, None), (0.0, None)]
    )
    assert found.success
    return found.x[0]


def largest_yaw_share(kept, yaw):
    from scipy.optimize import linprog

    slack = 1e-12
    upper = np.concatenate([yaw, -yaw])[:, None] / TOP
    limits = np.concatenate([1.0 - kept / TOP + slack, kept / TOP + slack])
    found = linprog([-1.0], A_ub=upper, b_ub=limits, bounds=[(0.0, 1.0)])
    assert found.success
    return found.x[0]


@settings(max_examples=120, deadline=None, derandomize=True)
@given(
    name=st.sampled_from(sorted(LAYOUTS)),
    roll=st.floats(-6.0, 6.0),
    pitch=st.floats(-6.0, 6.0),
    yaw=st.floats(-2.0, 2.0),
    thrust=st.floats(-5.0, 60.0),
)
def test_each_share_is_the_largest_there_is(name, roll, pitch, yaw, thrust):
    """One linear program a priority; a solver is exact to about 1e-9 of the limits."""
    vehicle = LAYOUTS[name]
    speeds, _ = priority(vehicle, (roll, pitch, yaw), thrust)
    assert speeds.min() >= 0.0
    assert speeds.max() <= HIGHEST
    inverse = np.linalg.pinv(
        np.array([[float(v) for v in row] for row in allocation_matrix(vehicle)])
    )
    share = largest_tilt_share(inverse, (roll, pitch))
    tx, ty, tz, fz = wrench(vehicle, speeds)
    assert (tx, ty) == pytest.approx((share * roll, share * pitch), abs=1e-7)
    tilt = share * (inverse[:, :2] @ np.array([roll, pitch]))
    held = nearest_thrust(inverse, tilt, thrust)
    assert fz == pytest.approx(held, abs=1e-6)
    # at the reached thrust, so that the solver's last digits are not amplified by a
    # steep limit
    kept = tilt + inverse[:, 3] * fz
    yaw_share = largest_yaw_share(kept, inverse[:, 2] * yaw)
    assert tz == pytest.approx(yaw_share * yaw, abs=1e-6)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    tx=st.floats(-6.0, 6.0),
    ty=st.floats(-6.0, 6.0),
    tz=st.floats(-2.0, 2.0),
    thrust=st.floats(-5.0, 60.0),
    step=st.floats(-1e-6, 1e-6),
)
def test_a_small_change_of_the_command_is_a_small_change_of_the_speeds(
    tx, ty, tz, thrust, step
):
    vehicle = LAYOUTS["lopsided"]
    a, _ = priority(vehicle, (tx, ty, tz), thrust)
    b, _ = priority(vehicle, (tx + step, ty - step, tz + step), thrust + step)
    # a yaw share moves at most by (change / largest possible yaw of the layout); 1e3
    # bounds that of this layout
    assert np.abs(np.square(a) - np.square(b)).max() / TOP <= 1e3 * abs(step) + 1e-9


@pytest.mark.parametrize("name", sorted(LAYOUTS))
def test_no_bit_of_a_speed_is_outside_its_limits(name):
    """Many saturated commands at once; 838 squared and its root are whole numbers, so
    the bound is exact.
    """
    rng = np.random.default_rng(14)
    torque = rng.uniform(-6.0, 6.0, size=(3, 20_000)) * [[1.0], [1.0], [0.3]]
    speeds, _ = mix(
        make_mixer(LAYOUTS[name], "priority"),
        Vec3(*torque),
        rng.uniform(-5.0, 60.0, size=20_000),
    )
    assert np.max(speeds) == HIGHEST
    assert np.min(speeds) == 0.0


def test_a_rotor_that_rounding_put_past_its_limit_cannot_turn_the_yaw_around():
    """One rotor 1e-10 past its limit whose own share in yaw is rounding too: no yaw,
    not a hundredfold one back.
    """
    assert _largest_share([1.0 + 1e-10, 0.5], [1e-12, 0.1], [1.0, 1.0]) == 0.0
    assert _largest_share([-1e-10, 0.5], [-1e-12, 0.1], [1.0, 1.0]) == 0.0


def test_tilted_rings_reach_full_rank():
    assert make_mixer(layout("x", ring(6, tilt=0.2)), "priority").policy == "priority"


def test_a_mirrored_demand_beyond_all_limits_is_mirrored_speeds():
    """Two pairs beside each other, arms of their own: no rounding decides where bounds
    of two rotors are parallel.
    """
    rows = [(0.2, 1), (0.15, -1)]
    places = [
        (turns * a * math.cos(0.7), side * a * math.sin(0.7), side * turns)
        for a, turns in rows
        for side in (1, -1)
    ]
    quad = layout("pairs", [(x, y, 0.0, turns, 0.0, 0.0) for x, y, turns in places])
    mixer, rng = (
        make_mixer(quad, "thrust_before_yaw", yaw_slack=0.02),
        np.random.default_rng(12),
    )
    for tx, ty, tz, thrust in (
        rng.normal(size=(300, 4)) * [3.0, 3.0, 0.5, 5.0] + [0.0, 0.0, 0.0, 12.0]
    ).tolist():
        here, _ = mix(mixer, Vec3(tx, ty, tz), thrust)
        there, _ = mix(mixer, Vec3(-tx, ty, -tz), thrust)
        np.testing.assert_allclose(
            np.square(here), np.square(there)[[1, 0, 3, 2]], atol=TOLERANCE * TOP
        )
