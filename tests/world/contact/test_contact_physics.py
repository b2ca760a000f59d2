"""Contact on both plants against closed forms: weights carried, blocks that slide or
stick, bounces, moving floors.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from skyarm.algebra import Sym3, Vec3
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.energy import kinetic_energy
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.surroundings import Surroundings
from skyarm.reference import Sine
from skyarm.vehicle.linkage import Body
from skyarm.world import SignalVector
from skyarm.world.contact import Contact, ContactPoint, Material, Surface
from support.worlds import GRAVITY, SKIDS, around, at_rest, fall, ground, limp, states

BIRD = limp()
WEIGHT = float(BIRD.mass) * GRAVITY
REST = WEIGHT / (4.0 * 5000.0)
"""m, into which four skids are pressed."""


def test_a_vehicle_that_was_dropped_rests_as_deep_as_its_weight_presses_it():
    rows = fall(
        BIRD, at_rest(BIRD, (0.0, 0.0, 0.1205)), around(ground(dissipation=9.0)), 1.2
    )
    assert rows[-1, 2] == pytest.approx(0.12 - REST, abs=2e-6)
    assert rows[:, 2].min() < 0.12 - 1.3 * REST, "it was dropped"
    assert np.abs(rows[-1, 7:13]).max() < 1e-3


@pytest.mark.parametrize("kind", [RigidBodyPlant, MujocoPlant])
def test_feet_that_damp_hard_come_off_the_floor_as_solve_ivp_says(kind):
    """Dissipation 900 s/m at 1 m/s makes the floor 900 times as stiff: steps for a
    floor at rest gave energy.
    """
    light = dataclasses.replace(
        BIRD, base=Body(mass=0.1, inertia=Sym3(1e-3, 1e-3, 1e-3))
    )
    start = at_rest(light, (0.0, 0.0, 0.13), velocity=Vec3(0.0, 0.0, -1.0))
    rows = fall(light, start, around(ground(dissipation=900.0)), 0.05, kind=kind)

    def slope(_t, x):
        push = 4.0 * 5000.0 * max(0.12 - x[0], 0.0) * max(1.0 - 900.0 * x[1], 0.0)
        return [x[1], push / 0.1 - GRAVITY]

    exact = solve_ivp(
        slope, (0.0, 0.05), [0.13, -1.0], "LSODA", rtol=1e-9, atol=1e-12, max_step=1e-4
    ).y
    assert rows[-1, 9] == pytest.approx(exact[1, -1], abs=0.05)
    assert rows[-1, 2] == pytest.approx(exact[0, -1], abs=2e-4)


@pytest.mark.parametrize(
    "friction", [0.3, pytest.param(0.15, marks=pytest.mark.thorough)]
)
def test_a_block_that_slides_loses_mu_g_of_its_speed_each_second(friction):
    start = at_rest(BIRD, (0.0, 0.0, 0.12 - REST), velocity=Vec3(0.8, 0.6, 0.0))
    rows = fall(BIRD, start, around(ground(friction=friction, dissipation=3.0)), 0.15)
    speed = np.hypot(*rows[-1, 7:9])
    assert 1.0 - speed == pytest.approx(friction * GRAVITY * 0.15, rel=5e-3)
    assert rows[-1, 8] / rows[-1, 7] == pytest.approx(0.75, rel=1e-3)


def test_on_a_slope_it_sticks_below_the_cone_and_slides_above():
    """tan 20 degrees is 0.364: at 0.5 it creeps by less than 0.1 mm/s, at 0.3 it gets g
    (sin - mu cos).

    Friction makes it rock on its skids as it slides, with 2.5 Hz: the mean is over one
    of these.
    """
    slope = math.radians(20.0)
    tilt = dataclasses.replace(
        at_rest(BIRD, (0.12 * math.sin(slope), 0.0, 0.12 * math.cos(slope) - REST)),
        quaternion=type(at_rest(BIRD, (0, 0, 0)).quaternion)(
            math.cos(slope / 2), 0.0, math.sin(slope / 2), 0.0
        ),
    )
    down = np.array([math.cos(slope), 0.0, -math.sin(slope)])
    stuck = fall(
        BIRD, tilt, around(ground(friction=0.5, angles=(0.0, slope, 0.0))), 1.2
    )
    assert abs((stuck[-1, :3] - stuck[-101, :3]) @ down) < 0.5e-4
    slid = fall(BIRD, tilt, around(ground(friction=0.3, angles=(0.0, slope, 0.0))), 0.6)
    expected = GRAVITY * (math.sin(slope) - 0.3 * math.cos(slope))
    assert (slid[-1, 7:10] - slid[-81, 7:10]) @ down / 0.4 == pytest.approx(
        expected, rel=2e-3
    )


@pytest.mark.parametrize(
    "stiffness", [5000.0, pytest.param(20000.0, marks=pytest.mark.thorough)]
)
def test_an_elastic_bounce_keeps_its_energy(stiffness):
    """Of a limp vehicle on its tip at 0.3 m/s, at any phase of the step: within 0.02 %,
    the stretch of the target.
    """
    bird = limp("hummingbird_arm2_rotors")
    start = at_rest(bird, (0.0, 0.0, 0.0), (-0.45, -0.9), velocity=Vec3(0.3, 0.0, 0.0))
    for off in (0.0, 2.5e-4):
        wall = Surface(
            name="wall",
            shape="box",
            size=(0.2, 1.0, 1.0),
            position=(0.2116 + 0.101 + off, 0.0, 0.0),
            material=Material(stiffness=stiffness, dissipation=0.0, friction=0.0),
        )
        tip = (ContactPoint(name="tip", frame="tip"),)
        rows = fall(bird, start, around(wall, points=tip), 0.06, gravity=0.0)
        energy = [float(kinetic_energy(bird, each)) for each in states(start, rows)]
        first = float(kinetic_energy(bird, start))
        assert min(energy) < 0.995 * first, "it touched"
        assert -2e-4 < energy[-1] / first - 1.0 < 2e-4


@pytest.mark.parametrize("kind", [RigidBodyPlant, MujocoPlant])
def test_a_limp_vehicle_that_falls_on_its_skids_keeps_its_energy(kind):
    """From 0.05 to 3 m, level, on elastic ground: within 0.02 %."""
    for height in (0.05, 0.3, 0.6, 1.0, 1.7, 3.0):
        start = at_rest(BIRD, (0.0, 0.0, 0.12 + height))
        seconds = 0.005 * round(
            (1.5 * math.sqrt(2.0 * height / GRAVITY) + 0.05) / 0.005
        )
        rows = fall(
            BIRD,
            start,
            around(ground(dissipation=0.0, friction=0.0)),
            seconds,
            kind=kind,
        )
        first, last = (
            float(kinetic_energy(BIRD, each)) + WEIGHT * float(each.position.z)
            for each in (start, states(start, rows)[-1])
        )
        assert rows[-1, 2] > 0.125 > rows[:, 2].min() + 0.005, "it bounced"
        assert last / first == pytest.approx(1.0, abs=2e-4), height


def test_a_moving_floor_gives_what_the_motion_of_the_mass_needs():
    """Newton's law for the whole: the sum of the forces is m (g + a), of a floor that
    heaves by 5 mm at 1 Hz.
    """
    heave = SignalVector(z=Sine(amplitude=0.005, frequency_hz=1.0))
    floor = Surface(name="floor", motion=heave, material=Material(dissipation=3.0))
    start = at_rest(
        BIRD, (0.0, 0.0, 0.12 - REST), velocity=Vec3(0.0, 0.0, 0.005 * 2.0 * math.pi)
    )
    surroundings = around(floor)
    rows = fall(BIRD, start, surroundings, 0.7)
    after = 70
    t = 0.005 * np.arange(1, len(rows) + 1)
    floor_z = 0.005 * np.sin(2.0 * math.pi * t)
    depth = 0.12 + floor_z - rows[:, 2]
    needed = (
        float(BIRD.mass) * (GRAVITY - floor_z * (2.0 * math.pi) ** 2) / (4.0 * 5000.0)
    )
    assert depth[after:] == pytest.approx(needed[after:], abs=3e-6)
    assert np.ptp(needed) > 0.5 * REST * 0.04, "the acceleration shows"


@pytest.mark.thorough
def test_friction_drags_a_vehicle_along_with_a_floor_that_moves_under_it():
    floor = Surface(
        name="floor", motion=SignalVector(x=Sine(amplitude=0.1, frequency_hz=0.5))
    )
    start = at_rest(
        BIRD, (0.0, 0.0, 0.12 - REST), velocity=Vec3(0.1 * math.pi, 0.0, 0.0)
    )
    rows = fall(BIRD, start, around(floor), 0.3)
    assert rows[:, 0] == pytest.approx(
        0.1 * np.sin(math.pi * 0.005 * np.arange(1, 61)), abs=5e-4
    )


@pytest.fixture(scope="module")
def pressed():
    """A vehicle whose tip and skids are in surfaces, and 1000 states around it."""
    bird = limp("hummingbird_arm2_rotors")
    wall = Surface(
        name="wall",
        shape="box",
        size=(0.5, 2.0, 2.0),
        position=(0.45, 0.0, 0.0),
        angles=(0.1, 0.2, 0.3),
    )
    ball = Surface(name="ball", shape="sphere", size=(0.2,), position=(0.1, 0.0, -0.3))
    points = (
        ContactPoint(name="tip", frame="tip"),
        ContactPoint(
            name="skid", body="base", position=Vec3(0.1, 0.05, -0.12), radius=0.02
        ),
        ContactPoint(
            name="elbow", body="link1", position=Vec3(0.0, 0.01, -0.14), radius=0.03
        ),
    )
    rng = np.random.default_rng(11)
    start = at_rest(bird, (0.0, 0.0, 0.0), (-0.45, -0.9))
    n = len([*start.position, *start.quaternion, *start.velocity, *start.rate]) + 4 + 4
    numbers = rng.normal(size=(1000, n)) * np.repeat(
        [0.03, 0.2, 0.5, 1.0, 0.2, 1.0, 1.0], [3, 4, 3, 3, 2, 2, 4]
    )
    numbers += [0.0, 0.0, 0.0, 1.0, *[0.0] * 9, -0.45, -0.9, *[0.0] * 6]
    numbers[:, 3:7] /= np.linalg.norm(numbers[:, 3:7], axis=1, keepdims=True)
    numbers[:, 17:] = 0.0
    bristles = 1e-4 * rng.normal(size=(1000, 18))
    return bird, (wall, ball), points, start, numbers, bristles


def test_both_plants_apply_the_same_force(pressed):
    """The change of acceleration on ours times MuJoCo's mass matrix is what MuJoCo is
    pushed with: 1e-9 of 1000.
    """
    from skyarm.compile import trace
    from skyarm.compile.tracing.array_evaluation import evaluate
    from skyarm.plant.interface import Truth
    from skyarm.plant.surroundings import Surroundings
    from skyarm.records.leaves import leaves
    from support.mujoco_plants import Equations
    from support.one_vehicle import acceleration

    bird, surfaces, points, start, numbers, bristles = pressed
    told = around(*surfaces, points=points)
    plant, equations = (
        MujocoPlant(Truth(vehicle=bird, gravity=GRAVITY), told),
        Equations(bird, GRAVITY),
    )
    world, effort = Truth(vehicle=bird, gravity=GRAVITY), Command(efforts=(0.0, 0.0))

    def change(state, memories):
        both = (
            acceleration(world, state, effort, each)
            for each in (dataclasses.replace(told, memories=memories), Surroundings())
        )
        (base, joints), (free, own) = both
        linear = state.quaternion.rotation().apply(base.linear - free.linear)
        return (
            *linear,
            *(base.angular - free.angular),
            *(a - b for a, b in zip(joints, own, strict=True)),
        )

    program, examples = trace(change, start, told.memories), leaves(told)
    held = leaves(told.memories)[:-18]  # before the bristles
    accelerations = np.stack(
        evaluate(program, [*numbers.T, *held, *bristles.T], len(numbers)), axis=1
    )
    theirs, ours = np.empty((1000, 8)), np.empty((1000, 8))
    for i, row in enumerate(numbers):
        plant._set((*row,), (0.0,) * 6, [*examples[:-19], *bristles[i], examples[-1]])
        plant._loads.step()
        theirs[i] = plant._pushed
        ours[i] = (
            equations.at(row[:3], row[3:7], row[13:15], row[7:15], np.zeros(8))[0]
            @ accelerations[i]
        )
    strength = np.abs(theirs).max(axis=1)
    assert (strength > 0.1).sum() > 700
    assert (np.abs(ours - theirs).max(axis=1) / np.maximum(strength, 1e-3)).max() < 1e-9


def test_a_drop_is_that_of_mujocos_own_contact():
    """Peak force and depth of MuJoCo's own contact, made as stiff per mass as ours, on
    its own body: within 5 %.

    Without weight, which MuJoCo's contact carries without a depth.
    """
    import mujoco

    mass, k = float(BIRD.mass), 5000.0
    text = f"""<mujoco><option gravity="0 0 0" timestep="1e-4" cone="elliptic"/>
      <default>
      <geom condim="1" solref="-{k / mass} 0" solimp="0.9999 0.9999 0.001"/>
      </default>
      <worldbody><geom type="plane" size="1 1 1"/>
      <body pos="0 0 0.1"><freejoint/>
      <geom type="sphere" size="0.1" mass="{mass}"/></body>
      </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qvel[2] = -0.3
    depths, forces = [], []
    for _ in range(600):
        mujoco.mj_step(model, data)
        depths.append(0.1 - data.qpos[2])
        forces.append(mass * data.qacc[2])
    under = (ContactPoint(name="below", body="base", position=Vec3(0.0, 0.0, -0.12)),)
    start = at_rest(BIRD, (0.0, 0.0, 0.12), velocity=Vec3(0.0, 0.0, -0.3))
    rows = fall(
        BIRD,
        start,
        around(ground(dissipation=0.0), points=under),
        0.06,
        step=0.001,
        gravity=0.0,
    )
    assert (0.12 - rows[:, 2]).max() == pytest.approx(max(depths), rel=0.05)
    assert k * (0.12 - rows[:, 2]).max() == pytest.approx(max(forces), rel=0.05)
    assert rows[:, 9].max() == pytest.approx(0.3, rel=5e-3)
    # m w^2 = k: half a period
    assert (rows[:, 2] < 0.12).sum() * 1e-3 == pytest.approx(
        math.pi * math.sqrt(mass / k), rel=0.04
    )


