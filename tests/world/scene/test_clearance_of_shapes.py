"""Signed distances of boxes, hulls, cylinders, capsules and balls against MuJoCo's, and
of a vehicle that states such shapes.
"""

from __future__ import annotations

import dataclasses
import math

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm import load_vehicle
from skyarm.algebra import ZERO3, Mat3, Quaternion, Scalar, Scalars, Vec3
from skyarm.algebra.scalars.taylor import Taylor, nth_derivative
from skyarm.compile import trace
from skyarm.dynamics.kinematics import Pose
from skyarm.plant.mujoco_model import joint_addresses
from skyarm.vehicle import BASE, Vehicle
from skyarm.vehicle.convex_hull import COLLISION_SIZES
from skyarm.vehicle.vehicle_records import Collision
from skyarm.world.contact.surface import Surface
from skyarm.world.scene.clearance import (
    Volume,
    clearances,
    pair_distance,
    solid_of,
    surface_distance,
    volumes,
)
from support.mujoco_shapes import GEOMS, add_geom, boxed, distance, spec_with_shapes

PAIRS = [(a, b) for a in GEOMS for b in GEOMS if a <= b]


def drawn(rng: np.random.Generator, shape: str) -> Collision:
    """A shape of a random size at a random pose."""
    names = COLLISION_SIZES[shape]
    corners = 0.15 * rng.normal(size=(12, 3)) if shape == "hull" else ()
    R = Rotation.random(random_state=rng).as_matrix()
    return Collision(
        name="it",
        link=BASE,
        shape=shape,
        size=tuple(rng.uniform(0.03, 0.3, len(names)).tolist()),
        vertices=tuple(Vec3(*map(float, corner)) for corner in corners),
        position=Vec3(*map(float, rng.normal(size=3) * 0.2)),
        rotation=Mat3(*(Vec3(*map(float, row)) for row in R)),
    )


def finely(spec: mujoco.MjSpec) -> mujoco.MjModel:
    spec.option.ccd_tolerance, spec.option.ccd_iterations = 1e-10, 500
    return spec.compile()


def expected(one: Collision, other: Collision) -> float:
    spec = mujoco.MjSpec()
    for name, each in (("a", one), ("b", other)):
        add_geom(spec, spec.worldbody.add_body(), each, name)
    model = finely(spec)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return distance(model, data, "a", "b")


def solid(each: Collision) -> Volume:
    return solid_of(each, Pose(each.rotation, each.position))


@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_two_shapes_are_as_far_from_each_other_as_mujoco_has_them(
    pair: tuple[str, str],
) -> None:
    rng, apart, overlapping = np.random.default_rng(21), 0, 0
    # of rims both are approximate
    rims = "cylinder" in pair and {*pair} <= {"box", "cylinder", "hull"}
    slack = 3e-4 if rims else 1e-6
    for _ in range(12):
        one, other = (drawn(rng, shape) for shape in pair)
        there = expected(one, other)
        found = float(pair_distance(solid(one), solid(other)))
        if there > 1e-6:
            assert there - slack <= found <= there + slack
            if apart < 2:
                back = float(pair_distance(solid(other), solid(one)))
                assert back == pytest.approx(found, abs=slack)
            apart += 1
        elif there < -1e-6:
            # never less deep than it is
            assert found <= 1e-9 + max(there, -1e-6)
            overlapping += 1
    assert apart > 2
    assert overlapping > 0


def poses_of(vehicle: Vehicle, count: int) -> np.ndarray:
    """Random states: position, quaternion and joints."""
    x = np.random.default_rng(22).normal(size=(count, 7 + vehicle.n))
    x[:, :3] *= 0.3
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1)[:, None]
    return x


OBSTACLES = (
    Surface(name="wall", shape="box", size=(0.2, 1.0, 0.5), position=Vec3(0.5, 0, 0)),
    Surface(name="ball", shape="sphere", size=(0.1,), position=Vec3(0.1, 0.5, 0.2)),
    Surface(name="bar", shape="capsule", size=(0.05, 0.4), position=Vec3(0, 0, -0.6)),
    Surface(name="pole", shape="cylinder", size=(0.1, 1.0), position=Vec3(-0.6, 0, 0)),
    Surface(name="floor", position=Vec3(0.0, 0.0, -1.0)),
    Surface(
        name="rock",
        shape="hull",
        vertices=tuple(map(Vec3.from_numbers, np.vstack([np.eye(3), -np.eye(3)]) / 5)),
        position=Vec3(0.0, -0.6, 0.0),
    ),
)


RIMS = {
    "base/leg",
    "pole",
    *(f"rotor/{side}" for side in ("front", "left", "back", "right")),
}
"""Cylinders and discs."""


def rows_of(vehicle: Vehicle, x: Scalars) -> Scalars:
    every = clearances(vehicle, OBSTACLES)
    return every.distances(Vec3(*x[:3]), Quaternion(*x[3:7]).rotation(), x[7:])


