"""What the predictive law remembers from call to call, seen by an engine of hand-made
parts that only takes notes.

The whole numbers of the predictive law: the ends of their ranges are taken, one beyond
is refused by name.

The belief that a predictive controller moves, and what it wants of it, against
Pinocchio and SciPy.
"""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from predictive_models import ROTORS, belief, drawn, goal_of, true_accelerations
from scipy.integrate import solve_ivp

from skyarm.algebra import Quaternion, Vec3
from skyarm.control.catalogue import make_controller
from skyarm.control.controller import ControllerError
from skyarm.control.laws.predictive import preview
from skyarm.control.laws.predictive.cost import (
    Weights,
    input_residuals,
    state_residuals,
)
from skyarm.control.laws.predictive.law import (
    PredictiveMemory,
    engine_key,
    make_predictive_controller,
    nmpc,
)
from skyarm.control.laws.predictive.observer import (
    Observation,
    ObserverState,
    first_lateness,
)
from skyarm.control.laws.predictive.prediction import (
    StageInputs,
    accelerations,
    advance,
    motors,
)
from skyarm.control.laws.predictive.solver import Bounds, MotionPlan
from skyarm.dynamics.actuators import Command
from skyarm.records.leaves import leaves
from skyarm.reference import Reference
from skyarm.reference.preview import samples
from support.laws import ARM2, MODEL, cases, scalars
from support.vehicles import PinocchioTwin, RandomState, rotation_matrix

DT = 0.005
NX, NU = 21, 6


class Notes(Observation):
    """Observer and solver that write down what they are given; the estimate carries the
    state in its own numbers.
    """

    def __init__(self, stages):
        self.steps, self.dt, self.joints, self.motors = (
            np.full(stages, DT),
            DT,
            2,
            motors(ARM2.rotors, DT),
        )
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
        return MotionPlan(
            np.tile(problem.start, (count + 1, 1)),
            u,
            np.zeros((count, NU, NX)),
            cost=0.0,
        )


def engine(par):
    notes = Notes(par.stages)
    bounds = Bounds(np.full(2, 0.5), np.full(4, 838.0))
    made = SimpleNamespace(
        solver=notes,
        observation=notes,
        bounds=bounds,
        contact=None,
        key=engine_key(par, DT, False),
    )
    made.stance, made.most, made.stabiliser = (
        lambda _thrusts, values: np.zeros((len(values), 3)),
        1.0,
        None,
    )
    return made, notes


def reading(k, delay):
    """A measurement in period k, which shows the instant k - delay, but never one
    before the start.
    """
    shown = max(k - delay, 0)
    base = cases(1, seed=4)[0].measurement()
    silent = (float("nan"),) * 4  # rotors that tell nothing of a command's delay
    return dataclasses.replace(
        base,
        time=shown * DT,
        position=Vec3(float(shown), 0.0, 1.0),
        rotor_speeds=silent,
    )


def numbered(k):
    """The command of period k, told by its numbers."""
    return Command(rotor_speeds=(400.0 + k,) * 4, efforts=(0.01 * k, -0.01 * k))


@pytest.mark.parametrize("delay", [0, 1, 2, 5])
def test_the_observer_sees_each_new_measurement_with_the_command_that_led_to_it(delay):
    """The instant j is shown in period j + delay; the command of period j - 1 acted
    until then.
    """
    controller = make_controller("nmpc", MODEL, delay_periods=delay)
    made, notes = engine(controller.par)
    memory = PredictiveMemory(engine=made)
    for k in range(12):
        before, shown = len(notes.seen), max(k - delay, 0)
        memory, _ = nmpc(memory, reading(k, delay), hover(), DT, par=controller.par)
        sent = memory.sent[:-1]
        assert memory.past.estimate[0] == shown
        assert len(notes.seen) - before == (1 if shown > 0 else 0)
        if shown:
            _, command, seen = notes.seen[-1]
            assert seen[0] == pytest.approx(shown * DT)
            assert command.tolist() == [
                *(400.0 + shown - 1,) * 4,
                0.01 * (shown - 1),
                -0.01 * (shown - 1),
            ]
        # what no measurement shows yet: the commands from then on, oldest first
        assert sent == tuple(numbered(j) for j in range(shown, k))
        memory = dataclasses.replace(memory, sent=(*sent, numbered(k)))


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("held", [-1.0, 1.0])
@pytest.mark.parametrize("largest", range(4))
def test_of_a_quaternions_two_signs_the_observer_sees_the_one_near_its_estimate(
    largest, held, sign
):
    """Attitudes a few degrees apart, alike in the sign of their largest component
    alone, each told by either sign.
    """
    _, notes = engine(make_controller("nmpc", MODEL).par)
    beside = np.where(np.arange(4) == largest, 0.0, [0.03, -0.02, 0.025, -0.03])
    last, now = (
        (np.eye(4)[largest] + part) / np.hypot(1.0, np.linalg.norm(part))
        for part in (beside, -beside)
    )
    estimate = np.zeros(29)
    estimate[3:7] = held * last
    seen = dataclasses.replace(
        reading(1, 0), quaternion=Quaternion(*(sign * now).tolist())
    )
    notes.update(
        ObserverState(estimate, first_lateness(np.zeros(4))), numbered(0), seen
    )
    ((_, _, row),) = notes.seen
    np.testing.assert_array_equal(row[4:8], held * now)
    # nothing else of the measurement is touched
    assert row[1:4].tolist() == list(seen.position)
    assert row[8:11].tolist() == list(seen.velocity)


