"""Largest distance of the tip from the arm's first joint."""

import pytest

import skyarm
from skyarm.dynamics.workspace import reach


@pytest.mark.parametrize(
    ("name", "length"),
    [("hummingbird", 0.0), ("hummingbird_arm2", 0.3), ("hexarotor_arm6", 0.625)],
)
def test_a_stretched_arm_is_its_reach(name, length):
    assert reach(skyarm.load_vehicle(name)) == pytest.approx(length, abs=1e-9)
