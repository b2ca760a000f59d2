"""A predictive controller that presses: the force that its plan foresees, its goals,
touch and loss, and flights.
"""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from predictive_models import belief, drawn, goal_of, true_accelerations
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.control.blocks.force_control import InteractionGains
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.catalogue import make_controller
from skyarm.control.controller import ControllerError, presses
from skyarm.control.law_estimates import PushAlone, observed_push
from skyarm.control.laws.predictive import preview
from skyarm.control.laws.predictive.cost import (
    ContactGoal,
    input_residuals,
    state_residuals,
    under_contact,
)
from skyarm.control.laws.predictive.law import WEIGHTS, problem_at
from skyarm.control.laws.predictive.prediction import StageInputs
from skyarm.control.laws.predictive.solver import examples
from skyarm.control.laws.predictive.tip_contact import (
    KEPT,
    TipContact,
    contact_goals,
    shift_ahead,
)
from skyarm.control.model import Model
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.controller_table import controller_by_name
from skyarm.vehicle.vehicle_files import load_vehicle
from support.laws import MODEL, cases, scalars, vec
from support.vehicles import PinocchioTwin, RandomState

pytest.importorskip("pinocchio")

DT = 0.005
GAINS = InteractionGains(touch=0.3, lost=0.1)


def contact_of(seed, touching=1.0):
    n = np.random.default_rng(seed + 7).normal(size=3)
    return ContactGoal(
        normal=vec(n / np.linalg.norm(n)), touching=touching, force=2.0, damping=15.0
    )


def tip_of(model, r):
    """Place of the tip, world axes, by Pinocchio."""
    twin = PinocchioTwin(model.vehicle)
    q, _, _ = twin._prepare(r)
    twin.pin.framesForwardKinematics(twin.model, twin.data, q)
    return twin.data.oMf[
        twin.model.getFrameId(model.vehicle.end_effector)
    ].translation.copy()


def later(r, a, t):
    """A state with constant accelerations ``t`` s later, to second order."""
    w, x, y, z = r.quaternion
    turned = Rotation.from_quat([x, y, z, w]) * Rotation.from_rotvec(
        r.velocity[3:6] * t + 0.5 * a[3:6] * t * t
    )
    x, y, z, w = turned.as_quat()
    moved = r.velocity * t + 0.5 * a * t * t
    return RandomState(
        position=r.position + moved[:3],
        quaternion=np.array([w, x, y, z]),
        joints=r.joints + moved[6:],
        velocity=r.velocity + a * t,
    )


def tip_motion(model, r, a):
    """Velocity and acceleration of the tip, by differences of Pinocchio's places."""
    h = 1e-4
    before, now, after = (tip_of(model, later(r, a, t)) for t in (-h, 0.0, h))
    return (after - before) / (2.0 * h), (after - 2.0 * now + before) / h**2


@pytest.mark.parametrize("seed", range(6))
def test_under_the_predicted_force_pinocchio_damps_the_tip_along_the_normal(seed):
    model, (r, state, efforts, unknown), contact = (
        belief(seed),
        drawn(seed),
        contact_of(seed),
    )
    held, force = under_contact(model, state, efforts, unknown, None, contact)
    v, a = tip_motion(
        model, r, true_accelerations(model, r, state.rotor_speeds, efforts, held)
    )
    n = scalars(contact.normal)
    # differences of second order over 0.1 ms: 1e-8 of the motion, and 1e-16 / h^2 of
    # the places
    assert n @ a == pytest.approx(-15.0 * n @ v, abs=1e-5 * (1.0 + np.abs(a).max()))
    # and it is a force at the tip along the normal: its power is that of the tip
    power = (
        scalars(held.force - unknown.force) @ r.velocity[:3]
        + scalars(held.torque - unknown.torque) @ (r.velocity[3:6])
    )
    power += (np.array(held.efforts) - unknown.efforts) @ r.velocity[6:]
    assert power == pytest.approx(float(force) * (n @ v), rel=1e-6, abs=1e-7)


