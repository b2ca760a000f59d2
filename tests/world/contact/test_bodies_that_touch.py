"""Vehicles that touch with their shapes: closed forms of rest, slope, rolling and
impact, energy, and flights.
"""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.algebra import ZERO3, Quaternion, Sym3, Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.log.flown_scenario import flown_scenario
from skyarm.plant.surroundings import Surroundings
from skyarm.records.coerce import RecordError
from skyarm.scenario.scenario_checks import check_scenario
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import Solver
from skyarm.simulate.loop import run_in_python
from skyarm.vehicle import Body
from skyarm.vehicle.vehicle_records import Collision
from skyarm.world.component import columns_of_agent
from skyarm.world.contact import Contact, FreeObject, Material, Surface
from support.worlds import GRAVITY, at_rest, fall, limp, states

BIRD = limp()

EXAMPLES = Path(__file__).parents[3] / "examples"

PINCH = EXAMPLES / "pick_with_fingers.toml"


def shape(kind, size=(), **fields):
    numbers = {"name": kind, "link": -1, "position": ZERO3, **fields}
    return Collision(shape=kind, size=size, **numbers)


def solid(*shapes, mass=1.0, moments=(0.01, 0.01, 0.01)):
    """A vehicle that nothing drives, with shapes on its base."""
    base = Body(mass=mass, com=ZERO3, inertia=Sym3(*moments, 0.0, 0.0, 0.0))
    return dataclasses.replace(BIRD, base=base, collisions=shapes)


def along(slope, height):
    """Place above the origin of a plane that is tilted about y, and its attitude."""
    normal = Vec3(math.sin(slope), 0.0, math.cos(slope)) * height
    turned = Quaternion(math.cos(0.5 * slope), 0.0, math.sin(0.5 * slope), 0.0)
    return {"position": normal, "quaternion": turned}


def flown(vehicle, state, surfaces, seconds, **fields):
    """States of a vehicle on surfaces, one every 5 ms."""
    contact = Contact(surfaces=surfaces, **fields).on({"": vehicle})
    around = Surroundings(components=(contact,), memories=(contact.start(0.005, ()),))
    return states(state, fall(vehicle, state, around, seconds))


@pytest.mark.parametrize(
    ("kind", "size", "half", "places"),
    [
        ("sphere", (0.1,), 0.1, 1),
        ("box", (0.2, 0.3, 0.1), 0.05, 4),
        ("cylinder", (0.1, 0.2), 0.1, 3),
    ],
)
def test_a_shape_rests_where_its_weight_bends_its_places(kind, size, half, places):
    vehicle = solid(shape(kind, size))
    ground = Surface(name="ground", material=Material(dissipation=5.0))
    last = flown(vehicle, at_rest(vehicle, (0.0, 0.0, half)), (ground,), 1.0)[-1]
    deep = GRAVITY / 5000.0 / places
    assert half - last.position.z == pytest.approx(deep, rel=1e-3)
    assert abs(last.velocity.z) < 1e-4


def test_a_sphere_rolls_down_at_five_sevenths_of_the_slope():
    radius, slope = 0.1, 0.2
    moment = 0.4 * radius**2
    vehicle = solid(shape("sphere", (radius,)), moments=(moment,) * 3)
    plane = Surface(name="g", angles=(0.0, slope, 0.0), material=Material(friction=0.5))
    resting = radius - GRAVITY * math.cos(slope) / 5000.0
    start = dataclasses.replace(
        at_rest(vehicle, (0.0, 0.0, 1.0)), position=along(slope, resting)["position"]
    )
    last = flown(vehicle, start, (plane,), 1.0)[-1]
    # the friction of its rotors' hubs is none: 5 / 7 g sin, from rest
    turning = 1.0 + float(vehicle.base.inertia.xx) / (float(vehicle.mass) * radius**2)
    way = math.hypot(float(last.position.x) - float(start.position.x), 0.0)
    assert way == pytest.approx(
        0.5 * GRAVITY * math.sin(slope) / turning * math.cos(slope), rel=0.01
    )


