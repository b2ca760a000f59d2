"""MuJoCo's own contacts: what settles is as stiff, as heavy and as rough as the files
say, as in ours.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth, flat
from skyarm.plant.surroundings import Surroundings
from skyarm.records.leaves import leaves
from skyarm.reference import Sine
from skyarm.world import SignalVector
from skyarm.world.contact import (
    Contact,
    ContactPoint,
    FreeObject,
    Gripper,
    Material,
    Mechanism,
    Surface,
)
from support.one_vehicle import places_in
from support.worlds import GRAVITY, SKIDS, Scene, at_rest, limp, states

pytest.importorskip("mujoco")
from support.mujoco_plants import (
    IMPEDANCE,
    SLIP_STIFFER,
    Felt,
    MujocoContactPlant,
    contact_numbers,
    damping_of,
    mean_material,
    plant_contact,
)

MU, K = 0.3, 5000.0
GROUND = Surface(name="ground", material=Material(friction=MU))
TABLE = Surface(
    name="table", shape="box", size=(0.6, 0.6, 0.5), position=Vec3(0.0, 3.0, 0.25)
)
BELT = Surface(
    name="belt",
    shape="box",
    size=(2.0, 2.0, 0.5),
    position=Vec3(0.0, 5.0, 0.75),
    material=Material(friction=0.6),
    motion=SignalVector(x=Sine(amplitude=0.1, frequency_hz=0.5)),
)


def box(name, x, y, z, side=0.06, **numbers):
    return FreeObject(
        name=name, size=(side, side, side), mass=0.1, position=Vec3(x, y, z), **numbers
    )


OBJECTS = (
    box("slider", 0.0, 0.0, 0.02995, velocity=Vec3(0.6, 0.0, 0.0)),
    FreeObject(
        name="ball",
        shape="sphere",
        size=(0.03,),
        mass=0.05,
        position=Vec3(2.0, 0.0, 0.03),
        velocity=Vec3(0.0, 0.0, -0.1),
    ),
    box("lower", 5.0, 0.0, 0.0399, side=0.08),
    box("upper", 5.0, 0.0, 0.1098, com=Vec3(0.005, 0.0, 0.004)),
    FreeObject(
        name="can",
        shape="cylinder",
        size=(0.03, 0.1),
        mass=0.1,
        position=Vec3(0.0, 3.0, 0.55),
    ),
    box("rider", 0.0, 5.0, 1.02995),
    box("load", -3.0, 0.0, 1.04),
)


SOFT = Surface(
    name="plate",
    shape="box",
    size=(0.2, 0.2, 0.02),
    material=Material(stiffness=1000.0),
)
PLATE = Mechanism(
    name="scales",
    kind="slide",
    axis=(0.0, 0.0, 1.0),
    position=(-3.0, 0.0, 1.0),
    mass=0.05,
    stiffness=200.0,
    damping=5.0,
    parts=(SOFT,),
)


@pytest.fixture(scope="module")
def scene():
    """Places (N, objects, 3) and velocities of a scene of bodies in one second."""
    contact = plant_contact(
        Contact(surfaces=(GROUND, TABLE, BELT), objects=OBJECTS, mechanisms=(PLATE,))
    )
    _, rows = Scene(contact, kind=MujocoContactPlant, integrator="euler").fly(
        contact, 1.0
    )
    return {
        each.name: (rows[:, i, :3], rows[:, i, 7:10]) for i, each in enumerate(OBJECTS)
    }


def test_a_box_slides_to_its_stop_by_its_friction_and_then_stands(scene):
    """From 0.6 m/s it goes v^2 / (2 mu g) far and slows down by mu g; 1 % is the step
    in which it stops.
    """
    places, speeds = scene["slider"]
    moving = speeds[:, 0] > 0.1
    slowing = np.diff(speeds[moving, 0]) / 0.005  # it rocks a little
    assert slowing == pytest.approx(-MU * GRAVITY, rel=0.02)
    assert slowing.mean() == pytest.approx(-MU * GRAVITY, rel=1e-3)
    assert places[-1, 0] == pytest.approx(0.36 / (2.0 * MU * GRAVITY), rel=0.01)
    assert np.abs(speeds[-1]).max() < 1e-5


def test_what_stands_is_as_deep_as_its_weight_presses_it(scene):
    """Of a box four corners carry, of a box on another each carries what is above it;
    to a thousandth.
    """
    depth = 0.1 * GRAVITY / (4.0 * K)
    assert 0.03 - scene["slider"][0][-1, 2] == pytest.approx(depth, rel=2e-3)
    assert 0.04 - scene["lower"][0][-1, 2] == pytest.approx(2.0 * depth, rel=5e-3)


def test_a_stack_stands_and_a_can_on_a_table(scene):
    """The upper box rocks on the side where its centre of mass is, by less than 1 mm/s;
    the can stands on its rim.
    """
    for name, height in (("lower", 0.04), ("upper", 0.114), ("can", 0.55)):
        places, speeds = scene[name]
        assert np.abs(speeds[-20:]).max() < 1e-3, name
        assert 0.0 < height - places[-1, 2] < 5e-4, name


def test_a_ball_leaves_as_fast_as_hunt_and_crossley_say(scene):
    """It touches with 0.1 m/s and leaves with 1 - 2/3 c v of that, c = 1 s/m."""
    _, speeds = scene["ball"]
    left = 0.1 * (1.0 - 0.2 / 3.0)
    assert left < speeds[:, 2].max() < 1.02 * left, (
        "a damper that does not pull takes a little less"
    )


def test_what_lies_on_a_mechanism_weighs_on_its_spring(scene):
    """Box and plate, 150 g, on 200 N/m: by their weight below where the spring is
    slack; 1000 N/m of the plate.
    """
    places, _ = scene["load"]
    assert 1.04 - places[-1, 2] == pytest.approx(
        0.15 * GRAVITY / 200.0 + 0.1 * GRAVITY / 4000.0, rel=5e-3
    )


def test_what_stands_on_a_surface_that_moves_goes_with_it(scene):
    """With a velocity of A w at the start of the sine a box slips by v^2 / (2 mu g)
    before it is as fast.
    """
    places, speeds = scene["rider"]
    t = 1.0
    belt = 0.1 * math.sin(math.pi * t)
    first = 0.1 * math.pi
    assert speeds[-1, 0] == pytest.approx(first * math.cos(math.pi * t), rel=5e-3)
    assert places[-1, 0] == pytest.approx(
        belt - first**2 / (2.0 * 0.6 * GRAVITY), rel=0.02
    )


def test_the_numbers_are_a_spring_and_a_damper_whatever_the_mass():
    """MuJoCo's law f = (a_ref - a_0) / (A + R), written out: at rest K, with a speed K
    and D, within A / R.
    """
    material = Material(stiffness=3000.0, dissipation=2.0, friction=0.5)
    numbers = contact_numbers(material, 7.0, 0.001)
    d, _ = numbers.solimp[:2]
    k, b = -numbers.solref[0] * d / d**2, -numbers.solref[1] / d
    R = 7.0 * (1.0 - d) / d
    assert k * 1e-3 / R == pytest.approx(3.0, rel=1e-9)
    assert b / R == pytest.approx(damping_of(material, 1.0 / 7.0), rel=1e-9)
    assert numbers.friction[:2] == [0.5, 0.5]
    assert (d, IMPEDANCE * SLIP_STIFFER) == (1e-4, 100.0)
    soft, hard = Material(friction=0.2), Material(friction=0.6, stiffness=9000.0)
    assert mean_material(soft, hard) == Material(friction=0.4, stiffness=7000.0)


BIRD = limp("hummingbird_arm2_rotors")
WALL = Surface(
    name="wall",
    shape="box",
    size=(0.5, 2.0, 2.0),
    position=(0.5132, 0.0, 0.0),
    angles=(0.1, 0.2, 0.3),
)
PAD = Surface(
    name="pad", shape="box", size=(0.1, 0.1, 0.1), position=(0.1, 0.05, -0.149)
)
POINTS = (
    ContactPoint(name="tip", frame="tip"),
    ContactPoint(
        name="skid", body="base", position=Vec3(0.1, 0.05, -0.08), radius=0.02
    ),
)


def step(contact, state, vehicle=BIRD, seconds=0.001, gravity=0.0, memory=None):
    """(state, memory as a list) after a step, and the memory's place for its
    numbers.
    """
    memory = contact.start(0.005, ()) if memory is None else memory
    around = Surroundings(components=(contact,), memories=(memory,))
    plant = MujocoContactPlant(
        Truth(vehicle=vehicle, gravity=gravity), around, "euler", 0.001
    )
    command = (0.0,) * (len(vehicle.rotors) + vehicle.n)
    told = list(leaves(around))
    found = plant.advance(flat(state), command, told, seconds)
    assert found == plant.advance(flat(state), command, told, seconds), (
        "nothing outlives a call"
    )
    for place, value in zip(places_in(around), found[len(flat(state)) :], strict=True):
        told[place] = value
    return plant, found, told


def test_points_of_the_vehicle_feel_what_ours_feel():
    """A tip and a ball in two surfaces, sliding: normal force and depth of each as in
    our contact, friction mu of it, the wrench against the slip."""
    contact = Contact(surfaces=(WALL, PAD), points=POINTS)
    state = dataclasses.replace(
        at_rest(BIRD, (0.0, 0.0, 0.0), (-0.45, -0.9)), velocity=Vec3(0.0, 0.2, 0.0)
    )
    around = Surroundings(
        components=(plant_contact(contact),),
        memories=(plant_contact(contact).start(0.005, ()),),
    )
    plant = MujocoContactPlant(Truth(vehicle=BIRD, gravity=0.0), around, "euler", 1e-3)
    found = plant.advance(flat(state), (0.0,) * 6, leaves(around), 1e-3)
    rows = np.reshape(found[len(flat(state)) :], (-1, 9))
    (state,) = states(state, np.array([found[: len(flat(state))]]))
    touches = contact.on_points(contact.start(0.005, ()), PointMotion(BIRD, state))
    assert sum(float(each.depth) > 0.0 for each in touches) == 2
    for row, touch in zip(rows, touches, strict=True):
        depth = max(float(touch.depth), 0.0)
        assert row[8] == pytest.approx(depth, abs=1e-6)
        assert row[6] == pytest.approx(K * depth, rel=0.02)  # the damper takes a part
        if depth:
            n, force = np.array([*touch.axis]), row[:3]
            assert force @ n == pytest.approx(row[6], rel=1e-9)
            assert row[7] == pytest.approx(MU * row[6], rel=1e-3)
            slip = np.array([*touch.bristle_rate])
            across = force - (force @ n) * n
            assert across @ slip == pytest.approx(
                -row[7] * np.linalg.norm(slip), rel=0.01
            )
            lever = np.array([*touch.spot])
            assert row[3:6] == pytest.approx(
                np.cross(lever, force),
                rel=0.01,
                abs=0.6 * depth * np.linalg.norm(force),
            )


def test_a_vehicle_stands_on_its_skids_by_its_weight():
    """The forces of the log are the weight, a hundredth of a second and more after it
    was set down.
    """
    vehicle = limp()
    contact = plant_contact(Contact(surfaces=(Surface(name="ground"),), points=SKIDS))
    weight = float(vehicle.mass) * GRAVITY
    state = at_rest(vehicle, (0.0, 0.0, 0.12 - weight / 4.0 / K))
    plant, found, told = step(contact, state, vehicle, 0.05, GRAVITY)
    later = plant.advance(
        found[: len(flat(state))], (0.0,) * len(vehicle.rotors), told, 0.05
    )
    for numbers in (found, later):
        rows = np.reshape(numbers[len(flat(state)) :], (-1, 9))
        assert rows[:, 6].sum() == pytest.approx(weight, rel=2e-3)
        assert rows[:, 2] == pytest.approx(rows[:, 6])


def test_a_plane_that_moves_is_where_its_signal_says():
    """A skid at 1 mm below the origin, 1 ms later, on a plane that has risen by A sin(w
    t).
    """
    vehicle, rise = limp(), Sine(amplitude=0.5, frequency_hz=1.0)
    ground = Surface(
        name="ground", position=(0.0, 0.0, -0.002), motion=SignalVector(z=rise)
    )
    state = at_rest(vehicle, (0.0, 0.0, 0.119))
    _, found, _ = step(
        plant_contact(Contact(surfaces=(ground,), points=SKIDS)), state, vehicle
    )
    skid = found[2] - 0.12
    expected = -0.002 + 0.5 * math.sin(2.0 * math.pi * 1e-3) - skid
    rows = np.reshape(found[-36:], (-1, 9))
    assert rows[:, 8] == pytest.approx(expected, abs=2e-6)
    spring = K * expected + damping_of(Material(), float(vehicle.mass)) * math.pi
    assert rows[:, 6] == pytest.approx(spring, rel=0.1)


def test_a_mechanism_turns_by_its_own_inertia_and_inner_efforts():
    """A lever of 0.02 kg m^2 on a spring, let go: a quarter of its period later it is
    at its rest.
    """
    lever = Mechanism(
        name="lever",
        kind="valve",
        size=(0.2, 0.02, 0.02),
        mass=0.0,
        inertia=0.02,
        initial=0.1,
        stiffness=2.0,
    )
    contact = plant_contact(Contact(mechanisms=(lever,), points=POINTS))
    state = at_rest(BIRD, (0.0, 0.0, 9.0), (-0.45, -0.9))
    plant, found, _ = step(contact, state, seconds=0.157)
    angle, rate = found[len(flat(state)) :][:2]
    assert angle == pytest.approx(0.1 * math.cos(1.57), abs=1e-3)
    assert rate == pytest.approx(-1.0 * math.sin(1.57), rel=1e-2)
    # of its farthest place, which moves in one of three directions
    assert plant.model.body_invweight0[-1][0] == pytest.approx(
        float(lever.mobility) / 3.0, rel=1e-6
    )


def test_what_was_felt_acts_on_sensors_and_stands_in_logs():
    contact = plant_contact(Contact(surfaces=(WALL, PAD), points=POINTS))
    felt = [
        Felt(
            force=Vec3(1.0, i, 0.0),
            torque=Vec3(0.0, 0.1 * i, 2.0),
            normal=3.0 + i,
            friction=0.5 * i,
            depth=1e-3 * i,
        )
        for i in range(4)
    ]
    memory = dataclasses.replace(contact.start(0.005, ()), felt=tuple(felt))
    motion = PointMotion(BIRD, at_rest(BIRD, (0.0, 0.0, 0.0), (-0.45, -0.9)))
    assert list(contact.logged(memory, motion)) == [
        c for f in felt for c in (f.normal, f.friction, f.depth)
    ]
    on = {wrench.body: wrench for wrench in contact.wrenches(memory, 0.0, motion, ())}
    skid, tip = on[-1], on[1]
    assert [*tip.force_W] == [2.0, 2.0, 0.0]
    assert [*tip.torque_W] == pytest.approx([0.0, 0.2, 4.0])
    assert [*skid.force_W] == [2.0, 4.0, 0.0]
    lever = np.cross([0.1, 0.05, -0.08], [2.0, 4.0, 0.0])
    assert [*skid.torque_W] == pytest.approx(list(lever + np.array([0.0, 0.4, 4.0])))
    assert not any(leaves(contact.without_touches(memory).felt))


def test_a_grasp_is_ours_and_pulls_both_with_one_force():
    """A magnet at the side of a body that leaves it: its first step by our equations,
    then the momentum of both.
    """
    state = at_rest(BIRD, (0.0, 0.0, 0.0), (-0.45, -0.9))
    motion = PointMotion(BIRD, state)
    tip = motion.position(*motion.frame("tip"))
    held = FreeObject(
        name="held",
        size=(0.06, 0.02, 0.02),
        mass=0.03,
        com=Vec3(0.01, 0.0, 0.002),
        angles=Vec3(0.0, 0.0, 0.2),
        position=tip - Vec3(0.02, 0.0, 0.012),
        velocity=Vec3(0.0, 0.05, -0.05),
    )
    ours = Contact(objects=(held,), grippers=(Gripper(name="magnet", frame="tip"),))
    theirs = plant_contact(ours)
    grips = ours.act(ours.start(0.005, ()), 0.0, 0.005, motion).grips
    assert grips[0].taken == 1.0
    slope = ours.slope(
        dataclasses.replace(ours.start(0.005, ()), grips=grips), 0.0, motion, ()
    )
    memory = dataclasses.replace(theirs.start(0.005, ()), grips=grips)
    plant, found, _ = step(theirs, state, memory=memory, seconds=0.02)
    h = float(plant.model.opt.timestep)
    around = Surroundings(components=(theirs,), memories=(memory,))
    count, velocity = len(flat(state)), np.array([0.0, 0.05, -0.05])
    body = np.array(plant.advance(flat(state), (0.0,) * 6, leaves(around), h)[count:])
    assert np.abs(body[10:13]).max() > 0.01
    assert body[10:13] == pytest.approx(
        [float(each) * h for each in slope.carried[0].rate], rel=1e-6, abs=1e-9
    )
    assert body[7:10] == pytest.approx(
        velocity + h * np.array([float(each) for each in slope.carried[0].velocity])
    )
    x, total = np.array(found[:count]), 0.03 * np.array(found[count:][7:10])
    after = dataclasses.replace(
        state,
        velocity=Vec3(*x[7:10]),
        rate=Vec3(*x[10:13]),
        joint_rates=tuple(x[15:17]),
    )
    moved = PointMotion(BIRD, dataclasses.replace(after, joints=tuple(x[13:15])))
    for i, each in (
        (-1, BIRD.base),
        *((i, link.body) for i, link in enumerate(BIRD.links)),
    ):
        total = total + float(each.mass) * np.array(
            [*moved.velocity(each.com, i)], dtype=float
        )
    assert np.linalg.norm(np.array(found[count:][7:10]) - velocity) > 0.01
    assert total == pytest.approx(0.03 * velocity, abs=5e-5)


@pytest.mark.thorough
def test_an_elastic_bounce_of_a_tip_is_that_of_ours_in_every_posture():
    """The impedance is so small that no mass is in the stiffness: velocities after the
    bounce within 1 %.
    """
    material = Material(dissipation=0.0, friction=0.0)
    wall = Surface(
        name="wall",
        shape="box",
        size=(0.5, 2.0, 2.0),
        position=(0.461, 0.0, -0.2),
        material=material,
    )
    contact = Contact(surfaces=(wall,), points=POINTS[:1])
    rows, postures = {}, ((-0.45, -0.9), (-0.2, -0.3))
    kinds = (
        (RigidBodyPlant, contact, "rk4"),
        (
            MujocoContactPlant,
            plant_contact(contact),
            "euler",
        ),
    )
    for kind, held, integrator in kinds:
        scene = Scene(held, vehicle=BIRD, gravity=0.0, kind=kind, integrator=integrator)
        for joints in postures:
            state = dataclasses.replace(
                at_rest(BIRD, (0.0, 0.0, 0.0), joints), velocity=Vec3(0.3, 0.0, 0.0)
            )
            motion = PointMotion(BIRD, state)
            tip = float(motion.position(*motion.frame("tip")).x)
            scene.state = dataclasses.replace(
                state, position=Vec3(0.21 - tip, 0.0, 0.0)
            )
            rows[kind, joints] = scene.fly(held, 0.06)[0][-1]
    for joints in postures:
        ours, theirs = rows[RigidBodyPlant, joints], rows[MujocoContactPlant, joints]
        assert ours[7] < 0.2985
        assert np.abs(ours[15:17]).max() > 1.0
        assert theirs[7:17] == pytest.approx(ours[7:17], rel=0.01, abs=0.02)
