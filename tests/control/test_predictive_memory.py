"""What the predictive law remembers from call to call, seen by an engine of hand-made parts that only takes notes."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from flown import ARM2, MODEL, cases
from skyarm.actuation import Command
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.catalogue import make_controller
from skyarm.control.laws.predictive import preview
from skyarm.control.laws.predictive.law import PredictiveMemory, _seen, nmpc
from skyarm.control.laws.predictive.linearise import Bounds
from skyarm.control.laws.predictive.prediction import motors
from skyarm.control.laws.predictive.riccati import Plan
from skyarm.reference import Reference, Trajectory
from skyarm.reference.signals import Sine

DT = 0.005
NX, NU = 21, 6


class Notes:
    """Observer and solver that write down what they are given; the estimate carries the state in its own numbers."""

    def __init__(self, stages):
        self.steps = np.full(stages, DT)
        self.seen, self.since, self.problems = [], [], []

    def at(self, before, command, reading):
        self.seen.append((before.copy(), command.copy(), reading.copy()))
        return np.concatenate([reading[1:8], before[7:]])

    def now(self, estimate, commands):
        self.since.append([row.copy() for row in commands])
        return estimate

    def solve(self, problem, guess):
        self.problems.append((problem, guess))
        count = len(self.steps)
        u = np.zeros((count, NU))
        # no two commands of a flight are alike
        u[:, NU - 1] = 0.01 * len(self.problems) + 0.0001 * np.arange(count)
        return Plan(np.tile(problem.start, (count + 1, 1)), u, np.zeros((count, NU, NX)), cost=0.0)


def engine(stages=14):
    notes = Notes(stages)
    bounds = Bounds(np.full(2, 0.5), np.full(4, 838.0))
    stance = SimpleNamespace(at=lambda _thrusts, values: np.zeros((len(values), 3)))
    made = SimpleNamespace(solver=notes, observation=notes, motors=motors(ARM2.rotors, DT), bounds=bounds)
    made.stance, made.most, made.stabiliser = stance, 1.0, None
    return made, notes


def reading(k, delay):
    """A measurement in period k, which shows the instant k - delay, but never one before the start."""
    shown = max(k - delay, 0)
    base = cases(1, seed=4)[0].measurement()
    return dataclasses.replace(base, time=shown * DT, position=Vec3(float(shown), 0.0, 1.0))


def numbered(k):
    """The command of period k, told by its numbers."""
    return Command(rotor_speeds=(400.0 + k,) * 4, efforts=(0.01 * k, -0.01 * k))


@pytest.mark.parametrize("delay", [0, 1, 2, 5])
def test_the_observer_sees_each_new_measurement_with_the_command_that_led_to_it(delay):
    """The instant j is shown in period j + delay; the command of period j - 1 acted until then."""
    made, notes = engine()
    par = make_controller("nmpc", MODEL, delay_periods=delay).par
    memory = PredictiveMemory()
    for k in range(12):
        before, shown = len(notes.seen), max(k - delay, 0)
        left = _seen(made, memory, reading(k, delay), par, DT)
        estimate, sent = left.estimate, left.sent
        assert estimate[0] == shown
        assert len(notes.seen) - before == (1 if shown > 0 else 0)
        if shown:
            _, command, seen = notes.seen[-1]
            assert seen[0] == pytest.approx(shown * DT)
            assert command.tolist() == [*(400.0 + shown - 1,) * 4, 0.01 * (shown - 1), -0.01 * (shown - 1)]
        # what no measurement shows yet: the commands from then on, oldest first
        assert sent == tuple(numbered(j) for j in range(shown, k))
        memory = dataclasses.replace(memory, estimate=estimate, sent=(*sent, numbered(k)), late=left.late)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("held", [-1.0, 1.0])
@pytest.mark.parametrize("largest", range(4))
def test_of_a_quaternions_two_signs_the_observer_sees_the_one_near_its_estimate(largest, held, sign):
    """Attitudes a few degrees apart, alike in the sign of their largest component alone, each told by either sign."""
    made, notes = engine()
    par = make_controller("nmpc", MODEL).par
    beside = np.where(np.arange(4) == largest, 0.0, [0.03, -0.02, 0.025, -0.03])
    last, now = ((np.eye(4)[largest] + part) / np.hypot(1.0, np.linalg.norm(part)) for part in (beside, -beside))
    estimate = np.zeros(29)
    estimate[3:7] = held * last
    seen = dataclasses.replace(reading(1, 0), quaternion=Quaternion(*(sign * now).tolist()))
    _seen(made, PredictiveMemory(estimate=estimate, sent=(numbered(0),)), seen, par, DT)
    ((_, _, row),) = notes.seen
    np.testing.assert_array_equal(row[4:8], held * now)
    # nothing else of the measurement is touched
    assert row[1:4].tolist() == list(seen.position)
    assert row[8:11].tolist() == list(seen.velocity)


def hover():
    zeros = (0.0, 0.0)
    return Reference(position=Vec3(0.0, 0.0, 1.0), joints=zeros, joint_rates=zeros, joint_accelerations=zeros)


@pytest.mark.parametrize(("delay", "every"), [(0, 1), (0, 3), (2, 3), (4, 2)])
def test_a_plan_is_made_every_so_many_periods_from_the_last_one_moved_on_by_these(delay, every):
    made, notes = engine()
    controller = make_controller("nmpc", MODEL, delay_periods=delay, every=every)
    memory = dataclasses.replace(controller.memory, engine=made)
    solved, sent = [], []
    for k in range(10):
        memory, command = nmpc(memory, reading(k, delay), hover(), DT, par=controller.par)
        solved.append(len(notes.problems))
        assert memory.since == k % every + 1
        sent.append(command)
        assert memory.sent == tuple(sent[-len(memory.sent) :])
        # everything not shown yet is foreseen, except in the first call, before which nothing was sent
        assert len(notes.since[-1]) == min(k, delay)
        assert len(memory.sent) == min(k, delay) + 1
    assert solved == [k // every + 1 for k in range(10)]
    assert len({command.efforts for command in sent}) == 10


@pytest.mark.parametrize("delay", [0, 3])
def test_a_known_trajectory_is_read_from_the_present_on_however_late_the_measurement(delay):
    made, notes = engine()
    wave = Sine(amplitude=0.1, frequency_hz=0.7)
    path = Trajectory(y=wave, joints=(wave, wave))
    controller = make_controller("nmpc", MODEL, delay_periods=delay, every=1, preview=path)
    memory = dataclasses.replace(controller.memory, engine=made)
    at = dataclasses.replace(reading(0, 0), position=Vec3(0.0, 0.0, 0.0))
    for k in range(delay, 6):
        shown = dataclasses.replace(at, time=(k - delay) * DT)
        memory, _ = nmpc(memory, shown, hover(), DT, par=controller.par)
        goals = notes.problems[-1][0].goals
        times = (k + np.arange(15)) * DT
        # the base is within 0.15 m of its path, so that goals are the path itself
        np.testing.assert_allclose(goals[:, 1], 0.1 * np.sin(2.0 * np.pi * 0.7 * times), atol=1e-12)


CHANGES = {
    "position": {"position": Vec3(0.0, 0.001, 1.0)},
    "velocity": {"velocity": Vec3(0.0, 0.0, 0.2)},
    "acceleration": {"acceleration": Vec3(-0.3, 0.0, 0.0)},
    "yaw": {"yaw": 0.001},
    "yaw rate": {"yaw_rate": 0.1},
    "yaw acceleration": {"yaw_acceleration": -0.1},
    "joint": {"joints": (0.0, 0.001)},
    "joint rate": {"joint_rates": (0.2, 0.0)},
    "joint acceleration": {"joint_accelerations": (0.0, 0.4)},
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_sample_has_come_when_any_one_of_its_numbers_differs(name):
    first = preview.taken(hover(), None, DT)
    held = preview.taken(hover(), preview.taken(hover(), first, DT), DT)
    assert held.age == pytest.approx(2.0 * DT)
    assert not held.jerks.any()
    new = preview.taken(dataclasses.replace(hover(), **CHANGES[name]), held, DT)
    assert new.age == 0.0
    values, rates, accelerations = preview.read(dataclasses.replace(hover(), **CHANGES[name]))
    for found, wanted in ((new.values, values), (new.rates, rates), (new.accelerations, accelerations)):
        np.testing.assert_array_equal(found, wanted)
    # three periods after the sample before it
    np.testing.assert_allclose(new.jerks, accelerations / (3.0 * DT), rtol=1e-12)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("signal", range(6))
def test_a_jump_of_any_signal_either_way_starts_without_jerk(signal, sign):
    def sample(step):
        values = np.zeros(6)
        values[signal] = sign * step
        x, y, z, yaw, *joints = values.tolist()
        changes = {"position": Vec3(x, y, z + 1.0), "yaw": yaw, "joints": tuple(joints)}
        return dataclasses.replace(hover(), acceleration=Vec3(0.5, 0.0, 0.0), **changes)

    first = preview.taken(hover(), None, DT)
    assert preview.taken(sample(0.0199), first, DT).jerks[0] == pytest.approx(0.5 / DT)
    assert not preview.taken(sample(0.0201), first, DT).jerks.any()


def test_what_was_foretold_is_no_jump_however_far_it_is():
    """A base at 30 m/s: 0.15 m from one period to the next, as its last sample said."""
    fast = dataclasses.replace(hover(), velocity=Vec3(30.0, 0.0, 0.0))
    first = preview.taken(fast, None, DT)
    there = dataclasses.replace(fast, position=Vec3(0.15, 0.0, 1.0), acceleration=Vec3(0.0, 1.0, 0.0))
    assert preview.taken(there, first, DT).jerks[1] == pytest.approx(1.0 / DT)
    behind = dataclasses.replace(there, position=Vec3(0.0, 0.0, 1.0))
    assert not preview.taken(behind, first, DT).jerks.any()
