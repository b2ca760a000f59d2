"""Poses as one program, quaternions of rotations, and triangles of shapes."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.log.tip_positions import tip
from skyarm.vehicle.description import turn_onto
from skyarm.world.scene.shapes import Shape, mesh_of
from skyarm.world.scene.vehicle_shapes import body_poses, place, quaternions_of

RNG = np.random.default_rng(7)


@pytest.mark.parametrize("name", skyarm.list_vehicles())
def test_the_program_gives_the_poses_of_the_bodies_and_the_tip(name: str) -> None:
    vehicle = skyarm.load_vehicle(name)
    for _ in range(5):
        p, q, joints = (
            RNG.normal(size=3),
            RNG.normal(size=4),
            0.5 * RNG.normal(size=vehicle.n),
        )
        found, wanted = (
            place(vehicle, p, q, joints),
            body_poses(vehicle, p[None], q[None], joints[None]),
        )
        for body, (R, at) in wanted.items():
            assert np.array_equal(found.rotations[body + 1], R[0])
            assert np.array_equal(found.positions[body + 1], at[0])
        assert np.allclose(
            found.tip, tip(vehicle, p[None], q[None], joints[None])[0], atol=1e-12
        )


def test_quaternions_are_those_of_the_rotations() -> None:
    turns = Rotation.random(500, random_state=3)
    found = quaternions_of(turns.as_matrix())
    wanted = turns.as_quat()[:, [3, 0, 1, 2]]
    same = np.abs((found * wanted).sum(axis=1))
    assert np.allclose(same, 1.0, atol=1e-9)
    assert (found[:, 0] >= 0.0).all()


SHAPES = {
    "sphere": (Shape("s", "tip", "sphere", -1, (0.2,)), 4.0 / 3.0 * math.pi * 0.2**3),
    "ellipsoid": (
        Shape("e", "hull", "ellipsoid", -1, (0.3, 0.2, 0.1)),
        4.0 / 3.0 * math.pi * 0.3 * 0.2 * 0.1,
    ),
    "cylinder": (
        Shape("c", "rotor", "cylinder", -1, (0.2, 0.5)),
        math.pi * 0.2**2 * 0.5,
    ),
    "capsule": (
        Shape("k", "link", "capsule", -1, (0.2, 0.5)),
        math.pi * 0.2**2 * (0.5 + 4.0 / 3.0 * 0.2),
    ),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_a_mesh_is_closed_faces_outwards_and_holds_the_volume_of_its_shape(
    kind: str,
) -> None:
    shape, volume = SHAPES[kind]
    vertices, faces = mesh_of(shape)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    # the volume within a closed surface, by the divergence theorem; turned inside out
    # it is negative
    held = float((a * np.cross(b, c)).sum() / 6.0)
    assert volume * 0.94 < held < volume
    assert np.allclose(np.cross(b - a, c - a).sum(axis=0), 0.0, atol=1e-9)


def test_a_mesh_stands_where_its_shape_does() -> None:
    turned = turn_onto((0.0, 1.0, 0.0))
    shape = Shape("c", "boom", "cylinder", -1, (0.1, 2.0), (1.0, 2.0, 3.0), turned)
    vertices, _ = mesh_of(shape)
    assert np.allclose(vertices.min(axis=0), [0.9, 1.0, 2.9], atol=1e-9)
    assert np.allclose(vertices.max(axis=0), [1.1, 3.0, 3.1], atol=1e-9)


def test_an_unknown_kind_of_shape_is_refused() -> None:
    with pytest.raises(ValueError, match=r"shape\.kind = 'cube'"):
        mesh_of(Shape("x", "hull", "cube", -1, (1.0,)))
