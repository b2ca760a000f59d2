"""What is drawn of a world is where the contact has it: surfaces, objects, points,
forces, and rotors that tilt.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from skyarm import load_vehicle
from skyarm.algebra import ZERO3, Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.actuators.tilting import turn_rotors
from skyarm.dynamics.point_motion import PointMotion
from skyarm.reference.signals import Constant, Sine
from skyarm.vehicle import BASE
from skyarm.vehicle.vehicle_records import Collision
from skyarm.world.contact import Contact, ContactPoint, Material, Surface
from skyarm.world.contact.free_object import FreeObject
from skyarm.world.contact.mechanism import Mechanism, MechanismMotion
from skyarm.world.scene.component_scenes import scene_in_log, scene_now
from skyarm.world.scene.scene import PATCH, Instants, Scene, hidden_share, instant_of
from skyarm.world.scene.shapes import AROUND, mesh_of
from skyarm.world.scene.vehicle_shapes import (
    body_poses,
    disc_name,
    rotor_turns,
    shape_rotation,
    vehicle_shapes,
)
from skyarm.world.signal_vector import SignalVector

SIZES: dict[str, tuple[float, ...]] = {
    "plane": (),
    "box": (0.3, 0.7, 1.1),
    "cylinder": (0.2, 0.9),
    "sphere": (0.4,),
    "hole": (0.1, 0.3, 0.05, 0.4, 0.5),
}
MOTION = SignalVector(
    x=Sine(amplitude=0.3, frequency_hz=0.4), y=Constant(value=0.1), z=Constant(value=0)
)


VEHICLE = load_vehicle("hummingbird_arm2")


def scene_of(
    contact: Contact,
    times: np.ndarray,
    about: tuple[float, ...] = (0.0, 0.0, 0.0),
    patch: float = PATCH,
    **logged: np.ndarray,
) -> Scene:
    """The scene of a contact about a vehicle at rest."""
    count = len(times)
    seen = Instants(
        vehicle=VEHICLE,
        times=times,
        position=np.zeros((count, 3)),
        quaternion=np.eye(4)[[0] * count],
        joints=np.zeros((count, VEHICLE.n)),
        around=np.array(about),
        patch=patch,
    )
    nothing = np.zeros((count, contact.logged_pairs))
    return scene_in_log([contact], seen, lambda name: logged.get(name, nothing))


def a_surface(shape: str, **fields: Any) -> Surface:
    """A surface somewhere, turned about all axes."""
    place: dict[str, Any] = {
        "position": Vec3(0.4, -0.2, 0.9),
        "angles": Vec3(0.3, -0.5, 1.2),
    } | fields
    return Surface(name=shape, shape=shape, size=SIZES[shape], **place)


def on_faces(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """A drawn place on every triangle."""
    shares = np.random.default_rng(1).dirichlet((1.0, 1.0, 1.0), len(faces))
    return np.einsum("fk,fki->fi", shares, vertices[faces])


@pytest.mark.parametrize("shape", SIZES)
@pytest.mark.parametrize("moving", [False, True])
def test_a_drawn_surface_is_where_the_contact_has_its_skin(
    shape: str, moving: bool
) -> None:
    surface = a_surface(shape, **({"motion": MOTION} if moving else {}))
    times = np.array([0.0, 0.3, 1.7])
    (solid,) = scene_of(Contact(surfaces=(surface,)), times, (3.0, 1.0, 0.5)).solids
    assert (solid.moves, solid.fixed) == (moving, not moving)
    vertices, faces = mesh_of(solid.shape)
    # of round shapes the mesh has its corners alone on the skin
    flat = shape in ("plane", "box")
    drawn = [
        on_faces(vertices, faces) if flat else vertices,
        mesh_of(solid.shape, 48)[0],
    ]
    # straight along the axis: between two rings of corners it is on the skin, too
    if shape in ("cylinder", "hole"):
        rings = vertices.reshape(-1, AROUND, 3)
        drawn.append(0.5 * (rings[1:] + rings[:-1]).reshape(-1, 3))
    for points in drawn:
        for k, t in enumerate(times):
            world = solid.position[k] + points @ solid.rotation[k].T
            # rounding of two rotations; circles of 24 corners have these on the rim
            np.testing.assert_allclose(
                surface.depth(Vec3(*world.T), 0, float(t))[0], 0.0, atol=1e-12
            )


@pytest.mark.parametrize("shape", ["box", "cylinder", "sphere"])
def test_an_object_is_drawn_as_its_carrier_has_it_from_a_log_and_from_memory(
    shape: str,
) -> None:
    thing = FreeObject(
        name="thing",
        mass=0.3,
        shape=shape,
        size=SIZES[shape],
        com=Vec3(0.05, -0.1, 0.2),
        position=Vec3(1.0, 2.0, 3.0),
        angles=Vec3(0.4, -0.2, 0.9),
    )
    contact = Contact(surfaces=(), objects=(thing,))
    memory = contact.start(0.005, ())
    frame, (skin,) = thing.frame(memory.carried[0]), thing.surfaces
    numbers = np.array([float(c) for c in thing.logged(memory.carried[0])])
    logged = {
        "object_position": numbers[None, :3],
        "object_quaternion": 1.7 * numbers[None, 3:7],
    }
    logged |= {"object_velocity": np.zeros((1, 3)), "object_rate": np.zeros((1, 3))}
    state = State(
        position=Vec3(0.0, 0.0, 0.0),
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(0.0, 0.0, 0.0),
        joints=(0.0, 0.0),
        joint_rates=(0.0, 0.0),
        rotor_speeds=(0.0,) * 4,
    )
    motion = PointMotion(VEHICLE, state)
    for scene in (
        scene_of(contact, np.zeros(1), **logged),
        scene_now([contact], [memory], instant_of(motion, 0.0, np.zeros(3)), motion),
    ):
        (solid,) = scene.solids
        assert (solid.shape.role, solid.fixed) == ("object", False)
        world = solid.position[0] + mesh_of(solid.shape)[0] @ solid.rotation[0].T
        np.testing.assert_allclose(
            frame.depth(skin, Vec3(*world.T), 0)[0], 0.0, atol=1e-12
        )
    assert scene_of(contact, np.zeros(1)) == Scene(), "its columns are not in the log"


@pytest.mark.parametrize("kind", ["door", "drawer", "valve"])
def test_a_mechanism_is_drawn_as_its_carrier_has_it_at_every_coordinate(
    kind: str,
) -> None:
    handle = Surface(
        name="handle", shape="sphere", size=(0.05,), position=Vec3(0.1, 0.3, 0.2)
    )
    thing = Mechanism(
        name="thing",
        kind=kind,
        size=(0.8, 0.9, 0.05)[: 2 if kind == "valve" else 3],
        mass=3.0,
        parts=(handle,),
        position=Vec3(1.0, 2.0, 0.5),
        angles=Vec3(0.1, 0.2, 0.7),
    )
    contact, coordinates = (
        Contact(surfaces=(), mechanisms=(thing,)),
        np.array([[0.0], [0.3], [-0.8]]),
    )
    logged = {column[0]: coordinates for column in contact.columns}
    drawn = scene_of(contact, np.zeros(3), **logged).solids
    assert [each.shape.name for each in drawn] == [
        f"world/{each.name}" for each in thing.surfaces
    ]
    assert all(each.shape.role == "object" and each.moves for each in drawn)
    for k, (coordinate,) in enumerate(coordinates):
        frame = thing.frame(
            MechanismMotion(coordinate=float(coordinate), rate=0.0, bristle=())
        )
        for solid, skin in zip(drawn, thing.surfaces, strict=True):
            world = solid.position[k] + mesh_of(solid.shape)[0] @ solid.rotation[k].T
            np.testing.assert_allclose(
                frame.depth(skin, Vec3(*world.T), 0)[0], 0.0, atol=1e-12
            )


def test_a_patch_is_about_the_nearest_point_of_its_plane_and_goes_with_it() -> None:
    plane = a_surface("plane", motion=MOTION)
    away = np.array([3.0, 1.0, 0.5])
    (solid,) = scene_of(
        Contact(surfaces=(plane,)), np.array([0.0, 0.5]), tuple(away), 2.5
    ).solids
    assert solid.shape.size == (2.5, 2.5)
    from_patch = away - solid.position[0]
    assert np.linalg.norm(np.cross(from_patch, solid.rotation[0, :, 2])) < 1e-12
    went = [
        float(b) - float(a)
        for a, b in zip(plane.place(0.0)[0], plane.place(0.5)[0], strict=True)
    ]
    np.testing.assert_allclose(solid.position[1] - solid.position[0], went, atol=1e-15)


def test_the_ground_is_the_highest_level_plane_at_rest_and_no_patch() -> None:
    low, high = (
        Surface(name=name, position=Vec3(5.0, 0.0, z))
        for name, z in (("low", -1.0), ("high", -0.4))
    )
    ceiling = Surface(
        name="ceiling", position=Vec3(0, 0, 3.0), angles=Vec3(np.pi, 0, 0)
    )
    deck = Surface(name="deck", position=Vec3(0, 0, 0.5), motion=MOTION)
    scene = scene_of(Contact(surfaces=(low, high, ceiling, deck)), np.zeros(1))
    assert scene.ground == -0.4
    assert [each.shape.name for each in scene.solids] == [
        "world/low",
        "world/ceiling",
        "world/deck",
    ]
    scene = scene_of(Contact(surfaces=(ceiling, deck)), np.zeros(1))
    assert scene.ground is None
    assert scene.solids[1].shape.size == (PATCH, PATCH)


def touching_world() -> tuple[Contact, State, Any]:
    """A vehicle at rest whose points are in a wall, in a ground and in an object that
    is turned.
    """
    vehicle = load_vehicle("hummingbird_arm2")
    still = {
        "velocity": Vec3(0.0, 0.0, 0.0),
        "rate": Vec3(0.0, 0.0, 0.0),
        "joint_rates": (0.0, 0.0),
    }
    attitude = Quaternion(0.9, 0.1, -0.2, 0.3).normalized()
    state = State(
        position=Vec3(0.1, 0.2, 0.3),
        quaternion=attitude,
        joints=(0.4, -0.7),
        rotor_speeds=(0.0,) * 4,
        **still,
    )
    points = (
        ContactPoint(name="tip", frame=vehicle.end_effector),
        ContactPoint(
            name="ball", body="base", position=Vec3(0.1, 0.0, -0.2), radius=0.05
        ),
        ContactPoint(
            name="elbow", body=vehicle.moving[1].name, position=Vec3(0.02, 0.0, 0.01)
        ),
    )
    motion = PointMotion(vehicle, state)
    places = [motion.position(*each.place(vehicle)) for each in points]
    smooth = Material(dissipation=0.0)
    tilted = Surface(
        name="tilted",
        position=places[0] + Vec3(0.0, 0.0, 1e-3),
        angles=Vec3(0.3, 0.2, 0),
        material=smooth,
    )
    box = FreeObject(
        name="box",
        mass=1.0,
        size=(0.2, 0.2, 0.2),
        position=places[1] - Vec3(0.0, 0.0, 0.149),
        material=smooth,
        angles=Vec3(0.1, 0.0, 0.4),
    )
    return Contact(surfaces=(tilted,), points=points, objects=(box,)), state, vehicle


def test_arrows_are_the_forces_on_the_points() -> None:
    contact, state, vehicle = touching_world()
    memory, motion = contact.start(0.005, ()), PointMotion(vehicle, state)
    scene = scene_now([contact], [memory], instant_of(motion, 0.0, np.zeros(3)), motion)
    assert len(scene.arrows) == contact.logged_pairs
    arrows = [each for each in scene.arrows if each.force.any()]
    assert len(arrows) >= 3
    assert {each.name.split("/")[1] for each in arrows} == {"tilted", "box"}
    for arrow in arrows:
        (point,) = (
            each for each in contact.points if each.name == arrow.name.split("/")[2]
        )
        middle = np.array([float(c) for c in motion.position(*point.place(vehicle))])
        along = arrow.force[0] / np.linalg.norm(arrow.force[0])
        np.testing.assert_allclose(
            arrow.spot[0], middle - float(point.radius) * along, atol=1e-12
        )
    # at rest bristles stand upright: there is no friction
    force, torque = np.zeros(3), np.zeros(3)
    for wrench in contact.wrenches(memory, 0.0, motion, state.rotor_speeds):
        push = np.array([float(c) for c in wrench.force_W])
        lever = np.array([float(c) for c in motion.position(wrench.point, wrench.body)])
        force, torque = (
            force + push,
            torque + np.cross(lever, push) + [float(c) for c in wrench.torque_W],
        )
    np.testing.assert_allclose(sum(each.force[0] for each in arrows), force, rtol=1e-9)
    np.testing.assert_allclose(
        sum(np.cross(each.spot[0], each.force[0]) for each in arrows), torque, rtol=1e-9
    )


def test_points_are_marked_where_they_are_and_the_tip_has_no_second_mark() -> None:
    contact, state, vehicle = touching_world()
    motion = PointMotion(vehicle, state)
    memory, seen = contact.start(0.005, ()), instant_of(motion, 0.0, np.zeros(3))
    shapes = {
        each.name: each
        for each in scene_now([contact], [memory], seen, motion).attached
    }
    assert set(shapes) == {"point/ball", "stalk/ball", "point/elbow", "stalk/elbow"}
    assert shapes["point/ball"].size == (0.05,)
    q = state.quaternion
    where = ([*state.position], [q.w, q.x, q.y, q.z], [*state.joints])
    poses = body_poses(vehicle, *(np.array([each]) for each in where))
    for point in contact.points[1:]:
        shape, stalk = shapes[f"point/{point.name}"], shapes[f"stalk/{point.name}"]
        R, p = poses[shape.body]
        expected = [
            float(c)
            for c in PointMotion(vehicle, state).position(*point.place(vehicle))
        ]
        np.testing.assert_allclose(
            p[0] + R[0] @ np.array(shape.position), expected, atol=1e-12
        )
        end = (
            np.array(stalk.position)
            + 0.5 * stalk.size[1] * np.array(stalk.rotation)[:, 2]
        )
        np.testing.assert_allclose(end, shape.position, atol=1e-12)


def test_a_tip_that_is_a_ball_has_its_ball() -> None:
    vehicle = load_vehicle("hummingbird_arm2")
    ball = ContactPoint(name="tip", frame=vehicle.end_effector, radius=0.03)
    shape, _stalk = scene_of(
        Contact(surfaces=(a_surface("plane"),), points=(ball,)), np.zeros(1)
    ).attached
    assert shape.size == (0.03,)


def test_discs_are_turned_as_the_servos_turn_the_thrust() -> None:
    vehicle = load_vehicle("voliro_like")
    first, *others = vehicle.rotors
    assert first.tilt is not None
    leaning = dataclasses.replace(
        first,
        axis=Vec3(0.6, 0.0, 0.8),
        tilt=dataclasses.replace(first.tilt, axis=Vec3(0.8, 0.0, -0.6)),
    )
    vehicle = vehicle.with_checked(rotors=(leaning, *others))
    angles = np.random.default_rng(2).uniform(-0.6, 0.6, (3, len(vehicle.tilts)))
    turns = rotor_turns(vehicle, angles)
    shapes = {each.name: each for each in vehicle_shapes(vehicle)}
    for k, row in enumerate(angles):
        for before, after in zip(
            vehicle.rotors, turn_rotors(vehicle, tuple(row)).rotors, strict=True
        ):
            R = shape_rotation(shapes[disc_name(before.name)], turns)
            axis = (R[k] if before.tilt is not None else R)[:, 2]
            np.testing.assert_allclose(axis, [float(c) for c in after.axis], atol=1e-12)
    assert shape_rotation(shapes["hull"], turns).shape == (3, 3)
    assert rotor_turns(vehicle, np.zeros((3, 0))) == {}


@pytest.mark.parametrize("shape", SIZES)
def test_a_surface_hides_what_is_behind_it_and_nothing_beside_it(shape: str) -> None:
    surface = a_surface(
        shape,
        position=Vec3(1.0, 0.0, 0.2 if shape == "hole" else 0.0),
        angles=Vec3(0.0, -0.5 * np.pi if shape == "plane" else 0, 0),
    )
    (solid,) = scene_of(Contact(surfaces=(surface,)), np.zeros(1)).solids
    for way, hidden in (
        ((1.0, 0.0, 0.0), 1.0),
        ((-1.0, 0.0, 0.0), 0.0),
        ((0.0, 1.0, 0.0), 0.0),
        ((0.0, 0.0, 1.0), 0.0),
    ):
        assert hidden_share([solid], np.zeros((1, 3)), np.array(way)) == hidden
    two = dataclasses.replace(
        solid,
        position=solid.position + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 9.0]]),
        rotation=np.concatenate([solid.rotation] * 2),
    )
    assert hidden_share([two], np.zeros((2, 3)), np.array([1.0, 0.0, 0.0])) == 0.5


def ball(name: str, link: int, **fields: Any) -> Collision:
    usual = {"shape": "sphere", "size": (0.05,), "position": ZERO3}
    return Collision(name=name, link=link, **usual | fields)


def test_arrows_of_bodies_stand_at_their_places_along_the_other_ones_normal() -> None:
    times, angle = np.array([0.0, 0.1]), 0.3
    tool = ball(
        "tool", 1, position=Vec3(0.01, 0.02, 0.03), shape="box", size=(0.1,) * 3
    )
    vehicle = dataclasses.replace(VEHICLE, collisions=(ball("hull", BASE), tool))
    wall = Surface(name="wall", angles=Vec3(0.0, angle, 0.0))
    thing = FreeObject(name="thing", mass=0.3, shape="box", size=(0.2, 0.4, 0.6))
    contact = Contact(surfaces=(wall,), objects=(thing,), self_collision=True)
    contact = contact.on({"": vehicle})
    names = [each.name for each in contact.body_pairs]
    assert names == [
        "base/wall",
        "link2/wall",
        "base/thing",
        "link2/thing",
        "base/link2",
    ]
    R, p = body_poses(vehicle, np.zeros((2, 3)), np.eye(4)[[0, 0]], np.zeros((2, 2)))[1]
    middle = p[0] + R[0] @ np.array([0.01, 0.02, 0.03])
    turned = Quaternion(np.cos(0.4), 0.0, 0.0, np.sin(0.4))
    side = np.array([np.cos(0.8), np.sin(0.8), 0.0])
    places = np.zeros((2, 15))
    places[:, 6:9], places[:, 12:15] = side * 0.099, middle + R[0] @ [0.0, -0.049, 0.0]
    numbers = {
        "collision_force": np.array([[1.0, 0.0, 2.0, 0.0, 3.0], [0.0] * 5]),
        "collision_place": places,
        "object_position": np.zeros((2, 3)),
        "object_quaternion": np.array([[*turned]] * 2, float),
    }
    seen = Instants(
        vehicle=vehicle,
        times=times,
        position=np.zeros((2, 3)),
        quaternion=np.eye(4)[[0, 0]],
        joints=np.zeros((2, VEHICLE.n)),
    )
    nothing = np.zeros((2, 6))
    logged = {column[0]: nothing[:, :3] for column in contact.columns} | numbers

    def arrows() -> dict[str, Any]:
        scene = scene_in_log([contact], seen, lambda name: logged.get(name, nothing))
        return {each.name: each for each in scene.arrows}

    drawn = arrows()
    for name, force in (
        ("base/wall", [np.sin(angle), 0.0, np.cos(angle)]),
        ("base/thing", 2.0 * side),
        ("base/link2", 3.0 * R[0] @ [0.0, -1.0, 0.0]),
        ("link2/wall", np.zeros(3)),
    ):
        i, arrow = names.index(name), drawn[f"touch/{name}"]
        np.testing.assert_allclose(arrow.spot, places[:, 3 * i : 3 * i + 3])
        np.testing.assert_allclose(arrow.force, [force, np.zeros(3)], atol=1e-9)
    # the log of a member of a team has the pairs of all
    logged["collision_force"] = np.ones((2, 9))
    assert not any(each.force.any() for each in arrows().values())
