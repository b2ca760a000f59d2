"""Signed distances of a vehicle's bodies against the collision libraries coal and
MuJoCo, and their derivatives.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
import pytest

from skyarm import load_vehicle
from skyarm.algebra import ZERO3, Mat3, Quaternion, Scalar, Scalars, Vec3
from skyarm.algebra.scalars.taylor import Taylor, nth_derivative
from skyarm.compile import trace
from skyarm.compile.tracing.lower import live, operations
from skyarm.compile.tracing.tracer import Graph
from skyarm.plant.mujoco_model import build_spec, joint_addresses
from skyarm.reference.signals import Ramp
from skyarm.vehicle.description import turn_onto
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.world.contact.surface import Surface, rotation_of
from skyarm.world.scene.clearance import (
    Clearances,
    Volume,
    clearances,
    pair_distance,
    surface_distance,
    volumes,
)
from skyarm.world.scene.vehicle_shapes import vehicle_shapes
from skyarm.world.signal_vector import SignalVector

ARMS = ("hummingbird_arm2", "hexarotor_arm6")

OBSTACLES = (
    Surface(
        name="box",
        shape="box",
        size=(0.4, 0.5, 0.6),
        position=Vec3(1.0, 0.2, 0.3),
        angles=Vec3(0.1, 0.2, 0.3),
    ),
    Surface(
        name="pole", shape="cylinder", size=(0.1, 2.0), position=Vec3(-0.8, 0.1, 0.0)
    ),
    Surface(name="ball", shape="sphere", size=(0.2,), position=Vec3(0.1, 1.0, 0.2)),
    Surface(name="floor", position=Vec3(0.0, 0.0, -1.5)),
)


def vec(v: np.ndarray) -> Vec3:
    return Vec3(*map(float, v))


def capsule(a: np.ndarray, b: np.ndarray, radius: float) -> Volume:
    return Volume("rod", BASE, (vec(a), vec(b)), radius)


@dataclasses.dataclass
class Coal:
    """Signed distances by coal, with tolerances that its own defaults do not reach."""

    coal: Any

    def rod(self, a: np.ndarray, b: np.ndarray, radius: float) -> tuple[Any, Any]:
        turn = np.array(turn_onto(tuple(b - a)))
        return self.coal.Capsule(
            radius, float(np.linalg.norm(b - a))
        ), self.coal.Transform3s(turn, 0.5 * (a + b))

    def surface(self, surface: Surface) -> tuple[Any, Any]:
        makers: dict[str, Callable[..., Any]] = {
            "box": self.coal.Box,
            "cylinder": self.coal.Cylinder,
            "sphere": self.coal.Sphere,
            "plane": lambda: self.coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0),
        }
        pose = self.coal.Transform3s(
            np.array(surface.rotation), np.array(surface.position)
        )
        return makers[surface.shape](*map(float, surface.size)), pose

    def distance(self, one: tuple[Any, Any], other: tuple[Any, Any]) -> float:
        request = self.coal.DistanceRequest()
        request.gjk_tolerance = request.epa_tolerance = 1e-10
        request.gjk_max_iterations = request.epa_max_iterations = 1000
        request.enable_signed_distance = True
        return float(
            self.coal.distance(*one, *other, request, self.coal.DistanceResult())
        )


@pytest.fixture(scope="module")
def oracle() -> Coal:
    return Coal(pytest.importorskip("coal", reason="comes with pinocchio"))


SIZES = {"box": 3, "cylinder": 2, "sphere": 1, "plane": 0}


def scenes(
    seed: int, count: int, shape: str
) -> list[tuple[Surface, np.ndarray, np.ndarray, float]]:
    """Random surfaces, each with a random rod near it: long and short ones, outside and
    inside.
    """
    rng, rows = np.random.default_rng(seed), []
    for _ in range(count):
        size, at, angles = (
            rng.uniform(0.05, 1.0, SIZES[shape]),
            rng.normal(size=3),
            rng.uniform(-3.0, 3.0, 3),
        )
        surface = Surface(
            name="s",
            shape=shape,
            size=tuple(size),
            position=vec(at),
            angles=vec(angles),
        )
        a = at + rng.normal(size=3) * rng.choice([0.2, 1.0])
        rows.append(
            (
                surface,
                a,
                a + rng.normal(size=3) * rng.choice([0.1, 1.0]),
                float(rng.uniform(0.01, 0.2)),
            )
        )
    return rows


@pytest.mark.parametrize("shape", SIZES)
def test_a_rod_is_as_far_from_a_surface_as_coal_has_it(
    oracle: Coal, shape: str
) -> None:
    inside = 0
    for surface, a, b, radius in scenes(3, 150, shape):
        expected = oracle.distance(oracle.rod(a, b, radius), oracle.surface(surface))
        deep = expected < -0.99 * radius
        inside += deep
        # there the depth is that of the deepest point
        if not (deep and shape == "cylinder"):
            assert surface_distance(
                capsule(a, b, radius), surface, 0.0
            ) == pytest.approx(expected, abs=1e-6)
    assert 10 < inside < 140


def test_in_a_cylinder_the_depth_is_that_of_the_deepest_point() -> None:
    for surface, a, b, radius in scenes(4, 60, "cylinder"):
        at = np.array(surface.position)
        local = (
            np.array(surface.rotation).T
            @ (a + np.linspace(0.0, 1.0, 4001)[:, None] * (b - a) - at).T
        )
        heights = np.maximum(
            np.hypot(*local[:2]) - surface.size[0],
            np.abs(local[2]) - 0.5 * surface.size[1],
        )
        if heights.min() < 0.0:
            found = surface_distance(capsule(a, b, radius), surface, 0.0) + radius
            # the search ends within a share of 2^-5 of the rod
            assert (
                heights.min() - 1e-4
                <= found
                <= heights.min() + np.linalg.norm(b - a) / 32.0
            )
            assert found < 0.0


def test_rods_and_discs_are_as_far_from_each_other_as_coal_has_them(
    oracle: Coal,
) -> None:
    rng = np.random.default_rng(6)
    for _ in range(150):
        a, b, c, d = rng.normal(size=(4, 3)) * 0.6
        rod = oracle.rod(a, b, 0.05)
        expected = oracle.distance(rod, oracle.rod(c, d, 0.1))
        assert pair_distance(capsule(a, b, 0.05), capsule(c, d, 0.1)) == pytest.approx(
            expected, abs=1e-9
        )
        axis = (d - c) / np.linalg.norm(d - c)
        disc = Volume("disc", BASE, (vec(c),), 0.02, 0.3, vec(axis))
        pose = oracle.coal.Transform3s(np.array(turn_onto(tuple(axis))), c)
        expected = oracle.distance(rod, (oracle.coal.Cylinder(0.3, 1e-9), pose)) - 0.02
        # coal takes the flat disc for a thick one where the rod's axis passes through
        # it
        if expected > -0.065:
            assert pair_distance(capsule(a, b, 0.05), disc) == pytest.approx(
                expected, abs=1e-5
            )
            assert pair_distance(disc, capsule(a, b, 0.05)) == pair_distance(
                capsule(a, b, 0.05), disc
            )


@pytest.mark.parametrize("shape", SIZES)
def test_a_disc_is_at_least_as_far_from_a_surface_as_it_says(
    oracle: Coal, shape: str
) -> None:
    exact = 0
    for surface, c, d, _ in scenes(7, 100, shape):
        axis = (d - c) / np.linalg.norm(d - c)
        pose = oracle.coal.Transform3s(np.array(turn_onto(tuple(axis))), c)
        expected = (
            oracle.distance(
                (oracle.coal.Cylinder(0.3, 1e-9), pose), oracle.surface(surface)
            )
            - 0.02
        )
        found = surface_distance(
            Volume("disc", BASE, (vec(c),), 0.02, 0.3, vec(axis)), surface, 0.0
        )
        if expected > -0.02:
            assert found <= expected + 1e-6
            assert shape in ("box", "cylinder") or found == pytest.approx(
                expected, abs=1e-6
            )
            exact += found > expected - 1e-3
    assert exact > 10


SIDES: dict[str, tuple[Sequence[float], Sequence[float], float]] = {
    "along an edge": ((-0.1, 0.45, 0.5), (0.1, 0.45, 0.5), math.hypot(0.2, 0.2)),
    "above a face": ((-0.1, 0.0, 0.5), (0.1, 0.0, 0.5), 0.2),
    "through the middle": ((0.0, 0.0, -0.5), (0.0, 0.0, 0.5), -0.2),
    "a point inside": ((0.0, 0.1, 0.0), (0.0, 0.1, 0.0), -0.15),
    "a point outside": ((0.5, 0.0, 0.0), (0.5, 0.0, 0.0), 0.3),
    "in the middle": ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), -0.2),
}


@pytest.mark.parametrize("side", SIDES)
def test_special_positions_at_a_box_have_a_distance_and_a_finite_derivative(
    side: str,
) -> None:
    a, b, expected = SIDES[side]
    box = Surface(name="box", shape="box", size=(0.4, 0.5, 0.6))
    rod = capsule(np.array(a), np.array(b), 0.0)
    assert surface_distance(rod, box, 0.0) == pytest.approx(expected, abs=1e-11)
    moved = dataclasses.replace(
        rod,
        points=tuple(Vec3(*(Taylor((c, 1.0)) for c in point)) for point in rod.points),
    )
    assert (
        abs(nth_derivative(surface_distance(moved, box, 0.0), 1))
        <= math.sqrt(3.0) + 1e-9
    )


@pytest.mark.parametrize("shape", SIZES)
def test_derivatives_of_a_rod_near_and_in_a_surface_are_central_differences(
    shape: str,
) -> None:
    draw, h = np.random.default_rng(13), 1e-6
    for surface, a, b, radius in scenes(8, 40, shape):
        da, db = draw.normal(size=(2, 3))
        here, ahead, behind = (
            surface_distance(capsule(a + t * da, b + t * db, radius), surface, 0.0)
            for t in (0.0, h, -h)
        )
        moved = capsule(a, b, radius)
        points = tuple(
            Vec3(*(Taylor((c, dc)) for c, dc in zip(p, dp, strict=True)))
            for p, dp in zip(moved.points, (da, db), strict=True)
        )
        series = surface_distance(
            dataclasses.replace(moved, points=points), surface, 0.0
        )
        assert nth_derivative(series, 0) == pytest.approx(here, abs=1e-12)
        if here > -radius or shape != "cylinder":
            assert nth_derivative(series, 1) == pytest.approx(
                (ahead - behind) / (2.0 * h), abs=1e-5
            )


def test_second_derivative_of_distance_from_edge_is_that_of_hypotenuse() -> None:
    box, rod = (
        Surface(name="box", shape="box", size=(0.4, 0.4, 4.0)),
        capsule(np.zeros(3), np.ones(3), 0.0),
    )
    x, y = Taylor((0.5, 1.0, 0.0)), Taylor((0.6, 0.0, 0.0))
    upright = dataclasses.replace(rod, points=(Vec3(x, y, -0.2), Vec3(x, y, 0.3)))
    # sqrt(u^2 + v^2)'' = v^2 / (u^2 + v^2)^(3/2) along u
    found = nth_derivative(surface_distance(upright, box, 0.0), 2)
    assert found == pytest.approx(0.4**2 / math.hypot(0.3, 0.4) ** 3, rel=1e-9)


def test_the_nearest_point_slides_in_second_derivatives() -> None:
    ball, rod = (
        Surface(name="ball", shape="sphere", size=(0.1,)),
        capsule(np.zeros(3), np.ones(3), 0.0),
    )
    x = Taylor((0.3, 1.0, 0.0))
    slanted = dataclasses.replace(
        rod, points=(Vec3(x - 2.0, -2.0, 0.4), Vec3(x + 2.0, 2.0, 0.4))
    )
    # a straight line passes at hypot(x / sqrt(2), 0.4), whose second derivative is that
    # of a hypotenuse
    found = nth_derivative(surface_distance(slanted, ball, 0.0), 2)
    assert found == pytest.approx(
        0.5 * 0.4**2 / math.hypot(0.3 / math.sqrt(2.0), 0.4) ** 3, rel=1e-9
    )


def test_first_derivatives_cost_little_beside_the_distances() -> None:
    vehicle = load_vehicle("hummingbird_arm2")
    every = clearances(vehicle, OBSTACLES[:2])
    counts = []
    for rates in (False, True):
        graph = Graph(loops=True)
        x = [graph.input(f"x{i}") for i in range(2 * (7 + vehicle.n))]
        state = (
            [Taylor(each) for each in zip(x[::2], x[1::2], strict=True)]
            if rates
            else x[::2]
        )
        rows = [row.c if rates else (row,) for row in rows_of(every, state)]
        counts.append(operations(live([graph.lift(c) for row in rows for c in row])))
    assert counts[1] < 1.4 * counts[0]


def test_parallel_and_touching_rods_have_a_distance_and_a_finite_derivative() -> None:
    def rod(x: float, z: float, length: float) -> Volume:
        return capsule(np.array([x, 0.0, z]), np.array([x + length, 0.0, z]), 0.01)

    cases = {
        (0.2, 0.1): 0.08,
        (1.3, 0.0): 0.28,
        (-1.3, 0.4): 0.48,
        (0.0, 0.0): -0.02,
        (2.0, 0.0): 0.98,
    }
    for (x, z), expected in cases.items():
        other = rod(x, z, 1.0)
        assert pair_distance(rod(0.0, 0.0, 1.0), other) == pytest.approx(
            expected, abs=1e-11
        )
        moved = dataclasses.replace(
            other,
            points=(other.points[0] + Vec3(0, 0, Taylor((0.0, 1.0))), other.points[1]),
        )
        assert math.isfinite(
            nth_derivative(pair_distance(rod(0.0, 0.0, 1.0), moved), 1)
        )
    assert pair_distance(rod(0.0, 0.0, 0.0), rod(0.0, 0.3, 0.0)) == pytest.approx(
        0.28, abs=1e-11
    )


def rows_of(every: Clearances, x: Sequence[Scalar]) -> Scalars:
    return every.distances(Vec3(*x[:3]), Quaternion(*x[3:7]).rotation(), x[7:])


def states(vehicle: Vehicle, count: int) -> np.ndarray:
    draw = np.random.default_rng(11)
    x = draw.normal(size=(count, 7 + vehicle.n)) * 0.8
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1)[:, None]
    return x


@pytest.mark.parametrize("name", ARMS)
def test_bodies_of_a_vehicle_are_as_far_apart_as_mujoco_has_them(name: str) -> None:
    vehicle = load_vehicle(name)
    every, spec = clearances(vehicle, OBSTACLES[2:3]), build_spec(vehicle, 9.81)
    rods = [
        shape
        for shape in vehicle_shapes(vehicle, meshes=False)
        if shape.kind == "capsule"
    ]
    names = {BASE: spec.worldbody.bodies[0].name} | {
        i: link.name for i, link in enumerate(vehicle.moving)
    }
    for shape in rods:
        turn = np.zeros(4)
        mujoco.mju_mat2Quat(turn, np.array(shape.rotation).ravel())
        spec.body(names[shape.body]).add_geom(
            name=shape.name,
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[shape.size[0], 0.5 * shape.size[1], 0.0],
            pos=shape.position,
            quat=turn,
            mass=0.0,
        )
    spec.worldbody.add_geom(
        name="ball",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[0.2, 0, 0],
        pos=[0.1, 1.0, 0.2],
    )
    model = spec.compile()
    data, (addresses, _) = mujoco.MjData(model), joint_addresses(vehicle, model)
    compared, capsules = 0, {shape.name for shape in rods} | {"ball"}
    for x in states(vehicle, 5):
        data.qpos[:7], data.qpos[addresses] = x[:7], x[7:]
        mujoco.mj_kinematics(model, data)
        for pair, row in zip(every.pairs, rows_of(every, x.tolist()), strict=True):
            if {pair.volume, pair.other} <= capsules:
                one, other = (model.geom(each).id for each in (pair.volume, pair.other))
                assert row == pytest.approx(
                    mujoco.mj_geomDistance(model, data, one, other, 10.0, None),
                    abs=1e-9,
                )
                compared += 1
    assert compared > 5 * len(rods)


@pytest.mark.parametrize("name", ARMS)
def test_derivatives_are_central_differences_of_the_distances(name: str) -> None:
    vehicle = load_vehicle(name)
    every = clearances(vehicle, OBSTACLES)
    every = dataclasses.replace(
        every, pairs=every.pairs[:: max(1, len(every.pairs) // 60)]
    )
    turns = np.random.default_rng(12).normal(size=(3, 7 + vehicle.n))
    for x, dx in zip(states(vehicle, 3), turns, strict=True):
        orders = ((), (0.0,))[: 1 if vehicle.n > 2 else 2]
        rows = [
            rows_of(every, [Taylor((a, b, *rest)) for a, b in zip(x, dx, strict=True)])
            for rest in orders
        ]
        ahead, here, behind = (
            np.array(rows_of(every, (x + h * dx).tolist())) for h in (1e-6, 0.0, -1e-6)
        )
        for order in rows:
            np.testing.assert_allclose(
                [nth_derivative(row, 0) for row in order], here, atol=1e-11
            )
            slopes = np.array([nth_derivative(row, 1) for row in order])
            np.testing.assert_allclose(slopes, (ahead - behind) / 2e-6, atol=1e-5)


@pytest.mark.parametrize("name", ARMS)
def test_a_batch_and_a_traced_program_are_a_loop(name: str) -> None:
    vehicle = load_vehicle(name)
    every, x = clearances(vehicle, OBSTACLES), states(vehicle, 4)
    every = dataclasses.replace(
        every, pairs=every.pairs[:: max(1, len(every.pairs) // 30)]
    )
    alone = np.array([rows_of(every, row.tolist()) for row in x])
    batch = np.array(
        [np.broadcast_to(row, len(x)) for row in rows_of(every, tuple(x.T))]
    )
    np.testing.assert_allclose(batch.T, alone, rtol=1e-12, atol=1e-12)
    program = trace(lambda *x: rows_of(every, x), *x[0].tolist())
    np.testing.assert_array_equal([program.flat(row.tolist()) for row in x], alone)


def test_varied_lengths_of_an_arm_are_those_of_as_many_vehicles() -> None:
    def longer(by: Any) -> Vehicle:
        vehicle = load_vehicle("hummingbird_arm2")
        first, second = vehicle.links
        joint = dataclasses.replace(
            second.joint, position=second.joint.position + Vec3(by, 0.0, 0.0)
        )
        return vehicle.with_checked(
            links=(first, dataclasses.replace(second, joint=joint))
        )

    x, by = states(longer(0.0), 1)[0].tolist(), np.array([0.0, 0.05, 0.4])
    several = clearances(longer(by), OBSTACLES[:1])
    found = dict(zip(several.names, rows_of(several, x), strict=True))
    for k, each in enumerate(by.tolist()):
        one = clearances(longer(each), OBSTACLES[:1])
        expected = dict(zip(one.names, rows_of(one, x), strict=True))
        for name, row in found.items():
            lane = float(np.broadcast_to(row, 3)[k])
            assert lane == (
                pytest.approx(expected[name], abs=1e-12)
                if name in expected
                else math.inf
            )


def test_pairs_that_touch_at_rest_and_bodies_in_contact_are_left_out() -> None:
    vehicle = load_vehicle("hexarotor_arm6")
    rest = [
        float(np.clip(0.0, link.joint.lower, link.joint.upper))
        for link in vehicle.links
    ]
    every = clearances(vehicle)
    assert min(every.distances(ZERO3, Mat3.identity(), rest)) >= 0.0
    # a link and the one that it carries share the place of the joint
    names = {frozenset((pair.volume, pair.other)) for pair in every.pairs}
    rods = [each.name for each in volumes(vehicle) if each.name.startswith("link/")]
    chain = [*dict.fromkeys(rods)]
    assert not names & {
        frozenset(each) for each in pairwise(chain) if "camera" not in each[0] + each[1]
    }
    assert frozenset(("link/hand/tip", "hull")) in names
    body = {each.name: each.body for each in volumes(vehicle)}
    assert all(body[pair.volume] != body[pair.other] for pair in every.pairs)
    tip = vehicle.frame().link
    met = {
        pair.volume
        for pair in clearances(vehicle, OBSTACLES, {tip}).pairs
        if pair.surface is not None
    }
    assert met == {name for name in body if body[name] != tip}
    based = {
        pair.volume
        for pair in clearances(vehicle, OBSTACLES, {BASE}).pairs
        if pair.surface is not None
    }
    assert {"hull", "boom/rotor0", "rotor/rotor0"} < based
    assert not [name for name in based if name.startswith("base/")]


def test_a_moving_surface_is_where_it_is_then_and_a_filled_hole_is_a_cylinder() -> None:
    rise = SignalVector(z=Ramp(start=0.0, duration=2.0, height=1.0))
    ball = Surface(
        name="ball",
        shape="sphere",
        size=(0.2,),
        position=Vec3(0.0, 0.0, 1.0),
        motion=rise,
    )
    rod = capsule(np.array([0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.1]), 0.1)
    assert [surface_distance(rod, ball, t) for t in (0.0, 2.0)] == pytest.approx(
        [0.6, 1.6], abs=1e-9
    )
    plate = Surface(
        name="plate",
        shape="hole",
        size=(0.05, 0.1, 0.01, 0.3, 0.2),
        angles=Vec3(0.4, 0.2, 0.1),
    )
    middle = rotation_of(plate.angles).apply(Vec3(0.0, 0.0, -0.1))
    solid = Surface(
        name="solid",
        shape="cylinder",
        size=(0.3, 0.2),
        position=middle,
        angles=plate.angles,
    )
    for a, b in np.random.default_rng(9).normal(size=(10, 2, 3)):
        rod = capsule(a, b, 0.1)
        assert surface_distance(rod, plate, 0.0) == pytest.approx(
            surface_distance(rod, solid, 0.0), abs=1e-12
        )
