"""Pressing on a surface: touch and loss, the ramps of the force, its integral, the
shift of the reference.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Mat3, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks import force_control as law
from skyarm.control.blocks.force_control import (
    InteractionGains,
    Pressing,
    first_interaction,
)
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.blocks.tip_force import levers
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.contact.interaction import (
    estimated_normal,
    shift_reference,
    update_lean,
    with_slow_wind,
)
from skyarm.control.laws.centroidal.tip_tasks import TipGoal, release_normal
from skyarm.control.model import Model
from skyarm.reference import Reference
from skyarm.scenario.scenario_file import scenario_from
from skyarm.sensing.measurement import blank_measurement
from support.worlds import NOISE

DT = 0.005
GAINS = InteractionGains(touch=0.3, lost=0.1)
FREE = first_interaction(2)
ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")
MODEL = Model(vehicle=ARM, gravity=9.8)


def touched(forces, *, into=0.0, asked=True, memory=FREE):
    """Touch after each of some forces along the normal."""
    found = []
    for force in forces:
        touching, losing = law.touches(GAINS, memory, asked, force, into, DT)
        memory = dataclasses.replace(memory, touching=touching, losing=losing)
        found.append(touching)
    return found


def test_touch_has_a_hysteresis_and_is_lost_after_its_patience():
    assert touched([0.2, 0.29, 0.31, 0.2, 0.11]) == [0.0, 0.0, 1.0, 1.0, 1.0]
    weak = touched([1.0, *[0.05] * 9])
    assert weak == [1.0] * 8 + [0.0] * 2  # 0.04 s are eight periods
    bounces = touched([1.0, *([0.05] * 7 + [0.2]) * 5])
    assert all(bounces)
    assert touched([1.0], asked=False) == [0.0]


def test_nothing_is_learned_in_half_a_second_of_contact_or_under_an_unwanted_force():
    """A hole's wall pushes a peg that is on its way out: learned as a load, the push
    would press it there.
    """
    rested = dataclasses.replace(FREE, free=0.51, force=Vec3(0.1, 0.0, -0.2))
    assert law.contact_cleared(GAINS, rested) == 1.0
    assert law.contact_cleared(GAINS, dataclasses.replace(rested, free=0.5)) == 0.0
    assert (
        law.contact_cleared(
            GAINS, dataclasses.replace(rested, force=Vec3(0.2, 0.0, -0.23))
        )
        == 0.0
    )


@pytest.mark.parametrize(("share", "left"), [(0.0, 1.0), (0.5, 0.75), (1.0, 0.5)])
def test_the_accelerometer_is_heard_half_as_fast_while_the_tip_presses(share, left):
    made = make_centroidal(MODEL, mode="tip", interaction=[0.3, 0.1]).par
    changed = made.parts.interaction.adjust_gains(
        dataclasses.replace(FREE, share=share), made, DT
    )
    heard, before = changed.observer.accelerometer, made.observer.accelerometer
    assert (heard.force, heard.velocity) == (left * before.force, before.velocity)
    deaf = make_centroidal(
        MODEL, mode="tip", interaction=[0.3, 0.1], accelerometer=[0.0, 0.0]
    ).par
    assert deaf.parts.interaction.adjust_gains(FREE, deaf, DT) is deaf


def test_a_tip_that_goes_in_fast_for_three_periods_has_lost_the_surface():
    there = dataclasses.replace(FREE, touching=1.0, found=1.0)
    # the order was never there as a whole: it drives the tip back
    bouncing = dataclasses.replace(there, found=0.5)
    assert all(touched([1.0] * 4, into=0.11, memory=bouncing))
    # what is left is no new touch
    assert touched([1.0] * 4, into=0.11, memory=there) == [1.0, 1.0, 0.0, 0.0]
    for again in (
        {"memory": dataclasses.replace(FREE, free=0.051), "into": 0.11},
        {"memory": FREE, "into": 0.09},
    ):
        assert touched([1.0], **again) == [1.0]
    assert all(touched([1.0] * 4, into=0.09, memory=there))
    # what was doubtful before the touch is no doubt of it
    free = dataclasses.replace(FREE, free=1.0, found=1.0)
    assert touched([0.0] * 9 + [1.0] * 4, into=0.11, memory=free) == [0.0] * 9 + [
        1.0,
        1.0,
        1.0,
        0.0,
    ]


def test_ramps_take_their_times_and_end_at_none_and_all():
    share, up = 0.0, []
    for _ in range(40):
        share = law.ramp_share(GAINS, share, 1.0, 1.0, DT)
        up.append(share)
    assert up[0] == pytest.approx(DT / 0.15)
    assert up.index(1.0) in (29, 30)
    lost, released = (
        [law.ramp_share(GAINS, s, 0.0, met, DT) for s in (1.0, 0.3, 0.0)]
        for met in (0.0, 1.0)
    )
    assert lost == pytest.approx([0.75, 0.05, 0.0])
    assert released == pytest.approx([1.0 - 1.0 / 30.0, 0.3 - 1.0 / 30.0, 0.0])


def test_the_integral_is_bounded_and_stands_still_but_at_the_full_force():
    def step(integral, along, touching=1.0, share=1.0, worn=0.0):
        return law.integrate_force_error(
            GAINS, integral, 2.0, along, touching, share, worn, DT
        )

    assert step(0.1, 1.5) == pytest.approx(0.1 + 4.0 * 0.5 * DT)
    assert step(0.1, 1.5, share=0.99) == 0.1
    assert step(0.1, 1.5, worn=1.0) == 0.1  # nothing is left that could give more
    assert step(0.1, 1.5, worn=0.25) == pytest.approx(0.1 + 0.75 * 4.0 * 0.5 * DT)
    assert step(0.1, 2.5, worn=1.0) == pytest.approx(0.1 - 4.0 * 0.5 * DT)
    assert step(0.1, 1.5, touching=0.0) == 0.0
    assert step(1.3, -10.0) == pytest.approx(1.3)  # half of the wanted force and 0.3 N
    assert step(-1.9, 10.0) == pytest.approx(-2.0)  # the order never pulls


def test_the_reference_comes_follows_and_returns():
    def run(memory, seconds, asked, touching, gap=0.0, speed=0.1):
        memory = dataclasses.replace(memory, gap=gap)
        for _ in range(round(seconds / DT)):
            # the tip rests on a surface; the reference's own shift closes the gap
            if touching:
                memory = dataclasses.replace(memory, gap=gap - memory.shift)
            s, rate, acceleration = law.normal_shift(
                GAINS, memory, asked, touching, touching, speed, DT
            )
            assert abs(acceleration) <= 4.0
            memory = dataclasses.replace(memory, shift=s, shift_rate=rate)
        return memory

    came = run(FREE, 2.0, True, 0.0)
    assert came.shift_rate == pytest.approx(-0.1, rel=1e-4)
    assert came.shift == pytest.approx(-0.1 * (2.0 - 1.0 / 8.0), rel=0.01)
    met = dataclasses.replace(FREE, found=1.0)
    assert [
        run(m, 2.0, True, 0.0, speed=0.5).shift_rate for m in (FREE, met)
    ] == pytest.approx([0.0, -0.1], abs=0.02)
    # no further
    assert run(FREE, 10.0, True, 0.0).shift == pytest.approx(-0.5, abs=0.02)
    assert run(came, 4.0, True, 1.0, gap=-0.3).shift == pytest.approx(-0.3, abs=1e-4)
    assert run(came, 4.0, False, 0.0).shift == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("touching", [0.0, 1.0])
def test_the_shift_is_of_two_equal_poles_and_a_steady_acceleration_within_a_period(
    touching,
):
    """Free, without a push, it comes back; with contact it goes to where the tip is:
    (s - e) = (a + b t) exp(-w t).
    """
    gap, dt, w, s0, v0 = 0.05 * touching, 5e-4, GAINS.follow, 0.1, -0.05
    memory = dataclasses.replace(FREE, shift=s0, shift_rate=v0)
    for k in range(600):
        held = dataclasses.replace(memory, gap=gap - memory.shift)
        s, rate, a = law.normal_shift(GAINS, held, False, 0.0, touching, 0.1, dt)
        assert s == pytest.approx(
            memory.shift + memory.shift_rate * dt + 0.5 * a * dt * dt, abs=1e-15
        )
        memory = dataclasses.replace(memory, shift=s, shift_rate=rate)
        t, off = (k + 1) * dt, s0 - gap
        exact = gap + (off + (v0 + w * off) * t) * np.exp(-w * t)
        assert memory.shift == pytest.approx(exact, abs=3e-4)


def test_what_no_contact_is_is_learned_in_free_flight_and_of_the_base_in_contact():
    share, wind = 1.0 - np.exp(-0.5 * DT), 1.0 - np.exp(-1.0 * DT)
    none, d = (
        FREE.bias,
        Disturbance(
            force=Vec3(1.0, 0.0, 0.0), torque=Vec3(0.1, 0.0, 0.0), efforts=(0.2, 0.0)
        ),
    )
    push = Vec3(0.4, 0.0, 0.0)
    free, early, pressing = (
        law.update_bias(GAINS, none, d, push, asked, since, DT)
        for asked, since in ((False, 0.6), (False, 0.4), (True, 0.0))
    )
    assert (free.force.x, free.torque.x, free.efforts[0]) == pytest.approx(
        (share, 0.1 * share, 0.2 * share)
    )
    assert early == none
    # what is learned already and still there stays, and what has changed is followed by
    # a share of the difference
    assert law.update_bias(GAINS, d, d, push, False, 0.6, DT) == d
    assert law.update_bias(
        GAINS, d, none, push, False, 0.6, DT
    ).torque.x == pytest.approx(0.1 * (1.0 - share))
    assert law.update_bias(
        GAINS, d, none, push * 0.0, True, 0.0, DT
    ).force.x == pytest.approx(1.0 - wind)
    assert (pressing.force.x, pressing.torque.x, pressing.efforts[0]) == pytest.approx(
        (0.6 * wind, 0.0, 0.0)
    )


def pressing(**changes):
    held = {
        "n": Vec3(-1.0, 0.0, 0.0),
        "share": 1.0,
        "damping": 20.0,
        "engaged": 1.0,
        "shift": (0.1, 0.2, 0.3),
    }
    return Pressing(
        **{
            **held,
            "order": 2.0,
            "beyond": 0.0,
            "force": Vec3(-1.5, 0.0, 0.4),
            "kept": 1.0,
            **changes,
        }
    )


def test_the_wanted_force_stands_in_place_of_the_observed_one_along_the_normal():
    joints, R = (-0.45, -0.9), Mat3.identity()
    at = levers(ARM, R, joints)
    wind = Disturbance(
        force=Vec3(0.0, 0.7, 0.0), torque=Vec3(0.0, 0.0, 0.1), efforts=(0.01, 0.02)
    )
    held = at.disturbance(Vec3(-1.5, 0.0, 0.4)) + wind
    for kept, across in ((1.0, 0.4), (0.5, 0.2)):
        given, expected = (
            pressing(kept=kept).with_order(held, at, at),
            at.disturbance(Vec3(-2.0, 0.0, across)) + wind,
        )
        assert np.allclose(
            [*given.force, *given.torque, *given.efforts],
            [*expected.force, *expected.torque, *expected.efforts],
        )
    assert pressing(engaged=0.0).with_order(held, at, at) == held
    given, ordered = (pressing(beyond=b).with_order(held, at, at) for b in (0.3, 0.0))
    more = at.disturbance(Vec3(-0.3, 0.0, 0.0))
    # joints yield to an impact, the base carries it
    assert given.efforts == ordered.efforts
    assert np.allclose(given.force - ordered.force, more.force)
    assert np.allclose(given.torque - ordered.torque, more.torque)


def test_geared_joints_answer_the_slow_wind_alone_along_the_normal():
    at = levers(ARM, Mat3.identity(), (-0.45, -0.9))
    pushed, gust, slow = Vec3(-1.5, 0.0, 0.4), Vec3(0.6, 0.7, 0.2), Vec3(0.1, 0.3, 0.5)
    steady = Vec3(slow.x, gust.y, gust.z)
    step = pressing(force=pushed)
    given = step.with_order(
        at.disturbance(pushed)
        + Disturbance(force=gust, torque=Vec3(0, 0, 0), efforts=(0, 0)),
        at,
        at,
    )
    wanted = step.with_order(
        at.disturbance(pushed)
        + Disturbance(force=steady, torque=Vec3(0, 0, 0), efforts=(0, 0)),
        at,
        at,
    )
    found = with_slow_wind(given, step, gust, slow)
    assert np.allclose(
        [*found.force, *found.torque, *found.efforts],
        [*wanted.force, *wanted.torque, *wanted.efforts],
    )
    assert with_slow_wind(given, pressing(engaged=0.0), gust, slow) == given
    heavy = Model(vehicle=skyarm.load_vehicle("quadrotor_roll_arm2"))
    laws = (
        make_centroidal(model, mode="tip", interaction=(0.3, 0.1))
        for model in (heavy, MODEL)
    )
    assert [law.par.parts.interaction.geared for law in laws] == [True, False]


def test_the_tip_keeps_its_goal_across_and_is_only_damped_along_the_normal():
    goal = TipGoal(
        (Vec3(1.0, 2.0, 3.0), Vec3(0.1, 0.2, 0.3), Vec3(1.0, 1.0, 1.0)), (), (), ()
    )
    tip, velocity, kp, kd = Vec3(1.5, 2.5, 3.5), Vec3(0.4, 0.5, 0.6), 700.0, 53.0

    def asked(of):
        p, v, a = of.tip
        return a + (v - velocity) * kd + (p - tip) * kp

    free, held = asked(goal), asked(release_normal(pressing(), goal, tip, velocity, kd))
    assert (held.y, held.z) == pytest.approx((free.y, free.z))
    assert held.x == pytest.approx(-20.0 * 0.4)
    assert asked(release_normal(pressing(share=0.0), goal, tip, velocity, kd)) == free


def test_the_reference_moves_along_the_normal_with_its_derivatives():
    still = [Taylor((float(i), 0.0, 0.0, 0.0, 0.0)) for i in range(6)]
    moved = shift_reference(pressing(), still)
    assert [moved[0].derivative(k) for k in range(3)] == pytest.approx(
        [-0.1, -0.2, -0.3]
    )
    assert [each.derivative(0) for each in moved[1:]] == [1.0, 2.0, 3.0, 4.0, 5.0]


def test_pressing_is_left_out_by_default_and_without_a_push_the_law_is_the_same():
    off, on = (
        make_centroidal(MODEL, mode="tip", interaction=pair)
        for pair in ((0.0, 0.0), (0.3, 0.1))
    )
    assert off.par.parts.interaction is None
    assert off.memory == make_centroidal(MODEL, mode="tip").memory
    assert off.memory.parts.interaction == ()
    reading, reference = (
        blank_measurement(2, 4, 0),
        Reference(
            joints=(0.1, 0.2), joint_rates=(0.0,) * 2, joint_accelerations=(0.0,) * 2
        ),
    )
    commands = [
        each.law(each.memory, reading, reference, DT, par=each.par)
        for each in (off, on)
    ]
    assert commands[0][1] == commands[1][1]
    assert commands[1][0].parts.interaction == on.memory.parts.interaction


@pytest.mark.parametrize(
    "pair",
    [(0.3, 0.3), (0.3, 0.0), (0.0, 0.1), (-1.0, 0.1), (10001.0, 0.1), 0.3, ("a", 0.1)],
)
def test_other_thresholds_are_refused_in_one_line(pair):
    with pytest.raises(ControllerError, match=r"controller\.interaction") as error:
        make_centroidal(MODEL, mode="tip", interaction=pair)
    assert "\n" not in str(error.value)


def test_a_law_without_a_tip_to_lead_is_refused():
    with pytest.raises(ControllerError, match="mode 'tip'"):
        make_centroidal(MODEL, mode="joint", interaction=(0.3, 0.1))


def slope(direction, seconds, *, slides=True, asked=True, angle=0.1745329252):
    """The normal that is believed after sliding on a wall that leans back by some
    angle, told upright.
    """
    told, up = (
        Vec3(-1.0, 0.0, 0.0),
        Vec3(float(np.sin(angle)), 0.0, float(np.cos(angle))),
    )
    velocity = up * (0.1 * direction[1]) + Vec3(0.0, 0.1 * direction[0], 0.0)
    lean = Vec3(0.0, 0.0, 0.0)
    for _ in range(round(seconds / DT)):
        lean = update_lean(
            lean, estimated_normal(told, lean), velocity, 1.0, asked, slides, DT
        )
    return np.array([*estimated_normal(told, lean)])


def test_sliding_finds_the_normal_in_its_own_direction_only():
    true = [-np.cos(np.radians(10.0)), 0.0, np.sin(np.radians(10.0))]
    for direction in ((0.0, 1.0), (0.0, -1.0)):
        assert np.allclose(slope(direction, 10.0), true, atol=1e-3)
    # a time constant of 1 / rate, but for what is held back at slow speeds
    first = slope((0.0, 1.0), 1.0)[2] / true[2]
    assert first == pytest.approx(1.0 - np.exp(-1.0 / 1.04), abs=0.02)
    told = [-1.0, 0.0, 0.0]
    assert np.allclose(slope((1.0, 0.0), 10.0), told, atol=1e-6)
    for without in ({"slides": False}, {"asked": False}):
        assert np.allclose(slope((0.0, 1.0), 1.0, **without), told, atol=1e-6)
    steep = slope((0.0, 1.0), 20.0, angle=1.2)
    assert steep[2] == pytest.approx(0.4 / np.hypot(0.6, 0.4), rel=0.1)  # bounded
    assert np.linalg.norm(slope((0.3, 1.0), 3.0)) == pytest.approx(1.0)


def test_the_lag_is_estimated_before_the_first_contact_of_a_flight():
    """It waited for half a second, as after a contact, and a touch at 1.2 s held what
    little was found by then.
    """
    document = {
        "schema": 1,
        "name": "late",
        "duration": 0.45,
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "model": {"vehicle": "hummingbird_arm2"},
        "controller": {"law": "centroidal", "mode": "tip", "interaction": [0.3, 0.1]},
        "reference": {
            "base": {"kind": "signals", "z": 1.0},
            "joints": [-0.45, -0.9],
            "push": {
                "force": {"kind": "constant", "value": 1.0, "start": 1.0},
                "normal": [-1.0, 0.0, 0.0],
            },
        },
        "world": {
            "surfaces": [
                {
                    "name": "wall",
                    "shape": "box",
                    "size": [0.1, 2.0, 0.9],
                    "position": [1, 0, 0.45],
                }
            ]
        },
        "sensors": NOISE,
        "delays": {"measurement": 0.005, "command": 0.01},
    }
    log = skyarm.run(scenario_from(document))
    found = log.lag_found.max(axis=1)
    assert found[log.time < 0.15].max() < 1e-6
    assert found[-1] > 0.005
