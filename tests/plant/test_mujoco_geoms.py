"""MuJoCo's own contacts between surfaces, objects and shapes of vehicles: closed forms
of rest, slide, roll, tip-over and impact; what is logged and what is refused.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import E_Z, ZERO3, Quaternion, Vec3
from skyarm.dynamics.state import State
from skyarm.plant.interface import Truth, flat
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.surroundings import Surroundings, Together, coupled_places
from skyarm.records.coerce import RecordError
from skyarm.records.leaves import leaves, rebuild
from skyarm.reference.signals import Constant
from skyarm.scenario.in_flight import require_continuous
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.vehicle import BASE, Vehicle
from skyarm.vehicle.vehicle_records import Collision
from skyarm.world.contact.closed_contact import GeomContact
from skyarm.world.contact.contact import Contact
from skyarm.world.contact.contact_memory import ContactMemory
from skyarm.world.contact.contact_point import ContactPoint
from skyarm.world.contact.free_object import FreeObject
from skyarm.world.contact.gripper import Gripper
from skyarm.world.contact.material import Material
from skyarm.world.contact.surface import Surface, rotation_of
from skyarm.world.signal_vector import SignalVector
from support.worlds import AWAY, BIRD, GRAVITY, SKIDS, at_rest

STIFF = 5000.0
"""Stiffness of the default material, N/m."""

TETRAHEDRON = tuple(
    Vec3(0.03 * x, 0.03 * y, 0.03 * z)
    for x, y, z in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))
)

WEDGE = tuple(
    Vec3(x, y, z)
    for x, y, z in (
        *((a, b, -0.05) for a in (-0.05, 0.05) for b in (-0.05, 0.05)),
        (0.0, -0.05, 0.05),
        (0.0, 0.05, 0.05),
    )
)
"""Corners of a roof on a square."""


def shape(name: str, kind: str, *size: float, **fields: Any) -> Collision:
    """Shape of a vehicle at the origin of its base, if no field says another."""
    usual = {"link": BASE, "position": ZERO3} | fields
    return Collision(name=name, shape=kind, size=size, **usual)


def beside(contact: Contact) -> Together:
    """Surroundings of one vehicle with a contact."""
    return Together(
        each=(Surroundings(),),
        components=(contact,),
        memories=(contact.start(0.005, ()),),
    )


def flown(
    contact: GeomContact,
    seconds: float,
    vehicle: Vehicle = BIRD,
    state: State = AWAY,
    gravity: float = GRAVITY,
) -> list[ContactMemory]:
    """Memories of a contact, with a limp vehicle that is far away if left out."""
    contact = contact.on({"": vehicle})
    around = beside(contact)
    plant = MujocoPlant(Truth(vehicle=vehicle, gravity=gravity), around)
    x, given, memories = flat(state), list(leaves(around)), []
    places = coupled_places(around)
    command = (0.0,) * (len(vehicle.rotors) + vehicle.n)
    for _ in range(round(seconds / 0.005)):
        row = plant.advance(x, command, given, 0.005)
        x, after = row[: len(x)], row[len(x) :]
        for place, value in zip(places, after, strict=True):
            given[place] = value
        memories.append(rebuild(around.memories, iter(after))[0])
    return memories


def world(*objects: FreeObject, angle: float = 0.0, **fields: Any) -> GeomContact:
    """Objects on a plane that rises by an angle against x."""
    material = fields.pop("material", Material())
    plane = Surface(name="plane", angles=Vec3(0.0, angle, 0.0), material=material)
    # far from the vehicle nothing touches its tip
    return GeomContact(surfaces=(plane,), objects=objects, **fields)


def on_slope(angle: float, height: float, **fields: Any) -> FreeObject:
    """Object whose middle is at a height above that plane, along its normal."""
    usual = {"name": "it", "mass": 0.2, "angles": Vec3(0.0, angle, 0.0)} | fields
    normal = rotation_of(Vec3(0.0, angle, 0.0)).apply(E_Z)
    return FreeObject(position=normal * height, **usual)


def way(memories: Sequence[ContactMemory], angle: float) -> np.ndarray:
    """Places (m) of the first object down the plane that rises by an angle."""
    down = rotation_of(Vec3(0.0, angle, 0.0)).apply(Vec3(1.0, 0.0, 0.0))
    return np.array([float(each.carried[0].position.dot(down)) for each in memories])


# MuJoCo itself stretches the heights of a field from 0 to 1
@pytest.mark.parametrize(
    ("row", "height", "low"), [("0000ffff", 0.4, -0.2), ("40008000", 1.6, -0.6)]
)
def test_a_ball_rolls_on_a_heightfield_as_on_a_plane_of_its_slope(
    row: str, height: float, low: float
) -> None:
    radius, angle = 0.05, math.atan(0.2)
    moment = 0.4 * 0.2 * radius**2
    above = radius - 0.2 * GRAVITY * math.cos(angle) / STIFF
    ball = on_slope(
        -angle, above, shape="sphere", size=(radius,), inertia=(moment,) * 3
    )
    relief = Surface(
        name="hill",
        shape="heightfield",
        size=(2.0, 1.0, height, 0.1),
        position=Vec3(0.0, 0.0, low),
        heights=(row,) * 3,
        material=Material(friction=0.5),
    )
    contact = GeomContact(surfaces=(relief,), objects=(ball,))
    x = way(flown(contact, 0.5), -angle)
    assert -x[-1] == pytest.approx(
        0.5 * 5.0 / 7.0 * GRAVITY * math.sin(angle) * 0.25, rel=0.01
    )


@pytest.mark.parametrize(
    ("kind", "size", "height", "contacts"),
    [
        ("sphere", (0.04,), 0.04, 1),
        ("box", (0.1, 0.06, 0.04), 0.02, 4),
        ("cylinder", (0.03, 0.08), 0.04, 3),
    ],
)
def test_a_body_at_rest_sinks_in_by_its_weight_over_the_stiffness(
    kind: str, size: tuple[float, ...], height: float, contacts: int
) -> None:
    thing = on_slope(0.0, height, shape=kind, size=size)
    memories = flown(world(thing, material=Material(dissipation=50.0)), 0.8)
    depth = height - float(memories[-1].carried[0].position.z)
    assert depth == pytest.approx(0.2 * GRAVITY / STIFF / contacts, rel=1e-3)
    assert abs(float(memories[-1].carried[0].velocity.z)) < 1e-4


@pytest.mark.parametrize("mirrored", [1.0, -1.0])
def test_a_box_holds_below_the_friction_angle_and_slides_above(mirrored: float) -> None:
    friction = 0.3
    for share in (0.95, 1.5):
        angle = mirrored * math.atan(share * friction)
        box = on_slope(angle, 0.02 - 0.2 * GRAVITY / STIFF / 4.0, size=(0.1, 0.1, 0.04))
        memories = flown(world(box, angle=angle), 1.0)
        x = mirrored * way(memories, angle)
        if share < 1.0:
            # what it slips at first, and then less than 10 micrometres a second
            assert abs(x[-1]) < 3e-4
            assert abs(x[-1] - x[100]) < 5e-6
        else:
            rate = GRAVITY * abs(math.sin(angle)) * (1.0 - 1.0 / share)
            assert x[-1] == pytest.approx(0.5 * rate, rel=0.01)


def test_a_ball_rolls_down_with_five_sevenths_of_the_weight() -> None:
    angle = 0.2
    ball = on_slope(angle, 0.05, shape="sphere", size=(0.05,), mass=0.1)
    memories = flown(world(ball, angle=angle), 1.0)
    expected = 0.5 * 5.0 / 7.0 * GRAVITY * math.sin(angle)
    assert way(memories, angle)[-1] == pytest.approx(expected, rel=0.01)
    spin, speed = memories[-1].carried[0].rate, memories[-1].carried[0].velocity
    assert float(spin.y) * 0.05 == pytest.approx(
        math.hypot(float(speed.x), float(speed.z)), rel=0.01
    )


@pytest.mark.parametrize(("share", "falls"), [(0.99, False), (1.01, True)])
def test_a_box_tips_over_where_its_middle_passes_its_edge(
    share: float, *, falls: bool
) -> None:
    width, height = 0.12, 0.36
    angle = math.atan(share * width / height)
    size = (width, 0.08, height)
    # stiff, or it leans on the edge that sinks in
    material = Material(friction=2.0, stiffness=2e5, dissipation=50.0)
    box = on_slope(angle, 0.5 * height, size=size, mass=0.5)
    memories = flown(world(box, angle=angle, material=material), 0.9)
    turned = memories[-1].carried[0].attitude.rotation().apply(E_Z)
    normal = rotation_of(Vec3(0.0, angle, 0.0)).apply(E_Z)
    turn = math.degrees(math.acos(min(float(turned.dot(normal)), 1.0)))
    assert turn > 20.0 if falls else turn < 0.1


@pytest.mark.parametrize("dissipation", [0.0, 1.0])
def test_an_impact_takes_what_the_law_of_the_other_plant_takes(
    dissipation: float,
) -> None:
    speed = 0.3
    material = Material(dissipation=dissipation)
    ball = on_slope(
        0.0, 0.05, shape="sphere", size=(0.05,), velocity=Vec3(0.0, 0.0, -speed)
    )
    memories = flown(world(ball, material=material), 0.06, gravity=0.0)
    after = float(memories[-1].carried[0].velocity.z)
    # by Hunt and Crossley: ln((1 + c v) / (1 - c u)) = c (v + u) of the speed u after
    c, expected = dissipation, speed
    for _ in range(100 if c else 0):
        expected = (1.0 - (1.0 + c * speed) * math.exp(-c * (speed + expected))) / c
    assert after == pytest.approx(expected, rel=0.01)


def test_two_equal_balls_exchange_their_velocities() -> None:
    balls = [
        FreeObject(
            name=name,
            shape="sphere",
            size=(0.04,),
            mass=0.1,
            position=Vec3(x, 0.0, 1.0),
            velocity=Vec3(speed, 0.0, 0.0),
            material=Material(dissipation=0.0),
        )
        for name, x, speed in (("a", 0.0, 0.5), ("b", 0.081, 0.0))
    ]
    memories = flown(world(*balls), 0.06, gravity=0.0)
    a, b = (float(each.velocity.x) for each in memories[-1].carried)
    assert a + b == pytest.approx(0.5, abs=1e-9)
    assert b == pytest.approx(0.5, rel=0.01)


SHAPES = [
    shape("leg", "sphere", 0.04),
    shape("leg", "capsule", 0.01, 0.06),
    shape("leg", "hull", vertices=tuple(Vec3(a.x, a.y, 0.0 - a.z) for a in WEDGE)),
    shape("leg", "box", 0.1, 0.1, 0.1),
]


@pytest.mark.parametrize("own", SHAPES, ids=lambda each: each.shape)
def test_shapes_of_a_vehicle_bear_it_and_say_where(own: Collision) -> None:
    if own.shape in ("sphere", "capsule"):
        # of one alone it would topple
        corners = [Vec3(0.1 * x, 0.1 * y, 0.0) for x in (-1, 1) for y in (-1, 1)]
        legs = tuple(
            dataclasses.replace(own, name=f"leg{i}", position=at)
            for i, at in enumerate(corners)
        )
    else:
        legs = (own,)
    low = {"sphere": 0.04, "capsule": 0.04}.get(own.shape, 0.05)
    bird = dataclasses.replace(BIRD, collisions=legs)
    contact = world(material=Material(dissipation=50.0))
    memories = flown(contact, 0.6, bird, at_rest(bird, (0.0, 0.0, low)))
    ((force, *place),) = memories[-1].touches
    assert force == pytest.approx(float(bird.mass) * GRAVITY, rel=1e-3)
    np.testing.assert_allclose(place, (0.0, 0.0, 0.0), atol=1e-3)


def test_contact_points_bear_a_vehicle_and_are_logged() -> None:
    angle = 0.1
    contact = dataclasses.replace(
        world(angle=angle, material=Material(dissipation=50.0)), points=SKIDS
    )
    normal = rotation_of(Vec3(0.0, angle, 0.0)).apply(E_Z)
    start = at_rest(
        BIRD,
        normal * 0.12,
        quaternion=Quaternion.of_rotation_vector(Vec3(0.0, angle, 0.0)),
    )
    force, friction, depth = np.transpose(flown(contact, 0.6, state=start)[-1].touches)
    weight = float(BIRD.mass) * GRAVITY
    assert force.sum() == pytest.approx(weight * math.cos(angle), rel=1e-3)
    assert friction.sum() == pytest.approx(weight * math.sin(angle), rel=1e-2)
    np.testing.assert_allclose(depth, force / STIFF, atol=1e-6)
    # the lower two bear more: the middle is 0.12 m high
    share = math.tan(angle) * 0.12 / 0.1
    assert force.max() == pytest.approx(0.25 * force.sum() * (1.0 + share), rel=0.02)


def test_a_point_without_radius_touches_where_it_is() -> None:
    contact = dataclasses.replace(world(), points=SKIDS)
    for height, touches in ((0.12 + 5e-5, False), (0.12 - 5e-5, True)):
        state = at_rest(BIRD, (0.0, 0.0, height))
        memories = flown(contact, 0.005, state=state, gravity=0.0)
        assert (np.array(memories[0].touches)[:, 0].max() > 0.0) == touches


def test_an_object_falls_on_the_skin_around_its_middle() -> None:
    box = on_slope(0.0, 0.02, size=(0.2, 0.2, 0.04), com=Vec3(0.02, 0.0, 0.005))
    memories = flown(world(box, material=Material(dissipation=50.0)), 0.8)
    R, at = memories[-1].carried[0].attitude.rotation(), memories[-1].carried[0]
    middle = at.position - R.apply(box.com)
    assert float(middle.z) == pytest.approx(0.02 - 0.05 * GRAVITY / STIFF, abs=1e-5)
    # below its centre of mass it sinks in by more
    assert float(R.apply(E_Z).x) > 1e-5


def test_two_vehicles_push_each_other_apart_with_one_force() -> None:
    bird = dataclasses.replace(BIRD, collisions=(shape("shell", "sphere", 0.3),))
    birds = {"a": bird, "b": bird}
    states = [at_rest(bird, (0.0, y, 1.0)) for y in (0.0, 0.599)]
    contact = world().on(birds)
    around = Together(
        each=(Surroundings(),) * 2,
        names=tuple(birds),
        components=(contact,),
        memories=(contact.start(0.005, ()),),
    )
    truths = [Truth(vehicle=each, gravity=0.0) for each in birds.values()]
    plant = MujocoPlant(truths, around)
    x = [number for each in states for number in flat(each)]
    command = (0.0,) * (2 * len(bird.rotors))
    row = plant.advance(x, command, leaves(around), 0.005)
    after = rebuild(tuple(states), iter(row))
    pushed = [float(each.velocity.y) * float(bird.mass) for each in after]
    assert sum(pushed) == pytest.approx(0.0, abs=1e-12)
    # a spring of 5000 N/m that is pressed by 1 mm, for a while in which it hardly gives
    assert 0.005 * 5.0 * 0.5 < pushed[1] < 0.005 * 5.0
    (memory,) = rebuild(around.memories, iter(row[len(x) :]))
    names = [pair.name for pair in contact.body_pairs]
    force, *place = memory.touches[names.index("a.base/b.base")]
    assert 0.0 < force < 5.0
    np.testing.assert_allclose(place, (0.0, 0.2995, 1.0), atol=1e-4)


def pairs(contact: Contact, vehicle: Vehicle) -> int:
    """Number of pairs of geoms that MuJoCo looks at."""
    contact = contact.on({"": vehicle})
    return MujocoPlant(Truth(vehicle=vehicle), beside(contact)).model.npair


def test_pairs_are_those_of_the_other_plant() -> None:
    arm = skyarm.load_vehicle("hummingbird_arm2_rotors")
    arm = dataclasses.replace(
        arm,
        collisions=(
            shape("body", "box", 0.2, 0.2, 0.05),
            shape("upper", "sphere", 0.02, link=0),
            shape("fore", "capsule", 0.01, 0.05, link=1),
            shape("hand", "hull", vertices=TETRAHEDRON, link=1),
        ),
    )
    box = FreeObject(name="box", mass=0.1, size=(0.1, 0.1, 0.1))
    contact = world(box, FreeObject(name="ball", mass=0.1, shape="sphere", size=(0.1,)))
    # of 3 carried or fixed: 2 objects on the plane, 1 on each other, 4 shapes on each
    assert pairs(contact, arm) == 2 + 1 + 3 * 4
    touching = dataclasses.replace(contact, self_collision=True)
    # base and link 2 are no neighbours
    assert pairs(touching, arm) == 15 + 2
    apart = dataclasses.replace(touching, ignore=("base/box",))
    assert pairs(apart, arm) == 16
    points = dataclasses.replace(
        contact, points=(ContactPoint(name="tip", frame=arm.end_effector),)
    )
    assert pairs(points, arm) == 15 + 3


def scenario(**plant: Any) -> skyarm.Scenario:
    """Flight above a box that lies on a table."""
    tables: dict[str, Any] = {
        "name": "lying",
        "duration": 0.3,
        "controller": {"preset": "paper_ct"},
        "model": {"vehicle": "hummingbird_arm2"},
        "plant": {
            "vehicle": "hummingbird_arm2_rotors",
            "kind": "mujoco",
            "contact": "geoms",
            **plant,
        },
        "world": {
            "surfaces": [{"name": "table", "position": [0.0, 0.0, -1.0]}],
            "objects": [
                {
                    "name": "box",
                    "mass": 0.1,
                    "size": [0.1, 0.1, 0.1],
                    "position": [0.5, 0.0, -0.9],
                    "standing": True,
                }
            ],
        },
    }
    return skyarm.scenario_from(tables, Path())


def test_a_flight_logs_the_same_arrays_as_on_points() -> None:
    geoms, points = skyarm.run(scenario()), skyarm.run(scenario(contact="points"))
    assert geoms.info["status"] == points.info["status"] == "completed"
    assert geoms.component("contact_force").shape == (60, 2)
    for array in ("object_position", "object_quaternion", "position"):
        np.testing.assert_allclose(
            getattr(geoms, array), getattr(points, array), atol=1e-5
        )


def test_the_contact_model_stays_as_a_session_began() -> None:
    with pytest.raises(
        ScenarioError,
        match=r"^plant\.contact = 'points': must be 'geoms' as the session began$",
    ):
        require_continuous(scenario(), scenario(contact="points"))


UNLESS = "must be 'points' unless kind is 'mujoco' and integrator is not 'euler'"


@pytest.mark.parametrize(
    ("plant", "words"),
    [
        ({"kind": "rigid_body"}, f"plant.contact = 'geoms': {UNLESS}"),
        ({"integrator": "euler"}, f"plant.contact = 'geoms': {UNLESS}"),
        (
            {"contact": "meshes"},
            "plant.contact = 'meshes': must be one of points, geoms",
        ),
    ],
)
def test_a_plant_without_geoms_is_refused_in_one_line(
    plant: dict[str, str], words: str
) -> None:
    with pytest.raises(ScenarioError) as error:
        scenario(**plant)
    assert str(error.value) == words


MOVED = Surface(name="lift", motion=SignalVector(z=Constant(0.1)))
HOLE = Surface(name="hole", shape="hole", size=(0.02, 0.03, 0.001, 0.1, 0.05))


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"surfaces": (MOVED,)}, "surfaces[0], a hole or in motion: must be left out"),
        ({"surfaces": (HOLE,)}, "surfaces[0], a hole or in motion: must be left out"),
        ({"grippers": (Gripper(name="hand"),)}, "grippers: must be left out"),
    ],
)
def test_what_geoms_lack_is_refused_in_one_line(
    fields: dict[str, Any], words: str
) -> None:
    box = FreeObject(name="box", mass=0.1, size=(0.1, 0.1, 0.1))
    contact = dataclasses.replace(world(box), **fields)
    bird = skyarm.load_vehicle("hummingbird_arm2_rotors")
    with pytest.raises(RecordError) as error:
        contact.require_vehicles({"": bird}, 0.005, GRAVITY)
    assert str(error.value) == f"world.{words} where plant.contact is 'geoms'"


def test_fingers_that_follow_each_other_share_the_effort_of_their_leader() -> None:
    limp = skyarm.load_vehicle(Path(__file__).parents[2] / "examples/two_fingers.toml")
    box = FreeObject(
        name="box", mass=0.05, size=(0.03,) * 3, position=Vec3(0.0, 0.0, 0.89)
    )
    contact = GeomContact(objects=(box,)).on({"": limp})
    around = beside(contact)
    plant = MujocoPlant(Truth(vehicle=limp, gravity=0.0), around)
    effort, start = 2.0, at_rest(limp, (0.0, 0.0, 1.0), (0.0151,))
    x, given = flat(start), list(leaves(around))
    for _ in range(100):
        row = plant.advance(x, (0.0, 0.0, 0.0, 0.0, -effort), given, 0.005)
        x = row[: len(x)]
        for place, value in zip(coupled_places(around), row[len(x) :], strict=True):
            given[place] = value
    (after,) = rebuild(around.memories, iter(row[len(x) :]))
    # by virtual work: either pad moves as far as the leader
    forces = [float(each[0]) for each in after.touches]
    assert forces == pytest.approx([0.5 * effort] * 2, rel=1e-3)
    assert tuple(after.carried[0].position) == pytest.approx((0, 0, 0.89), abs=1e-5)
