"""Rays against MuJoCo's, from outside and from within; planes, holes, many worlds."""

from __future__ import annotations

import numpy as np
import pytest
from mujoco_rays import KINDS, Ours, caster_of, random_model, surface_of, theirs
from scipy.spatial.transform import Rotation

from skyarm.algebra import Mat3, Vec3
from skyarm.sensing.cameras.ray_casting import RayCaster
from skyarm.world.contact.surface import Surface, from_plate
from skyarm.world.contact.vehicle_bodies import Part

FLOOR = 1e-9
"""m, that is asked; found in 50 scenes of 10 000 rays are 4e-12 m."""


def unit_rows(rng, count):
    rows = rng.normal(size=(count, 3))
    return rows / np.linalg.norm(rows, axis=1)[:, None]


@pytest.mark.parametrize("seed", range(4))
def test_rays_meet_what_those_of_mujoco_meet(seed):
    rng = np.random.default_rng(seed)
    model, data = random_model(rng, 25)
    ways, eye = unit_rows(rng, 1000), rng.uniform(-3.0, 3.0, 3)
    depth, geom = Ours(model, data, ways).cast(eye)
    far, hit = theirs(model, data, eye, ways)
    np.testing.assert_array_equal(geom, hit)
    np.testing.assert_allclose(depth, far, rtol=0, atol=FLOOR)
    assert len(set(hit)) > 10


def test_rays_from_within_a_body_meet_its_far_side():
    rng = np.random.default_rng(9)
    model, data = random_model(rng, len(KINDS))
    ways = unit_rows(rng, 60)
    ours = Ours(model, data, ways)
    for inside in range(1, model.ngeom):
        eye = data.geom_xpos[inside] + 1e-3
        depth, geom = ours.cast(eye)
        far, hit = theirs(model, data, eye, ways)
        np.testing.assert_array_equal(geom, hit)
        np.testing.assert_allclose(depth, far, rtol=0, atol=FLOOR)
        assert (hit == inside).mean() > 0.5


def test_a_ray_along_an_axis_or_a_face_meets_what_is_ahead():
    ahead = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    for shape, size in (("box", (0.4, 0.2, 0.2)), ("cylinder", (0.2, 0.4))):
        caster = caster_of(ahead, [Surface(name="it", shape=shape, size=size)])
        eye = np.array([[[-1.0, 0.0, 0.0]]])
        depth, number = caster.cast(np.eye(3)[None, None], eye)
        np.testing.assert_allclose(depth, [[0.8, np.inf]], atol=1e-12)
        np.testing.assert_array_equal(number, [[1, 0]])


def test_a_plane_is_seen_from_outside_alone():
    ways = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    caster = caster_of(ways, [Surface(name="ground", shape="plane")])
    for height, depth in ((2.0, 2.0), (-2.0, np.inf)):
        eye = np.array([[[0.0, 0.0, height]]])
        found, _ = caster.cast(np.eye(3)[None, None], eye)
        np.testing.assert_array_equal(found, [[depth, np.inf, np.inf]])


def test_a_plate_with_a_hole_is_met_where_its_distance_is_zero():
    """Oracle: sphere tracing, steps of the distance to the plate."""
    size = (0.05, 0.08, 0.02, 0.2, 0.15)
    rng = np.random.default_rng(3)
    places = np.concatenate(
        [
            rng.uniform([-0.3, -0.3, 0.05], [0.3, 0.3, 0.4], (60, 3)),
            rng.uniform([-0.3, -0.3, -0.5], [0.3, 0.3, -0.2], (20, 3)),
            rng.uniform([0.25, -0.3, -0.2], [0.5, 0.3, 0.1], (20, 3)),
        ]
    )
    aims = rng.uniform([-0.1, -0.1, -0.15], [0.1, 0.1, 0.0], (100, 3)) - places
    ways = aims / np.linalg.norm(aims, axis=1)[:, None]
    plate = Surface(name="plate", shape="hole", size=size)
    here, traced = places.copy(), np.zeros(100)
    for _ in range(1500):
        away = np.asarray(from_plate(size, Vec3(*here.T))[0])
        step = np.where(away > 1e-9, away, 0.0)
        traced, here = traced + step, here + ways * step[:, None]
    for place, way, far in zip(places, ways, traced, strict=True):
        found, _ = caster_of(way[None], [plate]).cast(
            np.eye(3)[None, None], place[None, None]
        )
        if far > 5.0:
            assert np.isinf(found)
        else:
            # a grazing ray stops some way before the place
            assert found[0, 0] == pytest.approx(far, abs=1e-7)
    assert (np.abs(traced) < 5.0).mean() > 0.5


def views(rng, ours, worlds):
    """Poses of a sensor in as many worlds."""
    poses = [
        ours.poses(rng.uniform(-3.0, 3.0, 3), Rotation.random(rng=rng).as_matrix())
        for _ in range(worlds)
    ]
    return tuple(map(np.concatenate, zip(*poses, strict=True)))


def test_many_worlds_at_once_are_the_same_as_one_by_one():
    rng = np.random.default_rng(6)
    model, data = random_model(rng, 20)
    ours = Ours(model, data, unit_rows(rng, 101))
    turns, eyes = views(rng, ours, 5)
    together = ours.caster.cast(turns, eyes)
    for i in range(5):
        alone = ours.caster.cast(turns[i : i + 1], eyes[i : i + 1])
        for one, other in zip(together, alone, strict=True):
            np.testing.assert_array_equal(one[i], other[0])


def test_places_and_turns_of_shapes_on_their_body_count():
    """Oracle: the same shapes, each on a body of its own."""
    rng = np.random.default_rng(7)
    model, data = random_model(rng, 10)
    ways = unit_rows(rng, 200)
    ours = Ours(model, data, ways)
    parts = [
        Part(surface_of(model, i), Mat3.from_numbers(R.tolist()), Vec3(*map(float, p)))
        for i, (R, p) in enumerate(zip(ours.turns, ours.places, strict=True))
    ]
    world = RayCaster(ways, np.zeros(len(parts), int), parts)
    eye = rng.uniform(-3.0, 3.0, 3)
    for one, other in zip(
        world.cast(np.eye(3)[None, None], eye[None, None]),
        ours.caster.cast(*ours.poses(eye)),
        strict=True,
    ):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


def test_a_sensor_without_anything_to_see_sees_nothing():
    caster = caster_of(np.eye(3), [])
    depth, number = caster.cast(np.zeros((2, 0, 3, 3)), np.zeros((2, 0, 3)))
    assert np.isinf(depth).all()
    assert not number.any()
