"""What pressing reads of a period of the law, and what it gives back."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from law_parts import with_parts

import skyarm
from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks import force_control as law
from skyarm.control.blocks.disturbance_observer import disturbance
from skyarm.control.blocks.force_control import (
    InteractionGains,
    first_interaction,
    wanted_of,
)
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.blocks.tip_force import levers
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.contact.interaction import motion_share, update_lean
from skyarm.control.laws.centroidal.lag_estimate import CANDIDATES, Bank
from skyarm.control.laws.centroidal.parameters import Step
from skyarm.control.laws.centroidal.step_records import Effect
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.kinematics import frame_pose
from skyarm.records.leaves import leaves, rebuild
from skyarm.reference import Reference
from skyarm.sensing.measurement import blank_measurement
from support.engines import evaluate

DT, JOINTS, ZERO = 0.005, (-0.45, -0.9), Vec3(0.0, 0.0, 0.0)
ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")
MODEL = Model(vehicle=ARM, gravity=9.8)
GAINS = InteractionGains(touch=0.3, lost=0.1)
HELD = dataclasses.replace(
    first_interaction(2), touching=1.0, found=1.0, share=1.0, integral=0.1
)
PUSH = (2.0, 0.1, -1.0, 0.0, 0.0)
AT = levers(ARM, Mat3.identity(), JOINTS)


def press(
    gains,
    par,
    memory,
    push,
    signals,
    observed,
    sent,
    state,
    unknown,
    tip_force,
    dt,
    weight=0.0,
):
    """One period of the part: its memory, and the pressing, disturbance and force of
    the step.
    """
    load = SimpleNamespace(mass=weight / par.model.gravity)
    step = Step(
        par=par,
        vehicle=par.model.vehicle,
        memory=SimpleNamespace(sent=sent, parts=SimpleNamespace(load=load)),
        measurement=SimpleNamespace(tip_force=tip_force),
        reference=SimpleNamespace(push=push),
        dt=dt,
        timing=SimpleNamespace(acted=sent),
        motion=None,
        seen=SimpleNamespace(observed=observed),
        state=state,
    )
    memory, effect = gains.affect(
        memory, step, Effect(signals=signals, unknown=unknown, force=observed.force)
    )
    return memory, effect.pressing, effect.unknown, effect.force


def asked(memory, load=0.0, force=1.5):
    return law.interact(
        GAINS,
        memory,
        wanted_of(PUSH),
        AT.disturbance(Vec3(-force, 0.0, 0.3)),
        AT,
        0.0,
        load,
        DT,
    )


def test_the_order_is_the_ramped_sum_of_the_wanted_force_and_the_integral():
    after, pressing = asked(HELD)
    assert after.integral == pytest.approx(0.1 + 4.0 * 0.5 * DT)
    assert pressing.order == pytest.approx(2.0 + after.integral)
    assert (after.found, after.met) == (1.0, 1.0)
    # the next push comes to its surface with the speed that is told again
    met, nothing = (
        dataclasses.replace(HELD, found=1.0, touching=0.0),
        wanted_of((0.0, *PUSH[1:])),
    )
    assert (
        law.interact(GAINS, met, nothing, AT.disturbance(ZERO), AT, 0.0, 0.0, DT)[
            0
        ].found
        == 0.0
    )
    assert asked(met, force=0.0)[0].found == 1.0
    assert np.allclose([*after.force], [-1.5, 0.0, 0.3])
    # as the ramp falls, what is left of the order still stands in place of the observed
    # force
    lost, falling = asked(dataclasses.replace(HELD, touching=0.0), force=0.2)
    assert (lost.integral, falling.engaged, falling.share) == pytest.approx(
        (0.0, 1.0, 0.75)
    )
    assert falling.order == pytest.approx(0.75 * 2.0)
    # the base carries what is beyond the order while it touches
    assert falling.beyond == 0.0
    assert asked(first_interaction(2), force=0.0)[0].met == 0.0
    # free flight begins a period after the last one in which it touched or an order
    # stood
    briefly, gone = dataclasses.replace(HELD, share=0.1, losing=1.0, touching=1.0), []
    for _ in range(3):
        briefly = asked(briefly, force=0.0)[0]
        gone.append((briefly.touching, briefly.free))
    assert gone == [(0.0, 0.0), (0.0, DT), (0.0, 2.0 * DT)]
    rising = asked(dataclasses.replace(HELD, share=0.5))[1]
    assert rising.order == pytest.approx((0.5 + DT / 0.15) * 2.1)


def test_friction_is_let_go_near_a_limit_and_the_base_follows_no_faster_than_it_may():
    assert [
        asked(HELD, load)[1].kept for load in (0.9, 0.95, 1.0, 1.2)
    ] == pytest.approx([1.0, 0.9, 0.8, 0.8])
    far = [
        asked(dataclasses.replace(HELD, gap=gap))[1].shift[2] for gap in (10.0, -10.0)
    ]
    assert far == [4.0, -4.0]


def test_a_quarter_of_the_push_is_answered_across_at_rest_and_all_of_it_in_sliding():
    """Of 1.2 N across a push of 2.1 N; the size counts, whatever the direction."""
    order = 2.0 + 0.1 + 4.0 * 0.5 * DT
    for moving, share in ((0.0, 0.25), (0.5, 0.625), (1.0, 1.0)):
        for side in (Vec3(0.0, 0.0, 1.2), Vec3(0.0, 1.2, 0.0), Vec3(0.0, -0.72, 0.96)):
            seen = AT.disturbance(Vec3(-1.5, 0.0, 0.0) + side)
            _, found = law.interact(
                GAINS, HELD, wanted_of(PUSH), seen, AT, 0.0, 0.0, DT, moving=moving
            )
            assert found.kept * 1.2 == pytest.approx(min(share * order, 1.2))


def test_a_reference_that_moves_along_the_surface_slides_at_once_or_after_2_seconds():
    def after(share, speed, periods):
        for _ in range(periods):
            share = motion_share(GAINS, share, Vec3(0.0, 0.6 * speed, -0.8 * speed), DT)
        return share

    assert (after(0.0, 0.011, 1), after(0.0, 0.00098, 9), after(1.0, 0.00102, 9)) == (
        1.0,
        0.0,
        1.0,
    )
    assert after(0.0, 0.009, 200) == pytest.approx(0.5)
    assert after(1.0, 0.0, 15) == pytest.approx(0.5)
    along = Vec3(0.3, 0.0, 0.0)  # the surface's normal is x: this is no motion along it
    assert (
        pressed(memory=dataclasses.replace(HELD, moving=0.2), led=along)[1][0].moving
        == 0.2 - DT / 0.15
    )
    assert pressed(led=Vec3(0.0, 0.011, 0.0))[1][0].moving == 1.0


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
        first,
        quaternion=level,
        joints=JOINTS,
        force=d.force,
        torque=d.torque,
        efforts=d.efforts,
    )
    signals = [Taylor((0.0, rate, 0.0, 0.0, 0.0)) for rate in (*led, 0.0, 0.0, 0.0)]
    sent = Command(rotor_speeds=(400.0, speed, 400.0, 400.0), efforts=efforts)
    return par, press(
        par.parts.interaction,
        par,
        memory,
        PUSH,
        signals,
        observed,
        sent,
        state,
        disturbance(observed),
        (),
        DT,
    )


def test_the_tip_that_goes_into_the_surface_is_the_one_that_is_lost():
    doubts = [
        pressed(velocity=Vec3(speed, 0.0, 0.0))[1][0].losing
        for speed in (0.2, -0.2, 0.0)
    ]
    assert doubts == pytest.approx([DT / 0.015, 0.0, 0.0])


def test_a_load_is_of_the_joint_or_rotor_nearest_its_limit_unless_the_tip_is_guided():
    limit, highest = (
        float(ARM.links[0].joint.effort_limit),
        float(ARM.rotors[0].max_speed),
    )
    up = Vec3(0.0, 0.0, 0.1)
    cases = [
        {},
        {"efforts": (-limit, 0.0)},
        {"speed": highest},
        {"speed": highest * np.sqrt(0.95)},
    ]
    assert [pressed(**case)[1][1].kept for case in cases] == pytest.approx(
        [1.0, 0.8, 0.8, 0.9]
    )
    assert pressed(efforts=(limit, 0.0), led=up)[1][1].kept == 1.0
    slow = [
        pressed(efforts=(limit, 0.0), led=up * share)[1][1].kept
        for share in (0.099, 0.101)
    ]
    assert slow == pytest.approx([0.8, 1.0])  # sliding from 10 mm/s on
    # along the normal
    assert pressed(efforts=(limit, 0.0), led=Vec3(0.1, 0.0, 0.0))[1][
        1
    ].kept == pytest.approx(0.8)


def test_the_base_carries_the_order_and_sliding_corrects_the_normal():
    _, (after, pressing, given, force) = pressed()
    assert given.force.x == pytest.approx(-pressing.order)
    assert force.x == pytest.approx(-pressing.order)
    assert [*after.lean] == [0.0, 0.0, 0.0]
    slope = Vec3(0.01, 0.0, 0.1)
    lean = pressed(velocity=slope, led=Vec3(0.0, 0.0, 0.1))[1][0].lean
    assert lean.z == pytest.approx(DT * 0.01 * 0.1 / (0.0101 + 0.0004))
    half = dataclasses.replace(HELD, share=0.5)
    assert [
        *pressed(memory=half, velocity=slope, led=Vec3(0.0, 0.0, 0.1))[1][0].lean
    ] == [0.0, 0.0, 0.0]


PLACE, TILTED = Vec3(0.4, -0.3, 1.2), Quaternion(0.9, 0.2, -0.3, 0.15).normalized()
MOVING = State(
    position=PLACE,
    quaternion=TILTED,
    velocity=Vec3(0.3, -0.1, 0.2),
    rate=Vec3(0.4, 0.7, -0.5),
    joints=JOINTS,
    joint_rates=(0.8, -0.6),
    rotor_speeds=(400.0,) * 4,
)
EARLIER, BEFORE = Quaternion(0.95, -0.1, 0.2, 0.1).normalized(), (-0.2, -1.3)


def pressed_in_motion(memory, push, unknown=None, tip_force=()):
    """A period of a vehicle that is tilted, turns and moves; what is observed is of
    another attitude and posture.
    """
    par = make_centroidal(
        MODEL, mode="tip", interaction=(0.3, 0.1), force_sensor=bool(tip_force)
    ).par
    d = unknown or levers(ARM, EARLIER.rotation(), BEFORE).disturbance(
        Vec3(-1.5, 0.2, 0.3)
    )
    first = make_centroidal(MODEL, mode="tip").memory.observed
    observed = dataclasses.replace(
        first,
        quaternion=EARLIER,
        joints=BEFORE,
        force=d.force,
        torque=d.torque,
        efforts=d.efforts,
    )
    signals = [
        Taylor((0.0, rate, 0.0, 0.0, 0.0)) for rate in (0.0, 0.2, 0.1, 0.0, 0.0, 0.0)
    ]
    sent = Command(rotor_speeds=(400.0,) * 4, efforts=(0.0, 0.0))
    return d, press(
        par.parts.interaction,
        par,
        memory,
        push,
        signals,
        observed,
        sent,
        MOVING,
        d,
        tip_force,
        DT,
        0.5,
    )


def tip_of(state, seconds):
    """Place of the tip (m, world axes) after a while of steady motion."""
    turned = TILTED * Quaternion.of_rotation_vector(state.rate * seconds)
    joints = [
        q + rate * seconds
        for q, rate in zip(state.joints, state.joint_rates, strict=True)
    ]
    p = frame_pose(ARM, ARM.frame(), joints).p
    return np.array(
        [*(state.position + state.velocity * seconds + turned.rotation().apply(p))],
        dtype=float,
    )


def test_the_lean_of_the_normal_follows_the_velocity_of_the_tip_itself():
    velocity = (tip_of(MOVING, 1e-5) - tip_of(MOVING, -1e-5)) / 2e-5
    _, (after, *_) = pressed_in_motion(HELD, PUSH)
    # what turns the normal across the velocity: n.v = -v_x of the normal that is told
    assert [*after.lean] == pytest.approx(
        velocity * (DT * velocity[0] / (velocity @ velocity + 0.0004)), rel=1e-6
    )
    gripping, pivot = (0.0, 0.1, -1.0, 0.0, 0.0, 1.0), (0.1, 0.2, 0.0)
    _, (after, pressing, _, _) = pressed_in_motion(
        HELD, (*gripping, *pivot, 0.0, 0.0, 1.0)
    )
    assert after.lean == ZERO  # an arc is no surface
    out = (tip_of(MOVING, 0.0) - pivot) * (1.0, 1.0, 0.0)
    assert [*pressing.n] == pytest.approx(out / np.linalg.norm(out))


def test_what_was_observed_in_one_posture_is_given_in_another():
    d, (after, pressing, given, force) = pressed_in_motion(HELD, PUSH)
    assert [*after.force] == pytest.approx([-1.5, 0.2, 0.3])
    wanted = levers(ARM, TILTED.rotation(), JOINTS).disturbance(
        Vec3(-pressing.order, 0.2, 0.3)
    )
    assert [*given.torque, *given.efforts] == pytest.approx(
        [*wanted.torque, *wanted.efforts], abs=1e-9
    )
    # the bias of the base's force stays in it, and the base follows what is observed
    # and ordered
    assert [*force] == pytest.approx([-pressing.order, 0.2, 0.3])
    unknown = d + Disturbance(
        force=Vec3(0.3, 0.0, 0.1), torque=ZERO, efforts=(0.0, 0.0)
    )
    _, (_, _, given, force) = pressed_in_motion(HELD, PUSH, unknown=unknown)
    assert [*force] == pytest.approx([*given.force])


def test_a_sensor_is_turned_by_the_attitude_and_posture_in_which_it_read():
    read, heard = (
        Vec3(0.5, 0.2, -0.3),
        dataclasses.replace(HELD, felt=Vec3(-1.0, 0.4, 0.0)),
    )
    _, (after, *_) = pressed_in_motion(heard, PUSH, tip_force=(*read,))
    pushed = EARLIER.rotation().apply(
        frame_pose(ARM, ARM.frame(), BEFORE).R.apply(read)
    ) + Vec3(0.0, 0.0, 0.5)
    share = 1.0 - np.exp(-60.0 * DT)
    assert [*after.felt] == pytest.approx(
        [*(heard.felt * (1.0 - share) + pushed * share)]
    )


def test_what_a_touch_does_to_the_trend_of_the_force_is_not_foretold():
    made = make_centroidal(MODEL, mode="tip", interaction=(0.3, 0.1))
    reference = Reference(
        joints=JOINTS, joint_rates=(0.0,) * 2, joint_accelerations=(0.0,) * 2, push=PUSH
    )
    fast = dataclasses.replace(
        made.memory.parts.trend,
        rates=(Vec3(2.0, 0.0, 0.0),) * 4,
        agreement=4.0,
        size=4.0,
    )
    fast = dataclasses.replace(fast, rate=Vec3(2.0, 0.0, 0.0))

    def command(trend, held):
        memory = with_parts(
            dataclasses.replace(made.memory, started=1.0), trend=trend, interaction=held
        )
        return made.law(
            memory, blank_measurement(2, 4, 0), reference, DT, par=made.par
        )[1]

    before = made.memory.parts.trend
    assert command(fast, HELD) == command(before, HELD)
    free = first_interaction(2)
    assert command(fast, free) != command(before, free)


def test_no_lag_is_learned_until_a_contact_has_rested():
    """After it for half a second; at the start of a flight for 0.15 s, in which the
    observers settle.
    """
    made = make_centroidal(MODEL, mode="tip", interaction=(0.3, 0.1))
    reference = Reference(
        joints=JOINTS, joint_rates=(0.0,) * 2, joint_accelerations=(0.0,) * 2, push=PUSH
    )
    bank = Bank(paid=(0.5,) * CANDIDATES, scale=1.0)
    lag = dataclasses.replace(
        made.memory.parts.lag, count=100.0, past=((1.0,) * 4,) * 8, base=bank, arm=bank
    )

    def banks(held):
        memory = with_parts(
            dataclasses.replace(made.memory, started=1.0), lag=lag, interaction=held
        )
        after = made.law(
            memory, blank_measurement(2, 4, 0), reference, DT, par=made.par
        )[0].parts.lag
        return after.base.paid != bank.paid, after.arm.paid != bank.paid

    assert banks(HELD) == (False, False)
    for met, free, learned in (
        (0.0, 0.14, False),
        (0.0, 0.15, True),
        (1.0, 0.49, False),
        (1.0, 0.51, True),
    ):
        memory = dataclasses.replace(first_interaction(2), free=free, met=met)
        assert banks(memory) == (learned, learned), (met, free)


def test_friction_is_let_go_by_what_was_sent_last():
    made, instant = (
        make_centroidal(MODEL, mode="tip", delay=0.02, interaction=(0.3, 0.1)),
        1e-9,
    )
    reference = Reference(
        joints=JOINTS, joint_rates=(0.0,) * 2, joint_accelerations=(0.0,) * 2, push=PUSH
    )
    # within what is answered of a tip that stands
    d = AT.disturbance(Vec3(-1.5, 0.0, 0.4))
    observed = dataclasses.replace(
        made.memory.observed,
        joints=JOINTS,
        force=d.force,
        torque=d.torque,
        efforts=d.efforts,
    )
    reading = dataclasses.replace(blank_measurement(2, 4, 0), joints=JOINTS)
    idle, limit = made.memory.sent, float(ARM.links[0].joint.effort_limit)

    def efforts(sent):
        memory = dataclasses.replace(
            made.memory, started=1.0, observed=observed, sent=sent
        )
        memory = with_parts(memory, interaction=HELD)
        return np.array(
            made.law(memory, reading, reference, instant, par=made.par)[1].efforts
        )

    less = efforts(dataclasses.replace(idle, efforts=(limit, 0.0))) - efforts(idle)
    # a fifth of the force across is not answered
    assert less == pytest.approx(
        np.array(AT.disturbance(Vec3(0.0, 0.0, 0.2 * 0.4)).efforts), rel=1e-3
    )


def numbers_of_a_step(*numbers):
    memory, rest = (
        rebuild((HELD, PUSH), iter(numbers[: len(leaves((HELD, PUSH)))])),
        numbers[len(leaves((HELD, PUSH))) :],
    )
    d = Disturbance(
        force=Vec3(*rest[:3]), torque=Vec3(*rest[3:6]), efforts=tuple(rest[6:8])
    )
    after, pressing = law.interact(
        GAINS,
        memory[0],
        wanted_of(memory[1]),
        d,
        levers(ARM, Mat3.identity(), rest[8:10]),
        rest[10],
        rest[11],
        DT,
    )
    lean = update_lean(
        after.lean,
        pressing.n,
        Vec3(*rest[12:15]),
        1.0,
        pressing.share > 0.1,
        rest[10] > 0.0,
        DT,
    )
    given = pressing.with_order(d, AT, AT)
    return [
        *leaves(after),
        *lean,
        *given.force,
        *given.torque,
        *given.efforts,
        pressing.order,
        *pressing.shift,
    ]


@pytest.mark.parametrize(
    "engine", ["trace", pytest.param("numpy", marks=pytest.mark.thorough)]
)
def test_every_engine_presses_as_floats_do(engine):
    rng = np.random.default_rng(4)
    start = np.array(
        [*leaves((HELD, PUSH)), *np.zeros(8), *JOINTS, 0.0, 0.5, 0.0, 0.0, 0.1]
    )
    given = start + 0.2 * rng.normal(size=(40, len(start)))
    given[:, 0] = rng.uniform(0.0, 1.0, 40)  # touching or not
    expected = evaluate("floats", numbers_of_a_step, given)
    assert len(np.unique(expected[:, 0])) == 2
    assert np.abs(evaluate(engine, numbers_of_a_step, given) - expected).max() <= 1e-12
