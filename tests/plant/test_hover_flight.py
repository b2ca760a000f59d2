"""A trimmed hover stays where it is: mixer, rotors, loads and both plants must agree on
every sign.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from skyarm.dynamics.actuators.hover import highest_thrust, hover_trim
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth, flat
from skyarm.plant.mujoco import MujocoPlant
from support.vehicles import hovering, hummingbird_arm, steady_wind

G = 9.8


def test_the_hover_speed_with_a_hanging_arm_is_that_of_the_spec():
    trim = hover_trim(hummingbird_arm(), (0.0, 0.0), G)
    assert trim.speeds == pytest.approx([485.08] * 4, abs=0.01)
    assert trim.thrust == pytest.approx(0.82103 * G, rel=1e-12)
    assert trim.efforts == pytest.approx((0.0, 0.0), abs=1e-15)


def test_the_highest_thrust_is_24_newtons():
    assert highest_thrust(hummingbird_arm()) == pytest.approx(24.01, abs=0.005)


def test_holding_torques_of_a_raised_arm_by_hand():
    """Both links along -x, 0.15 m long, their centres of mass in the middle: levers of
    0.075 m and 0.225 m.
    """
    trim = hover_trim(hummingbird_arm(), (math.pi / 2.0, 0.0), G)
    weight = 0.045 * G
    # positive rotation moves the tip to -x; gravity pulls it back down, so holding
    # takes a positive torque
    assert trim.efforts == pytest.approx(
        (weight * 0.075 + weight * 0.225, weight * 0.075), rel=1e-12
    )
    # the raised arm's weight tips the nose up (negative pitch); the rotor behind must
    # lift more
    assert trim.speeds[2] > trim.speeds[1] > trim.speeds[0]


@pytest.mark.parametrize("joints", [(0.0, 0.0), (0.4, -0.7), (1.2, 0.5)])
@pytest.mark.parametrize("kind", [RigidBodyPlant, MujocoPlant])
def test_a_trimmed_hover_stays_for_a_tenth_of_a_second(kind, joints):
    vehicle = hummingbird_arm()
    trim = hover_trim(vehicle, joints, G)
    start = replace(
        hovering(vehicle),
        joints=joints,
        joint_rates=(0.0, 0.0),
        rotor_speeds=tuple(float(s) for s in trim.speeds),
    )
    plant = kind(Truth(vehicle=vehicle, gravity=G), steady_wind())
    x = flat(start)
    for _ in range(20):
        x = plant.advance(x, (*trim.speeds, *trim.efforts), (), 0.005)
    # an unstable equilibrium: rounding of the trim grows little in so short a time
    np.testing.assert_allclose(x, flat(start), rtol=0.0, atol=1e-11)
