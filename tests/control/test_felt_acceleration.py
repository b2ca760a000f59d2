"""The accelerometer in the disturbance observer: a bias is no force, a force is felt at
once, noise is left out.
"""

import dataclasses
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pytest
from centroidal_flights import fly
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import ZERO3, Mat3, Quaternion, Vec3
from skyarm.control.blocks.common import standing_command
from skyarm.control.blocks.disturbance_observer import (
    LARGEST_BIAS,
    MOST,
    AccelerometerGains,
    ObserverGains,
    TranslationEstimate,
    first_observed,
    measure_translation,
    modelled_specific_force,
    observe,
    unmodelled_thrust,
)
from skyarm.control.blocks.prediction import Disturbance as Unknown
from skyarm.control.blocks.prediction import acceleration, actuation, rotor_wrench
from skyarm.control.blocks.stale_readings import Fresh, ReadingSums
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.force_trend import lateness
from skyarm.control.laws.centroidal.parameters import at_shares
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command
from skyarm.log.metrics.windows import Window, Windows
from skyarm.records.units import Unit
from skyarm.reference import Constant, Ramp, Sine, Sum, Trajectory
from skyarm.sensing.estimate.estimator import PassThrough
from skyarm.sensing.measurement import SensorNoise, blank_measurement
from skyarm.simulate.batch import Batch
from skyarm.world import Disturbance
from skyarm.world.signal_vector import SignalVector

DT, G = 0.005, 9.81
GAINS = AccelerometerGains(force=40.0, velocity=5.0)
ARM = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"), gravity=G)
UP = np.array([0.0, 0.0, G])
BIAS = np.array([0.3, -0.2, 0.25])
LEVEL = Rotation.identity()
WIDE = dataclasses.replace(GAINS, agreement=10.0)
STILL = TranslationEstimate(
    velocity=ZERO3,
    bias=Vec3(0.0, 0.0, 0.0),
    change=ZERO3,
    integrated=Vec3(0.0, 0.0, 0.0),
)
FRESH = Fresh(
    position=1.0,
    quaternion=1.0,
    velocity=1.0,
    rate=1.0,
    specific_force=1.0,
    joints=1.0,
    joint_rates=1.0,
)


def vec(a):
    return Vec3(*(float(x) for x in a))


def felt_in(
    turn,
    specific_force,
    velocity,
    before=STILL,
    free=(1.0,),
    linear=ZERO3,
    rotors=ZERO3,
    fresh=FRESH,
    gains=GAINS,
):
    """What one period tells; ``before`` also stands for what the velocity alone
    tells.
    """
    measured = dataclasses.replace(
        blank_measurement(0, 4),
        velocity=vec(velocity),
        specific_force=vec(specific_force),
    )
    R = Mat3(*(vec(row) for row in turn.as_matrix()))
    modelled = modelled_specific_force(ARM, R, linear, rotors)
    return measure_translation(
        gains, before, measured, R, linear, modelled, free, fresh, DT
    )


def felt_along(turn, accelerations, bias, start=0.0, gains=GAINS):
    """The velocity that is true and what is felt, after each period; the model believes
    that nothing accelerates it.
    """
    velocity, base, found = np.full(3, start), STILL, []
    for a in accelerations:
        velocity = velocity + a * DT
        base = felt_in(
            turn, turn.inv().apply(a + UP) + bias, velocity, base, gains=gains
        )
        found.append((velocity, base))
    return found


def test_a_constant_error_of_the_accelerometer_is_found_and_is_no_force():
    turn = Rotation.from_euler("ZYX", [0.7, -0.2, 0.3])
    t = np.arange(0.0, 5.0, DT)
    accelerations = np.stack(
        [np.sin(3.0 * t), 0.5 * np.cos(5.0 * t), 0.4 * np.sin(t)], axis=1
    )
    found = felt_along(turn, accelerations, BIAS)
    velocity, last = found[-1]
    share = 1.0 - np.exp(-40.0 * DT)
    assert list(last.bias) == pytest.approx(BIAS, abs=1e-9)  # 25 time constants
    assert list(last.velocity) == pytest.approx(velocity, abs=1e-9)
    assert list(last.change) == pytest.approx(share * accelerations[-1], abs=1e-9)


def test_velocity_and_bias_come_to_the_truth_with_both_poles_where_they_were_placed():
    """e_(k+2) - 2 beta e_(k+1) + beta^2 e_k = 0 for what the velocity is off, beta =
    exp(-w dt).
    """
    found = felt_along(LEVEL, np.zeros((200, 3)), BIAS, start=1.0, gains=WIDE)
    off = np.array(
        [velocity - np.array(list(base.velocity)) for velocity, base in found]
    )
    beta = np.exp(-5.0 * DT)
    assert np.abs(off[2:] - 2.0 * beta * off[1:-1] + beta**2 * off[:-2]).max() < 1e-12
    assert np.abs(off).max() > 0.1