@pytest.mark.parametrize(("slope", "slides"), [(0.4, False), (0.55, True)])
def test_a_box_slides_on_a_slope_beyond_its_angle_of_friction(slope, slides):
    friction = 0.5
    vehicle = solid(shape("box", (0.2, 0.3, 0.02)))
    plane = Surface(
        name="g",
        angles=(0.0, slope, 0.0),
        material=Material(friction=friction, dissipation=10.0),
    )
    resting = 0.01 - GRAVITY * math.cos(slope) / 20000.0
    start = dataclasses.replace(
        at_rest(vehicle, (0.0, 0.0, 1.0)), **along(slope, resting)
    )
    flight = flown(vehicle, start, (plane,), 1.0)
    # the bristle has bent by then
    early, last = flight[59], flight[-1]
    faster = last.velocity - early.velocity
    gained = math.sqrt(float(faster.dot(faster)))
    pull = GRAVITY * (math.sin(slope) - friction * math.cos(slope))
    if slides:
        assert gained == pytest.approx(pull * 0.7, rel=0.01)
    else:
        assert math.dist(tuple(last.position), tuple(early.position)) < 5e-4


def test_the_spin_of_an_upright_cylinder_ends_by_the_moment_of_its_rim():
    radius, friction, spin = 0.1, 0.3, 5.0
    vehicle = solid(shape("cylinder", (radius, 0.05)), moments=(0.05, 0.05, 0.05))
    start = dataclasses.replace(
        at_rest(vehicle, (0.0, 0.0, 0.025 - GRAVITY / 15000.0)),
        rate=Vec3(0.0, 0.0, spin),
    )
    plane = Surface(name="g", material=Material(friction=friction))
    last = flown(vehicle, start, (plane,), 0.2)[-1]
    moment = friction * float(vehicle.mass) * GRAVITY * radius
    inertia = float(vehicle.base.inertia.zz)
    assert last.rate.z == pytest.approx(spin - 0.2 * moment / inertia, rel=0.01)


@pytest.mark.parametrize("speed", [2.0, 8.0])
def test_a_fast_plate_just_above_the_ground_bounces_with_its_energy(speed):
    vehicle = solid(shape("box", (0.4, 0.4, 0.02)))
    start = dataclasses.replace(
        at_rest(vehicle, (0.0, 0.0, 0.016)), velocity=Vec3(0.0, 0.0, -speed)
    )
    elastic = Material(friction=0.0, dissipation=0.0)
    flight = flown(vehicle, start, (Surface(name="ground", material=elastic),), 0.05)
    gained = GRAVITY * (start.position.z - flight[-1].position.z)
    assert flight[-1].velocity.z == pytest.approx(
        math.sqrt(speed**2 + 2.0 * gained), rel=2e-3
    )


@pytest.mark.parametrize(
    ("mass", "moment", "size", "tilt", "height", "dissipation"),
    [
        # half a push at the speed before it used to throw the rim back, each step
        (0.25, 5.8e-4, (0.25, 0.1), 0.02, -5e-4, 30.0),
        # steps for 20 g behind the rim, which has 1 g, gain four times as much
        (0.03, 1.4e-5, (0.1, 0.02), 0.2, 0.02, 0.0),
    ],
)
def test_a_wide_guard_on_a_light_vehicle_gains_no_energy(
    mass, moment, size, tilt, height, dissipation
):
    moments = Vec3(moment, moment, 2.0 * moment)
    vehicle = solid(shape("cylinder", size), mass=mass, moments=moments)
    lowest = size[0] * math.sin(tilt) + 0.5 * size[1] * math.cos(tilt)
    turned = Quaternion(math.cos(0.5 * tilt), math.sin(0.5 * tilt), 0.0, 0.0)
    start = at_rest(vehicle, (0.0, 0.0, lowest + height), quaternion=turned)
    material = Material(friction=0.0, dissipation=dissipation)
    flight = flown(vehicle, start, (Surface(name="ground", material=material),), 0.2)
    energy = np.array(
        [
            0.5 * float(each.rate.dot(moments.hadamard(each.rate)))
            + 0.5 * mass * float(each.velocity.dot(each.velocity))
            + mass * GRAVITY * float(each.position.z)
            for each in flight
        ]
    )
    assert energy.max() - energy[0] < 1e-4 * mass * GRAVITY * 0.1


