"""Nodes of the scene follow the vehicle, and what nobody could see is not sent."""

from __future__ import annotations

import numpy as np
import pytest

import skyarm
from scenes_without_browser import Scene
from skyarm.drawing.pose_program import PoseProgram
from skyarm.studio.scene import STILL, VehicleNodes


@pytest.mark.parametrize("step", [STILL / 7.0, 3.0 * STILL])
def test_nodes_are_where_the_bodies_are_however_slowly_they_move(step: float) -> None:
    vehicle = skyarm.load_vehicle("hummingbird_arm2")
    scene, program = Scene(), PoseProgram(vehicle)
    nodes = VehicleNodes(scene, "/law1", vehicle, (10, 20, 30))
    count = 50
    beside = np.array([0.0, 1.2, 0.0])
    for k in range(count):
        placed = program((k * step, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), (0.3 + k * step, -0.2))
        nodes.place(placed, beside)
        assert scene.nodes["/law1"].position == pytest.approx(placed.positions[0] + beside, abs=STILL)
        w, x, y, z = scene.nodes["/law1/0"].wxyz
        angle = 2.0 * np.arctan2(np.linalg.norm([x, y, z]), abs(w))
        R = placed.rotations[0].T @ placed.rotations[1]
        assert angle == pytest.approx(np.arccos((np.trace(R) - 1.0) / 2.0), abs=2.5 * STILL)
        # the second link keeps its angle against the first, and turns with it in the base's axes
        held = placed.rotations[0].T @ (placed.positions[2] - placed.positions[0])
        assert scene.nodes["/law1/1"].position == pytest.approx(held, abs=STILL)
    sent = scene.nodes["/law1"].writes
    assert sent == count if step > STILL else sent < count / 4


def test_a_vehicle_that_stands_still_sends_nothing() -> None:
    vehicle = skyarm.load_vehicle("hummingbird_arm2")
    scene, placed = Scene(), PoseProgram(vehicle)((0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), (0.3, -0.2))
    nodes = VehicleNodes(scene, "/law1", vehicle, (10, 20, 30))
    nodes.place(placed, np.zeros(3))
    before = {name: getattr(node, "writes", 0) for name, node in scene.nodes.items()}
    nodes.place(placed, np.zeros(3))
    assert {name: getattr(node, "writes", 0) for name, node in scene.nodes.items()} == before
