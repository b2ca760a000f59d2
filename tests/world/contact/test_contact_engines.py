"""Contact on every engine, and the wrench of a ball that touches beside its middle."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.leaves import leaves, rebuild
from skyarm.reference import Sine
from skyarm.vehicle.linkage import BASE
from skyarm.world import SignalVector
from skyarm.world.contact import Contact, ContactPoint, Surface
from support.engines import evaluate
from support.worlds import at_rest, limp

BIRD = limp("hummingbird_arm2_rotors")
START = at_rest(BIRD, (0.0, 0.0, 0.0), (-0.45, -0.9))
CONTACT = Contact(
    surfaces=(
        Surface(
            name="wall",
            shape="box",
            size=(0.5, 2.0, 2.0),
            position=(0.45, 0.0, 0.0),
            angles=(0.1, 0.2, 0.3),
        ),
        Surface(
            name="pipe",
            shape="cylinder",
            size=(0.2, 2.0),
            position=(0.1, 0.0, -0.3),
            angles=(1.5, 0.0, 0.0),
            motion=SignalVector(z=Sine(amplitude=0.02, frequency_hz=1.0)),
        ),
    ),
    points=(
        ContactPoint(name="tip", frame="tip"),
        ContactPoint(
            name="skid", body="base", position=Vec3(0.1, 0.05, -0.12), radius=0.02
        ),
    ),
)
MEMORY = CONTACT.start(0.005, ())


def lanes(count=40):
    rng = np.random.default_rng(2)
    state = np.array(leaves(START)) + 0.05 * rng.normal(
        size=(count, len(leaves(START)))
    )
    state[:, 7:] *= 10.0
    state[:, 3:7] /= np.linalg.norm(state[:, 3:7], axis=1, keepdims=True)
    state[:, 13:15] = np.array(START.joints) + 0.1 * rng.normal(size=(count, 2))
    memory = 1e-4 * rng.normal(size=(count, len(leaves(MEMORY))))
    memory[:, 0] = rng.uniform(0.0, 1.0, count)
    return np.hstack([state, memory])


def everything(*numbers):
    state, memory = rebuild((START, MEMORY), iter(numbers))
    motion = PointMotion(BIRD, state)
    wrenches = CONTACT.wrenches(memory, 0.0, motion, ())
    found = [c for w in wrenches for c in (*w.force_W, *w.torque_W)]
    return [
        *found,
        *leaves(CONTACT.slope(memory, 0.0, motion, ())),
        *CONTACT.logged(memory, motion),
    ]


@pytest.mark.parametrize(
    ("engine", "tolerance"),
    [
        pytest.param("numpy", 1e-12, marks=pytest.mark.thorough),
        ("trace", 0.0),
        # one operation after the other: 5 s
        pytest.param("jax", 1e-10, marks=pytest.mark.thorough),
        pytest.param("casadi", 1e-10, marks=pytest.mark.thorough),
    ],
)
def test_every_engine_gives_what_floats_give(engine, tolerance):
    given = lanes()
    expected = evaluate("floats", everything, given)
    assert (np.abs(expected[:, :3]).max(axis=1) > 0.1).sum() > 10
    assert (np.abs(expected[:, 6:9]).max(axis=1) > 0.1).sum() > 10
    found = evaluate(engine, everything, given)
    assert np.abs(found - expected).max() <= tolerance * np.abs(expected).max()


def test_the_force_acts_where_the_ball_touches_and_its_power_is_that_of_the_spot():
    """Power of the wrench = force at the spot times the spot's velocity, taken by
    differences of positions.
    """
    for row in lanes(12):
        state, memory = rebuild((START, MEMORY), iter(row.tolist()))
        motion = PointMotion(BIRD, state)
        (wrench,) = (
            each
            for each in CONTACT.wrenches(memory, 0.0, motion, ())
            if each.body == BASE
        )
        w = motion.to_world(motion.angular_velocity(wrench.body), wrench.body)
        power = wrench.force_W.dot(
            motion.velocity(wrench.point, wrench.body)
        ) + wrench.torque_W.dot(w)
        expected, h = 0.0, 1e-7
        after = dataclasses.replace(
            state,
            position=state.position + state.velocity * h,
            quaternion=state.quaternion.plus(
                state.quaternion.derivative(state.rate), h
            ).normalized(),
        )
        for touch in CONTACT.on_points(memory, motion)[1::2]:
            at, body = CONTACT.points[1].place(BIRD)
            # the spot as a point of the base
            spot = at + state.quaternion.rotation().apply_T(touch.spot)
            before, later = (
                PointMotion(BIRD, each).position(spot, body) for each in (state, after)
            )
            expected += float(touch.force.dot((later - before) * (1.0 / h)))
        assert float(power) == pytest.approx(expected, abs=1e-5 * (1.0 + abs(expected)))


def test_what_sticks_on_a_ball_turns_with_its_normal():
    """A bristle has no part along the normal, whatever its memory says."""
    memory = dataclasses.replace(
        MEMORY, bristles=tuple(Vec3(1e-4, 1e-4, 1e-4) for _ in MEMORY.bristles)
    )
    for touch in CONTACT.on_points(memory, PointMotion(BIRD, START)):
        assert abs(float(touch.friction.dot(touch.axis))) < 1e-12
        assert float(touch.axis.dot(touch.axis)) == pytest.approx(1.0)


def test_one_surface_that_moves_is_where_the_clock_says():
    assert MEMORY.clock == (0.0,)
    assert CONTACT.slope(MEMORY, 0.0, PointMotion(BIRD, START), ()).clock == (1.0,)
    assert CONTACT.advance(MEMORY, 0.35, 0.005, START, ()).clock == (0.35,)
    later = dataclasses.replace(MEMORY, clock=(0.25,))
    before, after = (
        CONTACT.on_points(each, PointMotion(BIRD, START)) for each in (MEMORY, later)
    )
    assert float(after[0].depth) == float(before[0].depth)
    assert float(after[2].depth) > float(before[2].depth) + 0.005


def touch_of_ball(**motion):
    """A ball of 0.1 m about the base's origin, 0.09 m above the ground."""
    ball = Contact(
        surfaces=(Surface(name="ground"),),
        points=(ContactPoint(name="ball", body="base", radius=0.1),),
    )
    state = dataclasses.replace(START, position=Vec3(0.0, 0.0, 0.09), **motion)
    (touch,) = ball.on_points(ball.start(0.005, ()), PointMotion(BIRD, state))
    return touch