def test_two_spheres_part_with_the_momentum_that_they_bring():
    vehicle = solid(shape("sphere", (0.1,)))
    ball = FreeObject(
        name="ball",
        shape="sphere",
        size=(0.1,),
        mass=2.0,
        position=(0.25, 0.02, 0.0),
        material=Material(friction=0.3),
    )
    start = dataclasses.replace(
        at_rest(vehicle, (0.0, 0.0, 0.0)), velocity=Vec3(1.0, 0.0, 0.0)
    )
    contact = Contact(objects=(ball,)).on({"": vehicle})
    around = Surroundings(components=(contact,), memories=(contact.start(0.005, ()),))
    rows = fall(vehicle, start, around, 0.3, gravity=0.0)
    after = states(start, rows)[-1]
    memory = dict(zip(range(3), rows[-1][-6:-3], strict=True))
    mass = float(vehicle.mass)
    assert mass * after.velocity.x + 2.0 * memory[0] == pytest.approx(mass, rel=1e-9)
    assert mass * after.velocity.y + 2.0 * memory[1] == pytest.approx(0.0, abs=1e-12)
    # the ball is pushed away from where it is
    assert memory[0] > 0.2
    assert memory[1] > 0.0


LEGS = {
    "name": "drop_on_legs",
    "duration": 0.6,
    "plant": {"vehicle": "hummingbird"},
    "controller": {"law": "centroidal"},
    "initial": {"position": [0.0, 0.0, 0.14]},
    "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 0.1]}},
    "world": {"surfaces": [{"name": "ground"}]},
}


def on_legs(tmp_path, solver=(), **world):
    """A flight of the Hummingbird on two skids of capsules down to the ground."""
    text = 'schema = 1\nname = "legs"\nairframe = "hummingbird"\n'
    for name, side in (("left", 0.1), ("right", -0.1)):
        text += (
            f'[[collisions]]\nname = "{name}"\nshape = "capsule"\nsize = [0.01, 0.3]\n'
            f"position = [0.0, {side}, -0.12]\nrpy = [0.0, 1.5708, 0.0]\n"
        )
    (tmp_path / "legs.toml").write_text(text, "utf-8")
    tables = {
        **LEGS,
        "plant": {"vehicle": str(tmp_path / "legs.toml"), **dict(solver)},
        "world": {**LEGS["world"], **world},
    }
    return scenario_from(tables)


def test_a_vehicle_on_skids_pushes_on_the_ground_that_stops_it(tmp_path):
    log = skyarm.run(on_legs(tmp_path)).arrays()
    assert log["components.collision_force"].shape == (120, 1)
    assert log["components.collision_force"].max() > 1.0
    assert log["position"][:, 2].min() > 0.129


def test_a_vehicle_on_skids_stands_beside_a_box_on_a_heightfield(tmp_path):
    level = {"name": "level", "shape": "heightfield", "size": [2.0, 2.0, 0.1, 0.1]}
    # MuJoCo's own heights would begin at 0
    level |= {"heights": ["ffff" * 3] * 3, "position": [0.0, 0.0, -0.1]}
    box = {"name": "box", "mass": 0.2, "size": [0.1] * 3, "position": [0.5, 0.0, 0.05]}
    solver = {"kind": "mujoco", "contact": "geoms"}
    scenario = on_legs(tmp_path, solver, surfaces=[level], objects=[box])
    log = skyarm.run(dataclasses.replace(scenario, duration=0.3))
    assert log.component("collision_force")[:, 0].max() > 1.0
    assert log.position[-1, 2] > 0.125
    assert log.component("object_position")[-1, 2] == pytest.approx(0.05, abs=1e-3)


def test_floats_and_every_lane_of_a_batch_touch_with_the_same_bits(tmp_path):
    short = dataclasses.replace(on_legs(tmp_path), duration=0.3)
    path = "world.surfaces.ground.material.stiffness"
    batch = skyarm.Batch(short, [path], bit_exact=True, effort=0)
    ends = batch.fly({path: [4000.0, 5000.0]}).state.velocity.z
    single = skyarm.Session(short)
    while single.running:
        single.step()
    assert ends[0] != ends[1]
    assert ends[1] == single.state.velocity.z
    slow = run_in_python(short).arrays()
    fast = skyarm.run(short).arrays()
    for name in ("position", "components.collision_force"):
        assert np.array_equal(slow[name], fast[name])


