"""Arms of geared servos press with the force that is commanded, under noise and a known delay."""

from __future__ import annotations

import numpy as np
import pytest

import skyarm
from skyarm.dynamics.kinematics import frame_pose
from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate.batch import Batch

NOISE = {"position": 1e-3, "velocity": 1e-2, "attitude": 2e-3, "rate": 1e-2, "joints": 1e-3, "joint_rates": 1e-2}
HEIGHT, FLIGHTS = 1.5, 4


def before_a_wall(name, joints, force, duration):
    """A vehicle that comes to a wall 20 mm ahead of its tip; the wall ends between tip and base."""
    vehicle = skyarm.load_vehicle(name)
    tip = frame_pose(vehicle, vehicle.frame(), joints).p
    top = HEIGHT + 0.6 * float(tip.z)
    return scenario_from({
        "schema": 1, "name": "press", "duration": duration, "plant": {"vehicle": name},
        "controller": {"law": "centroidal", "mode": "tip", "preset": "robust", "interaction": [0.5, 0.15]},
        "sensors": NOISE, "delays": {"measurement": 0.005},
        "reference": {
            "base": {"kind": "signals", "z": HEIGHT}, "joints": list(joints),
            "push": {"force": {"kind": "constant", "value": force, "start": 0.2}, "normal": [-1.0, 0.0, 0.0]},
        },
        "world": {"surfaces": [{
            "name": "wall", "shape": "box", "size": [0.1, 2.0, top],
            "position": [float(tip.x) + 0.07, 0.0, 0.5 * top], "material": {"friction": 0.3},
        }]},
    })  # fmt: skip


@pytest.mark.parametrize(
    ("name", "joints", "force"),
    [
        ("quadrotor_roll_arm2", (0.0, -0.6), 2.05),
        pytest.param("hexarotor12_arm5", (0.0, -0.6, -0.97, -0.8, 0.0), 4.15, marks=pytest.mark.thorough),
        pytest.param("hexarotor12_arm5", (0.0, -0.6, -0.97, -0.8, 0.0), 8.3, marks=pytest.mark.thorough),
    ],
)
def test_servos_hold_the_force(name, joints, force):
    """Their layer observed no contact before: 18 and 21 % less force, which the law did not notice."""
    batch = Batch(before_a_wall(name, joints, force, 5.0), (), metrics=("contact",), effort=0)
    flown = batch.fly({}, seed=7, episodes=np.arange(FLIGHTS))
    assert set(flown.status) == {"completed"}
    assert np.abs(flown.metrics["contact_error_mean"]).max() < 0.03 * force
    assert flown.metrics["contact_ripple"].max() < 0.25 * force
    assert flown.metrics["contact_losses"].max() <= 2
