"""Bodies that lie on bodies, stand on slopes and hit each other: depths, forces and
speeds in closed form, and on both plants.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from drawn_drops import falling

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth, flat
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.surroundings import Surroundings, Together, coupled_places
from skyarm.records.leaves import leaves, rebuild
from skyarm.vehicle import Vehicle
from skyarm.world.contact import Contact, FreeObject, Material, Surface
from skyarm.world.contact.closed_contact import GeomContact
from skyarm.world.contact.initial_world import initial_clearance
from skyarm.world.contact.static_equilibrium import stand_vehicle
from support.one_vehicle import places_in
from support.worlds import AWAY, BIRD, GRAVITY, Scene, at_rest, fall, states

K = 5000.0
SOFT = Material(dissipation=20.0, friction=0.8)
LYING = (0.5 * math.pi, 0.0, 0.0)


def thing(name: str, height: float, mass: float = 0.3, **fields) -> FreeObject:
    """Object of soft material with its middle at a height (m)."""
    at = Vec3(0.0, 0.0, height)
    return FreeObject(name=name, mass=mass, position=at, material=SOFT, **fields)


def solid(kind: str, *size: float) -> Vehicle:
    """Vehicle of 1 kg that nothing drives, with a shape."""
    return falling({"shape": kind, "size": size}, 1.0, Vec3(0.01, 0.01, 0.01))


@pytest.mark.parametrize(
    ("sides", "places"),
    [
        pytest.param((0.3, 0.2, 0.1), (4, 4, 4), marks=pytest.mark.thorough),
        pytest.param((0.1, 0.1, 0.1), (4, 8, 8), marks=pytest.mark.thorough),
        pytest.param((0.06, 0.1, 0.14), (4, 4, 4), marks=pytest.mark.thorough),
    ],
)
def test_each_face_of_three_boxes_bears_what_is_above_it(sides, places):
    """n m g, and as deep as it bends the stiffness of its corners and crossed edges."""
    boxes = [
        thing(f"box_{i}", 0.05 + 0.1 * i, size=(side, side, 0.1))
        for i, side in enumerate(sides)
    ]
    ground = Surface(name="ground", material=SOFT)
    contact = Contact(surfaces=(ground,), objects=tuple(boxes))
    _, rows = Scene(contact).fly(contact, 0.5)
    heights = [0.0, *rows[-1, :, 2]]
    start = contact.start(0.005, ())
    carried = tuple(
        rebuild(each, iter(row.tolist()))
        for each, row in zip(start.carried, rows[-1], strict=True)
    )
    memory = dataclasses.replace(start, carried=carried)
    pushes = contact.meetings(memory, PointMotion(BIRD, AWAY))
    for i in range(3):
        weight = (3 - i) * 0.3 * GRAVITY
        deep = (0.1 if i else 0.05) - (heights[i + 1] - heights[i])
        assert deep * K * places[i] == pytest.approx(weight, rel=1e-3)
        face = [each for each in pushes if {each.of, each.by} == {i - 1, i}]
        normal = sum(float(each.touch.normal * each.touch.axis.z) for each in face)
        assert abs(normal) == pytest.approx(weight, rel=1e-3)


POSTS = {
    "box": {"shape": "box", "size": (0.04, 0.04, 0.2)},
    "cylinder": {"shape": "cylinder", "size": (0.02, 0.2)},
    "ball": {"shape": "sphere", "size": (0.1,)},
    "bar": {"shape": "capsule", "size": (0.1, 0.3), "angles": LYING},
}

THINGS = {
    "box": {"size": (0.1, 0.08, 0.06)},
    "cylinder": {"shape": "cylinder", "size": (0.05, 0.06)},
    "capsule": {"shape": "capsule", "size": (0.03, 0.2), "angles": (0.0, 1.5708, 0.0)},
    "ball": {"shape": "sphere", "size": (0.03,)},
}


@pytest.mark.parametrize(
    ("post", "kind", "places"),
    [
        ("box", "box", 4),
        ("bar", "box", 2),
        ("box", "capsule", 2),
        pytest.param("cylinder", "box", 3, marks=pytest.mark.thorough),
        pytest.param("ball", "box", 1, marks=pytest.mark.thorough),
        pytest.param("box", "cylinder", 4, marks=pytest.mark.thorough),
        pytest.param("bar", "cylinder", 2, marks=pytest.mark.thorough),
        pytest.param("bar", "capsule", 1, marks=pytest.mark.thorough),
        pytest.param("ball", "ball", 1, marks=pytest.mark.thorough),
    ],
)
def test_a_post_narrower_than_what_lies_on_it_bears_that(post, kind, places):
    under = Surface(
        name="post", position=(0.0, 0.0, -0.1), material=SOFT, **POSTS[post]
    )
    contact = Contact(surfaces=(under,), objects=(thing("it", 0.03, **THINGS[kind]),))
    assert contact.meeting_count == len(
        contact.meetings(contact.start(0.005, ()), PointMotion(BIRD, AWAY))
    )
    _, rows = Scene(contact).fly(contact, 0.3)
    depth = 0.03 - rows[-1, 0, 2]
    assert depth == pytest.approx(0.3 * GRAVITY / K / places, rel=1e-2)


def settled(contact, vehicle, start):
    """States of a vehicle whose friction bears its weight from the start."""
    motion = PointMotion(vehicle, start, gravity=GRAVITY)
    memory = contact.settle(contact.start(0.005, ()), motion, vehicle=True)
    around = Surroundings(components=(contact,), memories=(memory,))
    return states(start, fall(vehicle, start, around, 0.8))


def on_slope(vehicle, slope, height):
    """State at rest at a height (m) above a plane that is tilted about y (rad)."""
    normal = Vec3(math.sin(slope), 0.0, math.cos(slope))
    turned = Quaternion(math.cos(0.5 * slope), 0.0, math.sin(0.5 * slope), 0.0)
    start = at_rest(vehicle, (0.0, 0.0, 1.0))
    return dataclasses.replace(start, position=normal * height, quaternion=turned)


@pytest.mark.parametrize(
    "share", [pytest.param(0.99, marks=pytest.mark.thorough), 1.01]
)
def test_a_vehicle_at_rest_slides_down_slopes_beyond_its_angle_of_friction(share):
    vehicle, friction = solid("box", 0.2, 0.3, 0.02), 0.5
    slope = share * math.atan(friction)
    material = Material(friction=friction, dissipation=10.0)
    plane = Surface(name="g", angles=(0.0, slope, 0.0), material=material)
    resting = 0.01 - GRAVITY * math.cos(slope) / (4.0 * K)
    contact = Contact(surfaces=(plane,)).on({"": vehicle})
    start = on_slope(vehicle, slope, resting)
    if share < 1.0:
        above = at_rest(vehicle, (0.0, 0.0, 0.03))
        start = stand_vehicle(vehicle, GRAVITY, contact, above)
    flight = settled(contact, vehicle, start)
    faster = flight[-1].velocity - flight[59].velocity
    gained = math.sqrt(float(faster.dot(faster))) / 0.5
    pull = GRAVITY * (math.sin(slope) - friction * math.cos(slope))
    assert gained == pytest.approx(max(pull, 0.0), rel=1e-2, abs=1e-6)
    if share < 1.0:
        moved = flight[-1].position - flight[0].position
        assert float(moved.dot(moved)) < 1e-6**2


@pytest.mark.parametrize(
    ("kind", "size", "half", "high"),
    [
        pytest.param("box", (0.1, 0.2, 0.2), 0.05, 0.1, marks=pytest.mark.thorough),
        pytest.param("cylinder", (0.05, 0.2), 0.05, 0.1, marks=pytest.mark.thorough),
    ],
)
def test_a_vehicle_tips_over_where_its_centre_is_beyond_its_edge(
    kind, size, half, high
):
    """Within 1 % of tan(slope) = half / high, stiff enough not to lean; from rest, with
    its bristles bent.
    """
    vehicle = solid(kind, *size)
    for share in (0.99, 1.01):
        slope = share * math.atan(half / high)
        hard = Material(friction=2.0, dissipation=10.0, stiffness=50000.0)
        plane = Surface(name="g", angles=(0.0, slope, 0.0), material=hard)
        contact = Contact(surfaces=(plane,)).on({"": vehicle})
        start = at_rest(vehicle, (0.0, 0.0, high / math.cos(slope) + 0.02))
        if share < 1.0:
            start = stand_vehicle(vehicle, GRAVITY, contact, start)
        else:
            with pytest.raises(ValueError, match="vehicle's collisions; it tips over"):
                stand_vehicle(vehicle, GRAVITY, contact, start)
            start = on_slope(vehicle, slope, high - 1e-4)
        last = settled(contact, vehicle, start)[-1]
        moved = math.dist(tuple(last.position), tuple(start.position))
        assert moved < 1e-6 if share < 1.0 else moved > 0.02


@pytest.mark.parametrize("mass", [0.5, pytest.param(3.0, marks=pytest.mark.thorough)])
def test_two_elastic_spheres_exchange_their_momentum(mass):
    """Huygens: v1' = (m1 - m2) / (m1 + m2) v, v2' = 2 m1 / (m1 + m2) v."""
    elastic = Material(friction=0.0, dissipation=0.0)
    balls = [
        dataclasses.replace(
            thing(name, 1.0, each, shape="sphere", size=(0.1,)),
            position=Vec3(x, 0.0, 1.0),
            velocity=Vec3(v, 0.0, 0.0),
            material=elastic,
        )
        for name, each, x, v in (("a", 1.0, 0.0, 1.0), ("b", mass, 0.25, 0.0))
    ]
    contact = Contact(objects=tuple(balls))
    _, rows = Scene(contact, gravity=0.0).fly(contact, 0.12, step=0.001)
    expected = np.array([1.0 - mass, 2.0]) / (1.0 + mass)
    assert rows[-1, :, 7] == pytest.approx(expected, abs=1e-4)
    # one spring between both: m v^2 = k d^2
    apart = rows[:, 1, 0] - rows[:, 0, 0]
    reduced = mass / (1.0 + mass)
    assert 0.2 - apart.min() == pytest.approx(math.sqrt(reduced / K), rel=1e-2)


FLOORS = {
    "plane": ({},),
    "box": ({"shape": "box", "size": (1.0, 0.8, 0.2), "position": (0.0, 0.0, -0.1)},),
    "bars": tuple(
        {
            "shape": "capsule",
            "size": (0.03, 1.0),
            "angles": (0.0, 0.5 * math.pi, 0.0),
            "position": (0.0, y, -0.03),
        }
        for y in (-0.06, 0.06)
    ),
}


def slid(plant, surfaces, vehicle, start):
    """Place (m), and normal force (N), of a vehicle that has slid on surfaces for 0.8
    s.
    """
    kind = Contact if plant is RigidBodyPlant else GeomContact
    contact = kind(surfaces=surfaces).on({"": vehicle})
    shared = {"components": (contact,), "memories": (contact.start(0.005, ()),)}
    around, places = Surroundings(**shared), places_in
    if plant is MujocoPlant:
        around, places = Together(each=(Surroundings(),), **shared), coupled_places
    flown = plant(Truth(vehicle=vehicle, gravity=GRAVITY), around)
    x, told = flat(start), list(leaves(around))
    for _ in range(160):
        found = flown.advance(x, (0.0,) * len(vehicle.rotors), told, 0.005)
        x, after = found[: len(x)], found[len(x) :]
        for place, value in zip(places(around), after, strict=True):
            told[place] = value
    state = rebuild(start, iter(x))
    (memory,) = rebuild(around.memories, iter(after))
    numbers = contact.logged(memory, PointMotion(vehicle, state, gravity=GRAVITY))
    force = sum(map(float, numbers[: 4 * len(surfaces) : 4]))
    return np.array([float(c) for c in state.position]), force


@pytest.mark.parametrize(
    ("floor", "kind", "size", "half"),
    [
        ("plane", "box", (0.2, 0.3, 0.1), 0.05),
        pytest.param("plane", "sphere", (0.1,), 0.1, marks=pytest.mark.thorough),
        pytest.param("plane", "cylinder", (0.1, 0.2), 0.1, marks=pytest.mark.thorough),
        pytest.param("box", "box", (0.2, 0.3, 0.1), 0.05, marks=pytest.mark.thorough),
        pytest.param("box", "sphere", (0.1,), 0.1, marks=pytest.mark.thorough),
        pytest.param("bars", "box", (0.2, 0.3, 0.1), 0.05, marks=pytest.mark.thorough),
        pytest.param("bars", "cylinder", (0.1, 0.2), 0.1, marks=pytest.mark.thorough),
    ],
)
def test_both_plants_press_and_slide_alike(floor, kind, size, half):
    """Depth within 2 %, force within 1 %, way of a slide within 2 mm; an upright
    cylinder on a box has three places here and four in MuJoCo.
    """
    material = Material(dissipation=30.0, friction=0.4)
    surfaces = tuple(
        Surface(name=f"floor_{i}", material=material, **fields)
        for i, fields in enumerate(FLOORS[floor])
    )
    vehicle = solid(kind, *size)
    start = at_rest(vehicle, (0.0, 0.0, half - 2e-4), velocity=Vec3(0.3, 0.0, 0.0))
    (own, force), (other, there) = (
        slid(plant, surfaces, vehicle, start) for plant in (RigidBodyPlant, MujocoPlant)
    )
    assert half - own[2] == pytest.approx(half - other[2], rel=0.02)
    assert force == pytest.approx(there, rel=0.01)
    assert np.abs(own - other).max() < 2e-3
    assert own[0] > 0.01


def test_the_clearance_of_a_start_is_that_of_points_and_shapes():
    ground = Surface(name="ground")
    contact, vehicle = Contact(surfaces=(ground,)), solid("sphere", 0.1)
    state = at_rest(vehicle, (0.0, 0.0, 0.4))
    distance, what, surface = initial_clearance(contact, vehicle, state)
    assert (distance, what, surface) == (pytest.approx(0.3), "body 'base'", "ground")
