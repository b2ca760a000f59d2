"""The shapes that every picture of a vehicle is made of: where they are, and that
nothing of a vehicle is left out.
"""

from __future__ import annotations

import dataclasses
import math

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from skyarm import load_vehicle
from skyarm.algebra import Vec3
from skyarm.plant.mujoco_model import build_spec, joint_addresses
from skyarm.vehicle.description import turn_onto
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_files import list_vehicles
from skyarm.vehicle.vehicle_records import Collision, Frame, Vehicle
from skyarm.world.scene.shapes import ROLES, Shape, mesh_of, shape_between
from skyarm.world.scene.vehicle_shapes import (
    PAYLOAD_DENSITY,
    body_poses,
    payload_shape,
    place,
    rotor_radius,
    vehicle_shapes,
)
from support.mujoco_shapes import boxed

NAMES = list_vehicles()


@pytest.mark.parametrize("name", NAMES)
def test_every_part_of_a_vehicle_is_drawn_once_and_has_a_size(name: str) -> None:
    vehicle = load_vehicle(name)
    shapes = vehicle_shapes(vehicle)
    names = [shape.name for shape in shapes]
    assert len(names) == len(set(names))
    assert {shape.role for shape in shapes} <= set(ROLES)
    assert sum(shape.role == "rotor" for shape in shapes) == len(vehicle.rotors)
    assert {shape.body for shape in shapes if shape.role == "joint"} == {
        i for i, link in enumerate(vehicle.links) if link.joint.kind == "revolute"
    }
    assert all(part > 0.0 for shape in shapes for part in shape.size)
    assert all(-1 <= shape.body < vehicle.n for shape in shapes)


@pytest.mark.parametrize("name", NAMES)
def test_bodies_are_where_mujoco_has_them(name: str) -> None:
    vehicle = load_vehicle(name)
    draw = np.random.default_rng(5)
    position, quaternion = draw.normal(size=3), draw.normal(size=4)
    joints = draw.uniform(-1.0, 1.0, vehicle.n)
    model = build_spec(vehicle, 9.81).compile()
    data = mujoco.MjData(model)
    data.qpos[:3], data.qpos[3:7] = position, quaternion / np.linalg.norm(quaternion)
    addresses, _ = joint_addresses(vehicle, model)
    data.qpos[addresses] = joints
    mujoco.mj_kinematics(model, data)
    poses = body_poses(vehicle, position[None], quaternion[None], joints[None])
    for body, (R, p) in poses.items():
        at = 1 if body == BASE else model.body(vehicle.links[body].name).id
        # rounding of a chain of six rotations
        np.testing.assert_allclose(p[0], data.xpos[at], atol=1e-12)
        np.testing.assert_allclose(R[0], data.xmat[at].reshape(3, 3), atol=1e-12)


def solid_at(shape: Shape, point: np.ndarray) -> bool:
    """Whether a point of the body's axes is in an ellipsoid, or within the radius of a
    rod's axis.
    """
    local = np.array(shape.rotation).T @ (point - shape.position)
    if shape.kind == "ellipsoid":
        return bool(np.sum((local / shape.size) ** 2) <= 1.0)
    nearest = np.clip(local[2], -0.5 * shape.size[1], 0.5 * shape.size[1])
    return bool(np.linalg.norm(local - [0.0, 0.0, nearest]) <= shape.size[0])


def hanging() -> Vehicle:
    """A vehicle whose arm begins below its hull, and whose camera is ahead of it."""
    vehicle = load_vehicle("hummingbird_arm2")
    below = dataclasses.replace(vehicle.links[0].joint, position=Vec3(0.05, 0.0, -0.3))
    links = (dataclasses.replace(vehicle.links[0], joint=below), *vehicle.links[1:])
    camera = Frame(name="camera", link=BASE, position=Vec3(0.3, 0.0, -0.1))
    return dataclasses.replace(vehicle, links=links, frames=(*vehicle.frames, camera))


@pytest.mark.parametrize(
    "vehicle", [*map(load_vehicle, NAMES), hanging()], ids=lambda vehicle: vehicle.name
)
def test_nothing_hangs_in_the_air(vehicle: Vehicle) -> None:
    shapes = vehicle_shapes(vehicle)
    carried = [(other.parent, other.joint.position) for other in vehicle.moving]
    carried += [(frame.link, frame.position) for frame in vehicle.frames]
    for body, end in carried:
        own = [
            shape
            for shape in shapes
            if shape.body == body and shape.role in ("hull", "boom", "link", "joint")
        ]
        way = np.linspace(0.0, 1.0, 50)[:, None] * [float(c) for c in end]
        assert float(end.norm()) == 0.0 or all(
            any(solid_at(shape, point) for shape in own) for point in way
        )