def test_a_vehicle_with_shapes_is_as_far_from_all_as_mujoco_has_it() -> None:
    vehicle = boxed()
    every, spec = clearances(vehicle, OBSTACLES), spec_with_shapes(vehicle)
    for surface in OBSTACLES:
        if surface.shape != "plane":
            words = {"name": surface.name, "link": BASE, "shape": surface.shape}
            placed = Collision(
                **words,
                size=surface.size,
                vertices=surface.vertices,
                position=surface.position,
            )
            add_geom(spec, spec.worldbody, placed, surface.name)
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 1],
        pos=[0, 0, -1],
    )
    model = finely(spec)
    data, (addresses, _) = mujoco.MjData(model), joint_addresses(vehicle, model)
    compared = set()
    for x in poses_of(vehicle, 3):
        data.qpos[:7], data.qpos[addresses] = x[:7], x[7:]
        mujoco.mj_kinematics(model, data)
        for pair, row in zip(every.pairs, rows_of(vehicle, x.tolist()), strict=True):
            if pair.volume.startswith("rotor/") or pair.other.startswith("rotor/"):
                continue
            there = distance(model, data, pair.volume, pair.other)
            if there > 1e-6:
                cylinders = {"base/leg", "pole"} & {pair.volume, pair.other}
                slack = 3e-4 if cylinders else 1e-6
                assert float(row) == pytest.approx(there, abs=slack)
                compared.add((pair.volume, pair.other))
            else:
                assert row <= 1e-6
    assert len(compared) > 20


def test_shapes_take_the_place_of_rods_and_leave_the_discs() -> None:
    vehicle = boxed()
    names = [each.name for each in volumes(vehicle)]
    assert names == [
        *(f"rotor/{rotor.name}" for rotor in vehicle.rotors),
        "base/body",
        "base/leg",
        "link/link1/upper",
        "link/link2/fore",
        "link/link2/tool",
    ]
    bare = dataclasses.replace(vehicle, collisions=())
    plain = load_vehicle("hummingbird_arm2")
    assert [each.name for each in volumes(bare)] == [
        each.name for each in volumes(plain)
    ]
    body = {each.name: each.body for each in volumes(vehicle)}
    pairs = clearances(vehicle).pairs
    assert pairs
    assert all(body[pair.volume] != body[pair.other] for pair in pairs)


def test_derivatives_of_shapes_are_central_differences() -> None:
    vehicle = boxed()
    pairs = clearances(vehicle, OBSTACLES).pairs
    x = poses_of(vehicle, 1)
    turns = np.random.default_rng(23).normal(size=x.shape)
    for row, dx in zip(x, turns, strict=True):
        series = rows_of(
            vehicle, tuple(Taylor((a, b)) for a, b in zip(row, dx, strict=True))
        )
        ahead, here, behind = (
            np.array(rows_of(vehicle, tuple((row + h * dx).tolist())))
            for h in (1e-6, 0.0, -1e-6)
        )
        np.testing.assert_allclose(
            [nth_derivative(each, 0) for each in series], here, atol=1e-6
        )
        slopes = np.array([nth_derivative(each, 1) for each in series])
        # the nearest place of a rim is approached only
        exact = (here > 0.0) & ~np.array(
            [bool(RIMS & {pair.volume, pair.other}) for pair in pairs]
        )
        expected = (ahead - behind) / 2e-6
        np.testing.assert_allclose(slopes[exact], expected[exact], atol=1e-5)


def test_a_batch_and_a_traced_program_of_shapes_are_a_loop() -> None:
    every = clearances(boxed(), OBSTACLES)
    every = dataclasses.replace(every, pairs=every.pairs[::7])

    def rows(*x: Scalar) -> Scalars:
        return every.distances(Vec3(*x[:3]), Quaternion(*x[3:7]).rotation(), x[7:])

    x = poses_of(boxed(), 3)
    alone = np.array([rows(*row.tolist()) for row in x])
    batch = [np.broadcast_to(row, len(x)) for row in rows(*x.T)]
    np.testing.assert_allclose(np.array(batch).T, alone, atol=1e-6)
    program = trace(rows, *x[0].tolist())
    np.testing.assert_array_equal([program.flat(row.tolist()) for row in x], alone)


def test_concentric_boxes_overlap_by_half_of_both() -> None:
    one, other = (
        solid(
            Collision(
                name="it",
                link=BASE,
                shape="box",
                size=(edge,) * 3,
                position=ZERO3,
            )
        )
        for edge in (0.2, 0.4)
    )
    assert pair_distance(one, other) <= -0.3 + 1e-12
    far = other.transform(Pose(Mat3.identity(), Vec3(1.0, 0.0, 0.0)))
    assert pair_distance(one, far) == pytest.approx(0.7, abs=1e-12)
    corner = other.transform(Pose(Mat3.identity(), Vec3(0.6, 0.6, 0.6)))
    assert pair_distance(one, corner) == pytest.approx(0.3 * math.sqrt(3.0), abs=1e-12)


def test_a_box_above_a_tilted_plane_is_as_far_as_its_lowest_corner() -> None:
    floor = Surface(name="floor", angles=Vec3(0.3, 0.2, 0.1))
    box = dataclasses.replace(
        drawn(np.random.default_rng(3), "box"), position=Vec3(0.0, 0.0, 1.0)
    )
    up = np.array(floor.rotation)[:, 2]
    heights = [np.array(corner) @ up for corner in solid(box).points]
    assert surface_distance(solid(box), floor, 0.0) == pytest.approx(min(heights))
