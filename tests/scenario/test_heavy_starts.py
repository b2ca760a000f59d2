"""A truth too heavy to hover starts with its rotors at full speed, another at the
speeds that hold it.
"""

from __future__ import annotations

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.plant.interface import Truth
from skyarm.scenario.scenario_record import trimmed_state

VEHICLE = skyarm.load_vehicle("hummingbird_arm2_rotors")
TOP = float(VEHICLE.rotors[0].max_speed)


@pytest.mark.parametrize(
    ("payload", "full"), [(0.0, False), (0.2, False), (20.0, True)]
)
def test_no_rotor_starts_faster_than_it_can_turn(payload, full):
    vehicle = VEHICLE.with_payload(payload) if payload else VEHICLE
    state = trimmed_state(Truth(vehicle=vehicle), Vec3(0.0, 0.0, 1.0), 0.0, (0.0, 0.0))
    speeds = np.array([float(speed) for speed in state.rotor_speeds])
    assert (speeds <= TOP).all()
    if full:
        assert (speeds == TOP).all()
    else:
        thrust = sum(
            float(rotor.thrust_coefficient) * w**2
            for rotor, w in zip(vehicle.rotors, speeds, strict=True)
        )
        assert thrust == pytest.approx(float(vehicle.mass) * 9.81, rel=1e-9)
