"""The mixer that keeps the thrust before the yaw torque: two linear programs in a row
as oracle.
"""

from __future__ import annotations

import numpy as np
import pytest
from rotor_layouts import HIGHEST, K_F, K_M, LAYOUTS
from scipy.optimize import linprog

from skyarm.algebra import Vec3
from skyarm.dynamics.actuators import allocation_matrix, make_mixer, mix
from skyarm.dynamics.actuators import mixer as yaw_room

TOP = HIGHEST**2
RNG = np.random.default_rng(11)


def wrench(vehicle, speeds):
    A = np.array([[float(v) for v in row] for row in allocation_matrix(vehicle)])
    return A @ np.square(speeds)


def kept(vehicle, torque, thrust, slack=0.0):
    mixer = make_mixer(vehicle, "thrust_before_yaw", yaw_slack=slack)
    speeds, _ = mix(mixer, Vec3(*map(float, torque)), float(thrust))
    return wrench(vehicle, np.array(speeds))


def programs(vehicle, torque, thrust, slack):
    """Thrust nearest to the wanted one, then the nearest yaw torque, roll and pitch
    held; None if that is too much.
    """
    inverse = np.array([[float(v) for v in row] for row in make_mixer(vehicle).inverse])
    fixed, p, y = inverse[:, :2] @ torque[:2], inverse[:, 3], inverse[:, 2]
    yaw = (min(0.0, torque[2] - slack), max(0.0, torque[2] + slack))
    # variables: thrust, yaw torque, distance of the thrust, of the yaw torque
    rooms = np.r_[np.c_[p, y, 0 * p, 0 * p], np.c_[-p, -y, 0 * p, 0 * p]]
    sides = np.r_[TOP - fixed, fixed]
    apart = [[1, 0, -1, 0], [-1, 0, -1, 0], [0, 1, 0, -1], [0, -1, 0, -1]]
    A, b = np.r_[rooms, apart], np.r_[sides, thrust, -thrust, torque[2], -torque[2]]
    free = [(None, None), yaw, (0, None), (0, None)]
    first = linprog([0, 0, 1, 0], A_ub=A, b_ub=b, bounds=free)
    if not first.success:
        return None
    nearest = linprog(
        [0, 0, 0, 1],
        A_ub=np.r_[A, [[0, 0, 1, 0]]],
        b_ub=np.r_[b, first.x[2] + 1e-12],
        bounds=free,
    )
    return nearest.x[:2]


@pytest.mark.parametrize("name", sorted(LAYOUTS))
@pytest.mark.parametrize("slack", [0.0, 0.05])
def test_thrust_then_yaw_are_as_near_as_linear_programs_find(name, slack):
    vehicle = LAYOUTS[name]
    flown = 0
    for _ in range(25):
        torque = RNG.normal(size=3) * [0.5, 0.5, 0.1]
        thrust = RNG.uniform(0.5, 4.0 * K_F * TOP)
        best = programs(vehicle, torque, thrust, slack)
        # roll and pitch alone are too much: their share is the other mixer's test
        if best is None:
            continue
        found = kept(vehicle, torque, thrust, slack)
        assert found[:2] == pytest.approx(torque[:2], abs=1e-7)
        assert (found[3], found[2]) == pytest.approx((best[0], best[1]), abs=1e-6)
        flown += 1
    assert flown > 8


def test_yaw_torque_makes_room_where_roll_takes_a_rotor_to_zero():
    """Roll of 0.8 N m takes its pair to 4.7 N in all; the other pair would have to give
    as much for no yaw torque.
    """
    quad = LAYOUTS["hummingbird"]
    before = wrench(
        quad, np.array(mix(make_mixer(quad, "priority"), Vec3(0.8, 0.0, 0.0), 8.0)[0])
    )
    assert before[3] == pytest.approx(2.0 * 0.8 / 0.17, rel=1e-6)
    found = kept(quad, (0.8, 0.0, 0.0), 8.0, slack=1.0)
    assert found[3] == pytest.approx(8.0)
    assert abs(found[2]) == pytest.approx(K_M * (2.0 * 0.8 / 0.17 - 8.0), rel=1e-6)
    # without slack no yaw torque may be given up beyond what is wanted
    assert kept(quad, (0.8, 0.0, 0.0), 8.0)[3] == pytest.approx(before[3])
    # a wanted yaw torque that is given up makes its own room
    sign = np.sign(found[2])
    assert kept(quad, (0.8, 0.0, -sign * 0.01), 8.0, slack=0.0)[3] == pytest.approx(
        before[3]
    )
    assert kept(quad, (0.8, 0.0, sign * 1.0), 8.0, slack=0.0)[3] == pytest.approx(8.0)


def test_within_the_limits_nothing_is_touched():
    for vehicle in LAYOUTS.values():
        found = kept(vehicle, (0.05, -0.04, 0.005), 9.0, slack=0.1)
        np.testing.assert_allclose(found, [0.05, -0.04, 0.005, 9.0], rtol=1e-9)


def test_a_rotor_that_gives_no_yaw_torque_bounds_the_thrust_alone():
    """Its bound of the thrust stands, 0 <= 0.2 + 0.1 f <= 1, whatever the other rotor's
    yaw torque makes room for.
    """
    bounds = yaw_room.yaw_bounds(
        [0.2, 0.5], [0.1, 0.1], [0.0, 5.0], [1.0, 1.0], 0.0, 1.0
    )
    for wanted, nearest in ((20.0, 8.0), (-7.0, -2.0), (3.0, 3.0)):
        assert yaw_room.nearest_thrust(bounds, wanted) == pytest.approx(
            nearest, rel=1e-6
        )
