"""Readings that repeat: which are new, what stands still rightly, and what the observer
does over the others.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.algebra import ZERO3, Quaternion, Vec3
from skyarm.control.blocks.common import standing_command
from skyarm.control.blocks.disturbance_observer import (
    AccelerometerGains,
    ObserverGains,
    first_observed,
    observe,
)
from skyarm.control.blocks.prediction import Disturbance, actuation, no_disturbance
from skyarm.control.blocks.stale_readings import Fresh, ReadingSums
from skyarm.control.model import Model
from skyarm.sensing.measurement import Measurement, blank_measurement

DT, G = 0.005, 9.81
ARM = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"), gravity=G)
NAMES = tuple(field.name for field in dataclasses.fields(Fresh))
RATES = {"position": "velocity", "quaternion": "rate", "joints": "joint_rates"}
"""Of the quantities that are no rates themselves."""


def drawn(seed):
    """A measurement of something that moves."""
    draw = np.random.default_rng(seed).normal(size=19).tolist()
    return Measurement(
        time=0.0,
        position=Vec3(*draw[:3]),
        quaternion=Quaternion(*draw[3:7]).normalized(),
        velocity=Vec3(*draw[7:10]),
        rate=Vec3(*draw[10:13]),
        specific_force=Vec3(*draw[13:15], 9.0),
        joints=tuple(draw[15:17]),
        joint_rates=tuple(draw[17:]),
        rotor_speeds=(500.0,) * 4,
    )


def fresh(before, now):
    """Names of the quantities that are new."""
    flags, _ = ReadingSums.of(before).fresh(ReadingSums.of(now), 0.005)
    assert {getattr(flags, name) for name in NAMES} <= {0.0, 1.0}
    return {name for name in NAMES if getattr(flags, name) == 1.0}


@pytest.mark.parametrize("name", NAMES)
def test_each_quantity_repeats_or_is_new_for_itself(name):
    before, now = drawn(1), drawn(2)
    assert fresh(before, now) == set(NAMES)
    assert fresh(before, before) == set()
    assert fresh(before, dataclasses.replace(now, **{name: getattr(before, name)})) == {
        *NAMES
    } - {name}
    assert fresh(before, dataclasses.replace(before, **{name: getattr(now, name)})) == {
        name
    }


@pytest.mark.parametrize("name", NAMES)
def test_one_number_that_moves_is_enough_and_so_are_two_that_move_against_each_other(
    name,
):
    before = drawn(3)
    numbers, cls = [*getattr(before, name)], type(getattr(before, name))
    make = tuple if cls is tuple else lambda row: cls(*row)
    for i in range(len(numbers)):
        for k in range(len(numbers)):
            moved = list(numbers)
            moved[i] += 0.01
            moved[k] -= 0.01 if k != i else 0.0
            assert fresh(
                before, dataclasses.replace(before, **{name: make(moved)})
            ) == {name}


def test_opposite_motions_from_zero_are_new():
    """x = -y: the plain sum of such a measurement stands still."""
    before = dataclasses.replace(drawn(3), position=ZERO3)
    for k in range(1, 4):
        now = dataclasses.replace(before, position=Vec3(0.1 * k, -0.1 * k, 0.0))
        assert fresh(before, now) == {"position"}
        before = now


def test_numbers_weigh_by_powers_of_the_golden_ratio():
    """Each as the two after it together; the second as (sqrt 5 - 1) / 2 of the
    first.
    """
    for numbers, whole in (
        ((1.0, -1.0, -1.0), 0.0),
        ((0.0, 2.0, 0.0), np.sqrt(5.0) - 1.0),
    ):
        found = ReadingSums.of(dataclasses.replace(drawn(3), position=Vec3(*numbers)))
        assert found.position == pytest.approx(whole, abs=1e-15)


def test_a_vehicle_at_rest_repeats_its_readings_rightly():
    rest = dataclasses.replace(
        drawn(4), velocity=ZERO3, rate=ZERO3, joint_rates=(0.0, 0.0)
    )
    # the accelerometer too: about a state of equilibrium a loop is linearised with it
    assert fresh(rest, rest) == {*NAMES}
    turning = dataclasses.replace(rest, rate=drawn(4).rate)
    assert "specific_force" not in fresh(turning, turning)
    # up to a nanometre a second they rest
    for speed, stopped in ((0.999e-9, set()), (1.001e-9, {"position", "velocity"})):
        slow = dataclasses.replace(rest, velocity=Vec3(speed, 0.0, 0.0))
        assert fresh(slow, slow) == {*NAMES} - stopped


@pytest.mark.parametrize("name", sorted(RATES))
def test_what_stands_still_while_its_rate_does_not_is_old(name):
    rest = dataclasses.replace(
        drawn(4), velocity=ZERO3, rate=ZERO3, joint_rates=(0.0, 0.0)
    )
    moving = dataclasses.replace(rest, **{RATES[name]: getattr(drawn(5), RATES[name])})
    # the rate itself is new: it differs from zero
    stopped = {name} if RATES[name] != "rate" else {name, "specific_force"}
    assert fresh(rest, moving) == {*NAMES} - stopped
    assert fresh(moving, rest) == {*NAMES}


GAINS = ObserverGains(
    force=27.0,
    torque=31.0,
    joints=34.0,
    pose=60.0,
    accelerometer=AccelerometerGains(force=40.0, velocity=5.0),
)
COMMAND = standing_command(ARM)
DONE = actuation(ARM, COMMAND.rotor_speeds, COMMAND, DT)
NOTHING = Disturbance(force=ZERO3, torque=ZERO3, efforts=(0.0, 0.0))


def seen(before, measured, known=NOTHING, gains=GAINS, free=(1.0,) * 3):
    return observe(ARM, gains, before, measured, DONE, known, 1.0, free, DT)


def underway(measured):
    """An observer that begins with a measurement."""
    first = first_observed(2, COMMAND.rotor_speeds, True)
    return observe(ARM, GAINS, first, measured, DONE, NOTHING, 0.0, (1.0,) * 3, DT)[0]


def test_the_first_measurement_is_remembered_and_repeats_from_the_second_on():
    start = drawn(6)
    begun = underway(start)
    assert list(first_observed(2, COMMAND.rotor_speeds).quaternion) == [
        1.0,
        0.0,
        0.0,
        0.0,
    ]
    assert begun.readings == ReadingSums.of(start)
    assert list(begun.integrated) == list(start.velocity)
    assert seen(begun, drawn(7))[0].readings == ReadingSums.of(drawn(7))


@pytest.mark.parametrize(
    "gains", [GAINS, dataclasses.replace(GAINS, accelerometer=None)]
)
def test_over_readings_that_repeat_the_model_predicts_alone(gains):
    """All of them: pose and rates go on by the model, and no disturbance is learned."""
    start = drawn(6)
    begun = underway(start)
    after, told = seen(begun, start, gains=gains)
    assert list(after.position) == pytest.approx(
        list(start.position + start.velocity * DT)
    )
    assert after.joints == pytest.approx(
        [q + r * DT for q, r in zip(start.joints, start.joint_rates, strict=True)]
    )
    linear, angular, joints = told.amid.accelerations(ARM, DONE.squares, DONE.efforts)
    assert list(after.velocity) == pytest.approx(list(start.velocity + linear * DT))
    assert list(after.rate) == pytest.approx(list(start.rate + angular * DT))
    assert after.joint_rates == pytest.approx(
        [r + a * DT for r, a in zip(start.joint_rates, joints, strict=True)]
    )
    assert [*after.force, *after.torque, *after.efforts] == pytest.approx(
        [0.0] * 8, abs=1e-12
    )


@pytest.mark.parametrize(
    ("name", "of"), [("rate", "torque"), ("joint_rates", "efforts")]
)
def test_a_rate_that_repeats_corrects_nothing(name, of):
    """The model that predicts it errs by 1 unit a second; the others are as they should
    be.
    """
    start = drawn(6)
    begun = underway(start)
    _, told = seen(begun, start)
    linear, angular, joints = told.amid.accelerations(ARM, DONE.squares, DONE.efforts)
    predicted = {
        "velocity": start.velocity + linear * DT,
        "rate": start.rate + angular * DT,
        "joint_rates": tuple(
            r + a * DT for r, a in zip(start.joint_rates, joints, strict=True)
        ),
    }
    held, _ = seen(
        begun, dataclasses.replace(start, **(predicted | {name: getattr(start, name)}))
    )
    off, _ = seen(
        begun,
        dataclasses.replace(start, **(predicted | {name: getattr(drawn(8), name)})),
    )
    assert list(getattr(held, of)) == pytest.approx(
        [0.0] * len(getattr(held, of)), abs=1e-12
    )
    assert np.abs(list(getattr(off, of))).max() > 1e-3


@pytest.mark.parametrize("late", [0, 1, 3, 40])
def test_late_rates_of_sliding_joints_are_corrected_by_the_gains_of_all_periods(late):
    """An error e of them, in closed form: b falls with the square of the periods, the
    effort is that of their mean.

    Turning joints keep their gains.
    """
    model = Model(vehicle=skyarm.load_vehicle("octo_coaxial_two_arms"), gravity=G)
    command, draw = standing_command(model), np.random.default_rng(3)
    done, none = actuation(model, command.rotor_speeds, command, DT), no_disturbance(5)

    def step(before, rates, started=1.0):
        now = dataclasses.replace(
            blank_measurement(5, 8),
            velocity=Vec3(*draw.normal(0.0, 0.01, 3)),
            rate=Vec3(*draw.normal(0.0, 0.01, 3)),
            joints=tuple(draw.normal(size=5)),
            joint_rates=rates,
        )
        return observe(model, GAINS, before, now, done, none, started, (1.0,) * 6, DT)

    now, _ = step(first_observed(5, command.rotor_speeds, True), (0.1,) * 5, 0.0)
    for k in range(late):
        now, _ = step(now, (0.1,) * 5)
        assert now.readings.missed == k + 1
    rates = (0.3, -0.2, 0.2, 0.1, -0.1)
    after, told = step(now, rates)
    _, _, bending = told.amid.accelerations(model, done.squares, done.efforts)
    predicted = np.array(now.joint_rates) + np.array(bending) * DT
    error = np.array(rates) - predicted
    slides = np.array([0, 0, late, 0, late])
    b = np.exp(-GAINS.joints * DT) / (1 + slides**2)
    assert after.joint_rates == pytest.approx(predicted + (1 - b * b) * error)
    assert told.joint_corrections == pytest.approx(
        (1 - b) ** 2 * error / ((1 + slides) * DT)
    )
    assert after.readings.missed == 0.0


def test_a_velocity_that_repeats_is_integrated_from_the_accelerometer():
    """2 m/s^2 that the model lacks, for 0.3 s: the estimate follows them, and the force
    finds them.
    """
    start = dataclasses.replace(
        drawn(6),
        rate=ZERO3,
        joint_rates=(0.0, 0.0),
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
    )
    observed = underway(start)
    for k in range(60):
        known = Disturbance(
            force=observed.force, torque=observed.torque, efforts=observed.efforts
        )
        now = dataclasses.replace(
            start, specific_force=Vec3(2.0, 0.0, G + 1e-9 * k), joints=(1e-9 * k, 0.0)
        )
        observed, _ = seen(observed, now, known)
    assert observed.velocity.x - start.velocity.x == pytest.approx(0.6, abs=0.01)
    drag = 4 * 8.06428e-5 * COMMAND.rotor_speeds[0] * observed.velocity.x
    assert observed.force.x == pytest.approx(
        2.0 * float(ARM.vehicle.mass) + drag, rel=0.02
    )
    assert observed.agreed == 1.0


def test_a_reading_that_repeats_for_two_seconds_is_believed():
    """A vehicle that stands still under a coarse gyro with a bias: its attitude is
    measured, not predicted on.
    """
    still = dataclasses.replace(blank_measurement(2, 4), rate=Vec3(0.02, 0.0, 0.0))
    readings, ages = ReadingSums.of(drawn(3)), []
    for _ in range(500):
        flags, readings = readings.fresh(ReadingSums.of(still), 0.005)
        ages.append((flags.quaternion, flags.rate))
    assert ages[0] == (1.0, 1.0)
    assert set(ages[1:400]) == {(0.0, 0.0)}
    assert set(ages[402:]) == {(1.0, 1.0)}
    moved = dataclasses.replace(drawn(5), rate=Vec3(0.03, 0.0, 0.0))
    assert readings.fresh(ReadingSums.of(moved), 0.005)[1].stale == 0.0
