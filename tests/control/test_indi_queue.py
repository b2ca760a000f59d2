"""INDI's remembered commands: which of them its filters and its motors see, against SciPy and a lag by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy import signal
from test_published_formulas import DT, UP, gentle, measured, rotation, vec, wanted

import skyarm
from flown import pushes
from law_flights import scalars
from skyarm.actuation import Command
from skyarm.control.blocks.common import arm_alone
from skyarm.control.catalogue import make_controller
from skyarm.control.controller import with_applied_command
from skyarm.control.laws.published.indi import _passed, _speeds
from skyarm.control.model import Model
from vehicles_random import PinocchioTwin

pytest.importorskip("pinocchio")

VEHICLE = skyarm.load_vehicle("hummingbird_arm2_rotors").with_joints(effort_limit=np.inf)
"""Its motors are slower down than up, so that a lag taken the wrong way shows."""

PERIODS = 9


def law_of(delay, *, measured_speeds):
    model = Model(vehicle=VEHICLE, gravity=9.81)
    return make_controller("indi", model, delay_periods=delay, measured_speeds=measured_speeds)


def readings(seed):
    """What the sensors say in each period, unlike from one to the next in every signal."""
    found = []
    for k in range(PERIODS):
        rng = np.random.default_rng(100 * seed + k)
        base = measured(gentle(100 * seed + k))
        found.append(
            dataclasses.replace(
                base,
                specific_force=vec(rng.normal(size=3) + UP),
                rotor_speeds=tuple(rng.uniform(400.0, 600.0, 4).tolist()),
            )
        )
    return found


def commands(seed):
    rng = np.random.default_rng(seed + 7)
    return [
        # some beyond 838 rad/s, which is all that the rotors reach
        Command(rotor_speeds=tuple(rng.uniform(300.0, 900.0, 4)), efforts=tuple(0.1 * rng.normal(size=2)))
        for _ in range(PERIODS)
    ]


def stepped(law, seen, sent):
    """Memory before the last of the readings when every command was changed into the one that is listed."""
    memory = law.memory
    for reading, command in zip(seen[:-1], sent, strict=False):
        memory, _ = law.law(memory, reading, wanted(0), DT, par=law.par)
        memory = with_applied_command(memory, command)
    return memory


def acted(sent, first, delay):
    """The command of each period that a measurement so old shows: before the first one rotors and arm were held."""
    return [first] * (delay + 1) + sent[: PERIODS - delay - 1]


def lagged(first, targets):
    """Rotor speeds in each period: the first-order lag of each motor, up and down, by hand."""
    found = [np.array(first)]
    for target in targets[1:]:
        now = []
        for speed, goal, rotor in zip(found[-1], target, VEHICLE.rotors, strict=True):
            top = min(goal, float(rotor.max_speed))
            constant = float(rotor.time_constant_up if top > speed else rotor.time_constant_down)
            now.append(top + (speed - top) * np.exp(-DT / constant))
        found.append(np.array(now))
    return found


def held_by(reading):
    """Joint efforts that carry the arm on a base at rest, by Pinocchio."""
    w, x, y, z = (float(c) for c in reading.quaternion)
    still = dataclasses.replace(
        gentle(0), quaternion=np.array([w, x, y, z]), joints=scalars(reading.joints), velocity=np.zeros(8)
    )
    return PinocchioTwin(VEHICLE).inverse_dynamics(still, np.zeros(8))[6:]


def matrix(reading):
    w, x, y, z = (float(c) for c in reading.quaternion)
    return rotation(dataclasses.replace(gentle(0), quaternion=np.array([w, x, y, z]))).as_matrix()


@pytest.mark.parametrize("measured_speeds", [True, False])
@pytest.mark.parametrize("delay", [0, 1, 3])
def test_every_signal_is_as_late_as_the_measurement_and_filtered_alike(delay, measured_speeds):
    law, seen, sent = law_of(delay, measured_speeds=measured_speeds), readings(delay), commands(delay)
    memory, last = stepped(law, seen, sent), seen[-1]
    R = last.quaternion.rotation()
    speeds = _speeds(memory, last, law.par, False, DT)
    hold = arm_alone(law.par, R, last.joints, (0, 0))
    _, found = _passed(memory, last, R, speeds, hold, DT, law.par, False)

    shown = acted(sent, Command(rotor_speeds=seen[0].rotor_speeds, efforts=tuple(held_by(seen[0]))), delay)
    turning = [scalars(each.rotor_speeds) for each in seen]
    if not measured_speeds:
        turning = lagged(seen[0].rotor_speeds, [each.rotor_speeds for each in shown])
    np.testing.assert_allclose(scalars(speeds), turning[-1], rtol=1e-12)
    rows = []
    for reading, turned, command in zip(seen, turning, shown, strict=True):
        torque, thrust = pushes(VEHICLE, Command(rotor_speeds=tuple(turned.tolist()), efforts=()))
        rows.append(
            [
                *(matrix(reading) @ scalars(reading.specific_force)),
                *(matrix(reading)[:, 2] * thrust),
                *scalars(reading.rate),
                *torque,
                *scalars(reading.joint_rates),
                *command.efforts,
            ]
        )
    signals = np.array(rows)
    b, a = signal.butter(2, 15.0, fs=1.0 / DT)
    expected = [signal.lfilter(b, a, row, zi=signal.lfilter_zi(b, a) * row[0])[0][-1] for row in signals.T]
    # two forms of one filter, signals of up to 10 N
    np.testing.assert_allclose(found, expected, atol=1e-9)
    np.testing.assert_allclose(scalars(memory.sent[-1].efforts), sent[PERIODS - 2].efforts)


@pytest.mark.parametrize("delay", [0, 2, 6])
def test_modelled_rotor_speeds_are_the_measured_ones_of_a_vehicle_as_it_is_believed(delay):
    """The same commands, whichever of both the law takes: with what is measured late, what is modelled is late too."""
    seen, turning = readings(20 + delay), []
    laws = [law_of(delay, measured_speeds=each) for each in (True, False)]
    memories, start = [law.memory for law in laws], [480.0, 470.0, 490.0, 475.0]
    truth = [np.array(start)]
    for k, reading in enumerate(seen):
        shown = dataclasses.replace(reading, rotor_speeds=tuple(truth[max(k - delay, 0)].tolist()))
        found = [law.law(memory, shown, wanted(k), DT, par=law.par) for law, memory in zip(laws, memories, strict=True)]
        memories, (first, second) = [memory for memory, _ in found], [command for _, command in found]
        # one lag computed twice; commands of hundreds of rad/s
        np.testing.assert_allclose(second.rotor_speeds, first.rotor_speeds, rtol=1e-10, atol=1e-7)
        np.testing.assert_allclose(second.efforts, first.efforts, atol=1e-10)
        truth.append(lagged(truth[-1], [None, first.rotor_speeds])[-1])
        turning.append(first.rotor_speeds)
    assert np.ptp(turning, axis=0).min() > 50.0  # rad/s: the commands do move