def test_a_ball_is_as_deep_as_its_radius_says_and_slips_with_its_lowest_point():
    """w x (-r n): at 0.5 rad/s about y the lowest point goes backwards with 5 cm/s,
    which v_x makes good.
    """
    still = touch_of_ball()
    assert float(still.depth) == pytest.approx(0.01, rel=1e-12)
    assert [*still.spot] == pytest.approx([0.0, 0.0, -0.1])
    turning = touch_of_ball(rate=Vec3(0.0, 0.5, 0.0))
    assert [*turning.slip] == pytest.approx([-0.05, 0.0, 0.0], abs=1e-12)
    rolling = touch_of_ball(rate=Vec3(0.0, 0.5, 0.0), velocity=Vec3(0.05, 0.0, 0.0))
    assert [*rolling.slip] == pytest.approx([0.0] * 3, abs=1e-12)
    assert [*touch_of_ball(velocity=Vec3(0.1, 0.0, -0.2)).slip] == pytest.approx(
        [0.1, 0.0, -0.2]
    )


@pytest.mark.parametrize(
    ("height", "speed", "period", "far"),
    [
        (0.0051, 0.0, 0.005, True),
        (0.0049, 0.0, 0.005, False),
        (0.0099, -1.0, 0.005, False),
        (0.0101, -1.0, 0.005, True),
        (-0.002, 3.0, 0.005, False),  # leaves, and is pressed until it has left
        (0.005, 3.0, 0.005, False),
        (0.0201, 3.0, 0.005, True),
        (0.0051, 0.0, 0.001, True),  # shorter periods keep the distance
        (0.0049, 0.0, 0.001, False),
        (0.079, 0.0, 0.02, False),  # 400 m/s^2 for 20 ms
        (0.081, 0.0, 0.02, True),
    ],
)
def test_far_is_what_stays_five_millimetres_away_at_its_present_speed(
    height, speed, period, far
):
    ground = Contact(
        surfaces=(Surface(name="g"), Surface(name="deep", position=(0.0, 0.0, -1.0))),
        points=SPOT,
    )
    for way in (Vec3(0.0, 0.0, speed), Vec3(0.6 * speed, 0.0, 0.8 * speed)):
        state = dataclasses.replace(
            START, position=Vec3(0.0, 0.0, height), velocity=way
        )
        assert (
            bool(ground.far(ground.start(period, ()), PointMotion(BIRD, state), period))
            is far
        )


def test_while_it_is_far_the_clock_goes_on_and_bristles_stand_up():
    memory = dataclasses.replace(
        MEMORY,
        clock=(0.25,),
        bristles=tuple(Vec3(1e-4, 0.0, -2e-4) for _ in MEMORY.bristles),
    )
    later = CONTACT.alone(memory, 0.005, 3, 9.8)
    assert later.clock == (0.255,)
    for bristle in later.bristles:
        assert [*bristle] == pytest.approx(
            [1e-4 * math.exp(-2.5), 0.0, -2e-4 * math.exp(-2.5)], rel=1e-12
        )


def test_points_of_one_body_push_together_as_each_would_alone():
    """Force, moment about the base's origin and joint efforts of two skids and three
    balls, against one by one.
    """
    ground = Surface(name="ground", position=(0.0, 0.0, -0.09), angles=(0.05, 0.1, 0.0))
    skids = [
        ContactPoint(name=str(y), body="base", position=Vec3(0.1, y, -0.12))
        for y in (0.1, -0.05)
    ]
    link = ContactPoint(
        name="elbow", body="link1", position=Vec3(0.0, 0.01, -0.14), radius=0.03
    )
    ends = [
        ContactPoint(
            name=f"end{y}", body="link2", position=Vec3(0.0, y, -0.14), radius=0.02
        )
        for y in (0.01, 0.0)
    ]

    def moment(points):
        contact = Contact(surfaces=(ground,), points=points)
        start = dataclasses.replace(
            START, rate=Vec3(0.3, 0.2, 0.1), velocity=Vec3(0.1, 0.2, 0.0)
        )
        memory = dataclasses.replace(
            contact.start(0.005, ()), bristles=(Vec3(1e-4, 5e-5, 0.0),) * len(points)
        )
        motion, found = PointMotion(BIRD, start), np.zeros(8)
        wrenches = contact.wrenches(memory, 0.0, motion, ())
        for wrench in wrenches:
            base, joints = motion.generalized_force(
                wrench.force_W, wrench.torque_W, wrench.point, wrench.body
            )
            found += [*leaves(base), *joints]
        return found, len(wrenches)

    together, count = moment((*skids, link, *ends))
    alone = [moment((each,)) for each in (*skids, link, *ends)]
    assert all(np.abs(each).max() > 1.0 for each, _ in (*alone[:2], *alone[3:]))
    assert together == pytest.approx(sum(each for each, _ in alone), rel=1e-12)
    assert (count, {each for _, each in alone}) == (
        3,
        {1},
    ), "one wrench for the base, one for each link"


SPOT = (ContactPoint(name="spot", body="base"),)