@pytest.mark.parametrize(
    ("speed", "finer"), [(0.05, 1.0), (0.6, 6.0), (1.2, 12.0), (5.0, 12.0)]
)
def test_steps_are_finer_the_faster_a_hit_and_calm_down_within_a_tenth_of_a_second(
    speed, finer
):
    """12 from 1.2 m/s on, in proportion below; afterwards they grow by a factor of e in
    0.1 s.
    """
    vehicle = limp()
    contact = Contact(surfaces=(ground(),), points=SKIDS)
    memory = contact.start(0.005, ())

    def steps(memory, height, falls):
        state = at_rest(
            vehicle, (0.0, 0.0, 0.12 + height), velocity=Vec3(0.0, 0.0, -falls)
        )
        return contact.hurry(
            memory, PointMotion(vehicle, state, gravity=GRAVITY), 0.02
        )[1]

    assert float(steps(memory, 1e-3, speed)) == pytest.approx(finer)
    assert float(steps(memory, 1.0, speed)) == 1.0
    after = dataclasses.replace(memory, finer=(10.0,))
    assert float(steps(after, 1.0, speed)) == pytest.approx(10.0 * math.exp(-0.2))


@pytest.mark.parametrize("most", [1, 2, 3, 100])
def test_a_hit_is_flown_in_as_many_steps_as_are_stated(most):
    """One is the step itself: no state of how fine it is, and the plant counts no
    more.
    """
    vehicle = limp()
    contact = Contact(surfaces=(ground(),), points=SKIDS, hit_steps=most)
    memory = contact.start(0.005, ())
    world = Surroundings(components=(contact,), memories=(memory,))
    assert RigidBodyPlant(Truth(vehicle=vehicle), world).substeps(0.005).most == most
    state = at_rest(vehicle, (0.0, 0.0, 0.121), velocity=Vec3(0.0, 0.0, -5.0))
    assert len(memory.finer) == (most > 1)
    if most > 1:
        assert (
            float(
                contact.hurry(
                    memory, PointMotion(vehicle, state, gravity=GRAVITY), 0.02
                )[1]
            )
            == most
        )
    if most < 100:
        assert np.isfinite(fall(vehicle, state, world, 0.01)).all()
