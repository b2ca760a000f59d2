"""Nodes of the scene follow the vehicle, and what nobody could see is not sent."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.vehicle.linkage import BASE
from skyarm.view.picture.marks import tones_of
from skyarm.view.picture.viser_sink import STILL, LineNodes, SolidNodes, VehicleNodes
from skyarm.world.hanging_payload import HangingPayload
from skyarm.world.scene.component_scenes import scene_in_log
from skyarm.world.scene.scene import Instants
from skyarm.world.scene.shapes import Shape, Solid
from skyarm.world.scene.vehicle_shapes import place
from skyarm.world.timed_payload import TimedPayload
from support.mujoco_shapes import boxed
from support.peers import Scene

PAINT = tones_of((10, 20, 30))


@pytest.mark.parametrize("step", [STILL / 7.0, 3.0 * STILL])
def test_nodes_are_where_the_bodies_are_however_slowly_they_move(step: float) -> None:
    vehicle, scene = skyarm.load_vehicle("hummingbird_arm2"), Scene()
    nodes = VehicleNodes(scene, "/law1", vehicle, PAINT)
    count = 50
    for k in range(count):
        placed = place(
            vehicle, (k * step, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), (0.3 + k * step, -0.2)
        )
        nodes.place(placed.poses)
        assert scene.nodes["/law1"].position == pytest.approx(
            placed.positions[0], abs=STILL
        )
        w, x, y, z = scene.nodes["/law1/0"].wxyz
        angle = 2.0 * np.arctan2(np.linalg.norm([x, y, z]), abs(w))
        R = placed.rotations[0].T @ placed.rotations[1]
        assert angle == pytest.approx(
            np.arccos((np.trace(R) - 1.0) / 2.0), abs=2.5 * STILL
        )
        # the second link keeps its angle against the first, and turns with it in the
        # base's axes
        held = placed.rotations[0].T @ (placed.positions[2] - placed.positions[0])
        assert scene.nodes["/law1/1"].position == pytest.approx(held, abs=STILL)
    sent = scene.nodes["/law1"].writes
    assert sent == count if step > STILL else sent < count / 4


def test_a_vehicle_that_stands_still_sends_nothing() -> None:
    vehicle, scene = skyarm.load_vehicle("hummingbird_arm2"), Scene()
    placed = place(vehicle, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), (0.3, -0.2))
    nodes = VehicleNodes(scene, "/law1", vehicle, PAINT)
    nodes.place(placed.poses)
    before = {name: getattr(node, "writes", 0) for name, node in scene.nodes.items()}
    nodes.place(placed.poses)
    assert {
        name: getattr(node, "writes", 0) for name, node in scene.nodes.items()
    } == before


def test_payloads_are_drawn_where_they_are_held_and_where_they_hang() -> None:
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    hook = dataclasses.replace(
        vehicle.frames[0], name="hook", link=BASE, position=Vec3(0.1, 0.0, -0.2)
    )
    vehicle = dataclasses.replace(vehicle, frames=(*vehicle.frames, hook))
    pose = (
        np.array([[1.0, 2.0, 3.0]]),
        np.array([[0.8, 0.0, 0.6, 0.0]]),
        np.array([[0.3, -0.2, 0.1, 0.4, 0.0, 0.2]]),
    )
    seen = Instants(
        vehicle=vehicle,
        times=np.zeros(1),
        position=pose[0],
        quaternion=pose[1],
        joints=pose[2],
    )
    hangs, com = np.array([[1.0, 2.0, 2.0]]), Vec3(0.0, 0.0, 0.1)
    loads = (
        TimedPayload(mass=0.3, com=com),
        TimedPayload(mass=0.2, frame="hook"),
        HangingPayload(mass=0.1, frame="hook"),
    )
    logged = {"payload_mass": np.array([[0.3, 0.2, 0.1]]), "payload_position": hangs}
    scene, placed = (
        scene_in_log(loads, seen, logged.__getitem__),
        place(vehicle, *(each[0] for each in pose)),
    )
    nodes = Scene()
    solids, lines = SolidNodes(nodes, "/loads", PAINT), LineNodes(nodes, "/cords")
    solids.place(scene.solids)
    lines.place(scene.lines)
    tip, (R, p) = vehicle.frame(), (placed.rotations, placed.positions)
    middle = np.array([float(c) for c in tip.position + tip.rotation.apply(com)])
    at = p[1 + tip.link] + R[1 + tip.link] @ middle
    np.testing.assert_allclose(nodes.nodes["/loads/payload"].position, at, atol=1e-4)
    held = p[0] + R[0] @ [0.1, 0.0, -0.2]
    np.testing.assert_allclose(
        nodes.nodes["/loads/payload_2"].position, held, atol=1e-4
    )
    np.testing.assert_allclose(
        nodes.nodes["/loads/payload_3"].position, hangs[0], atol=1e-4
    )
    np.testing.assert_allclose(
        nodes.nodes["/cords/cord"].given[0], [held, hangs[0]], atol=1e-4
    )
    logged["payload_mass"] = np.array([[0.0, 0.2, 0.0]])
    scene = scene_in_log(loads, seen, logged.__getitem__)
    solids.place(scene.solids)
    lines.place(scene.lines)
    assert sorted(name for name in nodes.nodes if "payload" in name) == [
        "/loads/payload"
    ]
    assert not [name for name in nodes.nodes if "cord" in name]


def test_a_solid_at_the_world_origin_is_drawn_there_at_any_place_in_its_body() -> None:
    shape = Shape(
        name="box",
        role="object",
        kind="box",
        body=0,
        size=(0.1, 0.1, 0.1),
        position=(0.4, 0.0, 0.2),
    )
    nodes = Scene()
    SolidNodes(nodes, "/loads", PAINT).place(
        [Solid(shape, np.zeros((1, 3)), np.eye(3)[None])]
    )
    assert nodes.nodes["/loads/box"].position.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("wires", [0.0, 0.2])
def test_every_shape_that_touches_is_a_node_of_its_body(wires: float) -> None:
    vehicle, scene = boxed(), Scene()
    VehicleNodes(scene, "/law1", vehicle, PAINT, wires=wires)
    for each in vehicle.collisions:
        assert f"/law1/{each.link}/touch/{each.name}" in scene.nodes
