"""Actuators under late commands, against motors integrated in small steps and against
the plan period by period.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from law_parts import in_small_steps

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.blocks.extrapolation import extrapolate
from skyarm.control.blocks.late_actuators import first_past
from skyarm.control.blocks.prediction import no_disturbance, predict_across
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from support.cases import sampled

MODEL = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2_rotors"), gravity=9.81)
DT, PERIODS, FINE = 0.005, 9, 500
UP, DOWN = 0.0125, 0.025
STANDING = Command(rotor_speeds=(480.0,) * 4, efforts=(0.0, 0.0))
DRAW = np.random.default_rng(31)
COMMANDS = [
    Command(
        rotor_speeds=tuple(DRAW.uniform(440.0, 520.0, 4).tolist()),
        efforts=tuple(DRAW.uniform(-0.01, 0.01, 2).tolist()),
    )
    for _ in range(20)
]


def past(periods=PERIODS):
    found = first_past(STANDING, periods)
    for command in COMMANDS:
        found = found.after(MODEL, command, DT)
    return found


def fine():
    """Speeds of motors that get the commands at once, at the middle of each of FINE
    steps a period; efforts, too.
    """
    speeds, rows, efforts = np.full(4, 480.0), [], []
    h = DT / FINE
    for command in COMMANDS:
        target = np.array(command.rotor_speeds)
        rate = np.where(target > speeds, 1.0 / UP, 1.0 / DOWN)
        for _ in range(FINE):
            amid = speeds + (target - speeds) * (1.0 - np.exp(-0.5 * h * rate))
            speeds = speeds + (target - speeds) * (1.0 - np.exp(-h * rate))
            rows.append(amid)
            efforts.append(command.efforts)
    return np.array(rows), np.array(efforts)


@pytest.mark.parametrize("age", sampled((0.0, 0.3, 1.0, 2.5, 4.9, 8.0), 4))
def test_a_late_period_is_that_of_motors_that_turn_later(age):
    rows, efforts = fine()
    stop = len(rows) - round(age * FINE)
    done = past().period(age)
    within = slice(stop - FINE, stop)
    # a part of a period has the mean of the whole: 80 rad/s of steps leave some per
    # mille
    assert done.squares == pytest.approx(
        (rows[within] ** 2).mean(axis=0), rel=1e-6 if age % 1.0 == 0.0 else 0.01
    )
    assert done.efforts == pytest.approx(efforts[within].mean(axis=0), abs=1e-12)
    assert done.speeds == pytest.approx(
        rows[stop - 1], rel=1e-3 if age % 1.0 == 0.0 else 0.006
    )


@pytest.mark.parametrize("age", sampled((0.4, 1.0, 2.5, 4.9, 8.0), 4))
def test_the_mean_over_a_lag_is_that_of_the_motors_since(age):
    rows, efforts = fine()
    since = slice(len(rows) - round(age * FINE), None)
    done = past().since(age)
    assert done.squares == pytest.approx(
        (rows[since] ** 2).mean(axis=0), rel=1e-6 if age % 1.0 == 0.0 else 0.03
    )
    assert done.efforts == pytest.approx(efforts[since].mean(axis=0), abs=1e-12)
    assert done.speeds == pytest.approx(rows[-1], rel=1e-3)


def turning():
    return State(
        position=Vec3(0.2, -0.1, 1.0),
        quaternion=Quaternion(1.0, 0.1, -0.05, 0.02).normalized(),
        velocity=Vec3(0.5, -0.2, 0.1),
        rate=Vec3(0.6, -0.8, 0.3),
        joints=(0.3, -0.5),
        joint_rates=(0.8, -0.6),
        rotor_speeds=(0.0,) * 4,
    )


@pytest.mark.parametrize("periods", sampled((1, 3, 6, 8), 3))
def test_one_step_across_a_lag_is_the_flight_under_the_late_commands(periods):
    """Against five steps a period with those commands: the state in which the next
    command begins to act.
    """
    none, behind = no_disturbance(2), past()
    begun = dataclasses.replace(turning(), rotor_speeds=behind.speeds[-1 - periods])
    exact, jolts = begun, []
    for command in COMMANDS[-periods:]:
        before, exact = exact, in_small_steps(MODEL, exact, command, none, DT)
        jolts.append(
            np.abs(np.subtract(exact.joint_rates, before.joint_rates)).max() / DT
        )
    span = periods * DT
    found = predict_across(
        MODEL, begun, behind.since(float(periods)), none, span, False
    )
    moved = np.array([*exact.velocity]) - np.array([*begun.velocity])
    turned = np.array([*exact.rate]) - np.array([*begun.rate])
    # a tenth of what changed: without the prediction all of it is missing
    assert (
        np.linalg.norm(np.subtract([*found.velocity], [*exact.velocity]))
        < 0.1 * np.linalg.norm(moved) + 1e-3
    )
    assert (
        np.linalg.norm(np.subtract([*found.rate], [*exact.rate]))
        < 0.1 * np.linalg.norm(turned) + 0.02
    )
    assert (
        np.linalg.norm(np.subtract([*found.position], [*exact.position])) < 0.02 * span
    )
    # torques that vary at random move the joints by when they act, which their mean
    # does not tell: a share of what the strongest one would do all the time
    assert (
        np.abs(np.subtract(found.joints, exact.joints)).max()
        < 0.2 * 0.5 * max(jolts) * span**2
    )
    assert found.rotor_speeds == pytest.approx(exact.rotor_speeds, rel=1e-12)


def test_thrust_that_turns_with_the_base_is_that_amid_the_step():
    """A base that rolls at 3 rad/s for 40 ms: the integral of the thrust's direction,
    by its primitive.
    """
    model, w, h = (
        Model(vehicle=skyarm.load_vehicle("hummingbird"), gravity=9.81),
        3.0,
        0.04,
    )
    zero, speeds = Vec3(0.0, 0.0, 0.0), (480.0,) * 4
    begun = State(
        position=zero,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=zero,
        rate=Vec3(w, 0.0, 0.0),
        joints=(),
        joint_rates=(),
        rotor_speeds=speeds,
    )
    done = first_past(Command(rotor_speeds=speeds, efforts=()), PERIODS).since(h / DT)
    found = predict_across(model, begun, done, no_disturbance(0), h, False)
    push = (
        4.0
        * float(model.vehicle.rotors[0].thrust_coefficient)
        * 480.0**2
        / float(model.vehicle.mass)
    )
    exact = [
        0.0,
        -push * (1.0 - np.cos(w * h)) / w,
        push * np.sin(w * h) / w - 9.81 * h,
    ]
    assert [*found.velocity] == pytest.approx(exact, abs=5e-4)


def test_across_no_time_nothing_changes():
    begun = dataclasses.replace(turning(), rotor_speeds=past().speeds[-1])
    found = predict_across(
        MODEL, begun, past().since(0.0), no_disturbance(2), 0.0, False
    )
    for name in (
        "position",
        "velocity",
        "rate",
        "joints",
        "joint_rates",
        "rotor_speeds",
    ):
        assert [*getattr(found, name)] == pytest.approx(
            [*getattr(begun, name)], rel=1e-12
        ), name


def test_a_reference_is_continued_to_when_the_command_acts():
    """Of a quartic all derivatives are known from three samples."""
    T, ahead = 0.02, 0.033

    def at(t):
        return 0.3 + t - 2.0 * t**2, 1.0 - 4.0 * t + 3.0 * t**2, -4.0 + 6.0 * t

    def value(t):
        return 0.3 + t - 2.0 * t**2 + t**3

    at_sample = [((value(k * T), at(k * T)[1], at(k * T)[2]),) for k in range(4)]
    controller = make_centroidal(MODEL)
    channels, age, started = controller.memory.channels[:1], 0.0, 0.0
    for held in at_sample:
        series, channels, age = extrapolate(
            channels, age, held, started, T, T, late=ahead
        )
        started = 1.0
    now = 3 * T + ahead
    assert series[0].derivative(0) == pytest.approx(value(now), rel=1e-9)
    assert series[0].derivative(1) == pytest.approx(at(now)[1], rel=1e-9)
    assert series[0].derivative(2) == pytest.approx(at(now)[2], rel=1e-9)
