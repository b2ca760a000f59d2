"""Largest distance of the tip from the arm's first joint."""

from dataclasses import replace

import numpy as np
import pytest

import skyarm
from skyarm.dynamics.workspace import reach


@pytest.mark.parametrize(
    ("name", "length"),
    [("hummingbird", 0.0), ("hummingbird_arm2", 0.3), ("hexarotor_arm6", 0.625)],
)
def test_a_stretched_arm_is_its_reach(name, length):
    assert reach(skyarm.load_vehicle(name)) == pytest.approx(length, abs=1e-9)


def test_a_joint_whose_limits_lie_beyond_half_a_turn_has_a_reach():
    vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors")
    first, second = vehicle.links
    far = replace(second, joint=replace(second.joint, lower=3.5, upper=6.0))
    moved = replace(vehicle, links=(first, far))
    at = np.linspace(3.5, 6.0, 1001)
    # two links of 0.15 m, the second turned by the joint
    longest = np.max(np.hypot(0.15 + 0.15 * np.cos(at), 0.15 * np.sin(at)))
    assert reach(moved) == pytest.approx(longest, rel=1e-6)
