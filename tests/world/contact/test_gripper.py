"""Grasps against statics and momentum: what is held, where it gives way, what is let
go, on every engine.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.dynamics.energy import kinetic_energy
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.coerce import RecordError
from skyarm.records.leaves import leaves, rebuild
from skyarm.reference import Ramp
from skyarm.world.contact import Command, Contact, FreeObject, Gripper, Surface
from skyarm.world.contact.hold import Hold
from skyarm.world.contact.holds import _skin
from support.engines import evaluate
from support.worlds import BIRD, Scene, at_rest, energy, limp

ARM = limp("hummingbird_arm2_rotors")
START = at_rest(ARM, (0.0, 0.0, 0.0), (-0.45, -0.9))
TIP = PointMotion(ARM, START).position(*PointMotion(ARM, START).frame())
BELOW = Vec3(float(TIP.x), float(TIP.y), float(TIP.z) - 0.032)
"""Middle of a box of 6 cm whose top is 2 mm below the tip."""


def gripping(kind="magnet", **numbers):
    """The tip above a box of 100 g."""
    numbers = {"reach": 0.003} | numbers
    box = FreeObject(name="box", size=(0.06, 0.06, 0.06), mass=0.1, position=BELOW)
    return Contact(
        objects=(box,), grippers=(Gripper(name="hand", kind=kind, **numbers),)
    )


def taken(contact, state=START):
    """The memory once the gripper has taken hold."""
    return contact.act(contact.start(0.005, ()), 0.0, 0.005, PointMotion(ARM, state))


def moved(memory, way=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0)):
    """The memory with the first object elsewhere."""
    held = memory.carried[0]
    turned = Quaternion.of_rotation_vector(Vec3(*turn)) * held.attitude
    body = dataclasses.replace(
        held,
        position=held.position + Vec3(*way),
        attitude=turned,
        velocity=Vec3(*velocity),
    )
    return dataclasses.replace(memory, carried=(body, *memory.carried[1:]))


def after(contact, memory, t=0.1, state=START):
    """The grip after the next control instant."""
    return contact.act(memory, t, 0.005, PointMotion(ARM, state)).grips[0]


def test_it_takes_hold_within_its_reach_of_the_skin_and_not_beyond():
    assert float(taken(gripping(reach=0.0021)).grips[0].taken) == 1.0
    assert float(taken(gripping(reach=0.0019)).grips[0].taken) == 0.0
    grip = taken(gripping()).grips[0]
    assert [*grip.place] == pytest.approx([0.0, 0.0, 0.032])
    assert [*grip.normal] == pytest.approx([0.0, 0.0, 1.0])
    assert float(grip.ready) == 0.0


def test_of_two_bodies_within_reach_it_takes_the_first_and_only_that():
    one = gripping()
    beside = dataclasses.replace(
        one.objects[0], name="second", position=BELOW + Vec3(0.0, 0.0, 0.064)
    )
    both = dataclasses.replace(one, objects=(*one.objects, beside))
    assert float(taken(both).grips[0].taken) == 1.0
    away = dataclasses.replace(one.objects[0], position=BELOW - Vec3(0.0, 0.0, 0.1))
    other = dataclasses.replace(both, objects=(away, beside))
    memory = taken(other)
    assert float(memory.grips[0].taken) == 2.0
    assert [*memory.grips[0].normal] == pytest.approx([0.0, 0.0, -1.0])
    slope = other.slope(
        moved(memory, (0.0, 0.0, 1e-3)), 0.0, PointMotion(ARM, START), ()
    )
    assert [*slope.carried[0].velocity] == [0.0, 0.0, 0.0], "the other one is not held"


def wrench_and_rates(contact, memory, state=START):
    """Wrench on the vehicle, and the rates of the body."""
    motion = PointMotion(ARM, state)
    (wrench,) = contact.wrenches(memory, 0.0, motion, ())[-1:]
    return wrench, contact.slope(memory, 0.0, motion, ()).carried[0]


@pytest.mark.parametrize("kind", ["magnet", "jaw", "ball"])
def test_a_body_that_was_moved_away_is_pulled_back_by_the_stiffness_of_the_grasp(kind):
    contact = gripping(kind)
    wrench, rates = wrench_and_rates(contact, moved(taken(contact), (1e-4, 0.0, -2e-4)))
    assert [*rates.velocity] == pytest.approx([-5.0, 0.0, 10.0], abs=1e-9)
    assert [*wrench.force_W] == pytest.approx([0.5, 0.0, -1.0], abs=1e-9)


@pytest.mark.parametrize(
    ("kind", "holds"),
    [("magnet", True), ("suction", True), ("jaw", True), ("ball", False)],
)
def test_a_body_that_was_turned_is_turned_back_but_by_a_ball_grip(kind, holds):
    """By k rho^2 sin(angle), with rho^2 = a^2 / 6 of a cube: its angular acceleration
    is k / m of the angle.
    """
    contact = gripping(kind, radius=0.0)
    memory = taken(contact)
    # about the place where it is held: the place itself stays
    turn = np.array([0.0, 1e-3, 0.0])
    way = np.cross(turn, [0.0, 0.0, -0.032]) + np.array([0.0, 0.0, 0.032 * 0.5e-6])
    wrench, rates = wrench_and_rates(contact, moved(memory, way, turn))
    expected = -5000.0 / 0.1 * 1e-3 if holds else 0.0
    assert float(rates.rate.y) == pytest.approx(expected, abs=0.05)
    assert float(wrench.torque_W.y) == pytest.approx(
        -expected * 0.1 * 0.06**2 / 6.0, abs=1e-5
    )


def test_motion_against_each_other_is_damped():
    contact = gripping()
    hit = moved(taken(contact), velocity=(0.1, 0.0, 0.0))
    mass = 1.0 / (1.0 / 0.02 + float(contact.objects[0].mobility))
    _, rates = wrench_and_rates(contact, hit)
    assert float(rates.velocity.x) == pytest.approx(
        -0.1 * 2.0 * 0.5 * math.sqrt(5000.0 * mass) / 0.1
    )


@pytest.mark.parametrize("kind", ["magnet", "ball"])
def test_vehicle_and_what_it_holds_keep_their_momentum_and_lose_energy(kind):
    """Thrown apart in free space, they go on together: linear and angular momentum of
    the whole stay.
    """
    contact = gripping(kind, force=1e6, torque=1e6)
    contact = dataclasses.replace(
        contact,
        objects=(
            dataclasses.replace(contact.objects[0], velocity=Vec3(0.3, 0.2, -0.1)),
        ),
    )
    moving = dataclasses.replace(START, rate=Vec3(0.2, -0.3, 0.4))
    scene = Scene(
        contact, vehicle=ARM, state=moving, gravity=0.0, memory=taken(contact, moving)
    )
    vehicles, objects = scene.fly(contact, 0.1, step=0.0025)
    assert len(ARM.links) == 2

    def whole(x, o):
        state, body = rebuild(moving, iter(x.tolist())), contact.objects[0]
        linear, angular = momentum(state)
        Q = np.array(
            [
                [float(c) for c in row]
                for row in Quaternion(*o[3:7].tolist()).rotation().rows
            ]
        )
        own = Q @ (np.array([float(c) for c in body.moments]) * o[10:13])
        total = float(kinetic_energy(ARM, state)) + energy(o[None], body)[0]
        return (
            linear + 0.1 * o[7:10],
            angular + own + 0.1 * np.cross(o[:3], o[7:10]),
            total,
        )

    first, last = whole(vehicles[0], objects[0, 0]), whole(vehicles[-1], objects[-1, 0])
    # not linear in the state: of second order
    assert last[0] == pytest.approx(first[0], abs=1e-6)
    assert last[1] == pytest.approx(first[1], abs=2e-6)
    assert last[2] < first[2]
    tip, point = (
        PointMotion(ARM, rebuild(moving, iter(vehicles[-1].tolist()))),
        PointMotion(ARM, moving).frame(),
    )
    frame = contact.objects[0].frame(
        rebuild(contact.start(0.005, ()).carried[0], iter(objects[-1, 0].tolist()))
    )
    held = frame.position + frame.rotation.apply(Vec3(*scene.grip.place))
    assert [*tip.position(*point)] == pytest.approx([*held], abs=2e-4)


def momentum(state):
    """Linear and angular momentum of the vehicle about the world's origin, by points of
    its bodies.
    """
    motion, linear, angular = PointMotion(ARM, state), np.zeros(3), np.zeros(3)
    for index, body in (
        (-1, ARM.base),
        *((i, link.body) for i, link in enumerate(ARM.links)),
    ):
        x, v = (
            np.array([float(c) for c in f(body.com, index)])
            for f in (motion.position, motion.velocity)
        )
        w = motion.angular_velocity(index)
        spin = motion.to_world(body.inertia.apply(w), index)
        linear = linear + float(body.mass) * v
        angular = angular + float(body.mass) * np.cross(x, v) + [float(c) for c in spin]
    return linear, angular


def hold(force=(0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.0)):
    return Hold(force=Vec3(*force), torque=Vec3(*torque), place=Vec3(0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("kind", "force", "torque", "gives_way"),
    [
        # the normal is +z: 10 N, friction 0.5, 0.2 N m
        ("magnet", (0.0, 0.0, 9.9), (0.0, 0.0, 0.0), False),
        ("magnet", (0.0, 0.0, 10.1), (0.0, 0.0, 0.0), True),
        ("magnet", (0.0, 0.0, -30.0), (0.0, 0.0, 0.0), False),
        ("suction", (0.0, 0.0, 10.1), (0.0, 0.0, 0.0), True),
        ("magnet", (4.9, 0.0, 0.0), (0.0, 0.0, 0.0), False),
        ("magnet", (0.0, 5.1, 0.0), (0.0, 0.0, 0.0), True),
        ("magnet", (0.0, 2.6, 5.0), (0.0, 0.0, 0.0), True),
        ("magnet", (0.0, 5.9, -2.0), (0.0, 0.0, 0.0), False),
        ("magnet", (0.0, 0.0, 0.0), (0.0, 0.19, 0.0), False),
        ("magnet", (0.0, 0.0, 0.0), (0.0, 0.21, 0.0), True),
        ("jaw", (0.0, 7.0, -7.0), (0.0, 0.0, 0.0), False),
        ("jaw", (0.0, 7.2, -7.2), (0.0, 0.0, 0.0), True),
        ("jaw", (0.0, 0.0, 0.0), (0.15, 0.15, 0.0), True),
        ("ball", (-9.9, 0.0, 0.0), (0.0, 0.0, 0.0), False),
        ("hook", (0.0, 0.0, 10.1), (0.0, 0.0, 0.0), True),
    ],
)
def test_where_a_grasp_gives_way(kind, force, torque, gives_way):
    gripper = Gripper(name="hand", kind=kind, torque=0.2)
    grip = dataclasses.replace(gripper.start(), normal=Vec3(0.0, 0.0, 1.0))
    body = gripping().objects[0].frame(gripping().objects[0].start())
    assert bool(gripper.is_overloaded(grip, hold(force, torque), body)) is gives_way


def test_what_gave_way_is_taken_again_only_after_the_gripper_was_opened():
    contact = gripping(closed=Command(Ramp(start=0.0, duration=1.0, height=1.0)))
    assert float(after(contact, contact.start(0.005, ()), t=0.4).taken) == 0.0, (
        "open until one half"
    )
    memory = contact.act(contact.start(0.005, ()), 0.6, 0.005, PointMotion(ARM, START))
    assert float(memory.grips[0].taken) == 1.0
    pulled = moved(memory, (0.0, 0.0, -0.0021))
    lost = after(contact, pulled, t=0.7)
    assert (float(lost.taken), float(lost.lost), float(lost.ready)) == (0.0, 1.0, 0.0)
    near = dataclasses.replace(memory, grips=(lost,))
    assert float(after(contact, near, t=0.8).taken) == 0.0
    opened = after(contact, near, t=0.1)
    assert (float(opened.taken), float(opened.ready), float(opened.lost)) == (
        0.0,
        1.0,
        1.0,
    )
    assert (
        float(after(contact, dataclasses.replace(memory, grips=(opened,)), t=0.9).taken)
        == 1.0
    )


def test_a_command_lets_go_and_that_is_no_loss():
    contact = gripping(closed=Command(Ramp(start=0.0, duration=1.0, height=1.0)))
    memory = contact.act(contact.start(0.005, ()), 0.6, 0.005, PointMotion(ARM, START))
    grip = after(contact, memory, t=0.3)
    assert (float(grip.taken), float(grip.lost), float(grip.ready)) == (0.0, 0.0, 1.0)
    # also of what would have given way at that instant
    overloaded = moved(memory, (0.0, 0.0, -0.0021))
    assert float(after(contact, overloaded, t=0.7).lost) == 1.0
    assert float(after(contact, overloaded, t=0.3).lost) == 0.0


def test_a_hook_takes_an_object_in_rising_and_drops_it_in_sinking():
    contact = gripping("hook")
    rising = dataclasses.replace(START, velocity=Vec3(0.0, 0.0, 0.1))
    assert float(taken(contact).grips[0].taken) == 0.0
    memory = taken(contact, rising)
    assert float(memory.grips[0].taken) == 1.0
    _, hangs = wrench_and_rates(contact, moved(memory, (0.0, 0.0, -1e-3)))
    assert float(hangs.velocity.z) == pytest.approx(50.0)
    _, lifted = wrench_and_rates(contact, moved(memory, (1e-4, 0.0, 1e-3)))
    assert [*lifted.velocity] == pytest.approx([-5.0, 0.0, 0.0], abs=1e-9)
    assert float(after(contact, moved(memory, (0.0, 0.0, 0.0029))).taken) == 1.0
    out = after(contact, moved(memory, (0.0, 0.0, 0.0031)))
    assert (float(out.taken), float(out.lost), float(out.ready)) == (0.0, 0.0, 0.0)
    away = dataclasses.replace(moved(memory, (0.0, 0.0, -0.1)), grips=(out,))
    assert float(after(contact, away).ready) == 1.0


def test_a_flight_that_holds_something_takes_the_steps_of_contact():
    contact = gripping()
    far = moved(taken(contact), (0.0, 0.0, -0.001))
    free = dataclasses.replace(far, grips=contact.start(0.005, ()).grips)
    below = dataclasses.replace(contact, points=())
    assert not bool(below.far(far, PointMotion(ARM, START), 0.005))
    assert bool(below.far(free, PointMotion(ARM, START), 0.005))
    mass = 1.0 / (1.0 / 0.02 + float(contact.objects[0].mobility))
    steps = [float(step) for _, step in contact.steps]
    assert steps == [pytest.approx(0.85 * math.sqrt(mass / 5000.0))]
    soft = dataclasses.replace(
        contact, grippers=(Gripper(name="hand", stiffness=500.0),)
    )
    assert float(soft.largest_step) == pytest.approx(0.85 * math.sqrt(mass / 500.0))


@pytest.mark.parametrize(
    ("engine", "tolerance"),
    [
        pytest.param("numpy", 1e-12, marks=pytest.mark.thorough),
        ("trace", 0.0),
        pytest.param("jax", 1e-10, marks=pytest.mark.thorough),
    ],
)
@pytest.mark.parametrize(
    "kind", ["magnet", pytest.param("hook", marks=pytest.mark.thorough)]
)
def test_every_engine_gives_what_floats_give(engine, tolerance, kind):
    contact = gripping(kind, reach=0.01)
    first = taken(contact, dataclasses.replace(START, velocity=Vec3(0.0, 0.0, 0.1)))
    rng = np.random.default_rng(4)
    given = np.tile(np.array([*leaves(START), *leaves(first)]), (20, 1))
    given += 1e-3 * rng.normal(size=given.shape)
    n = len(leaves(START))
    given[:, 3:7] /= np.linalg.norm(given[:, 3:7], axis=1, keepdims=True)
    given[:, n + 14] = rng.integers(0, 2, 20)  # held or not

    def everything(*numbers):
        state, memory = rebuild((START, first), iter(numbers))
        motion = PointMotion(ARM, state, gravity=9.8)
        wrenches = contact.wrenches(memory, 0.0, motion, ())
        found = [c for w in wrenches for c in (*w.force_W, *w.torque_W)]
        later = leaves(contact.act(memory, 0.0, 0.005, motion))
        return [
            *found,
            *leaves(contact.slope(memory, 0.0, motion, ())),
            *later,
            *contact.logged(memory, motion),
        ]

    expected = evaluate("floats", everything, given)
    assert len(np.unique(expected[:, -6])) == 2
    found = evaluate(engine, everything, given)
    assert np.abs(found - expected).max() <= tolerance * np.abs(expected).max()


@pytest.mark.parametrize(
    ("numbers", "refusal"),
    [
        ({"name": ""}, "gripper.name = '': must not be empty"),
        ({"kind": "glue"}, "gripper.kind = 'glue': must be one of"),
        ({"kind": "ball", "radius": 1e308}, "gripper.radius = 1e+308: must be"),
        ({"reach": 0.0}, "gripper.reach"),
        ({"force": -1.0}, "gripper.force"),
        ({"stiffness": math.nan}, "gripper.stiffness"),
        (
            {
                "kind": "hook",
                "closed": Command(Ramp(start=0.0, duration=1.0, height=1.0)),
            },
            "must be left out of a hook",
        ),
        ({"closed": 3.0}, "gripper.closed"),
    ],
)
def test_a_gripper_that_cannot_be_is_refused(numbers, refusal):
    with pytest.raises(RecordError) as caught:
        Gripper(**({"name": "hand"} | numbers))
    assert refusal in str(caught.value)


def test_grippers_want_a_frame_of_the_vehicle_and_something_to_hold():
    with pytest.raises(
        RecordError, match=r"world.grippers\[0\].frame = 'claw': .*there are"
    ):
        gripping(frame="claw").require_vehicle(ARM, 0.005, 9.81)
    with pytest.raises(
        RecordError,
        match=r"world.grippers: must be left out of a world without objects",
    ):
        dataclasses.replace(
            gripping(), objects=(), surfaces=(Surface(name="ground"),)
        ).on({"": ARM}).require_vehicle(ARM, 0.005, 9.81)
    with pytest.raises(RecordError, match=r"world.grippers\[0\].frame = ''"):
        gripping().require_vehicle(BIRD, 0.005, 9.81)
    with pytest.raises(RecordError, match="must be of one only"):
        dataclasses.replace(gripping(), grippers=(Gripper(name="box"),))


def test_the_turn_that_is_kept_is_the_bodys_in_the_grippers_axes():
    contact = gripping()
    turned = dataclasses.replace(contact.objects[0], angles=Vec3(0.0, 0.0, 0.7))
    contact = dataclasses.replace(contact, objects=(turned,))
    memory = taken(contact)
    frame = contact.gripping.frames(PointMotion(ARM, START))[0]
    kept: Mat3 = frame.rotation @ memory.grips[0].turn
    expected = [
        [math.cos(0.7), -math.sin(0.7), 0.0],
        [math.sin(0.7), math.cos(0.7), 0.0],
        [0.0, 0.0, 1.0],
    ]
    assert [[float(c) for c in row] for row in kept.rows] == [
        pytest.approx(row, abs=1e-12) for row in expected
    ]
    _, rates = wrench_and_rates(contact, memory)
    assert [*rates.rate] == pytest.approx([0.0] * 3, abs=1e-9)


def test_a_semi_implicit_step_keeps_what_is_held():
    contact = gripping()
    memory = taken(contact)
    slope = contact.slope(memory, 0.0, PointMotion(ARM, START), ())
    assert contact.euler_step(memory, slope, 0.001).grips == memory.grips


def test_force_and_reaction_are_at_one_place():
    """Stretched by 1 mm along x and pulled on along z by damping: a couple about the
    frame of 1 mm times that.
    """
    contact = gripping("ball")
    memory = moved(taken(contact), (1e-3, 0.0, 0.0), velocity=(0.0, 0.0, -0.1))
    wrench, rates = wrench_and_rates(contact, memory)
    pull = -0.1 * float(rates.velocity.z)
    assert pull < -0.1
    assert [*wrench.torque_W] == pytest.approx([0.0, -1e-3 * pull, 0.0], abs=1e-12)
    # about the centre of mass: the place is 3.2 cm above it
    assert float(rates.rate.y) == pytest.approx(
        0.032 * 0.1 * float(rates.velocity.x) / (0.1 * 0.06**2 / 6.0)
    )


def test_the_nearest_of_several_surfaces_is_taken():
    class Two(FreeObject):
        """A box with a plate above it."""

        @property
        def surfaces(self):
            plate = Surface(
                name="plate",
                shape="box",
                size=(0.1, 0.1, 0.01),
                position=(0.0, 0.0, 0.05),
            )
            return (*FreeObject.surfaces.fget(self), plate)

    two = Two(name="two", size=(0.06, 0.06, 0.06), mass=0.1)
    distance, normal = _skin(two, two.frame(two.start()), Vec3(0.0, 0.0, 0.043))
    assert float(distance) == pytest.approx(0.002)
    assert [*normal] == pytest.approx([0.0, 0.0, -1.0])
    distance, normal = _skin(two, two.frame(two.start()), Vec3(0.0, 0.0, 0.031))
    assert float(distance) == pytest.approx(0.001)
    assert [*normal] == pytest.approx([0.0, 0.0, 1.0])


def test_turning_against_each_other_is_damped_where_the_pose_is_held():
    """Damping is that of the place times the square of the radius of gyration."""
    contact = gripping()
    memory = taken(contact)
    body = dataclasses.replace(memory.carried[0], rate=Vec3(0.0, 0.0, 0.4))
    spun = dataclasses.replace(memory, carried=(body,))
    mass = 1.0 / (1.0 / 0.02 + float(contact.objects[0].mobility))
    _, rates = wrench_and_rates(contact, spun)
    assert float(rates.rate.z) == pytest.approx(
        -0.4 * 2.0 * 0.5 * math.sqrt(5000.0 * mass) / 0.1
    )


def test_the_speed_of_a_grasp_is_that_of_both_where_the_body_is_held():
    """The gripper turns with 10 rad/s about y; 1 mm beside its frame that is 1 cm/s
    along z.
    """
    contact = gripping("ball")
    turning = dataclasses.replace(START, rate=Vec3(0.0, 10.0, 0.0))
    motion = PointMotion(ARM, turning)
    point, body = motion.frame()
    velocity = [float(c) for c in motion.velocity(point, body)]
    memory = moved(taken(contact), (1e-3, 0.0, 0.0), velocity=velocity)
    mass = 1.0 / (1.0 / 0.02 + float(contact.objects[0].mobility))
    _, rates = wrench_and_rates(contact, memory, turning)
    assert float(rates.velocity.z) == pytest.approx(
        -10.0 * 1e-3 * math.sqrt(5000.0 * mass) / 0.1
    )


@pytest.mark.parametrize("ratio", [0.0, 0.5, 1.0, 2.0])
def test_a_step_of_a_grasp_is_that_of_its_fastest_pole(ratio):
    """Runge-Kutta's steps are 1.5 over it, and at most 0.85 over the frequency; the
    poles are NumPy's.
    """
    hand = Gripper(name="hand", stiffness=5000.0, damping_ratio=ratio)
    poles = np.roots([1.0, 2.0 * ratio * math.sqrt(5000.0 * 0.1) / 0.1, 5000.0 / 0.1])
    expected = min(0.85 * math.sqrt(0.1 / 5000.0), 1.5 / np.abs(poles).max())
    assert float(hand.step_of(0.1, 0.1)) == pytest.approx(expected, rel=1e-6)