def pushed_at_the_tip(model, r, unknown, force):
    """A disturbance with a force (world axes) at the tip, by differences of Pinocchio's
    places.
    """
    columns = []
    for i in range(6 + model.vehicle.n):
        moving = dataclasses.replace(r, velocity=np.eye(6 + model.vehicle.n)[i])
        columns.append(tip_motion(model, moving, np.zeros(6 + model.vehicle.n))[0])
    wrench = np.array(columns) @ force
    return Disturbance(
        force=unknown.force + vec(wrench[:3]),
        torque=unknown.torque + vec(wrench[3:6]),
        efforts=tuple((np.array(unknown.efforts) + wrench[6:]).tolist()),
    )


@pytest.mark.parametrize("seed", range(3))
def test_what_pushes_the_tip_into_the_surface_is_what_the_surface_gives_beside(seed):
    model, (r, state, efforts, unknown), contact = (
        belief(seed),
        drawn(seed),
        contact_of(seed),
    )
    _, before = under_contact(model, state, efforts, unknown, None, contact)
    harder = pushed_at_the_tip(model, r, unknown, -1.5 * scalars(contact.normal))
    assert under_contact(model, state, efforts, harder, None, contact)[
        1
    ] == pytest.approx(before + 1.5, abs=1e-5)


def test_a_tip_that_touches_nothing_and_a_goal_without_contact_change_nothing():
    model, (_, state, efforts, unknown) = belief(1), drawn(1)
    assert under_contact(model, state, efforts, unknown, None, ()) == (unknown, 0)
    held, force = under_contact(
        model, state, efforts, unknown, None, contact_of(1, touching=0.0)
    )
    assert force == 0.0
    assert leaves(held) == pytest.approx(leaves(unknown), abs=0.0)