def test_what_the_model_knows_is_not_felt_as_a_force():
    """A body at rest under a believed 2 m/s^2 sideways, and rotors that give 1.5 N more
    where it was felt.
    """
    mass = float(ARM.vehicle.mass)
    turn = Rotation.from_euler("ZYX", [0.7, -0.2, 0.3])
    believed = np.array([2.0, -1.0, 0.5])
    y = turn.inv().apply(believed + UP) + np.array([0.0, 0.0, 1.5 / mass])
    rotors = Vec3(0.0, 0.0, 1.5)
    felt = felt_in(turn, y, believed * DT, linear=vec(believed), rotors=rotors)
    assert list(felt.change) == pytest.approx([0.0] * 3, abs=1e-12)
    assert list(felt.velocity) == pytest.approx(believed * DT, abs=1e-12)


@pytest.mark.parametrize("limited", [(0.0, 1.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 0.0)])
def test_any_actuator_at_its_limit_leaves_the_force_to_the_velocity(limited):
    seen = dataclasses.replace(STILL, change=Vec3(7.0, 8.0, 9.0))
    y = (1.0, 0.0, G)
    free, stuck = (
        felt_in(LEVEL, y, (0.0,) * 3, seen, each) for each in ((1.0, 1.0, 1.0), limited)
    )
    assert free.change.x == pytest.approx(1.0 - np.exp(-40.0 * DT))
    assert list(stuck.change) == [7.0, 8.0, 9.0]
    # the velocity goes on with what is felt in either case
    assert list(free.velocity) == list(stuck.velocity)
    assert free.velocity.x > 0.0


def test_three_zeros_are_no_reading():
    """Whoever measures no specific force leaves it at 0: velocity, force and bias are
    those of the velocity alone.
    """
    bias = Vec3(0.1, 0.2, 0.3)
    seen = dataclasses.replace(
        STILL, velocity=Vec3(0.4, 0.5, 0.6), change=Vec3(7.0, 8.0, 9.0), bias=bias
    )
    none = felt_in(LEVEL, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), seen, gains=WIDE)
    assert (list(none.velocity), list(none.change)) == (
        [0.4, 0.5, 0.6],
        [7.0, 8.0, 9.0],
    )
    assert list(none.bias) == list(bias)
    least = felt_in(LEVEL, (1e-12, 0.0, 0.0), (1.0, 0.0, 0.0), seen, gains=WIDE)
    assert least.change.z < -1.0


def world(accelerations, reading, noise=0.002, before=STILL, seed=1):
    """What is felt in each period, of a level body with these accelerations whose
    accelerometer has this ``reading``.

    The model believes that nothing accelerates it. The estimate by the velocity alone
    is the measured velocity.
    """
    rng, velocity, found = np.random.default_rng(seed), np.zeros(3), []
    for k, a in enumerate(accelerations):
        velocity = velocity + a * DT
        measured = velocity + noise * rng.normal(size=3)
        alone = dataclasses.replace(before, velocity=vec(measured), change=ZERO3)
        before = felt_in(LEVEL, reading(k, a + UP), measured, alone)
        found.append((velocity, measured, before))
    return found


def shaken(seconds):
    """Accelerations of a flight: some m/s^2 that change within a second."""
    t = np.arange(0.0, seconds, DT)
    return np.stack(
        [3.0 * np.sin(6.0 * t), 2.0 * np.cos(5.0 * t), 2.0 * np.sin(4.0 * t)], axis=1
    )


