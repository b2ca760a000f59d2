"""A ball in its socket: friction against Coulomb's pendulum (SciPy), statics and spin;
free without a radius.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from skyarm.algebra import ZERO3, Quaternion, Vec3
from skyarm.compile import trace
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.coerce import RecordError
from skyarm.records.leaves import leaves, rebuild
from skyarm.world.contact import Contact, FreeObject, Gripper
from skyarm.world.contact.mechanism import Mechanism
from support.engines import evaluate
from support.worlds import at_rest, limp

ARM = limp("hummingbird_arm2_rotors")
START = at_rest(ARM, (0.0, 0.0, 0.0), (-0.45, -0.9))
G, MASS, SIDE, GAP = 9.81, 0.1, 0.06, 0.002
STILL = PointMotion(ARM, START, gravity=G)
TIP = STILL.position(*STILL.frame())
TORQUE = 0.004
SOCKET = {"kind": "ball", "force": 20.0, "friction": 0.1, "radius": 0.002}
LEVER, SQUARE = 0.5 * SIDE + GAP, SIDE * SIDE / 6.0
"""m from the ball to the middle of the box; m^2, of its radius of gyration."""
PERIOD, STEP = 0.005, 0.0005


def holding(off=0.0, **numbers):
    """A gripper that stands still has taken a cube of 100 g beside the middle of its
    top.
    """
    middle = Vec3(float(TIP.x) - off, float(TIP.y), float(TIP.z) - LEVER)
    box = FreeObject(name="box", size=(SIDE,) * 3, mass=MASS, position=middle)
    contact = Contact(
        objects=(box,),
        grippers=(Gripper(name="hand", reach=0.003, **(SOCKET | numbers)),),
    )
    return contact, contact.act(contact.start(PERIOD, ()), 0.0, PERIOD, STILL)


FIRST = holding()[1]


def turned(memory, vector, rate=(0.0, 0.0, 0.0)):
    """The box turned about the ball by a rotation vector (rad)."""
    held = memory.carried[0]
    turn = Quaternion.of_rotation_vector(Vec3(*vector))
    lever = held.position - Vec3(*(float(c) for c in TIP))
    place = Vec3(*(float(c) for c in TIP)) + turn.rotation().apply(lever)
    body = dataclasses.replace(
        held, position=place, attitude=turn * held.attitude, rate=Vec3(*rate)
    )
    return dataclasses.replace(memory, carried=(body,))


@cache
def stepping(friction):
    """Machine code of an integration step of the object and of a control instant; the
    vehicle stands still.
    """
    contact, _ = holding(friction=friction)

    def step(*numbers):
        memory = contact.drift(rebuild(FIRST, iter(numbers)), 0.5 * STEP)
        return leaves(
            contact.drift(contact.push(memory, 0.0, STILL, (), STEP), 0.5 * STEP)
        )

    def instant(*numbers):
        return leaves(contact.act(rebuild(FIRST, iter(numbers)), 1.0, PERIOD, STILL))

    return tuple(
        trace(lambda *x, f=each: tuple(f(*x)), *(0.5 for _ in leaves(FIRST)))
        for each in (step, instant)
    )


def swing(memory, seconds, friction=SOCKET["friction"]):
    """Memories at control instants while the vehicle stands still."""
    step, instant = stepping(friction)
    numbers, found = [float(each) for each in leaves(memory)], [memory]
    for _ in range(round(seconds / PERIOD)):
        for _ in range(round(PERIOD / STEP)):
            numbers = step(*numbers)
        numbers = instant(*numbers)
        found.append(rebuild(FIRST, iter(numbers)))
    return found


def tilt(memory):
    """Angle about the world's y axis, rad."""
    attitude = memory.carried[0].attitude
    return 2.0 * math.atan2(float(attitude.y), float(attitude.w))