def hover():
    zeros = (0.0, 0.0)
    return Reference(
        position=Vec3(0.0, 0.0, 1.0),
        joints=zeros,
        joint_rates=zeros,
        joint_accelerations=zeros,
    )


@pytest.mark.parametrize(("delay", "every"), [(0, 1), (0, 3), (2, 3), (4, 2)])
def test_a_plan_is_made_every_so_many_periods_from_the_last_one_moved_on_by_these(
    delay, every
):
    controller = make_controller("nmpc", MODEL, delay_periods=delay, every=every)
    made, notes = engine(controller.par)
    memory = dataclasses.replace(controller.memory, engine=made)
    solved, sent = [], []
    for k in range(10):
        memory, command = nmpc(
            memory, reading(k, delay), hover(), DT, par=controller.par
        )
        solved.append(len(notes.problems))
        assert memory.since == k % every + 1
        sent.append(command)
        assert memory.sent == tuple(sent[-len(memory.sent) :])
        # everything not shown yet is foreseen, except in the first call, before which
        # nothing was sent
        assert len(notes.since[-1]) == min(k, delay)
        assert len(memory.sent) == min(k, delay) + 1
    assert solved == [k // every + 1 for k in range(10)]
    assert len({command.efforts for command in sent}) == 10


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
    first = preview.update_sample(hover(), None, DT)
    held = preview.update_sample(hover(), preview.update_sample(hover(), first, DT), DT)
    assert held.age == pytest.approx(2.0 * DT)
    assert not held.jerks.any()
    new = preview.update_sample(dataclasses.replace(hover(), **CHANGES[name]), held, DT)
    assert new.age == 0.0
    motion = np.array(samples(dataclasses.replace(hover(), **CHANGES[name]))).T
    np.testing.assert_array_equal(new.motion, motion)
    # three periods after the sample before it
    np.testing.assert_allclose(new.jerks, motion[2] / (3.0 * DT), rtol=1e-12)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("signal", range(6))
def test_a_jump_of_any_signal_either_way_starts_without_jerk(signal, sign):
    def sample(step):
        values = np.zeros(6)
        values[signal] = sign * step
        x, y, z, yaw, *joints = values.tolist()
        changes = {"position": Vec3(x, y, z + 1.0), "yaw": yaw, "joints": tuple(joints)}
        return dataclasses.replace(hover(), acceleration=Vec3(0.5, 0.0, 0.0), **changes)

    first = preview.update_sample(hover(), None, DT)
    assert preview.update_sample(sample(0.0199), first, DT).jerks[0] == pytest.approx(
        0.5 / DT
    )
    assert not preview.update_sample(sample(0.0201), first, DT).jerks.any()


def test_what_was_foretold_is_no_jump_however_far_it_is():
    """A base at 30 m/s: 0.15 m from one period to the next, as its last sample said."""
    fast = dataclasses.replace(hover(), velocity=Vec3(30.0, 0.0, 0.0))
    first = preview.update_sample(fast, None, DT)
    there = dataclasses.replace(
        fast, position=Vec3(0.15, 0.0, 1.0), acceleration=Vec3(0.0, 1.0, 0.0)
    )
    assert preview.update_sample(there, first, DT).jerks[1] == pytest.approx(1.0 / DT)
    behind = dataclasses.replace(there, position=Vec3(0.0, 0.0, 1.0))
    assert not preview.update_sample(behind, first, DT).jerks.any()


@pytest.mark.parametrize(
    ("name", "least", "most", "others"),
    [
        ("stages", 2, 200, {"every": 1}),
        ("every", 1, 199, {"stages": 200}),
        ("delay_periods", 0, 100, {}),
    ],
)
def test_both_ends_of_a_range_are_taken_and_no_more(name, least, most, others):
    for value in (least, most):
        assert (
            getattr(
                make_predictive_controller(MODEL, **others, **{name: value}).par, name
            )
            == value
        )
    for value in (least - 1, most + 1, True, 0.5 + least, "2"):
        with pytest.raises(ControllerError, match=rf"^controller\.{name} = "):
            make_predictive_controller(MODEL, **others, **{name: value})


def test_the_horizon_is_a_time_from_50_ms_to_5_s():
    for value in (0.05, 5.0, 1):
        par = make_predictive_controller(MODEL, horizon=value).par
        assert (par.horizon, par.every) == (float(value), 2)
    for value in (0.0499, 5.001, True, "1", float("nan")):
        with pytest.raises(
            ControllerError, match=r"^controller\.horizon = .*: must be"
        ):
            make_predictive_controller(MODEL, horizon=value)


pytest.importorskip("pinocchio")


WEIGHTS = Weights(
    position=2.0,
    velocity=3.0,
    heading=5.0,
    rate=7.0,
    joints=11.0,
    joint_rates=13.0,
    joint_accelerations=17.0,
    tool=19.0,
    rotor_accelerations=23.0,
    final=29.0,
)
"""No two alike, so that the weight of another residual shows."""


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("dry_rates", [None, (0.4, -0.9, 0.1)])
def test_accelerations_of_the_model_are_pinocchios_with_drag_friction_disturbance(
    seed, dry_rates
):
    model, (r, state, efforts, unknown) = belief(seed), drawn(seed)
    expected = true_accelerations(
        model, r, state.rotor_speeds, efforts, unknown, dry_rates
    )
    linear, angular, joints = accelerations(model, state, efforts, unknown, dry_rates)
    scale = 1.0 + np.abs(expected).max()
    np.testing.assert_allclose(scalars(linear), expected[:3], atol=1e-10 * scale)
    np.testing.assert_allclose(scalars(angular), expected[3:6], atol=1e-10 * scale)
    np.testing.assert_allclose(scalars(joints), expected[6:], atol=1e-10 * scale)


def test_the_belief_has_all_that_is_compared():
    assert min(float(rotor.drag_coefficient) for rotor in ROTORS) > 0.0
    assert min(float(link.joint.damping) for link in belief(0).vehicle.links) > 0.1
    assert min(float(link.joint.coulomb) for link in belief(0).vehicle.links) > 0.1


@pytest.mark.parametrize("seed", range(3))
def test_a_step_is_of_fourth_order_to_scipys_solution(seed):
    """Half the step leaves a sixteenth of the error of each, a 32nd of one step's; 20
    tells it from third order.
    """
    model, (_, state, efforts, unknown) = belief(seed), drawn(seed)
    inputs = StageInputs(
        rotor_accelerations=(900.0, -700.0, 500.0, -300.0), efforts=efforts
    )

    def slope(_t, y):
        q = y[3:7] / np.linalg.norm(y[3:7])
        velocity = np.concatenate([y[7:13], y[16:19]])
        r = RandomState(
            position=y[:3], quaternion=q, joints=y[13:16], velocity=velocity
        )
        a = true_accelerations(model, r, y[19:], efforts, unknown)
        w, x, y_, z = y[3:7]
        E = np.array([[-x, -y_, -z], [w, -z, y_], [z, w, -x], [-y_, x, w]])
        return np.concatenate(
            [
                y[7:10],
                0.5 * E @ y[10:13],
                a[:6],
                y[16:19],
                a[6:],
                inputs.rotor_accelerations,
            ]
        )

    start, found = np.array(leaves(state), dtype=float), []
    for h in (4e-3, 2e-3):
        exact = solve_ivp(
            slope, (0.0, h), start, method="DOP853", rtol=1e-13, atol=1e-13
        ).y[:, -1]
        exact[3:7] /= np.linalg.norm(exact[3:7])
        found.append(
            np.abs(
                np.array(leaves(advance(model, state, inputs, unknown, h))) - exact
            ).max()
        )
    assert found[0] > 20.0 * found[1]
    assert found[0] < 1e-3


def test_after_a_long_step_a_quaternion_is_of_unit_length():
    """Turning at some rad/s for 0.1 s the method alone would leave it 1e-5 long or
    short.
    """
    model, (_, state, efforts, unknown) = belief(1), drawn(1)
    after = advance(
        model,
        state,
        StageInputs(rotor_accelerations=(0.0,) * 4, efforts=efforts),
        unknown,
        0.1,
    )
    assert np.linalg.norm(scalars(after.quaternion)) == pytest.approx(1.0, abs=1e-14)


def plain_residuals(r, goal):
    """Those that are in every mode but for the joints."""
    R = rotation_matrix(r.quaternion)
    nose = R[:, 0]
    side = -np.sin(goal.yaw) * nose[0] + np.cos(goal.yaw) * nose[1]
    return np.concatenate(
        [
            2.0 * (r.position - scalars(goal.position) - scalars(goal.shift)),
            3.0 * (r.velocity[:3] - scalars(goal.velocity)),
            [5.0 * side],
            7.0 * r.velocity[3:6],
        ]
    )


@pytest.mark.parametrize("tip", ["", "tip1"])
@pytest.mark.parametrize("mode", ["tool", "joints"])
@pytest.mark.parametrize("seed", range(5))
def test_what_is_wanted_of_a_state_is_its_errors_and_in_tool_mode_the_tips(
    seed, mode, tip
):
    """With and without a tip: its error is there in mode "tool" of a vehicle that has
    one, and nowhere else.
    """
    model = belief(seed)
    vehicle = dataclasses.replace(model.vehicle, end_effector=tip)
    model = dataclasses.replace(model, vehicle=vehicle)
    (r, state, *_), goal = drawn(seed), goal_of(seed, 3)
    found = scalars(state_residuals(model, WEIGHTS, state, goal, mode))
    errors = r.joints - np.array(goal.joints)
    R = rotation_matrix(r.quaternion)
    if mode == "tool":
        up = R.T @ [0.0, 0.0, 1.0]
        for i, link in enumerate(vehicle.links):
            if link.parent == -1 and link.joint.kind == "revolute":
                axis = np.array(
                    [scalars(row) for row in link.joint.rotation.rows]
                ) @ scalars(link.joint.axis)
                errors[i] += axis @ [up[1], -up[0], 0.0]
    rates = r.velocity[6:] - np.array(goal.joint_rates)
    expected = [plain_residuals(r, goal), 11.0 * errors, 13.0 * rates]
    if mode == "tool" and tip:
        twin = PinocchioTwin(vehicle)
        half = 0.5 * goal.yaw
        level = RandomState(
            position=scalars(goal.position),
            quaternion=np.array([np.cos(half), 0.0, 0.0, np.sin(half)]),
            joints=np.array(goal.joints),
            velocity=np.zeros(9),
        )
        expected.append(19.0 * (twin.frame(r, tip)[0] - twin.frame(level, tip)[0]))
    np.testing.assert_allclose(found, np.concatenate(expected), atol=1e-11)


def test_the_beliefs_have_joints_of_both_kinds_next_to_the_base():
    kinds = {
        link.joint.kind
        for seed in range(5)
        for link in belief(seed).vehicle.links
        if link.parent == -1
    }
    assert kinds == {"revolute", "prismatic"}
    assert any(
        link.parent != -1 for seed in range(5) for link in belief(seed).vehicle.links
    )


@pytest.mark.parametrize("seed", range(4))
def test_what_is_wanted_of_inputs_is_the_joints_accelerations_and_slow_rotors(seed):
    model, (r, state, efforts, unknown), goal = (
        belief(seed),
        drawn(seed),
        goal_of(seed, 3),
    )
    inputs = StageInputs(rotor_accelerations=(9.0, -7.0, 5.0, -3.0), efforts=efforts)
    found = scalars(input_residuals(model, WEIGHTS, state, inputs, unknown, goal))
    # a plan takes dry friction at the rates that are wanted
    qdd = true_accelerations(
        model, r, state.rotor_speeds, efforts, unknown, goal.joint_rates
    )[6:]
    expected = [
        *(17.0 * (qdd - np.array(goal.joint_accelerations))),
        *(23.0 * np.array([9.0, -7.0, 5.0, -3.0])),
    ]
    np.testing.assert_allclose(found, expected, atol=1e-8 * (1.0 + np.abs(qdd).max()))
