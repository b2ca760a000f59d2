"""Nodes of the scene follow the vehicle, and what nobody could see is not sent."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from scenes_without_browser import Scene
from skyarm.algebra import Vec3
from skyarm.vehicle.linkage import BASE
from skyarm.view.studio.picture import FlightNodes, tones_of
from skyarm.view.studio.scene_nodes import STILL, SolidNodes, VehicleNodes
from skyarm.view.studio.sights import Load
from skyarm.world.scene.vehicle_shapes import place

PAINT = tones_of((10, 20, 30))


@pytest.mark.parametrize("step", [STILL / 7.0, 3.0 * STILL])
def test_nodes_are_where_the_bodies_are_however_slowly_they_move(step: float) -> None:
    vehicle, scene = skyarm.load_vehicle("hummingbird_arm2"), Scene()
    nodes = VehicleNodes(scene, "/law1", vehicle, PAINT)
    count = 50
    for k in range(count):
        placed = place(vehicle, (k * step, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), (0.3 + k * step, -0.2))
        nodes.place(placed.rotations, placed.positions)
        assert scene.nodes["/law1"].position == pytest.approx(placed.positions[0], abs=STILL)
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
    vehicle, scene = skyarm.load_vehicle("hummingbird_arm2"), Scene()
    placed = place(vehicle, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), (0.3, -0.2))
    nodes = VehicleNodes(scene, "/law1", vehicle, PAINT)
    nodes.place(placed.rotations, placed.positions)
    before = {name: getattr(node, "writes", 0) for name, node in scene.nodes.items()}
    nodes.place(placed.rotations, placed.positions)
    assert {name: getattr(node, "writes", 0) for name, node in scene.nodes.items()} == before


def test_payloads_are_drawn_where_they_are_held_and_where_they_hang() -> None:
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    hook = dataclasses.replace(vehicle.frames[0], name="hook", link=BASE, position=Vec3(0.1, 0.0, -0.2))
    vehicle = dataclasses.replace(vehicle, frames=(*vehicle.frames, hook))
    scene = Scene()
    placed = place(vehicle, (1.0, 2.0, 3.0), (0.8, 0.0, 0.6, 0.0), (0.3, -0.2, 0.1, 0.4, 0.0, 0.2))
    nodes = FlightNodes.__new__(FlightNodes)
    nodes._vehicle, nodes._paint, nodes._loads = vehicle, PAINT, SolidNodes(scene, "/loads")
    nodes._cords = scene.add_line_segments("/cords")
    hangs, com = np.array([1.0, 2.0, 2.0]), Vec3(0.0, 0.0, 0.1)
    loads = (Load(0.3, com=com), Load(0.2, "hook"), Load(0.1, "hook", hangs=hangs))
    nodes._carry(loads, placed)
    tip, (R, p) = vehicle.frame(), (placed.rotations, placed.positions)
    middle = np.array([float(c) for c in tip.position + tip.rotation.apply(com)])
    at = p[1 + tip.link] + R[1 + tip.link] @ middle
    np.testing.assert_allclose(scene.nodes["/loads/payload1"].position, at, atol=1e-4)
    held = p[0] + R[0] @ [0.1, 0.0, -0.2]
    np.testing.assert_allclose(scene.nodes["/loads/payload2"].position, held, atol=1e-4)
    np.testing.assert_allclose(scene.nodes["/loads/payload3"].position, hangs, atol=1e-4)
    np.testing.assert_allclose(scene.nodes["/cords"].points[2], [held, hangs], atol=1e-6)
    assert scene.nodes["/cords"].visible
    nodes._carry(loads[1:2], placed)
    assert sorted(name for name in scene.nodes if "payload" in name) == ["/loads/payload1"]
    assert not scene.nodes["/cords"].visible