def test_friction_is_that_of_a_bearing_under_the_force_of_its_seat():
    """The frictional moment of a spherical plain bearing: half its diameter times mu
    times the load.
    """
    hand = Gripper(name="hand", kind="ball", force=60.0, friction=0.15, radius=0.006)
    assert hand.socket_torque == pytest.approx(0.5 * 0.15 * 60.0 * 0.012)


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.6, 0.8)])
def test_a_ball_bears_a_small_twist_as_a_magnet_does_and_a_large_one_by_its_friction(
    axis,
):
    contact, memory = holding()
    stiffness = 5000.0 * SQUARE
    for angle, torque in ((5e-4, stiffness * math.sin(5e-4)), (0.3, TORQUE)):
        slope = contact.slope(
            turned(memory, [angle * c for c in axis]), 0.0, PointMotion(ARM, START), ()
        )
        found = np.array([*slope.carried[0].rate]) * MASS * SQUARE
        assert found == pytest.approx(
            [-torque * c for c in axis], abs=2e-6 + 1e-3 * torque
        )


def test_force_and_torque_act_back_on_the_vehicle():
    contact, memory = holding()
    motion = PointMotion(ARM, START)
    (wrench,) = contact.wrenches(turned(memory, (0.3, 0.0, 0.0)), 0.0, motion, ())[-1:]
    assert [*wrench.torque_W] == pytest.approx([TORQUE, 0.0, 0.0], abs=1e-6)


def test_what_has_turned_in_its_socket_stays_there():
    contact, memory = holding()
    after = contact.act(turned(memory, (0.0, 0.5, 0.0)), 1.0, PERIOD, STILL)
    left = contact.gripping.possible(
        after.grips,
        contact.gripping.frames(STILL),
        contact.gripping.bodies(after.carried),
    )
    assert left[0][0].twist.y == pytest.approx(-TORQUE / (5000.0 * SQUARE), rel=1e-3)
    back = turned(after, (0.0, -0.002, 0.0))  # it springs back by that much and no more
    slope = contact.slope(back, 0.0, PointMotion(ARM, START), ())
    assert float(slope.carried[0].rate.y) * MASS * SQUARE == pytest.approx(
        0.002 * 3.0 - TORQUE, abs=2e-5
    )


def test_what_friction_bears_does_not_creep():
    """A tenth of a radian, kept over and over: of the sine of that angle a sixth of its
    cube was lost each time.
    """
    contact, memory = holding(friction=50.0)
    held = turned(memory, (0.06, -0.08, 0.0))
    before = np.array([[*row] for row in held.grips[0].turn.rows], dtype=float)
    for k in range(40):
        held = contact.act(held, 1.0 + k * PERIOD, PERIOD, STILL)
    after = np.array([[*row] for row in held.grips[0].turn.rows], dtype=float)
    assert after == pytest.approx(before, abs=1e-5)


def test_a_box_swings_out_as_the_pendulum_of_coulomb():
    """Turning points against SciPy; where the angle is small each half-swing loses 2
    M / (m g l).
    """
    _, memory = holding(friction=0.025)
    torque = 0.25 * TORQUE
    inertia, weight = MASS * (SQUARE + LEVER * LEVER), MASS * G * LEVER
    angles = np.array(
        [tilt(each) for each in swing(turned(memory, (0.0, 0.3, 0.0)), 1.4, 0.025)]
    )
    expected, angle, side = [], 0.3, 1.0
    while weight * math.sin(abs(angle)) > torque:

        def rates(_, x, side=side):
            return [x[1], (side * torque - weight * math.sin(x[0])) / inertia]

        def stops(t, x, side=side):
            return side * x[1] if t > 1e-3 else -1.0

        stops.terminal = True
        angle = float(
            solve_ivp(
                rates, (0.0, 1.0), [angle, 0.0], events=stops, rtol=1e-9, atol=1e-12
            ).y[0, -1]
        )
        expected.append(angle)
        side = -side
    assert -np.diff(np.abs([0.3, *expected[:4]])) == pytest.approx(
        np.full(4, 2.0 * torque / weight), abs=1e-3
    )
    moving = np.diff(angles)
    found = angles[1:-1][moving[:-1] * moving[1:] < 0.0]
    assert found[:3] == pytest.approx(expected[:3], abs=4e-3)
    assert abs(angles[-1]) < torque / weight + 4e-3
    assert np.ptp(angles[-20:]) < 1e-3


