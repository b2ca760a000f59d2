"""What pressing reads of a period of the law, and what it gives back."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from flying_engines import evaluate
from skyarm.actuation import Command
from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.compile import leaves, rebuild
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.disturbance_observer import disturbance
from skyarm.control.laws.centroidal import interaction as law
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.interaction_records import InteractionGains, first_interaction, wanted_of
from skyarm.control.laws.centroidal.pressing_step import press
from skyarm.control.laws.centroidal.surface_normal import slid
from skyarm.control.laws.centroidal.tip_force import levers
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.reference import Reference
from skyarm.scalars.taylor import Taylor
from skyarm.sensors.measurement import blank_measurement

DT, JOINTS, ZERO = 0.005, (-0.45, -0.9), Vec3(0.0, 0.0, 0.0)
ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")
MODEL = Model(vehicle=ARM, gravity=9.8)
GAINS = InteractionGains(touch=0.3, lost=0.1)
HELD = dataclasses.replace(first_interaction(2), touching=1.0, found=1.0, share=1.0, integral=0.1)
PUSH = (2.0, 0.1, -1.0, 0.0, 0.0)
AT = levers(ARM, Mat3.identity(), JOINTS)


def asked(memory, load=0.0, force=1.5):
    return law.interact(GAINS, memory, wanted_of(PUSH), ARM, AT.disturbance(Vec3(-force, 0.0, 0.3)), AT, 0.0, load, DT)


def test_the_order_is_the_ramped_sum_of_the_wanted_force_and_the_integral():
    after, pressing = asked(HELD)
    assert after.integral == pytest.approx(0.1 + 4.0 * 0.5 * DT)
    assert pressing.order == pytest.approx(2.0 + after.integral)
    assert after.found == 1.0
    assert np.allclose([*after.force], [-1.5, 0.0, 0.3])
    # as the ramp falls, what is left of the order still stands in place of the observed force
    lost, falling = asked(dataclasses.replace(HELD, touching=0.0), force=0.2)
    assert (lost.integral, falling.engaged, falling.share) == pytest.approx((0.0, 1.0, 0.75))
    assert falling.order == pytest.approx(0.75 * 2.0)
    rising = asked(dataclasses.replace(HELD, share=0.5))[1]
    assert rising.order == pytest.approx((0.5 + DT / 0.15) * 2.1)


def test_friction_is_let_go_near_a_limit_and_the_base_follows_no_faster_than_it_may():
    assert [asked(HELD, load)[1].kept for load in (0.9, 0.95, 1.0, 1.2)] == pytest.approx([1.0, 0.9, 0.8, 0.8])
    far = [asked(dataclasses.replace(HELD, gap=gap))[1].shift[2] for gap in (10.0, -10.0)]
    assert far == [4.0, -4.0]


def pressed(*, memory=HELD, velocity=ZERO, led=ZERO, efforts=(0.0, 0.0), speed=400.0):
    par = make_centroidal(MODEL, mode="tip", interaction=(0.3, 0.1)).par
    level = Quaternion(1.0, 0.0, 0.0, 0.0)
    state = State(
        position=ZERO,
        quaternion=level,
        velocity=velocity,
        rate=ZERO,
        joints=JOINTS,
        joint_rates=(0.0, 0.0),
        rotor_speeds=(400.0,) * 4,
    )
    d = AT.disturbance(Vec3(-1.5, 0.0, 0.3))
    first = make_centroidal(MODEL, mode="tip").memory.observed
    observed = dataclasses.replace(
        first, quaternion=level, joints=JOINTS, force=d.force, torque=d.torque, efforts=d.efforts
    )
    signals = [Taylor((0.0, rate, 0.0, 0.0, 0.0)) for rate in (*led, 0.0, 0.0, 0.0)]
    sent = Command(rotor_speeds=(400.0, speed, 400.0, 400.0), efforts=efforts)
    return par, press(par, memory, PUSH, signals, observed, sent, state, disturbance(observed), (), DT)


def test_the_tip_that_goes_into_the_surface_is_the_one_that_is_lost():
    doubts = [pressed(velocity=Vec3(speed, 0.0, 0.0))[1][0].doubt for speed in (0.2, -0.2, 0.0)]
    assert doubts == pytest.approx([DT / 0.015, 0.0, 0.0])


def test_a_load_is_that_of_the_joint_or_rotor_nearest_to_its_limit_unless_the_tip_is_led_along():
    limit, highest = float(ARM.links[0].joint.effort_limit), float(ARM.rotors[0].max_speed)
    up = Vec3(0.0, 0.0, 0.1)
    cases = [{}, {"efforts": (-limit, 0.0)}, {"speed": highest}, {"speed": highest * np.sqrt(0.95)}]
    assert [pressed(**case)[1][1].kept for case in cases] == pytest.approx([1.0, 0.8, 0.8, 0.9])
    assert pressed(efforts=(limit, 0.0), led=up)[1][1].kept == 1.0
    assert pressed(efforts=(limit, 0.0), led=Vec3(0.1, 0.0, 0.0))[1][1].kept == pytest.approx(0.8)  # along the normal


def test_the_base_carries_the_order_and_sliding_corrects_the_normal():
    _, (after, pressing, given, force) = pressed()
    assert given.force.x == pytest.approx(-pressing.order)
    assert force.x == pytest.approx(-pressing.order)
    assert [*after.lean] == [0.0, 0.0, 0.0]
    slope = Vec3(0.01, 0.0, 0.1)
    lean = pressed(velocity=slope, led=Vec3(0.0, 0.0, 0.1))[1][0].lean
    assert lean.z == pytest.approx(DT * 0.01 * 0.1 / (0.0101 + 0.0004))
    half = dataclasses.replace(HELD, share=0.5)
    assert [*pressed(memory=half, velocity=slope, led=Vec3(0.0, 0.0, 0.1))[1][0].lean] == [0.0, 0.0, 0.0]


def test_what_a_touch_does_to_the_trend_of_the_force_is_not_foretold():
    made = make_centroidal(MODEL, mode="tip", preset="adaptive", interaction=(0.3, 0.1))
    reference = Reference(joints=JOINTS, joint_rates=(0.0,) * 2, joint_accelerations=(0.0,) * 2, push=PUSH)
    fast = dataclasses.replace(made.memory.following.trend, rates=(Vec3(2.0, 0.0, 0.0),) * 4, agreement=4.0, size=4.0)
    fast = dataclasses.replace(fast, rate=Vec3(2.0, 0.0, 0.0))

    def command(trend, held):
        following = dataclasses.replace(made.memory.following, trend=trend)
        memory = dataclasses.replace(made.memory, started=1.0, following=following, interaction=held)
        return made.law(memory, blank_measurement(2, 4, 0), reference, DT, par=made.par)[1]

    before = made.memory.following.trend
    assert command(fast, HELD) == command(before, HELD)
    free = first_interaction(2)
    assert command(fast, free) != command(before, free)


def numbers_of_a_step(*numbers):
    memory, rest = (
        rebuild((HELD, PUSH), iter(numbers[: len(leaves((HELD, PUSH)))])),
        numbers[len(leaves((HELD, PUSH))) :],
    )
    d = Disturbance(force=Vec3(*rest[:3]), torque=Vec3(*rest[3:6]), efforts=tuple(rest[6:8]))
    after, pressing = law.interact(
        GAINS, memory[0], wanted_of(memory[1]), ARM, d, levers(ARM, Mat3.identity(), rest[8:10]), rest[10], rest[11], DT
    )
    lean = slid(after.lean, pressing.n, Vec3(*rest[12:15]), 1.0, pressing.share > 0.1, rest[10] > 0.0, DT)
    given = pressing.exchanged(d, AT, AT)
    return [*leaves(after), *lean, *given.force, *given.torque, *given.efforts, pressing.order, *pressing.shift]


@pytest.mark.parametrize("engine", ["trace", pytest.param("numpy", marks=pytest.mark.thorough)])
def test_every_engine_presses_as_floats_do(engine):
    rng = np.random.default_rng(4)
    start = np.array([*leaves((HELD, PUSH)), *np.zeros(8), *JOINTS, 0.0, 0.5, 0.0, 0.0, 0.1])
    given = start + 0.2 * rng.normal(size=(40, len(start)))
    given[:, 0] = rng.uniform(0.0, 1.0, 40)  # touching or not
    expected = evaluate("floats", numbers_of_a_step, given)
    assert len(np.unique(expected[:, 0])) == 2
    assert np.abs(evaluate(engine, numbers_of_a_step, given) - expected).max() <= 1e-12