def test_a_bristle_stands_up_where_bodies_were_apart():
    contact = Contact(surfaces=(Surface(name="floor", shape="plane"),)).on(
        {"": solid(shape("sphere", (0.1,)))}
    )
    bent = (Vec3(1e-4, 0.0, 2e-4),)
    memory = dataclasses.replace(contact.start(0.005, ()), bristles=bent)
    assert contact.near(memory).bristles == bent
    apart = contact.alone(memory, 0.005, 1, GRAVITY)
    assert contact.near(apart).bristles == (ZERO3,)
    assert contact.near(contact.near(apart)) == contact.near(apart)


def test_a_pair_that_is_ignored_passes_through(tmp_path):
    post = {"name": "post", "shape": "sphere", "size": [0.1]}
    world = [{"name": "ground"}, {**post, "position": [5.0, 0.0, 0.0]}]
    scenario = on_legs(tmp_path, surfaces=world, ignore=["base/ground"])
    log = skyarm.run(scenario).arrays()
    assert log["components.collision_force"].max() == 0.0
    assert log["position"][:, 2].min() < 0.125


@pytest.mark.parametrize(
    ("ignore", "words"),
    [
        (["bas/ground"], r"ignore\[0\] = 'bas/ground': did you mean"),
        (["base/ground"] * 2, r"ignore\[1\] = 'base/ground': must stand once"),
    ],
)
def test_a_wrong_ignored_pair_is_refused(tmp_path, ignore, words):
    with pytest.raises(ValueError, match=words):
        on_legs(tmp_path, ignore=ignore)


def test_a_pair_of_one_vehicle_is_ignored_with_self_collision_alone():
    vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors")
    shapes = tuple(shape("sphere", (0.02,), name=f"s{i}", link=i) for i in (-1, 0, 1))
    vehicle = dataclasses.replace(vehicle, collisions=shapes)
    contact = Contact(surfaces=(Surface(name="g"),), ignore=("base/link2",))
    with pytest.raises(RecordError, match="must be left out, or self_collision true"):
        contact.on({"": vehicle}).require_vehicle(vehicle, 0.005, GRAVITY)
    dataclasses.replace(contact, self_collision=True).on({"": vehicle}).require_vehicle(
        vehicle, 0.005, GRAVITY
    )


def test_vehicles_that_touch_log_the_force_with_each_of_them(tmp_path):
    on_legs(tmp_path)
    tables = {
        "name": "meet",
        "duration": 0.1,
        "plant": {"vehicle": str(tmp_path / "legs.toml")},
        "controller": {"law": "centroidal"},
        "agents": {
            name: {"reference": {"base": {"kind": "hover", "position": [0.0, y, 1.0]}}}
            for name, y in (("left", 0.219), ("right", 0.0))
        },
        "world": {},
    }
    scenario = scenario_from(tables)
    log = skyarm.run(scenario)
    forces = [each.component("collision_force") for each in log.agents.values()]
    assert forces[0].shape == (20, 1)
    assert forces[0].max() > 0.1
    assert np.array_equal(*forces)
    # metrics of either vehicle take it into account
    for name in scenario.agents:
        own = columns_of_agent(scenario.of(name).components, name)
        assert own["collision_force"] == [True]


def test_a_member_that_ignores_pairs_is_flown_again_alone(tmp_path):
    on_legs(tmp_path)
    tables = {
        "name": "meet",
        "duration": 0.01,
        "plant": {"vehicle": str(tmp_path / "legs.toml")},
        "controller": {"law": "centroidal"},
        "agents": {
            name: {"reference": {"base": {"kind": "hover", "position": [0.0, y, 1.0]}}}
            for name, y in (("left", 1.0), ("right", 0.0))
        },
        "world": {
            "surfaces": [{"name": "ground"}, {"name": "roof", "position": [0, 0, -5]}],
            "ignore": ["left.base/roof", "left.base/right.base"],
        },
    }
    log = skyarm.run(scenario_from(tables))
    assert log.collision_force.shape == (2, 3)
    for name, ignored in (("left", ("base/roof",)), ("right", ())):
        again = flown_scenario(log.agents[name].info, {})
        assert again.world.ignore == ignored
        check_scenario(again)