def test_a_batch_of_foreseen_forces_is_a_loop():
    model, cases = belief(3), [drawn(seed)[1:] for seed in range(4)]
    contacts = [contact_of(seed) for seed in range(4)]
    alone = [
        under_contact(model, *case, None, contact)
        for case, contact in zip(cases, contacts, strict=True)
    ]

    def stacked(records):
        return rebuild(
            records[0],
            iter(np.array([leaves(each) for each in records], dtype=float).T),
        )

    state, efforts, unknown = (stacked(each) for each in zip(*cases, strict=True))
    held, force = under_contact(model, state, efforts, unknown, None, stacked(contacts))
    np.testing.assert_allclose(force, [each for _, each in alone], rtol=1e-12)
    np.testing.assert_allclose(
        np.array(leaves(held)).T,
        [leaves(each) for each, _ in alone],
        rtol=1e-11,
        atol=1e-11,
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_tip_that_touches_costs_its_force_and_no_place_along_the_normal(seed):
    model, (_, state, efforts, unknown), contact = (
        belief(seed),
        drawn(seed),
        contact_of(seed),
    )
    goal = goal_of(seed, 3)
    pressed, free = (
        dataclasses.replace(goal, contact=contact),
        scalars(state_residuals(model, WEIGHTS, state, goal, "tool")),
    )
    found = scalars(state_residuals(model, WEIGHTS, state, pressed, "tool"))
    n = scalars(contact.normal)
    np.testing.assert_array_equal(found[:-3], free[:-3])
    np.testing.assert_allclose(found[-3:], free[-3:] - n * (n @ free[-3:]), atol=1e-12)
    inputs = StageInputs(rotor_accelerations=(1.0, 2.0, 3.0, 4.0), efforts=efforts)
    held, force = under_contact(
        model, state, efforts, unknown, goal.joint_rates, contact
    )
    costs = scalars(input_residuals(model, WEIGHTS, state, inputs, unknown, pressed))
    assert costs[-1] == pytest.approx(float(WEIGHTS.force) * (force - 2.0))
    np.testing.assert_allclose(
        costs[:-1], scalars(input_residuals(model, WEIGHTS, state, inputs, held, goal))
    )
    away = dataclasses.replace(pressed, contact=contact_of(seed, touching=0.0))
    assert (
        scalars(input_residuals(model, WEIGHTS, state, inputs, unknown, away))[-1]
        == 0.0
    )


N = np.array([-0.6, 0.0, 0.8])
VEHICLE = MODEL.vehicle


def known(
    push,
    force,
    *,
    periods=1,
    place=(0.0, 0.0, 0.0),
    velocity=(0.0, 0.0, 0.0),
    before=None,
    beside=0.0,
):
    """What is known after some periods in which the tip of a level vehicle is pushed by
    ``force`` (world axes).
    """
    contact = TipContact(MODEL, GAINS, DT)
    state, *_ = examples(2, 4)
    moving = dataclasses.replace(
        state, position=vec(place), velocity=vec(velocity), joints=(-0.45, -0.9)
    )
    r = RandomState(
        position=np.zeros(3),
        quaternion=np.array([1.0, 0.0, 0.0, 0.0]),
        joints=np.array([-0.45, -0.9]),
        velocity=np.zeros(8),
    )
    still = Disturbance(
        force=vec(np.zeros(3)), torque=vec(np.zeros(3)), efforts=(0.0, 0.0)
    )
    observed = pushed_at_the_tip(MODEL, r, still, np.array(force))
    estimate = np.array([*leaves(moving), *leaves(observed)], dtype=float)
    wanted = np.array([0.0, 0.0, 0.0, 0.0, -0.45, -0.9])
    for _ in range(periods):
        before, touch = contact.at(before, estimate, push, wanted)
    levers = (
        np.array(leaves(pushed_at_the_tip(MODEL, r, still, N))),
        np.array(leaves(observed)),
    )
    return touch, levers, before


PUSH = (1.0, 0.1, *N)


def test_the_tip_touches_above_its_threshold_and_its_order_rises():
    weak, _, _ = known(PUSH, 0.25 * N)
    assert (weak.touching, weak.rising, weak.share) == (0.0, 0.0, 0.0)
    strong, _, _ = known(PUSH, 0.5 * N, periods=10)
    assert (strong.touching, strong.rising) == (1.0, 1.0)
    assert strong.share == pytest.approx(10 * DT / 0.15)
    assert strong.tip_force == pytest.approx(0.5 * N, abs=1e-6)
    pulled, _, _ = known(PUSH, -0.5 * N, periods=10)
    assert pulled.touching == 0.0
    unasked, _, _ = known((0.0, *PUSH[1:]), 0.5 * N, periods=10)
    assert (unasked.asked, unasked.touching) == (0.0, 0.0)


def test_a_plan_reckons_with_the_order_and_a_share_of_what_is_felt_across():
    across = np.array([0.8, 0.0, 0.6])
    touch, (unit, observed), _ = known(PUSH, 0.5 * N + 0.2 * across, periods=60)
    side = known(PUSH, across)[1][1]
    assert np.array(touch.free) == pytest.approx(KEPT * 0.2 * side, abs=1e-5)
    # the force is less than wanted, so that the integral asks for more
    assert touch.force > 1.0
    assert touch.share == 1.0
    assert np.array(touch.pressed) - touch.free == pytest.approx(
        touch.force * unit, abs=1e-5
    )
    away, (_, observed), _ = known(PUSH, 0.2 * N + 0.2 * across)
    assert np.array(away.free) == pytest.approx(observed)
    assert np.array(away.pressed) == pytest.approx(observed)


def test_the_gap_is_the_tips_way_out_of_the_surface_from_its_shifted_reference():
    touch, _, _ = known(PUSH, 0.0 * N, place=0.03 * N + [0.0, 0.02, 0.0])
    assert touch.gap == pytest.approx(0.03 - touch.shift)
    assert touch.shift < 0.0 < touch.gap


def test_a_tip_that_goes_in_fast_soon_after_a_loss_touches_nothing():
    _, _, before = known(PUSH, 1.0 * N, periods=60)
    _, _, before = known(PUSH, -1.0 * N, periods=14, before=before)
    assert known(PUSH, 1.0 * N, velocity=-0.3 * N, before=before)[0].rising == 0.0
    assert known(PUSH, 1.0 * N, velocity=0.3 * N, before=before)[0].rising == 1.0


def told(**changes):
    touch, _, _ = known(PUSH, 0.0 * N)
    numbers = {
        "asked": 1.0,
        "rising": 0.0,
        "shift": -0.02,
        "shift_rate": 0.03,
        "gap": 0.05,
        "speed": 0.1,
        "damping": 0.0,
        **changes,
    }
    return dataclasses.replace(touch, **numbers)


@pytest.mark.parametrize(
    ("changes", "law"),
    [
        ({}, lambda s, r: 8.0 * (-0.1 - r)),
        ({"rising": 1.0}, lambda s, r: 3.5**2 * (0.05 - (s + 0.02)) - 7.0 * r),
        ({"asked": 0.0}, lambda s, r: -(3.5**2) * s - 7.0 * r),
    ],
)
def test_the_shift_that_is_foreseen_is_the_one_that_the_interaction_will_make(
    changes, law
):
    times = np.linspace(0.0, 0.6, 7)
    exact = solve_ivp(
        lambda _t, y: [y[1], law(*y)],
        (0.0, 0.6),
        [-0.02, 0.03],
        t_eval=times,
        rtol=1e-10,
        atol=1e-12,
    ).y
    s, rate, acceleration = shift_ahead(GAINS, told(**changes), times)
    np.testing.assert_allclose(s, exact[0], atol=1e-8)
    np.testing.assert_allclose(rate, exact[1], atol=1e-8)
    np.testing.assert_allclose(acceleration, [law(*y) for y in exact.T], atol=1e-7)


def test_at_the_end_of_its_way_the_reference_stands():
    s, rate, acceleration = shift_ahead(
        GAINS, told(shift=-0.49, shift_rate=-0.1), np.array([0.05, 0.3])
    )
    assert (s[1], rate[1], acceleration[1]) == (-GAINS.furthest, 0.0, 0.0)
    assert s[0] > s[1]


def test_goals_foresee_the_ramp_and_a_damping_that_each_stage_can_hold():
    later_ = np.array([0.0, 0.05, 0.1, 0.3])
    touch = told(
        normal=(-1.0, 0.0, 0.0),
        touching=1.0,
        rising=1.0,
        share=0.5,
        force=2.0,
        damping=20.0,
    )
    rows = contact_goals(GAINS, touch, later_)
    np.testing.assert_array_equal(rows[:, :4], np.tile([-1.0, 0.0, 0.0, 1.0], (4, 1)))
    assert rows[:, 4] == pytest.approx([1.0, 2.0 * (0.5 + 1.0 / 3.0), 2.0, 2.0])
    steps = np.array([0.05, 0.05, 0.2, 0.2])
    assert 1.0 - rows[:, 5] * steps == pytest.approx(np.exp(-20.0 * steps))
    falling = contact_goals(GAINS, dataclasses.replace(touch, rising=0.0), later_)
    assert falling[:, 4] == pytest.approx([1.0, 0.0, 0.0, 0.0])


def test_it_presses_where_its_joints_move_a_tip_and_it_is_to_track_that():
    assert presses(make_controller("nmpc", MODEL).par)
    assert not presses(make_controller("nmpc", MODEL, mode="joints").par)
    assert not presses(make_controller("nmpc", MODEL, interaction=(0.0, 0.0)).par)
    bare = Model(vehicle=load_vehicle("hummingbird"), gravity=9.81)
    assert not presses(make_controller("nmpc", bare).par)


@pytest.mark.parametrize("value", [(0.3, 0.1), (0.1, 0.3), (1e5, 0.1)])
def test_where_no_tip_is_led_thresholds_are_left_out_or_twice_zero(value):
    bare = Model(vehicle=load_vehicle("hummingbird"), gravity=9.81)
    for options in ({"model": MODEL, "mode": "joints"}, {"model": bare}):
        model = options.pop("model")
        assert not presses(
            make_controller("nmpc", model, **options, interaction=(0.0, 0.0)).par
        )
        with pytest.raises(
            ControllerError, match=r"controller\.interaction = [(\[]"
        ) as caught:
            make_controller("nmpc", model, **options, interaction=value)
        assert "\n" not in str(caught.value)
    with pytest.raises(
        ControllerError,
        match="must be twice 0 but in mode 'tool' with joints that press",
    ):
        make_controller("nmpc", MODEL, mode="joints", interaction=(0.3, 0.1))


def test_left_out_thresholds_are_those_that_are_written_of():
    left, told = (
        make_controller("nmpc", MODEL, **more).par
        for more in ({}, {"interaction": (0.3, 0.1)})
    )
    assert left.interaction == told.interaction
    assert (
        make_controller("nmpc", MODEL, interaction=(1e4, 1.0)).par.interaction.touch
        == 1e4
    )


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ((0.1, 0.3), "interaction"),
        ((0.3,), "must be 2 numbers"),
        ((0.3, -0.1), "interaction"),
        (
            (0.3, 0.0),
            "must be two forces above 0, the second below the first, or twice 0",
        ),
        (
            (0.0, 0.1),
            "must be two forces above 0, the second below the first, or twice 0",
        ),
        ((10001.0, 0.1), "must be at most 10000 N"),
    ],
)
def test_wrong_thresholds_are_refused_by_name(value, words):
    with pytest.raises(ControllerError, match=words):
        make_controller("nmpc", MODEL, interaction=value)