@pytest.mark.parametrize(("share", "level"), [(0.8, True), (1.25, False)])
def test_a_box_held_off_its_middle_stays_level_as_far_as_friction_bears_its_weight(
    share, level
):
    """M = m g d; from further off it turns until its middle is nearer than that."""
    off = share * TORQUE / (MASS * G)
    last = swing(holding(off)[1], 0.6)[-1]
    assert (abs(tilt(last)) < 5e-3) is level
    away = float(last.carried[0].position.x) - float(TIP.x)
    assert abs(away) < TORQUE / (MASS * G) + 1e-3


def test_a_spin_about_the_vertical_is_braked_evenly_and_stops():
    rows = swing(turned(FIRST, (0.0, 0.0, 0.0), (0.0, 0.0, 20.0)), 0.6)
    rates = np.array([float(each.carried[0].rate.z) for each in rows])
    brake = TORQUE / (MASS * SQUARE)
    early = np.arange(10, 40)
    assert rates[early] == pytest.approx(20.0 - brake * PERIOD * early, abs=0.1)
    assert np.abs(rates[-20:]).max() < 0.05


def test_without_a_radius_it_turns_freely_and_a_mechanism_always_does():
    contact, memory = holding(radius=0.0)
    frames, bodies = (
        contact.gripping.frames(STILL),
        contact.gripping.bodies(turned(memory, (0.0, 0.3, 0.0)).carried),
    )
    hold = contact.gripping.possible(memory.grips, frames, bodies)[0][0]
    assert (hold.torque, hold.twist) == (ZERO3, None)
    hand, none = Gripper(name="hand", kind="ball"), contact.grippers[0].start()
    assert hand.hold(none, frames[0], bodies[0], 0.1, 0).twist is None
    assert Mechanism.gyration.fget(None) == 0


def test_friction_never_gives_way_and_the_force_does():
    contact, memory = holding(torque=1e-4)
    assert (
        float(
            contact.act(turned(memory, (0.0, 0.5, 0.0)), 1.0, PERIOD, STILL)
            .grips[0]
            .lost
        )
        == 0.0
    )


@pytest.mark.parametrize(
    "engine",
    [
        "trace",
        *(pytest.param(each, marks=pytest.mark.thorough) for each in ("numpy", "jax")),
    ],
)
def test_every_engine_turns_it_alike(engine):
    contact, memory = holding()
    rng = np.random.default_rng(5)
    first = turned(memory, (0.0, 0.0, 0.0))
    given = np.array(
        [
            leaves(turned(memory, 0.02 * rng.normal(size=3), rng.normal(size=3)))
            for _ in range(12)
        ],
        float,
    )

    def everything(*numbers):
        memory = rebuild(first, iter(numbers))
        later = contact.act(memory, 0.0, PERIOD, STILL)
        return [
            *leaves(contact.slope(memory, 0.0, STILL, ()).carried),
            *leaves(later.grips),
        ]

    expected = evaluate("floats", everything, given)
    found = evaluate(engine, everything, given)
    assert np.abs(found - expected).max() <= 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("numbers", [{"radius": -0.001}, {"radius": math.nan}])
def test_a_radius_that_cannot_be_is_refused(numbers):
    with pytest.raises(RecordError, match=r"gripper\.radius"):
        Gripper(name="hand", **numbers)


@pytest.mark.parametrize(
    ("friction", "side", "warned"), [(0.1, 0.06, True), (0.5, 0.03, False)]
)
def test_a_ball_that_cannot_hold_the_rim_of_an_object_level_is_warned_of(
    friction, side, warned
):
    contact, _ = holding(friction=friction)
    contact = dataclasses.replace(
        contact, objects=(dataclasses.replace(contact.objects[0], size=(side,) * 3),)
    )
    lines = contact.warnings(ARM, 1e-6)
    assert bool(lines) is warned
    if warned:
        millimetres = 1e3 * TORQUE / (MASS * 9.81)
        assert (
            f"'box' level up to {millimetres:.2g} mm beside its centre of mass"
            in lines[0]
        )
    lying = dataclasses.replace(contact.objects[0], shape="cylinder", size=(0.03, 0.2))
    assert [each.half_width for each in (contact.objects[0], lying)] == [
        0.5 * side,
        0.1,
    ]
    magnet = dataclasses.replace(
        contact, grippers=(dataclasses.replace(contact.grippers[0], kind="magnet"),)
    )
    assert not magnet.warnings(ARM, 1e-6)
