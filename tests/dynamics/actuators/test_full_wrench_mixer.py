"""Force across body z beside torque and thrust: exact where it fits, else the largest
share; programs as oracle.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from rotor_layouts import LAYOUTS, layout, ring
from scipy.optimize import linprog

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.actuators import AllocationError, make_mixer, mix

HEXA = skyarm.load_vehicle("tilted_hexarotor")
OCTO = layout("tilted_octo", ring(8, tilt=0.5))
VEHICLES = {"hexa": HEXA, "octo": OCTO}


def columns(vehicle):
    """Torque about the base origin and force of each rotor per squared speed, written
    out with NumPy.
    """
    found = []
    for rotor in vehicle.rotors:
        axis, at = (
            np.array([float(c) for c in v]) for v in (rotor.axis, rotor.position)
        )
        push = axis * float(rotor.thrust_coefficient)
        found.append(
            [
                *(
                    np.cross(at, push)
                    - rotor.direction * float(rotor.moment_coefficient) * push
                ),
                *push,
            ]
        )
    return np.array(found).T


def mixed(vehicle, torque, force):
    speeds, _ = mix(
        make_mixer(vehicle, "priority", sideways=True),
        Vec3(*torque),
        force[2],
        Vec3(force[0], force[1], 0),
    )
    return np.square(np.array(speeds, dtype=float))


@pytest.mark.parametrize("name", VEHICLES)
def test_torque_and_force_in_any_direction_are_given_exactly_where_they_fit(name):
    vehicle, rng = VEHICLES[name], np.random.default_rng(2)
    A, top = (
        columns(vehicle),
        np.array([float(r.max_speed) ** 2 for r in vehicle.rotors]),
    )
    tried = 0
    for _ in range(60):
        wrench = A @ (top * rng.uniform(0.05, 0.6, len(top)))
        least = np.linalg.pinv(A) @ wrench
        if least.min() > 0.0 and (least < top).all():
            tried += 1
            squares = mixed(vehicle, wrench[:3], wrench[3:])
            np.testing.assert_allclose(A @ squares, wrench, atol=1e-9)
            # of all squared speeds that give it those with the smallest sum of squares
            np.testing.assert_allclose(squares, least, rtol=1e-6)
    assert tried > 20


@pytest.mark.parametrize("name", VEHICLES)
def test_of_a_wish_too_large_torque_and_thrust_are_kept_and_a_share_of_the_rest(name):
    """The share from a linear program in one unknown; with six rotors nothing else
    reaches further that way.
    """
    vehicle, rng = VEHICLES[name], np.random.default_rng(3)
    A, top = (
        columns(vehicle),
        np.array([float(r.max_speed) ** 2 for r in vehicle.rotors]),
    )
    weight = 0.35 * (A @ top)[5]
    B = np.linalg.pinv(A)
    for _ in range(12):
        angle, torque = rng.uniform(0.0, 2.0 * math.pi), 0.02 * rng.normal(size=3)
        force = np.array(
            [100.0 * weight * math.cos(angle), 100.0 * weight * math.sin(angle), weight]
        )
        kept, side = (
            B @ [*torque, 0.0, 0.0, weight],
            B
            @ [
                0.0,
                0.0,
                0.0,
                *force[:2],
                0.0,
            ],
        )
        program = linprog(
            [-1.0],
            A_ub=np.array([*side, *-side])[:, None],
            b_ub=[*(top - kept), *kept],
            bounds=[(0, 1)],
        )
        given = A @ mixed(vehicle, torque, force)
        np.testing.assert_allclose(given[[0, 1, 2, 5]], [*torque, weight], atol=1e-8)
        np.testing.assert_allclose(given[3:5], force[:2] * program.x[0], atol=1e-6)
        if len(top) == 6:
            ahead = np.array([math.cos(angle), math.sin(angle)])
            equal = np.hstack([A * top, -np.array([[0.0, 0.0, 0.0, *ahead, 0.0]]).T])
            far = linprog(
                [*np.zeros(6), -1.0],
                A_eq=equal,
                b_eq=[*torque, 0.0, 0.0, weight],
                bounds=[*[(0.0, 1.0)] * 6, (0.0, None)],
            )
            assert np.linalg.norm(given[3:5]) == pytest.approx(far.x[-1], rel=1e-6)


def test_torque_goes_before_thrust_and_thrust_before_sideways_force():
    A = columns(HEXA)
    torque, force = (1.2, -0.8, 0.0), (3.0, 2.0, 1e4)
    given, upright = (
        A @ mixed(HEXA, torque, force),
        A @ mixed(HEXA, torque, (0.0, 0.0, 1e4)),
    )
    np.testing.assert_allclose(given[:2], torque[:2], atol=1e-9)
    np.testing.assert_allclose(given[[0, 1, 2, 5]], upright[[0, 1, 2, 5]], atol=1e-9)
    # of the sideways force the largest share in what is left
    kept, side = (
        mixed(HEXA, torque, (0.0, 0.0, 1e4)),
        np.linalg.pinv(A)
        @ [
            0.0,
            0.0,
            0.0,
            *force[:2],
            0.0,
        ],
    )
    program = linprog(
        [-1.0],
        A_ub=np.array([*side, *-side])[:, None],
        b_ub=[*(750.0**2 - kept), *kept],
    )
    assert 0.1 < program.x[0] < 0.9
    np.testing.assert_allclose(
        given[3:5], np.array(force[:2]) * program.x[0], atol=1e-6
    )
    assert (
        given[5]
        < 0.9 * 6.0 * float(HEXA.rotors[0].thrust_coefficient) * 750.0**2 * 0.8660254
    )


def test_a_force_across_may_be_what_makes_room_for_the_torque():
    A, rng, tried = columns(HEXA), np.random.default_rng(5), 0
    for _ in range(40):
        wrench = A @ (750.0**2 * rng.uniform(0.0, 0.5, 6))
        _, raw = mix(
            make_mixer(HEXA, "priority", sideways=True), Vec3(*wrench[:3]), wrench[5]
        )
        if min(raw) < -1e4:
            tried += 1
            np.testing.assert_allclose(
                A @ mixed(HEXA, wrench[:3], wrench[3:]), wrench, atol=1e-9
            )
    assert tried > 2


def test_without_a_force_across_none_is_given():
    """Of torques that least squares alone would buy with force across body z."""
    A = columns(OCTO)
    np.testing.assert_allclose(
        (A @ mixed(OCTO, (0.1, 0.05, 0.02), (0.0, 0.0, 9.0)))[3:5], 0.0, atol=1e-10
    )


def test_flat_rotors_are_refused_in_one_line():
    with pytest.raises(
        AllocationError,
        match=r"^vehicle 'hexa': allocation of 6 rotors has rank 4: must be 6; no ",
    ):
        make_mixer(LAYOUTS["hexa"], "priority", sideways=True)
