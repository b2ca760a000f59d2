"""Nodes of the scene follow the vehicle, and what nobody could see is not sent."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from scenes_without_browser import Scene
from skyarm.algebra import Vec3
from skyarm.drawing.pose_program import PoseProgram
from skyarm.studio.scene import STILL, VehicleNodes
from skyarm.studio.sights import Load
from skyarm.vehicle.linkage import BASE


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


def test_payloads_are_drawn_where_they_are_held_and_where_they_hang() -> None:
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    camera = dataclasses.replace(vehicle.frames[0], name="hook", link=BASE, position=Vec3(0.1, 0.0, -0.2))
    vehicle = dataclasses.replace(vehicle, frames=(*vehicle.frames, camera))
    scene, turn = Scene(), (0.8, 0.0, 0.6, 0.0)
    placed = PoseProgram(vehicle)((1.0, 2.0, 3.0), turn, (0.3, -0.2, 0.1, 0.4, 0.0, 0.2))
    nodes = VehicleNodes(scene, "/law1", vehicle, (10, 20, 30))
    hangs, com = np.array([1.0, 2.0, 2.0]), Vec3(0.0, 0.0, 0.1)
    loads = (Load(0.3, com=com), Load(0.2, "hook"), Load(0.1, "hook", hangs=hangs))
    nodes.carry(loads, placed)
    tip = vehicle.frame()
    middle = scene.nodes[f"/law1/{tip.link}/payload1"].given.mean(axis=0)
    np.testing.assert_allclose(middle, list(tip.position + tip.rotation.apply(com)), atol=1e-9)
    np.testing.assert_allclose(scene.nodes["/law1/-1/payload2"].given.mean(axis=0), [0.1, 0.0, -0.2], atol=1e-9)
    ball, cord = scene.nodes["/law1/-1/payload3"], scene.nodes["/law1/-1/payload3_cord"]
    R, p = placed.rotations[0], placed.positions[0]
    np.testing.assert_allclose(p + R @ (ball.given.mean(axis=0) + ball.position), hangs, atol=1e-9)
    np.testing.assert_allclose(p + R @ cord.points[0, 1], hangs, atol=1e-6)
    nodes.carry(loads[1:2], placed)
    assert sorted(name for name in scene.nodes if "payload" in name) == ["/law1/-1/payload1"]
