"""What keeps the predictive law flying: bad plans, late commands, frozen sensors,
swings, leaning bases.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import Quaternion, Vec3
from skyarm.control.catalogue import make_controller
from skyarm.control.laws.predictive import fallback, law, observer, preview
from skyarm.control.laws.predictive.law import (
    BEARABLE,
    bearable,
    engine_key,
    make_engine,
)
from skyarm.control.laws.predictive.prediction import (
    accelerations,
    base_accelerations,
    integrate_stage,
)
from skyarm.control.laws.predictive.preview import shift
from skyarm.control.laws.predictive.solver import MotionPlan, NoPlanError, examples
from skyarm.dynamics import frame_pose
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.records.leaves import leaves, rebuild
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from support.laws import ARM2, MODEL

DT = 0.005
SHAPES = examples(2, 4)
ENGINE = make_engine(engine_key(make_controller("nmpc", MODEL).par, DT, False))


def test_a_force_that_leans_too_far_keeps_its_direction_across():
    gravity = 9.81
    up = fallback._climbable(Vec3(30.0, -40.0, 9.81), gravity)
    assert up.z == 9.81
    assert up.y / up.x == pytest.approx(-4.0 / 3.0, rel=1e-12)
    assert np.hypot(up.x, up.y) == pytest.approx(fallback.LEAN * 9.81, rel=1e-12)
    assert tuple(fallback._climbable(Vec3(0.3, -0.4, -5.0), gravity)) == (
        0.3,
        -0.4,
        fallback.FLOOR * gravity,
    )


def swing(t, frequency, amplitude=0.7):
    w = 2.0 * np.pi * frequency
    s, c = amplitude * np.sin(w * t), amplitude * np.cos(w * t)
    return Reference(
        joints=(s, 0.1), joint_rates=(w * c, 0.0), joint_accelerations=(-w * w * s, 0.0)
    )


@pytest.mark.parametrize("frequency", [0.1, 0.5, 1.0, 2.0])
def test_a_swing_is_foretold_as_one(frequency):
    held = None
    for k in range(80):
        held = preview.update_sample(swing(k * 0.01, frequency), held, 0.01)
    ahead = np.linspace(0.0, 0.65, 14)
    values, rates, found = preview.extrapolate(held, ahead)
    w, at = 2.0 * np.pi * frequency, 2.0 * np.pi * frequency * (0.79 + ahead)
    np.testing.assert_allclose(values[:, 4], 0.7 * np.sin(at), atol=0.01)
    np.testing.assert_allclose(rates[:, 4], 0.7 * w * np.cos(at), atol=0.01 * w)
    np.testing.assert_allclose(
        found[:, 4], -0.7 * w * w * np.sin(at), atol=0.01 * w * w
    )
    # what does not move stays
    np.testing.assert_array_equal(values[:, 5], 0.1)


def random_state(seed):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=4) + np.array([3.0, 0.0, 0.0, 0.0])
    moving = [
        *rng.normal(size=3),
        *(q / np.linalg.norm(q)),
        *rng.normal(size=6),
        *rng.uniform(-1, 1, 4),
    ]
    state = rebuild(SHAPES[0], iter([*moving, *rng.uniform(300, 700, 4)]))
    inputs = rebuild(SHAPES[1], iter([*(rng.normal(size=4) * 1000.0), 0.1, -0.05]))
    return state, inputs, rebuild(SHAPES[2], iter(rng.normal(size=8) * 0.1))


@pytest.mark.parametrize("seed", range(3))
def test_a_base_under_moving_joints_accelerates_as_the_whole_vehicle_does(seed):
    state, inputs, unknown = random_state(seed)
    linear, angular, joints = accelerations(MODEL, state, inputs.efforts, unknown)
    found = base_accelerations(MODEL, state, joints, unknown)
    np.testing.assert_allclose(leaves(found), [*linear, *angular], rtol=1e-9, atol=1e-9)


def test_joints_move_over_a_stage_by_the_accelerations_of_torques_at_its_start():
    state, inputs, unknown = random_state(4)
    _, _, qdd = accelerations(MODEL, state, inputs.efforts, unknown, (0.0, 0.0))
    end = integrate_stage(MODEL, state, inputs, unknown, 0.1, (0.0, 0.0))
    for q, qd, a, q1, qd1 in zip(
        state.joints, state.joint_rates, qdd, end.joints, end.joint_rates, strict=True
    ):
        assert q1 == pytest.approx(q + 0.1 * qd + 0.005 * a)
        assert qd1 == pytest.approx(qd + 0.1 * a)


def a_plan(cost=1.0, **changed):
    arrays = {
        "x": np.zeros((15, 21)),
        "u": np.zeros((14, 6)),
        "K": np.zeros((14, 6, 21)),
    } | changed
    return MotionPlan(**arrays, cost=cost)


def test_a_plan_is_trusted_while_it_is_finite_and_not_too_dear():
    most = ENGINE.most
    assert 100.0 < most < 1e4
    assert fallback.is_flyable(a_plan(0.999 * most), most)
    for cost in (1.001 * most, float("nan"), float("inf")):
        assert not fallback.is_flyable(a_plan(cost), most)
    for name, shape in (("u", (14, 6)), ("K", (14, 6, 21))):
        broken = np.zeros(shape)
        broken.flat[7] = np.nan
        assert not fallback.is_flyable(a_plan(**{name: broken}), most)


def rests(outcomes, periods_each=2):
    """Trust after plans that are good or not, one every so many periods."""
    trust = fallback.Trust()
    for good in outcomes:
        trust = fallback.after_plan(trust, good)
        yield trust
        for _ in range(periods_each):
            trust = fallback.after_period(trust, DT)


def test_after_a_bad_plan_the_law_rests_until_enough_are_good():
    least, _ = fallback.REST
    for bad in (1, 5, 100):
        found = list(rests([True] * 3 + [False] * bad + [True] * 200))
        assert all(trust.flies_plans for trust in found[:3])
        again = next(k for k in range(3, len(found)) if found[k].flies_plans)
        # 10 ms a plan: the rest is over, and GOOD plans in a row are good
        assert again == max(3 + round(least / 0.01), 3 + bad + fallback.GOOD - 1)


def test_a_rest_doubles_with_each_bad_plan_that_follows_soon_and_is_forgiven_later():
    least, most = fallback.REST
    found, lengths = fallback.Trust(), []
    for calm in (1.0, 1.0, 2.9, 1.0, 1.0, 1.0, 3.1, 1.0):
        found = fallback.after_plan(found, False)
        assert not found.flies_plans
        lengths.append(found.rest)
        while not found.flies_plans:
            found = fallback.after_plan(fallback.after_period(found, DT), True)
        for _ in range(round(calm / DT)):
            found = fallback.after_period(found, DT)
    assert lengths == pytest.approx(
        [*(min(least * 2.0**k, most) for k in range(7)), least]
    )


def hovering(**changed):
    trim = hover_trim(ARM2, (0.0, 0.0), 9.81)
    zero = Vec3(0.0, 0.0, 0.0)
    fields = {
        "time": 0.0,
        "position": Vec3(0.0, 0.0, 1.0),
        "quaternion": Quaternion(1.0, 0.0, 0.0, 0.0),
        "velocity": zero,
        "rate": zero,
        "specific_force": Vec3(0.0, 0.0, 9.81),
        "joints": (0.0, 0.0),
        "joint_rates": (0.0, 0.0),
        "rotor_speeds": tuple(float(w) for w in trim.speeds),
    }
    return Measurement(**(fields | changed))


def hover_reference():
    still = (0.0, 0.0)
    return Reference(
        position=Vec3(0.0, 0.0, 1.0),
        joints=still,
        joint_rates=still,
        joint_accelerations=still,
    )


class Broken:
    """A solver that makes the first plan and then none: no numbers, or numbers that
    lead nowhere.
    """

    def __init__(self, solver, how):
        self.steps, self.solver, self.how, self.called = solver.steps, solver, how, 0

    def solve(self, problem, guess):
        self.called += 1
        if self.called == 1:
            return self.solver.solve(problem, guess)
        if self.how == "none":
            raise NoPlanError
        return dataclasses.replace(guess, cost=1e9, u=guess.u + 1e5)


@pytest.mark.parametrize("how", ["none", "dear"])
def test_the_computed_torque_law_flies_in_place_of_a_planted_bad_plan(how):
    par = make_controller("nmpc", MODEL).par
    memory = law.PredictiveMemory(
        engine=dataclasses.replace(ENGINE, solver=Broken(ENGINE.solver, how))
    )
    commands = []
    for k in range(3):
        memory, command = law.nmpc(
            memory, hovering(time=k * DT), hover_reference(), DT, par=par
        )
        commands.append(leaves(command))
    assert not memory.trust.flies_plans
    sample = preview.update_sample(hover_reference(), None, DT)
    known = bearable(memory.past.estimate[-8:], ENGINE.bounds.efforts)
    reading = np.array(leaves(hovering(time=2 * DT)))
    np.testing.assert_allclose(
        commands[2],
        leaves(ENGINE.stabiliser.command(reading, known, sample)),
        atol=1e-6,
    )
    assert np.isfinite(commands).all()


def fallback_command(measurement, disturbance=None):
    sample = preview.update_sample(hover_reference(), None, DT)
    pushing = np.zeros(8) if disturbance is None else np.array(disturbance)
    return ENGINE.stabiliser.command(np.array(leaves(measurement)), pushing, sample)


def test_the_fallback_in_place_holds_the_hover_and_leans_against_a_push():
    speeds = hovering().rotor_speeds
    command = fallback_command(hovering())
    np.testing.assert_allclose(command.rotor_speeds, speeds, rtol=1e-6)
    pushed = fallback_command(hovering(), [1.0, *(0.0,) * 7])
    squares = np.array(pushed.rotor_speeds) ** 2
    # against a push along x the nose goes up, which the rotor ahead lifts
    behind = int(np.argmin([float(rotor.position.x) for rotor in ARM2.rotors]))
    ahead = int(np.argmax([float(rotor.position.x) for rotor in ARM2.rotors]))
    assert squares[ahead] > squares[behind]


def test_the_fallback_that_leans_against_a_push_holds_an_arm_at_rest():
    """In equilibrium the thrust is weight less push, and the joints carry the weight of
    what hangs on them.
    """
    push, weight = (
        np.array([1.0, -0.6, 0.4]),
        np.array([0.0, 0.0, float(ARM2.mass) * 9.81]),
    )
    up = (weight - push) / np.linalg.norm(weight - push)
    b2 = np.cross(up, [1.0, 0.0, 0.0]) / np.linalg.norm(np.cross(up, [1.0, 0.0, 0.0]))
    R = np.column_stack([np.cross(b2, up), b2, up])
    x, y, z, w = Rotation.from_matrix(R).as_quat()
    leaning = hovering(
        quaternion=Quaternion(w, x, y, z),
        specific_force=Vec3(*(R.T @ (weight - push)) / float(ARM2.mass)),
    )
    command = fallback_command(leaning, [*push, *(0.0,) * 5])
    squares = np.array(command.rotor_speeds) ** 2
    thrust = float(squares @ [float(r.thrust_coefficient) for r in ARM2.rotors])
    assert thrust == pytest.approx(np.linalg.norm(weight - push), rel=1e-9)
    place, turned, joints, bodies = np.zeros(3), R, [], []
    for link in ARM2.links:
        place = place + turned @ np.array([*link.joint.position], dtype=float)
        turned = turned @ np.array(
            [[*row] for row in link.joint.rotation.rows], dtype=float
        )
        joints.append((place, turned @ np.array([*link.joint.axis], dtype=float)))
        bodies.append(
            (
                place + turned @ np.array([*link.body.com], dtype=float),
                float(link.body.mass),
            )
        )
    held = [
        sum(
            axis @ np.cross(com - at, [0.0, 0.0, mass * 9.81])
            for com, mass in bodies[i:]
        )
        for i, (at, axis) in enumerate(joints)
    ]
    assert np.abs(held).min() > 0.005
    np.testing.assert_allclose(command.efforts, held, atol=1e-9)


def test_the_fallback_far_off_asks_for_no_more_lean_than_it_can_climb_with():
    near, far = (
        fallback_command(hovering(position=Vec3(x, 0.0, 1.0))) for x in (30.0, 3000.0)
    )
    np.testing.assert_allclose(near.rotor_speeds, far.rotor_speeds, rtol=1e-9)
    carried_thrust = sum(
        float(r.thrust_coefficient) * w * w
        for r, w in zip(ARM2.rotors, near.rotor_speeds, strict=True)
    )
    assert carried_thrust > 0.5 * float(ARM2.mass) * 9.81
    high = fallback_command(hovering(position=Vec3(0.0, 0.0, 100.0)))
    thrust = sum(
        float(r.thrust_coefficient) * w * w
        for r, w in zip(ARM2.rotors, high.rotor_speeds, strict=True)
    )
    assert thrust == pytest.approx(fallback.FLOOR * float(ARM2.mass) * 9.81, rel=0.02)


def test_of_a_disturbance_no_more_torque_is_foreseen_than_the_arm_can_bear():
    light = np.array([1.0, 2.0, 3.0, 0.1, 0.1, 0.1, 0.2, -0.39])
    assert bearable(light, np.full(2, 0.5)) is light
    heavy = bearable(
        np.array([1.0, 2.0, 3.0, 0.4, 0.0, 0.2, 0.2, -0.8]), np.full(2, 0.5)
    )
    np.testing.assert_allclose(
        heavy, [1.0, 2.0, 3.0, 0.2, 0.0, 0.1, 0.1, -BEARABLE * 0.5]
    )


@pytest.mark.parametrize("late", [0, 1, 4, 12])
def test_the_delay_of_commands_is_found_from_rotor_speeds_with_noise(late):
    rng = np.random.default_rng(late)
    modelled = 500.0 + np.cumsum(rng.normal(size=(80, 4)), axis=0)
    found = observer.first_lateness(modelled[0])
    for k in range(1, 80):
        seen = modelled[max(k - late, 0)] + 0.1 * rng.normal(size=4)
        found = observer.update_lateness(found, modelled[k], seen, DT)
    assert found.periods == late


def test_rotors_that_say_nothing_or_nonsense_leave_the_delay_as_it_is():
    rng = np.random.default_rng(1)
    for nonsense in (np.zeros(4), np.full(4, np.nan)):
        found = observer.first_lateness(np.full(4, 500.0))
        for _ in range(60):
            found = observer.update_lateness(
                found, 500.0 + rng.normal(size=4), nonsense, DT
            )
        assert found.periods == 0


@pytest.mark.parametrize(
    "thrust", [(0.0, 0.0, 9.8), (2.6, 0.0, 9.8), (0.0, 2.6, 9.8), (-2.0, 1.0, 9.0)]
)
@pytest.mark.parametrize("yaw", [0.0, 0.9])
def test_a_leaning_base_that_stands_aside_has_its_tip_at_home(thrust, yaw):
    """Rodrigues' rotation of the upright frame onto the thrust is the oracle of a lean
    without yaw.
    """
    joints = (0.3, -0.2)
    frame = ARM2.frame(ARM2.end_effector)
    aside = np.array([*shift(ARM2, Vec3(*thrust), yaw, joints)], dtype=float)
    up = np.array(thrust) / np.linalg.norm(thrust)
    heading = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    b2 = np.cross(up, heading) / np.linalg.norm(np.cross(up, heading))
    R = np.column_stack([np.cross(b2, up), b2, up])
    level = np.column_stack([heading, [-heading[1], heading[0], 0.0], [0.0, 0.0, 1.0]])
    # the first joint turns about the base's y axis and takes the sine of that part of
    # the lean back
    axis = np.array(
        [*ARM2.links[0].joint.rotation.apply(ARM2.links[0].joint.axis)], dtype=float
    )
    tilt = np.array([(R.T @ [0, 0, 1.0])[1], -(R.T @ [0, 0, 1.0])[0], 0.0])
    bent = (joints[0] - float(axis @ tilt), joints[1])
    arm, held = (
        np.array([*frame_pose(ARM2, frame, q).p], dtype=float) for q in (joints, bent)
    )
    np.testing.assert_allclose(aside + R @ held, level @ arm, atol=1e-12)
    if thrust[:2] == (0.0, 0.0):
        np.testing.assert_allclose(aside, 0.0, atol=1e-12)