WRONG = {
    "stuck": (lambda k, y: UP + np.array([0.0, 0.0, 4.0]), 60),
    "upside down": (lambda k, y: -y, 5),
    "turned by 90 degrees": (lambda k, y: y[[2, 1, 0]], 5),
    "three times as large": (lambda k, y: 3.0 * y, 5),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_accelerometer_is_left_and_used_again_a_second_after_it_is_right(name):
    wrong, within = WRONG[name]
    begin, end = 100, 300
    found = world(shaken(5.0), lambda k, y: wrong(k, y) if begin <= k < end else y)
    agreed = np.array([base.agreed for *_, base in found])
    assert agreed[:begin].min() > 0.999
    left = begin + int(np.argmax(agreed[begin:] < 0.1))
    assert left - begin <= within
    assert agreed[end - 100 : end].max() < 0.5
    # the velocity is that which was measured, but for what is still used
    off = [
        np.linalg.norm(np.subtract(list(base.velocity), true))
        for true, _, base in found
    ]
    assert max(off) < 0.1
    assert max(np.abs(list(base.bias)).max() for *_, base in found) <= LARGEST_BIAS
    # it returns in a second at the earliest, once its bias and velocity are right again
    back = end + int(np.argmax(agreed[end:] > 0.999))
    assert 1.0 <= (back - end) * DT + 0.5 * (agreed[end]) < 3.5
    assert agreed[-1] > 0.999
    assert np.diff(agreed).max() <= DT / 1.0 + 1e-12


def test_the_force_is_that_of_the_velocity_as_far_as_the_accelerometer_disagrees():
    """Integrated and measured velocity 0.1 m/s apart, twice what is accepted: a 16th of
    it counts.
    """
    seen = dataclasses.replace(
        STILL, change=Vec3(7.0, 8.0, 9.0), velocity=Vec3(0.4, 0.5, 0.6)
    )
    found = felt_in(LEVEL, UP, (0.1, 0.0, 0.0), seen)
    used = (0.05**2 / (0.1**2 + 1e-9)) ** 2
    assert found.agreed == pytest.approx(used)
    assert found.heard == pytest.approx(used)
    assert list(found.change) == pytest.approx(
        [(1.0 - used) * each for each in (7.0, 8.0, 9.0)]
    )
    beta = np.exp(-5.0 * DT)
    own = 0.1 * (1.0 - beta**2 * min(1.0, 2.0 * 0.5))
    assert list(found.integrated) == pytest.approx([own, 0.0, 0.0], rel=1e-6)
    assert list(found.velocity) == pytest.approx(
        [used * own + (1.0 - used) * 0.4, (1.0 - used) * 0.5, (1.0 - used) * 0.6],
        rel=1e-6,
    )
    assert found.bias.x == pytest.approx(-0.5 * (1.0 - beta) ** 2 * 0.1 / DT, rel=1e-6)
    # four times as far: what is left of it is twice what is accepted
    far = felt_in(LEVEL, UP, (0.4, 0.0, 0.0), seen)
    assert 0.4 - far.integrated.x == pytest.approx(beta**2 * 0.1, rel=1e-6)
    # and it comes back by a period over a second
    back = felt_in(LEVEL, UP, (0.0, 0.0, 0.0), dataclasses.replace(seen, agreed=0.3))
    assert back.agreed == pytest.approx(0.3 + DT)
    assert (
        felt_in(
            LEVEL, UP, (0.0, 0.0, 0.0), dataclasses.replace(seen, agreed=0.999)
        ).agreed
        == 1.0
    )


@pytest.mark.parametrize("size", [20.0, 60.0, 1000.0])
def test_a_spike_moves_the_force_by_a_bounded_part_and_is_forgotten(size):
    found = world(
        np.zeros((400, 3)),
        lambda k, y: y + np.array([size, 0.0, 0.0]) if k == 50 else y,
        noise=0.0,
    )
    changes = np.array([list(base.change) for *_, base in found])
    share = 1.0 - np.exp(-40.0 * DT)
    assert np.abs(changes).max() <= MOST * share * (1.0 + 1e-9)
    agreed = np.array([base.agreed for *_, base in found])
    assert agreed[-1] == 1.0
    off = [np.linalg.norm(list(base.velocity)) for *_, base in found]
    assert max(off) < 0.11


def test_an_acceleration_counts_up_to_the_largest_and_keeps_its_direction():
    for size in (0.9 * MOST, 1.1 * MOST, 5.0 * MOST):
        turn = np.array([0.6, 0.0, 0.8])
        found = felt_in(LEVEL, UP + size * turn, size * turn * DT)
        share = 1.0 - np.exp(-40.0 * DT)
        assert list(found.change) == pytest.approx(
            share * min(size, MOST) * turn, rel=1e-9, abs=1e-12
        )
        # the velocity takes all of it
        assert list(found.velocity) == pytest.approx(size * turn * DT)


@pytest.mark.parametrize("bias", [3.0, -4.0])
def test_a_large_bias_is_learned_and_the_accelerometer_used_again(bias):
    found = world(shaken(5.0), lambda k, y: y + np.array([0.0, bias, 0.0]), noise=0.0)
    last = found[-1][2]
    assert last.bias.y == pytest.approx(bias, abs=0.02)
    assert last.agreed == 1.0
    assert last.heard == 1.0


def test_a_bias_is_bounded():
    """One of 9 m/s^2 is none: the accelerometer is wrong."""
    begun = dataclasses.replace(STILL, bias=Vec3(4.5, 0.0, -4.5))
    found = world(
        shaken(3.0), lambda k, y: y + np.array([9.0, 0.0, -9.0]), before=begun
    )
    largest = np.max([np.abs(list(base.bias)) for *_, base in found], axis=0)
    assert largest.max() == LARGEST_BIAS
    assert found[-1][2].agreed < 0.5


def test_readings_that_repeat_are_not_felt():
    seen = dataclasses.replace(
        STILL, change=Vec3(7.0, 8.0, 9.0), velocity=Vec3(0.4, 0.5, 0.6)
    )
    y, measured = UP + np.array([1.0, 0.0, 0.0]), (0.02, 0.0, 0.0)
    both = felt_in(LEVEL, y, measured, seen)
    force = felt_in(
        LEVEL, y, measured, seen, fresh=dataclasses.replace(FRESH, specific_force=0.0)
    )
    assert (force.heard, list(force.change)) == (0.0, [7.0, 8.0, 9.0])
    assert list(force.bias) == [0.0] * 3
    # the filter of the velocity goes on by the model alone: its share of 2 cm/s
    # measured
    share = 1.0 - np.exp(-2.0 * GAINS.velocity * DT)
    assert list(force.velocity) == pytest.approx([0.02 * share, 0.0, 0.0])
    assert force.agreed == both.agreed
    # without a new velocity what is felt goes on alone, and its bias is not learned
    alone = felt_in(
        LEVEL, y, measured, seen, fresh=dataclasses.replace(FRESH, velocity=0.0)
    )
    assert list(alone.velocity) == pytest.approx([DT, 0.0, 0.0])
    assert list(alone.bias) == [0.0] * 3
    assert alone.heard == 1.0
    assert both.bias.x < 0.0


NUDGED = ObserverGains(force=27.0, torque=31.0, joints=34.0, pose=60.0)
LOOSE, AT_LIMIT = (1.0, 1.0, 1.0), (0.0, 1.0, 1.0)


def pushed(
    force,
    velocity,
    free,
    pair=None,
    leap=0.0,
    gains=NUDGED,
    rate=(0.0,) * 3,
    joint_rates=(1e-9,) * 2,
    repeats=(),
    dt=DT,
    model=ARM,
):
    """The observer's memory after a measured motion, of a hover in which the force is
    only believed.
    """
    command, vehicle = standing_command(model), model.vehicle
    first = first_observed(vehicle.n, command.rotor_speeds, pair is not None)
    before = dataclasses.replace(first, force=vec(force))
    before = dataclasses.replace(before, leap=leap)
    measured = dataclasses.replace(
        blank_measurement(vehicle.n, len(vehicle.rotors)),
        velocity=vec(velocity),
        rate=vec(rate),
        specific_force=Vec3(1e-9, 0.0, G),
        joint_rates=joint_rates,
    )
    sums = ReadingSums.of(measured)
    last = dataclasses.replace(
        before.readings, **{name: getattr(sums, name) for name in repeats}
    )
    before = dataclasses.replace(before, readings=last)
    known = Unknown(force=before.force, torque=before.torque, efforts=before.efforts)
    done = actuation(model, command.rotor_speeds, command, dt)
    gains = dataclasses.replace(gains, accelerometer=pair)
    return observe(model, gains, before, measured, done, known, 1.0, free, dt)[0]


@pytest.mark.parametrize("pair", [None, GAINS])
@pytest.mark.parametrize(
    "force", [(3.0, 0.0, 0.0), (-1.0, 2.0, -8.0), (0.0, 0.0, 0.01)]
)
def test_a_false_force_shrinks_while_rotors_are_at_their_limit(force, pair):
    """What is measured is the model without it: at a twentieth of the pace of the
    velocity alone.
    """
    start = np.array(force)
    rows = ((LOOSE, None), (AT_LIMIT, pair))
    free, held = (
        np.array(list(pushed(force, (0.0, 0.0, 0.0), *row).force)) for row in rows
    )
    assert np.linalg.norm(held) < np.linalg.norm(start)
    assert held - start == pytest.approx(0.05 * (free - start), rel=1e-4)
    # one that is seen to be larger is held
    more = pushed(
        force,
        0.01 * start / np.linalg.norm(start) + start * (DT / float(ARM.vehicle.mass)),
        AT_LIMIT,
    )
    assert list(more.force) == pytest.approx(force, rel=1e-12)


def test_a_force_never_grows_while_rotors_are_at_their_limit():
    rng, shrank = np.random.default_rng(5), 0
    for _ in range(60):
        force = rng.normal(size=3) * 10.0 ** rng.uniform(-2.0, 1.0)
        held = pushed(
            force, rng.normal(size=3) * 10.0 ** rng.uniform(-3.0, 0.5), AT_LIMIT, GAINS
        )
        after, before = np.linalg.norm(list(held.force)), np.linalg.norm(force)
        assert after <= before * (1.0 + 1e-9)
        shrank += after < before * (1.0 - 1e-9)
    assert 10 < shrank < 50


def test_a_velocity_that_leaps_must_come_twice():
    """Once it is hardly believed; twice it is a blow: the velocity takes what it left,
    the force little of it.
    """
    sizes = np.array([0.15, 0.3, 0.6, 5.0, -40.0])
    slight = 1.0 / np.maximum(1.0, (sizes / 0.3) ** 2)
    once, twice = (
        [pushed((0.0,) * 3, (v, 0.0, 0.0), LOOSE, leap=leap) for v in sizes]
        for leap in (0.0, (41.0 / 0.3) ** 2)
    )
    least = once[1].force.x / 0.3
    assert [each.force.x for each in once] == pytest.approx(
        least * sizes * slight**2, rel=1e-6
    )
    assert [each.force.x for each in twice] == pytest.approx(
        least * sizes * slight, rel=1e-6
    )
    b2 = np.exp(-54.0 * DT)
    assert [each.velocity.x for each in once] == pytest.approx(
        (1.0 - b2) * sizes * slight, rel=1e-6
    )
    assert [each.velocity.x for each in twice] == pytest.approx(
        (1.0 - b2 * slight) * sizes, rel=1e-6
    )
    assert [each.leap for each in once] == pytest.approx((sizes / 0.3) ** 2, rel=1e-6)
    # it grew by more than one leap: some of it is new
    some = pushed((0.0,) * 3, (6.0, 0.0, 0.0), LOOSE, leap=(5.0 / 0.3) ** 2)
    known = (1.0 + (5.0 / 0.3) ** 2) / (6.0 / 0.3) ** 2
    assert some.velocity.x == pytest.approx(
        6.0 * known * (1.0 - b2 * (1.0 - known + 1.0 / 400.0)), rel=1e-6
    )


def test_a_blow_to_the_body_rate_is_motion_and_no_torque():
    """Of base and joints alike, once a leap of 1 rad/s has come twice; one false
    reading turns nothing.
    """
    sizes = np.array([0.5, 1.0, 3.0, -30.0])
    slight = 1.0 / np.maximum(1.0, sizes**2)
    moves = [{"rate": (w, 0.0, 0.0), "joint_rates": (0.0, 0.3 * w)} for w in sizes]
    once, twice = (
        [pushed((0.0,) * 3, (0.0,) * 3, LOOSE, leap=leap, **each) for each in moves]
        for leap in (0.0, 1e3)
    )
    for found in (once, twice):
        assert [each.torque.x for each in found] == pytest.approx(
            once[1].torque.x * sizes * slight, rel=1e-6
        )
        assert [each.efforts[1] for each in found] == pytest.approx(
            once[1].efforts[1] * sizes * slight, rel=1e-6
        )
    for found, left in ((once, 1.0), (twice, slight)):
        turned, bent = (
            1.0 - np.exp(-2.0 * bandwidth * DT) * left
            for bandwidth in (NUDGED.torque, NUDGED.joints)
        )
        assert [each.rate.x for each in found] == pytest.approx(
            turned * sizes, rel=1e-6
        )
        assert [each.joint_rates[1] for each in found] == pytest.approx(
            bent * 0.3 * sizes, rel=1e-6
        )


@pytest.mark.parametrize("leap", [0.0, 1e3])
def test_a_slides_rate_is_believed_in_the_first_period_of_a_blow(leap):
    """Where base velocity and slide leap together; turning joints wait for the
    second.
    """
    slides = Model(vehicle=skyarm.load_vehicle("octo_coaxial_two_arms"), gravity=G)
    sizes, bent = np.array([0.15, 0.3, 0.6, -3.0]), np.array([0.3, 0.2, 0.9, 0.4, -0.5])
    slight = 1.0 / np.maximum(1.0, (sizes / 0.3) ** 2)
    free, still = (
        (1.0,) * 6,
        pushed(
            (0.0,) * 3, (0.0,) * 3, (1.0,) * 6, model=slides, joint_rates=(1e-9,) * 5
        ),
    )
    found = [
        pushed(
            (0.0,) * 3,
            (v, 0.0, 0.0),
            free,
            leap=leap,
            model=slides,
            joint_rates=tuple(bent),
        )
        for v in sizes
    ]
    b2, taken = (
        np.exp(-2.0 * NUDGED.joints * DT),
        np.array([each.joint_rates for each in found]),
    )
    # in the hover the model's own change of the rates stays
    rest = np.array(still.joint_rates) / b2
    for joint, turns in enumerate([True, True, False, True, False]):
        left = b2 * (slight if not turns or leap else 1.0)
        assert taken[:, joint] == pytest.approx(
            bent[joint] + left * (rest[joint] - bent[joint]), abs=1e-6
        )


def test_a_reading_that_repeats_makes_no_leap_of_the_others_but_is_remembered():
    """What is far off since its sensor stands still is believed as soon as it is
    new.
    """
    slight = pushed((0.0,) * 3, (0.15, 0.0, 0.0), LOOSE)
    turns = pushed(
        (0.0,) * 3, (0.15, 0.0, 0.0), LOOSE, rate=(3.0, 0.0, 0.0), repeats=("rate",)
    )
    assert turns.force.x == pytest.approx(slight.force.x, rel=1e-6)
    assert turns.leap == pytest.approx(9.0, rel=1e-6)
    calm = pushed((0.0,) * 3, (0.0,) * 3, LOOSE, rate=(0.5, 0.0, 0.0))
    moves = pushed(
        (0.0,) * 3, (3.0, 0.0, 0.0), LOOSE, rate=(0.5, 0.0, 0.0), repeats=("velocity",)
    )
    assert moves.torque.x == pytest.approx(calm.torque.x, rel=1e-6)
    assert moves.leap == pytest.approx(100.0, rel=1e-6)


@pytest.mark.parametrize(("dt", "most"), [(0.0025, 1.0), (0.005, 1.0), (0.02, 4.0)])
def test_what_is_a_leap_grows_with_a_longer_period(dt, most):
    """A disturbance turns a vehicle by more in it."""
    leaps = pushed((0.0,) * 3, (0.0,) * 3, LOOSE, rate=(2.0, 0.0, 0.0), dt=dt)
    jumps = pushed((0.0,) * 3, (0.6, 0.0, 0.0), LOOSE, dt=dt)
    assert (leaps.leap, jumps.leap) == pytest.approx(((2.0 / most) ** 2,) * 2, rel=1e-6)


@pytest.mark.parametrize("size", [1.0, 20.0])
def test_a_single_false_velocity_moves_the_force_by_no_more_with_an_accelerometer(size):
    """Of what is felt nothing changed: the velocity is wrong, and neither is
    believed.
    """
    most = np.linalg.norm(list(pushed((0.0,) * 3, (0.3, 0.0, 0.0), LOOSE).force))
    spiked = pushed((0.0,) * 3, (size, 0.0, 0.0), LOOSE, GAINS)
    assert np.linalg.norm(list(spiked.force)) <= most * (1.0 + 1e-6)
    assert spiked.agreed < 1e-5


def test_thrust_across_that_changes_within_a_period_is_no_unknown_force():
    """Felt at the end of the period: what each rotor's thrust is there, its sum over
    the mass.
    """
    vehicle = skyarm.load_vehicle("tilted_hexarotor")
    first, told, tau = 400.0, (650.0, 380.0, 500.0, 620.0, 450.0, 350.0), 0.02
    vehicle = dataclasses.replace(
        vehicle,
        rotors=tuple(
            dataclasses.replace(r, time_constant_up=tau, time_constant_down=tau)
            for r in vehicle.rotors
        ),
    )
    speeds = [each + (first - each) * np.exp(-DT / tau) for each in told]
    thrusts = [
        np.array(list(rotor.axis), float) * float(rotor.thrust_coefficient) * speed**2
        for rotor, speed in zip(vehicle.rotors, speeds, strict=True)
    ]
    felt = np.sum(thrusts, axis=0) / float(vehicle.mass)
    assert np.abs(felt[:2]).max() > 0.4
    observed, _ = observe(
        Model(vehicle=vehicle, gravity=G),
        ObserverGains(
            force=27.0, torque=31.0, joints=34.0, pose=60.0, accelerometer=GAINS
        ),
        first_observed(0, (first,) * 6, True),
        dataclasses.replace(blank_measurement(0, 6), specific_force=vec(felt)),
        actuation(
            Model(vehicle=vehicle, gravity=G),
            (first,) * 6,
            Command(rotor_speeds=told, efforts=()),
            DT,
        ),
        Unknown(force=ZERO3, torque=ZERO3, efforts=()),
        1.0,
        (1.0,),
        DT,
    )
    assert list(observed.force) == pytest.approx([0.0] * 3, abs=1e-3)


def test_thrust_counts_along_the_axis_by_its_mean_and_across_by_the_mid_speed():
    """Each as the model itself reckons with it, so that the difference to the end of
    the period is the rotors' own.
    """
    vehicle, rng = skyarm.load_vehicle("tilted_hexarotor"), np.random.default_rng(3)
    squares, half, speeds = (
        rng.uniform(2e5, 3e5, 6),
        rng.uniform(400.0, 500.0, 6),
        rng.uniform(300.0, 600.0, 6),
    )
    axes = np.array([[*r.axis] for r in vehicle.rotors], dtype=float)
    thrust = np.array([float(r.thrust_coefficient) for r in vehicle.rotors])
    found = unmodelled_thrust(
        Model(vehicle=vehicle), squares.tolist(), half.tolist(), speeds.tolist()
    )
    assert found.z == pytest.approx(axes[:, 2] @ (thrust * (speeds**2 - squares)))
    assert [found.x, found.y] == pytest.approx(
        (thrust * (speeds**2 - half**2)) @ axes[:, :2]
    )


@pytest.mark.parametrize("pair", [None, GAINS])
def test_rotors_at_their_limit_hold_the_force_with_and_without_an_accelerometer(pair):
    speeds = (500.0,) * 4
    readings = blank_measurement(2, 4)
    measured = dataclasses.replace(
        readings, velocity=Vec3(0.1, 0.0, 0.0), specific_force=Vec3(2.0, 0.0, G)
    )
    observed, told = observe(
        ARM,
        ObserverGains(
            force=27.0, torque=31.0, joints=34.0, pose=60.0, accelerometer=pair
        ),
        first_observed(2, speeds, pair is not None),
        measured,
        actuation(ARM, speeds, Command(rotor_speeds=speeds, efforts=(0.0, 0.0)), DT),
        Unknown(force=ZERO3, torque=ZERO3, efforts=(0.0, 0.0)),
        1.0,
        (0.0, 1.0, 1.0),
        DT,
    )
    assert list(observed.force) == [0.0] * 3
    assert list(observed.torque) == [0.0] * 3
    assert list(told.angular_correction) == [0.0] * 3


def test_what_turns_a_joint_is_hardly_taken_for_a_force_on_the_base():
    """An unknown effort throws the arm of a vehicle that hovers, and the arm shakes the
    base.

    It is so small that nothing has moved far after a tenth of a second. What is left is
    the base's own turn.
    """
    gains = ObserverGains(
        force=27.0, torque=31.0, joints=34.0, pose=1e6, accelerometer=GAINS
    )
    command, still = standing_command(ARM), (0.0, 0.0)
    done = actuation(ARM, command.rotor_speeds, command, DT)
    thrown = Unknown(force=ZERO3, torque=ZERO3, efforts=(0.0, 1e-6))
    wrench = rotor_wrench(ARM, done.squares)
    linear, angular, qdd = acceleration(
        ARM, Mat3.identity(), ZERO3, still, still, wrench, still, thrown
    )
    observed, found = first_observed(2, command.rotor_speeds, True), []
    for k in range(1, 21):
        measured = dataclasses.replace(
            # a reading that repeats is none
            blank_measurement(2, 4),
            position=Vec3(1e-12 * k, 0.0, 0.0),
            quaternion=Quaternion(1.0, 0.0, 0.0, 1e-12 * k),
            joints=(0.0, 1e-12 * k),
            velocity=linear * (k * DT),
            rate=angular * (k * DT),
            joint_rates=tuple(a * k * DT for a in qdd),
            specific_force=linear + Vec3(0.0, 0.0, G + 1e-12 * k),
            rotor_speeds=command.rotor_speeds,
        )
        known = Unknown(
            force=observed.force, torque=observed.torque, efforts=observed.efforts
        )
        observed, _ = observe(
            ARM, gains, observed, measured, done, known, 1.0, (1.0,) * 3, DT
        )
        found.append(float(np.linalg.norm(list(observed.force))))
    assert observed.efforts[1] == pytest.approx(1e-6, rel=0.2)
    assert max(found) < 0.02 * float(ARM.vehicle.mass) * float(
        np.linalg.norm(list(linear))
    )


def test_beside_a_joint_at_its_limit_the_force_is_that_of_the_velocities_alone():
    """Rates of joints too: only their disturbance at the limit is held."""
    speeds, rates = (500.0,) * 4, (0.3, -0.2)
    measured = dataclasses.replace(
        blank_measurement(2, 4),
        velocity=Vec3(0.1, -0.05, 0.02),
        rate=Vec3(0.1, 0.2, 0.0),
        joint_rates=rates,
        specific_force=Vec3(2.0, 0.0, G),
    )
    found = []
    for pair in (None, GAINS):
        gains = ObserverGains(
            force=27.0, torque=31.0, joints=34.0, pose=60.0, accelerometer=pair
        )
        done = actuation(
            ARM, speeds, Command(rotor_speeds=speeds, efforts=(0.0, 0.0)), DT
        )
        known = Unknown(force=ZERO3, torque=ZERO3, efforts=(0.0, 0.0))
        start = first_observed(2, speeds, pair is not None)
        (observed, told), (alike, most) = (
            observe(ARM, gains, start, measured, done, known, 1.0, (1.0, free, 1.0), DT)
            for free in (0.0, 1.0)
        )
        found.append([*observed.force, *observed.torque, *observed.efforts])
        # at its limit a joint's disturbance follows a fifth as fast, and the other's as
        # ever
        if pair is None:
            assert observed.efforts == pytest.approx(
                [0.2 * alike.efforts[0], alike.efforts[1]], rel=1e-12
            )
        fifth = [0.2 * most.joint_corrections[0], most.joint_corrections[1]]
        assert told.joint_corrections == pytest.approx(fifth, rel=1e-12)
    assert np.abs([*found[0][:2], *found[0][6:]]).min() > 1e-4
    np.testing.assert_allclose(found[1], found[0], rtol=1e-12)


def test_the_part_is_left_out_by_twice_zero_and_its_force_goes_with_the_bandwidth():
    off, on = (
        make_centroidal(ARM, accelerometer=pair) for pair in ((0.0, 0.0), (40.0, 5.0))
    )
    assert off.par.observer.accelerometer is None
    assert off.memory.parts.noise.accelerometer == ()
    assert off.memory.observed.bias == ()
    assert on.par.observer.accelerometer == GAINS
    # what the trend of the force adds: two poles of the velocity's observer, one of the
    # accelerometer's
    assert lateness(off.par) == pytest.approx(2.0 / 27.0)
    assert lateness(on.par) == pytest.approx(1.0 / 40.0)
    shared = at_shares(on.par, 0.5, 0.25).observer.accelerometer
    assert shared == AccelerometerGains(force=20.0, velocity=5.0)


@pytest.mark.parametrize(
    "pair",
    [(40.0, 0.0), (0.0, 5.0), (40.0, -1.0), (1e4, 5.0), 40.0, (40.0,), ("a", 5.0)],
)
def test_other_pairs_are_refused_in_one_line(pair):
    with pytest.raises(ControllerError, match=r"controller\.accelerometer") as error:
        make_centroidal(ARM, accelerometer=pair)
    assert "\n" not in str(error.value)


@dataclass(frozen=True, kw_only=True, slots=True)
class Biased(PassThrough):
    """Readings of an accelerometer with a bias along x."""

    bias: Annotated[float, Unit("m/s^2")] = 0.0

    def step(self, memory, readings, command, dt):
        memory, told = PassThrough.step(self, memory, readings, command, dt)
        force = told.specific_force
        return memory, dataclasses.replace(
            told, specific_force=Vec3(force.x + self.bias, force.y, force.z)
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class WithoutAccelerometer(PassThrough):
    """Readings without a specific force: structural zeros."""

    def step(self, memory, readings, command, dt):
        memory, told = PassThrough.step(self, memory, readings, command, dt)
        return memory, dataclasses.replace(told, specific_force=ZERO3)


def hover(**changes):
    """A bare vehicle that hovers, pushed by 3 N along x from 2 s on."""
    found = skyarm.load_scenario("case3", duration=4.0)
    vehicle = skyarm.load_vehicle("hummingbird")
    push = SignalVector(x=Ramp(start=2.0, duration=DT, height=3.0))
    law = {name: changes.pop(name) for name in ("accelerometer",) if name in changes}
    return dataclasses.replace(
        found,
        plant=dataclasses.replace(found.plant, vehicle=vehicle),
        controller=make_centroidal(
            Model(vehicle=vehicle, gravity=float(found.plant.gravity)), **law
        ),
        reference=Trajectory(z=Constant(1.0)),
        forces=(Disturbance(force=push),),
        **changes,
    )


@pytest.fixture(scope="module")
def hovers():
    """Outcomes without and with the accelerometer, of perfect readings, of a bias of
    0.3 m/s^2 and of noise.
    """
    noise = {"velocity": 0.01, "rate": 0.01, "specific_force": 0.05}
    found = {}
    for name, pair in (("without", (0.0, 0.0)), ("with", (40.0, 5.0))):
        scenario = hover(
            accelerometer=pair, noise=SensorNoise(**noise), estimator=Biased()
        )
        batch = Batch(
            scenario,
            (*(f"sensors.{each}" for each in noise), "estimator.bias"),
            metrics=("iae_position", "rotor_jitter"),
            windows=Windows(steady=Window(1.0, 2.0)),
            effort=0,
        )
        columns = {
            f"sensors.{each}": np.array([1e-9, 1e-9, sigma])
            for each, sigma in noise.items()
        }
        found[name] = batch.fly(
            {**columns, "estimator.bias": np.array([0.0, 0.3, 0.0])}
        )
    return found


def test_a_step_of_the_force_moves_the_base_less_and_noise_moves_the_rotors_less(
    hovers,
):
    without, felt = (hovers[name].metrics for name in ("without", "with"))
    assert felt["iae_position"][0] < 0.75 * without["iae_position"][0]
    assert felt["rotor_jitter"][2] < 0.5 * without["rotor_jitter"][2]


def test_a_bias_is_forgotten_in_flight(hovers):
    """3 N hold the vehicle at its reference after 2 s, with a bias that would push a
    0.7 kg vehicle by 0.2 N.
    """
    x = np.asarray(hovers["with"].state.position.x)
    assert np.abs(x[1] - x[0]) < 2e-4
    assert np.abs(np.asarray(hovers["without"].state.position.x)[0]) < 2e-3
    assert np.abs(x[0]) < 1e-3


def test_a_true_model_feels_nothing_beside_itself_on_a_moving_vehicle():
    """Base and arm in motion, thrust changing by a fifth: what is left is of the
    period's length, no force, no bias.
    """
    found = skyarm.load_scenario("case3", duration=3.0)
    belief = Model(vehicle=found.plant.vehicle, gravity=float(found.plant.gravity))
    swing = Sine(amplitude=0.3, frequency_hz=1.0)
    scenario = dataclasses.replace(
        found,
        controller=make_centroidal(belief, accelerometer=(40.0, 5.0)),
        reference=Trajectory(
            z=Sum((Constant(1.0), Sine(amplitude=0.05, frequency_hz=1.0))),
            joints=(swing, swing),
        ),
    )
    observed = fly(scenario).memory.observed
    assert np.linalg.norm(list(observed.bias)) < 0.02
    assert np.linalg.norm(list(observed.force)) < 0.03


def test_without_a_specific_force_the_law_is_that_without_an_accelerometer():
    """To the bit: structural zeros leave no trace of it in the law's program, and a
    flight's numbers are the same.
    """
    with_it, without = (
        skyarm.run(hover(accelerometer=pair, estimator=WithoutAccelerometer()))
        for pair in ((40.0, 5.0), (0.0, 0.0))
    )
    assert with_it.status == "completed"
    assert np.array_equal(with_it.position, without.position)
    felt = skyarm.run(hover(accelerometer=(40.0, 5.0)))
    assert not np.array_equal(felt.position, without.position)


def test_whole_numbers_are_a_specific_force():
    measured = dataclasses.replace(
        blank_measurement(0, 4), velocity=ZERO3, specific_force=Vec3(0, 0, 10)
    )
    R = Mat3.identity()
    modelled = modelled_specific_force(ARM, R, ZERO3, ZERO3)
    felt = measure_translation(
        GAINS, STILL, measured, R, ZERO3, modelled, (1.0,), FRESH, DT
    )
    assert felt.change.z == pytest.approx((10.0 - G) * (1.0 - np.exp(-40.0 * DT)))


@pytest.mark.parametrize("law", ["centroidal_tip", "centroidal_joint"])
def test_a_pull_at_the_tip_beyond_the_joints_does_not_throw_the_vehicle_down(law):
    """3 N at 0.3 m are 0.9 N m of joints of 0.5 N m: the arm gives way, and the base
    bears the pull.
    """
    pull = [{"kind": "ramp", "start": 1.0, "duration": 0.5, "height": -3.0}, 0.0, 0.0]
    scenario = skyarm.scenario_from(
        {
            "schema": 1,
            "name": "pulled",
            "duration": 20.0,
            "plant": {"vehicle": "hummingbird_arm2_rotors"},
            "model": {"vehicle": "hummingbird_arm2"},
            "controller": {"preset": law},
            "reference": {
                "base": {"kind": "hover", "position": [0.0, 0.0, 2.0]},
                "joints": [
                    {"kind": "constant", "value": angle} for angle in (0.28, -0.7)
                ],
            },
            "environment": {
                "ground": True,
                "forces": [{"kind": "disturbance", "frame": "tip", "force": pull}],
            },
        }
    )
    log = skyarm.run(scenario)
    assert log.status == "completed"
    limits = [float(link.joint.effort_limit) for link in scenario.plant.vehicle.links]
    assert (np.abs(log.efforts) >= 0.999 * np.array(limits)).any(axis=1).mean() > 0.3
    assert np.abs(log.position[:, 2] - 2.0).max() < 0.2