def test_others_know_the_tips_force_of_a_memory_that_only_its_law_can_read():
    memory = make_controller("nmpc", MODEL).memory
    felt = dataclasses.replace(memory, tip_force=vec([1.0, 2.0, 3.0]))
    assert observed_push(PushAlone.of(felt)) == vec([1.0, 2.0, 3.0])
    silent = make_controller("nmpc", MODEL, mode="joints").memory
    assert PushAlone.of(silent).tip_force == ()
    assert observed_push(PushAlone.of(silent)) is None


def test_the_base_stands_for_the_order_and_the_plan_finds_the_force_itself():
    thrusts = []

    def stance(thrust, values):
        thrusts.append(thrust)
        return np.zeros((len(values), 3))

    engine = SimpleNamespace(
        solver=SimpleNamespace(steps=np.full(3, 0.1)),
        bounds=SimpleNamespace(efforts=np.full(2, 5.0)),
        stance=stance,
    )
    touch = told(
        normal=tuple(N),
        asked=0.0,
        free=(1.0, *(0.0,) * 7),
        pressed=(3.0, *(0.0,) * 7),
        shift=0.02,
        shift_rate=0.0,
    )
    still = np.zeros(6)
    sample = preview.SampledReference(np.zeros((3, 6)), still, 0.0, still, still)
    state, *_ = examples(2, 4)
    par = dataclasses.replace(make_controller("nmpc", MODEL).par, interaction=GAINS)
    problem = problem_at(
        engine, np.array(leaves(state)), np.full(8, 9.0), sample, 0.0, par, touch
    )
    np.testing.assert_array_equal(problem.disturbance, touch.free)
    s, rate, bend = shift_ahead(GAINS, touch, np.array([0.0, 0.1, 0.2, 0.3]))
    constant = np.array([0.0, 0.0, 9.81]) - np.array([3.0, 0.0, 0.0]) / float(
        VEHICLE.mass
    )
    expected = np.outer(bend, N) + constant
    np.testing.assert_allclose(thrusts[0], expected)
    np.testing.assert_allclose(problem.goals[:, :3], np.outer(s, N))
    np.testing.assert_allclose(problem.goals[:, 3:6], np.outer(rate, N))
    np.testing.assert_array_equal(
        problem.goals[:, -6:],
        contact_goals(GAINS, touch, np.array([0.0, 0.1, 0.2, 0.3])),
    )