def test_a_rod_goes_from_its_start_to_its_end() -> None:
    draw = np.random.default_rng(6)
    for start, end in [
        *draw.normal(size=(20, 2, 3)),
        ([0, 0, 0], [0, 0, -1]),
        ([0, 0, 1], [0, 0, 3]),
    ]:
        rod = shape_between("rod", "link", "capsule", 0, 0.01, tuple(start), tuple(end))
        along = np.array(rod.rotation) @ [0.0, 0.0, rod.size[1]]
        np.testing.assert_allclose(
            np.array(rod.position) - 0.5 * along, start, atol=1e-12
        )
        np.testing.assert_allclose(
            np.array(rod.position) + 0.5 * along, end, atol=1e-12
        )


def test_turning_onto_an_axis_is_a_rotation() -> None:
    draw = np.random.default_rng(7)
    for axis in [
        *draw.normal(size=(20, 3)),
        (0.0, 0.0, -2.0),
        (0.0, 0.0, 1.0),
        (1e-7, 0.0, -1.0),
    ]:
        R = np.array(turn_onto(tuple(axis)))
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-12)
        np.testing.assert_allclose(
            R[:, 2], np.array(axis) / np.linalg.norm(axis), atol=1e-12
        )


def test_discs_of_neighbours_leave_each_other_room() -> None:
    for name in NAMES:
        vehicle = load_vehicle(name)
        hubs = [
            np.array([float(c) for c in rotor.position]) for rotor in vehicle.rotors
        ]
        apart = [np.linalg.norm(a - b) for i, a in enumerate(hubs) for b in hubs[:i]]
        sideways = [
            d for d in apart if d > 0.15 * max(np.linalg.norm(hub) for hub in hubs)
        ]
        assert 2.0 * rotor_radius(vehicle) < min(sideways)


def test_a_payload_is_a_ball_of_its_mass_at_the_tip() -> None:
    vehicle = load_vehicle("hummingbird_arm2")
    ball = payload_shape(vehicle, 0.05)
    assert 4.0 / 3.0 * math.pi * ball.size[0] ** 3 * PAYLOAD_DENSITY == pytest.approx(
        0.05
    )
    assert ball.position == tuple(float(c) for c in vehicle.frame().position)
    assert ball.body == vehicle.frame().link


@pytest.mark.parametrize("arm", [True, False])
def test_a_tip_on_the_base_moves_with_the_base(arm: bool) -> None:
    vehicle = load_vehicle("hummingbird_arm2_rotors" if arm else "dragonfly")
    hook = Frame(name="hook", link=BASE, position=Vec3(0.0, 0.1, -0.06))
    vehicle = dataclasses.replace(
        vehicle, frames=(*vehicle.frames, hook), end_effector="hook"
    )
    half = math.sqrt(0.5)  # a quarter turn about x: y goes up
    placed = place(
        vehicle, (1.0, 2.0, 3.0), (half, half, 0.0, 0.0), (0.3, -0.7) if arm else ()
    )
    assert [float(c) for c in placed.tip] == pytest.approx([1.0, 2.06, 3.1], abs=1e-12)


def test_shapes_that_touch_are_drawn_in_place_of_rods() -> None:
    vehicle = boxed()
    shapes = {each.name: each for each in vehicle_shapes(vehicle)}
    bare = dataclasses.replace(vehicle, collisions=())
    plain = {each.name for each in vehicle_shapes(bare)}
    # one link has a shape of each kind that the base has not
    assert plain - set(shapes) == {"hull", "link/link1/joint2", "link/link2/tip"}
    names = [each.name for each in vehicle.collisions]
    assert set(shapes) - plain == {f"touch/{name}" for name in names}
    for each in vehicle.collisions:
        shape = shapes[f"touch/{each.name}"]
        assert (shape.kind, shape.body) == (each.shape, each.link)
        assert shape.role == ("hull" if each.link == BASE else "link")
        vertices, faces = mesh_of(shape)
        a, b, c = (vertices[faces[:, i]] for i in range(3))
        held = float((a * np.cross(b, c)).sum() / 6.0)
        assert 0.94 * volume(each) < held < (1.0 + 1e-12) * volume(each)
        middle = np.array(each.rotation) @ middle_of(each) + np.array(each.position)
        assert 0.5 * (vertices.min(0) + vertices.max(0)) == pytest.approx(middle)
    assert vehicle_shapes(vehicle, meshes=False) == vehicle_shapes(bare, meshes=False)


def volume(each: Collision) -> float:
    """Volume (m^3) by closed forms and Qhull."""
    size = each.size
    if each.shape == "hull":
        return float(ConvexHull(np.array(each.vertices)).volume)
    if each.shape == "box":
        return float(np.prod(size))
    ball = 4.0 / 3.0 * size[0] if each.shape == "capsule" else 0.0
    return math.pi * size[0] ** 2 * (size[1] + ball)


def middle_of(each: Collision) -> np.ndarray:
    corners = np.array(each.vertices or [[0.0, 0.0, 0.0]])
    return np.asarray(0.5 * (corners.min(0) + corners.max(0)))