def test_neighbours_do_not_touch_and_others_do_on_request():
    vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors")
    shapes = tuple(shape("sphere", (0.02,), name=f"s{i}", link=i) for i in (-1, 0, 1))
    vehicle = dataclasses.replace(vehicle, collisions=shapes)
    for asked, names in ((False, []), (True, ["base/link2"])):
        contact = Contact(surfaces=(), self_collision=asked).on({"": vehicle})
        assert [each.name for each in contact.body_pairs] == names


def test_an_own_shape_pushes_a_link_back_with_an_equal_torque():
    vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors")
    shapes = (
        shape("sphere", (0.05,), name="hull"),
        shape("sphere", (0.02,), name="hand", link=1),
    )
    vehicle = dataclasses.replace(vehicle, collisions=shapes)
    contact = Contact(self_collision=True).on({"": vehicle})
    folded = dataclasses.replace(
        at_rest(vehicle, (0.0, 0.0, 1.0), (0.0, 0.0)), joints=(0.0, 0.0)
    )
    motion = PointMotion(vehicle, folded)
    near = motion.position(ZERO3, 1) - folded.position
    grown = dataclasses.replace(
        shapes[0], size=(math.sqrt(near.dot(near)) - 0.02 + 1e-3,)
    )
    vehicle = dataclasses.replace(vehicle, collisions=(grown, shapes[1]))
    motion = PointMotion(vehicle, folded)
    wrenches = contact.wrenches(contact.start(0.005, ()), 0.0, motion, ())
    base, hand = (each for each in wrenches if each.body in (-1, 1))
    assert tuple(base.force_W + hand.force_W) == pytest.approx((0.0, 0.0, 0.0))
    assert base.force_W.z > 1.0
    moments = base.torque_W + hand.torque_W + near.cross(hand.force_W)
    assert tuple(moments) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize(
    ("solver", "most"),
    [
        (Solver(), 1e-5),
        pytest.param(
            Solver(kind="mujoco", contact="geoms"), 1e-4, marks=pytest.mark.thorough
        ),
    ],
)
def test_two_fingers_hold_a_box_by_the_friction_of_their_shapes(solver, most):
    scenario = dataclasses.replace(
        skyarm.load_scenario(PINCH), duration=5.5, solver=solver
    )
    log = skyarm.run(scenario).arrays()
    box = log["components.object_position"] - log["position"]
    turned = [
        Quaternion(*map(float, each)).rotation().apply_T(Vec3(*map(float, at)))
        for each, at in zip(
            log["quaternion"][[899, 1099]], box[[899, 1099]], strict=True
        )
    ]
    assert log["components.object_position"][-1, 2] > 1.2
    # in the last second
    assert math.dist(*map(tuple, turned)) < most


def test_a_hull_needs_vertices_and_an_object_of_it_moments():
    corners = (*(Vec3(*map(float, c)) for c in 0.1 * np.eye(3)), ZERO3)
    with pytest.raises(RecordError, match=r"surface\.vertices: is missing"):
        Surface(name="s", shape="hull")
    with pytest.raises(RecordError, match=r"object\.inertia: is missing"):
        FreeObject(name="o", mass=1.0, shape="hull", size=(), vertices=corners)


def test_a_hull_whose_corner_moves_has_other_faces():
    corners = tuple(
        Vec3(*map(float, each))
        for each in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0.1, 0.1, 0.1))
    )
    hull = Surface(name="s", shape="hull", vertices=corners)
    moved = dataclasses.replace(hull, vertices=(*corners[:4], Vec3(1.0, 1.0, 1.0)))
    assert len(hull.faces) == 4
    assert moved == Surface(name="s", shape="hull", vertices=moved.vertices)
    assert len(moved.faces) == 6


def test_a_uniform_capsule_has_the_moments_that_mujoco_computes():
    import mujoco

    from skyarm.world.contact.free_object import uniform_moments

    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><freejoint/><geom type="capsule" size="0.1 0.2"'
        ' mass="1.5"/></body></worldbody></mujoco>'
    )
    moments = uniform_moments("capsule", (0.1, 0.4), 1.5)
    assert tuple(moments) == pytest.approx(tuple(model.body_inertia[1]), rel=1e-12)
