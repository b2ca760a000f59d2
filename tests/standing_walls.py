"""Scenario of a vehicle that presses on a wall with its tip."""

from __future__ import annotations

import skyarm
from skyarm.dynamics import frame_pose
from skyarm.scenario.scenario_file import scenario_from

NOISE = {"position": 1e-3, "velocity": 1e-2, "attitude": 2e-3, "rate": 1e-2, "joints": 1e-3, "joint_rates": 1e-2}
HEIGHT = 1.5


def before_a_wall(name, joints, force, duration=5.0, friction=None, **law):
    """A vehicle that comes to a wall 20 mm ahead of its tip; the wall ends between tip and base."""
    vehicle = skyarm.load_vehicle(name)
    tip = frame_pose(vehicle, vehicle.frame(), joints).p
    top = HEIGHT + 0.6 * float(tip.z)
    wall = {
        "name": "wall", "shape": "box", "size": [0.1, 2.0, top], "position": [float(tip.x) + 0.07, 0.0, 0.5 * top],
    } | ({} if friction is None else {"material": {"friction": friction}})  # fmt: skip
    return scenario_from({
        "schema": 1, "name": "press", "duration": duration, "plant": {"vehicle": name},
        "controller": {"law": "centroidal", "mode": "tip"} | law,
        "sensors": NOISE, "delays": {"measurement": 0.005},
        "reference": {
            "base": {"kind": "signals", "z": HEIGHT}, "joints": list(joints),
            "push": {"force": {"kind": "constant", "value": force, "start": 0.2}, "normal": [-1.0, 0.0, 0.0]},
        },
        "world": {"surfaces": [wall]},
    })  # fmt: skip