@pytest.mark.parametrize("yaw", [1.5, 1.9, 2.0, -2.4, -1.3, 2.9])
def test_a_heading_far_off_is_approached_to_the_last_bit(yaw):
    engine = SimpleNamespace(
        solver=SimpleNamespace(steps=np.full(3, 0.1)),
        bounds=SimpleNamespace(efforts=np.full(2, 5.0)),
        stance=lambda thrust, values: np.zeros((len(values), 3)),
    )
    still = np.zeros(6)
    sample = preview.SampledReference(np.zeros((3, 6)), still, 0.0, still, still)
    x = np.array(leaves(examples(2, 4)[0]))
    c, s = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    x[3:7] = c, 0.0, 0.0, s
    par = make_controller("nmpc", MODEL).par
    problem = problem_at(engine, x, np.zeros(8), sample, 0.0, par, None)
    # by the C library, which the law's flights have always had
    turn = math.atan2(2.0 * (c * s), 1.0 - 2.0 * (s * s))
    off = float(np.angle(np.exp(1j * turn)))
    found = problem.goals[:, 6].tolist()
    assert found == [off - np.clip(off, -1.0, 1.0)] * len(found)


def test_the_law_remembers_touch_and_loss_and_tells_the_tips_force():
    own, case = make_controller("nmpc", MODEL), cases(1, seed=5)[0]
    reference = dataclasses.replace(case.reference(), push=PUSH)
    seen = case.measurement()
    first, _ = own.law(own.memory, seen, reference, DT, par=own.par)
    assert [*first.tip_force] == pytest.approx([0.0, 0.0, 0.0])
    estimate = first.past.estimate.copy()
    # of a force at the base alone the tip's is a small part, in its direction
    estimate[-8:-5] = 0.5 * N
    past = dataclasses.replace(first.past, estimate=estimate)
    following, _ = own.law(
        dataclasses.replace(own.memory, past=past), seen, reference, DT, par=own.par
    )
    assert 0.0 < N @ [*following.tip_force] < 0.5
    assert following.interaction != first.interaction
    free = dataclasses.replace(reference, push=())
    without, _ = own.law(own.memory, seen, free, DT, par=own.par)
    assert without.interaction is None


def flown(task, duration):
    scenario = skyarm.load_scenario(task)
    return skyarm.run(
        dataclasses.replace(
            scenario, controller=controller_by_name(scenario, "nmpc"), duration=duration
        )
    )


def test_it_comes_to_a_wall_and_holds_the_wanted_force():
    log = flown("press_and_hold", 3.6)
    force = log.contact_force[:, 0]
    met = log.time[np.argmax(force > 0.0)]
    assert log.status == "completed"
    assert 1.9 < met < 2.2
    assert force.max() < 2.5
    assert force[log.time > met + 1.0] == pytest.approx(1.0, abs=0.02)


@pytest.mark.thorough
def test_it_slides_round_a_circle_and_leaves():
    log = flown("slide_circle", 24.0)
    force = log.contact_force[:, 0]
    met = log.time[np.argmax(force > 0.0)]
    assert log.status == "completed"
    assert log.phase[-1] == log.phase.max()
    held = (log.time > met + 2.0) & (log.time < met + 12.0)
    assert force[held] == pytest.approx(1.0, abs=0.1)
    assert force[-1] == 0.0
