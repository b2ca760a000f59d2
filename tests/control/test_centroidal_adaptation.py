"""What the centroidal law learns of a load at the tip and of friction, and what teaches
it nothing.
"""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from centroidal_flights import fly, planned
from law_parts import demanded, with_parts

import skyarm
from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.blocks.tip_force import levers
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.adaptation import (
    adapt,
    adaptation_gains,
    felt_load,
    unit_load,
)
from skyarm.control.laws.centroidal.step_records import Planned
from skyarm.control.model import Model
from skyarm.reference import Sine
from skyarm.scenario.scenario_record import trimmed_state
from skyarm.sensing.measurement import blank_measurement
from support.cases import sampled
from support.vehicles import (
    TWINS,
    RandomState,
    random_state,
    random_vehicle,
    rotation_matrix,
)

TRUTH = skyarm.load_vehicle("hummingbird_arm2_rotors")
MODEL = Model(vehicle=TRUTH, gravity=9.8)
SLIDER = skyarm.load_vehicle("octo_coaxial_two_arms")
ZERO = Vec3(0.0, 0.0, 0.0)
FREE = (1.0, 1.0)
HELD = (0.0, 0.0)

SMALL, FRICTION, STICKIEST, MODELLED, SLOW = 1e-3, 2.0, 50.0, 5.0, 0.1
"""Constants of the page."""


def array(v):
    return np.array([float(c) for c in v])


def vec(values):
    return Vec3(*(float(v) for v in values))


def motion(angles, rates=(0.0, 0.0), accelerations=(0.0, 0.0)):
    """A level hover of the arm in motion."""
    series = tuple(
        Taylor.of_derivatives(each)
        for each in zip(angles, rates, accelerations, strict=True)
    )
    weight = Vec3(0.0, 0.0, 9.8)
    return Planned(
        R=Mat3.identity(), rate=ZERO, alpha=ZERO, proper=weight, joints=series
    )


def law(**options):
    return make_centroidal(MODEL, **options).par


def started(**fields):
    """What is known before anything is learned."""
    return dataclasses.replace(law().parts.adaptation.start(2), **fields)


def adapted_with_its_share(
    par,
    learned,
    plan,
    left,
    free,
    measured=None,
    modelled=(0.0, 0.0),
    wanted=None,
    found=(0.0, 0.0),
    first=False,
):
    """One period of 5 ms.

    ``left`` are the observer's efforts, ``modelled`` its last joint rates and ``found``
    those of now; ``measured`` is the plan's motion if left out, and ``wanted`` are the
    rates of the joints' references, the plan's if left out. Of the ``first``
    measurement no period is known before it. Learned, and what that takes from the
    disturbance.
    """
    rates = [q.derivative(1) for q in plan.joints]
    blank = blank_measurement(2, 4)
    if measured is None:
        places = tuple(q.derivative(0) for q in plan.joints)
        measured = dataclasses.replace(blank, joints=places, joint_rates=tuple(rates))
    signals = [None] * 4 + [
        Taylor.of_derivatives((0.0, rate)) for rate in wanted or rates
    ]
    step = SimpleNamespace(
        par=par,
        dt=0.005,
        measurement=measured,
        memory=SimpleNamespace(
            started=0.0 if first else 1.0,
            observed=SimpleNamespace(joint_rates=modelled),
        ),
        seen=SimpleNamespace(observed=SimpleNamespace(efforts=left, joint_rates=found)),
        motion=SimpleNamespace(signals=signals),
    )
    return adapt(par.parts.adaptation, step, learned, plan, free)


def adapted(*arguments, **options):
    return adapted_with_its_share(*arguments, **options)[0]


def hearing(par, plan, learned, free=HELD, **each):
    """Memory after plan and motion have been filtered for long, and further fields of
    the joints, a value for each.
    """
    for _ in range(400):
        learned = adapted(par, learned, plan, (0.0, 0.0), free)
    joints = []
    for i, joint in enumerate(learned.joints):
        joints.append(
            dataclasses.replace(
                joint, **{name: values[i] for name, values in each.items()}
            )
        )
    return dataclasses.replace(learned, joints=tuple(joints))


@pytest.mark.parametrize("joints", [1, 2, 5])
def test_a_load_pushes_by_what_pinocchio_needs_more_for_it(joints):
    """Inverse dynamics with 1 kg at the tip less those without: the forces that carry
    it, against which it pushes.
    """
    pytest.importorskip("pinocchio")
    rng = np.random.default_rng([21, joints])
    vehicle, state, acceleration = (
        random_vehicle(rng, joints),
        random_state(rng, joints),
        rng.normal(size=6 + joints),
    )
    # the point of the load is the end effector of the vehicle without it
    carried = TWINS["pinocchio"](vehicle.with_payload(1.0)).inverse_dynamics(
        state, acceleration, 9.81
    )
    needed = carried - TWINS["pinocchio"](vehicle).inverse_dynamics(
        state, acceleration, 9.81
    )
    R = rotation_matrix(state.quaternion)
    series = tuple(
        Taylor.of_derivatives(each)
        for each in zip(
            state.joints.tolist(),
            state.velocity[6:].tolist(),
            acceleration[6:].tolist(),
            strict=True,
        )
    )
    plan = Planned(
        R=Mat3(*(vec(row) for row in R)),
        rate=vec(state.velocity[3:6]),
        alpha=vec(acceleration[3:6]),
        proper=vec(R.T @ (acceleration[:3] + np.array([0.0, 0.0, 9.81]))),
        joints=series,
    )
    found = unit_load(vehicle, plan)
    ours = np.concatenate(
        [array(found.force), array(found.torque), np.array(found.efforts, dtype=float)]
    )
    np.testing.assert_allclose(
        ours, -needed, rtol=1e-9, atol=1e-9 * np.abs(needed).max()
    )


@pytest.mark.parametrize("joints", [2, 5])
def test_a_load_takes_of_the_measured_joints_what_pinocchio_needs_more_for_it(joints):
    """Of the tip's acceleration by differences of its velocity, over a motion of base
    and joints.
    """
    pytest.importorskip("pinocchio")
    rng = np.random.default_rng([22, joints])
    vehicle, state = random_vehicle(rng, joints), random_state(rng, joints)
    turning, bending, pull = (
        rng.normal(size=3),
        rng.normal(size=joints),
        rng.normal(size=3),
    )

    def reading(t):
        """Base and joints that accelerate evenly from the state: turned about the rate
        amid the time.
        """
        rate, joint_rates = (
            state.velocity[3:6] + turning * t,
            state.velocity[6:] + bending * t,
        )
        q, places = (
            Quaternion(*map(float, state.quaternion)),
            state.joints + 0.5 * (state.velocity[6:] + joint_rates) * t,
        )
        q = q * Quaternion.of_small_rotation(
            vec(0.5 * (state.velocity[3:6] + rate) * t)
        )
        return dataclasses.replace(
            blank_measurement(joints, 4),
            quaternion=q,
            velocity=vec(state.velocity[:3] + pull * t),
            rate=vec(rate),
            joints=tuple(places.tolist()),
            joint_rates=tuple(joint_rates.tolist()),
        )

    h = 1e-5

    def tip_velocity(seen):
        at = levers(vehicle, seen.rotation, seen.joints)
        return at.velocity(seen.velocity, seen.rate, seen.joint_rates)

    change = (tip_velocity(reading(h)) - tip_velocity(reading(-h))) * (0.5 / h)
    seen = reading(0.0)
    at = levers(vehicle, seen.rotation, seen.joints)
    found = felt_load(at, change + Vec3(0.0, 0.0, 9.81))
    acceleration = np.concatenate([pull, turning, bending])
    carried = TWINS["pinocchio"](vehicle.with_payload(1.0)).inverse_dynamics(
        state, acceleration, 9.81
    )
    needed = (
        carried
        - TWINS["pinocchio"](vehicle).inverse_dynamics(state, acceleration, 9.81)
    )[6:]
    np.testing.assert_allclose(
        found, -needed, rtol=1e-5, atol=1e-5 * np.abs(needed).max()
    )


def test_the_mass_moves_by_the_normalised_gradient():
    """A load dm takes torques dm y from a hovering arm of two 150 mm links: the step is
    rate dt dm y.y / (y.y + s).
    """
    y = -9.8 * 0.15 * np.array([np.sin(0.3) + np.sin(-0.2), np.sin(-0.2)])
    par, plan = law(adaptation=0.3), motion((0.3, -0.5))
    before = hearing(par, plan, started(tip_mass=0.01))
    # the observer finds what the feed-forward of 10 g leaves of 60 g
    found = adapted(par, before, plan, tuple((0.05 * y).tolist()), FREE)
    assert found.tip_mass - 0.01 == pytest.approx(
        0.3 * 0.005 * 0.05 * (y @ y) / (y @ y + SMALL), rel=1e-9
    )
    np.testing.assert_allclose(
        found.feedforward.efforts, found.tip_mass * y, rtol=1e-12
    )
    np.testing.assert_allclose(
        array(found.feedforward.force), [0.0, 0.0, -9.8 * found.tip_mass], atol=1e-15
    )


def test_each_joint_moves_by_the_normalised_gradient():
    """With e = d + h - m y + b v: damping -rate dt w e v / (v^2 + s), w of v against
    the reference's rate.
    """
    par, qd, wanted = law(adaptation=0.0), (0.9, -0.4), (0.7, -0.7)
    plan, left, modelled = motion((0.3, -0.2), qd), (-0.004, 0.001), (0.8, -0.3)
    known, most = (0.002, 0.02), par.parts.adaptation.modelled
    assert (known[0] < most[0], known[1] > most[1]) == (True, True)
    joints = tuple(
        dataclasses.replace(j, damping=b)
        for j, b in zip(started().joints, known, strict=True)
    )
    learned = started(joints=joints)
    for _ in range(1200):
        learned = adapted(
            par, learned, plan, (0.0, 0.0), HELD, modelled=modelled, wanted=wanted
        )
    found = adapted(par, learned, plan, left, FREE, modelled=modelled, wanted=wanted)
    for i, (joint, b) in enumerate(zip(found.joints, known, strict=True)):
        inside = min(b, most[i])
        # what the observer reckons with: at its own rate, and the rest at the plan's
        given = -inside * modelled[i] - (b - inside) * qd[i]
        error = left[i] + given + b * qd[i]
        p, off = wanted[i] ** 2, (qd[i] - wanted[i]) ** 2
        weight = p / (p + 0.01 * SLOW) * (1.0 + 2.0 * off / (p + SLOW)) ** -2
        step = FRICTION * 0.005 * weight * error * qd[i] / (qd[i] ** 2 + SLOW)
        assert joint.damping == pytest.approx(b - step, rel=1e-6)
        assert abs(step) > 1e-6
        rest = joint.damping - min(joint.damping, most[i])
        assert found.feedforward.efforts[i] == pytest.approx(-rest * qd[i], rel=1e-12)


def test_a_push_that_moves_the_joints_teaches_next_to_no_friction():
    """The observer finds a force against rates that no reference asks for: a tenth of a
    percent of what it would.
    """
    par, plan, measured = law(), motion((0.0, 0.0)), blank_measurement(2, 4)
    shaken = dataclasses.replace(measured, joint_rates=(0.8, 0.6))
    taught = []
    for wanted in ((0.0, 0.0), (0.8, 0.6)):
        learned = started()
        for _ in range(400):
            learned = adapted(
                par, learned, plan, (0.0, 0.0), HELD, measured=shaken, wanted=wanted
            )
        learned = adapted(
            par, learned, plan, (-0.02, -0.03), FREE, measured=shaken, wanted=wanted
        )
        taught.append([joint.damping for joint in learned.joints])
    assert min(taught[1]) > 1e-4
    np.testing.assert_array_less(taught[0], 0.02 * np.array(taught[1]))


def test_a_constant_force_on_joints_whose_reference_rests_is_no_friction():
    """A tip that is held and drifts: no damping, at rates and efforts that teach much
    along a reference.
    """
    par, plan = law(), motion((0.0, 0.0))
    drifting = dataclasses.replace(blank_measurement(2, 4), joint_rates=(0.1, 0.1))
    learned = started()
    for _ in range(2000):
        learned = adapted(par, learned, plan, (-0.3, -0.3), FREE, measured=drifting)
    assert [joint.damping for joint in learned.joints] == [0.0, 0.0]


def test_the_models_joints_have_what_their_loops_bear_of_the_learned_damping():
    known = Model(vehicle=TRUTH.with_joints(damping=0.003), gravity=9.8)
    par = make_centroidal(known).par
    most = par.parts.adaptation.modelled
    dampings, doubted = (most[0] + 0.01, -0.001), par.parts.adaptation.doubted
    # of what acts at the planned rate learning begins with all, and the model's joints
    # with none
    assert (doubted[0], doubted[1] > 0.001) == (0.0, True)
    joints = tuple(
        dataclasses.replace(j, damping=b)
        for j, b in zip(started().joints, dampings, strict=True)
    )
    changed = par.parts.adaptation.adjust_gains(started(joints=joints), par, 0.005)
    assert [
        link.joint.damping for link in changed.model.vehicle.links
    ] == pytest.approx([0.003 + most[0], 0.003 - doubted[1] - 0.001])


@pytest.mark.parametrize("periods", [0, 2])
def test_what_acted_before_the_measurement_is_fed_forward_the_known_delay_ago(periods):
    par, masses, acted = (
        make_centroidal(MODEL, delay=0.005 * periods, adaptation=1.0).par,
        [],
        [],
    )
    learned = par.parts.adaptation.start(2)
    for k in range(6):
        learned = dataclasses.replace(learned, tip_mass=0.01 * k)
        masses.append(0.01 * k)
        learned = adapted(par, learned, motion((0.3, -0.5)), (0.0, 0.0), HELD)
        acted.append(-learned.at_measurement().force.z / 9.8)
    assert acted == pytest.approx([0.0] * periods + masses[: 6 - periods], abs=1e-12)


@pytest.mark.parametrize("known", [0.0, 0.02])
@pytest.mark.parametrize("periods", [0, 2])
def test_what_is_learned_changes_no_effort_that_the_observer_reckons_with(
    periods, known
):
    """Observed, fed forward the known delay ago and in the model's joints: their sum is
    the observer's alone.
    """
    par = make_centroidal(MODEL, delay=0.005 * periods).par
    rng, plan, rates = (
        np.random.default_rng(5),
        motion((0.3, -0.5), (0.9, -0.4)),
        np.array((0.9, -0.4)),
    )
    learned, most = (
        par.parts.adaptation.start(2),
        np.array(par.parts.adaptation.modelled),
    )
    joints = tuple(
        dataclasses.replace(joint, damping=known) for joint in learned.joints
    )
    learned = dataclasses.replace(learned, tip_mass=0.02, joints=joints)
    for _ in range(periods + 1):
        learned = adapted(par, learned, plan, (0.0, 0.0), HELD)
    observed, begin, taken = np.array([0.2, -0.1]), None, []
    force, torque = np.zeros(3), np.zeros(3)
    for _ in range(60):
        told = tuple((0.05 * rng.normal(size=2)).tolist())
        learned, over = adapted_with_its_share(
            par, learned, plan, told, FREE, modelled=rates, found=rates
        )
        observed = observed - np.array(over.efforts)
        force, torque = force - array(over.force), torque - array(over.torque)
        acted = learned.at_measurement()
        inside = np.minimum([joint.damping for joint in learned.joints], most)
        total = np.concatenate(
            [
                force + array(acted.force),
                torque + array(acted.torque),
                observed + acted.efforts - inside * rates,
            ]
        )
        begin = total if begin is None else begin
        np.testing.assert_allclose(total, begin, atol=1e-12)
        taken.append(np.abs(over.efforts).max())
    assert max(taken) > 1e-4
    moved = [abs(joint.damping - known) for joint in learned.joints]
    assert min(moved) > 1e-6


def test_what_acts_now_and_what_acted_in_the_measured_period_are_two_feedforwards():
    """With a known delay of two periods the observer reckons with the one, the command
    with the other.
    """
    scenario = dataclasses.replace(planned("case3_wind"), duration=0.1)
    controller = make_centroidal(scenario.controller.par.model, delay=0.010)
    flown = fly(dataclasses.replace(scenario, controller=controller)).memory
    held, wanted = flown.parts.adaptation, scenario.reference.at(0.1).dense()
    more = Disturbance(force=Vec3(0.0, 0.0, 0.1), torque=ZERO, efforts=(0.01, 0.0))

    def step(**changes):
        memory = with_parts(flown, adaptation=dataclasses.replace(held, **changes))
        reading = measurement_of(flown.observed)
        following, command = controller.law(
            memory, reading, wanted, 0.005, par=controller.par
        )
        given = [joint.once.given for joint in following.parts.adaptation.joints]
        return array(following.observed.force)[2], given, command

    plain = step()
    before = step(earlier=(held.earlier[0], held.earlier[1] + more))
    now = step(feedforward=held.feedforward + more)
    # what was known to act is no more of the disturbance, and the joints' effort is
    # heard beside it
    assert before[0] < plain[0] - 1e-4
    assert before[1][0] - plain[1][0] == pytest.approx(
        0.01 * (1.0 - np.exp(-34.0 * 0.005)), rel=1e-3
    )
    # what acts now is not observed in this period, and taken from the rotors and joints
    # at once
    assert now[0] == pytest.approx(plain[0], abs=1e-6)
    assert now[1] == pytest.approx(plain[1], abs=1e-6)
    assert sum(now[2].rotor_speeds) < sum(plain[2].rotor_speeds) - 1.0
    assert now[2].efforts[0] < plain[2].efforts[0] - 0.005


def test_the_first_measurement_is_of_a_tip_that_does_not_accelerate():
    par, plan = law(), motion((0.3, -0.5))
    flying = dataclasses.replace(
        blank_measurement(2, 4), joints=(0.3, -0.5), velocity=Vec3(2.0, -1.0, 3.0)
    )
    one, rest = (
        adapted(par, started(), plan, (0.0, 0.0), FREE, measured=each, first=True)
        for each in (flying, dataclasses.replace(flying, velocity=ZERO))
    )
    assert [joint.once for joint in one.joints] == [joint.once for joint in rest.joints]
    assert array(one.tip_velocity) == pytest.approx([2.0, -1.0, 3.0])


def test_a_sliding_joint_is_slow_below_3_cm_a_second():
    """At a mean square of its rate of 1e-3 (m/s)^2 half of the gradient counts."""
    slides = [
        i for i, link in enumerate(SLIDER.links) if link.joint.kind == "prismatic"
    ]
    slow = make_centroidal(Model(vehicle=SLIDER, gravity=9.8)).par.parts.adaptation.slow
    assert [slow[i] for i in slides] == [1e-3] * len(slides)
    assert slides


def test_what_an_actuator_at_its_limit_would_teach_is_not_learned():
    plan, left = motion((0.3, -0.5), (0.9, -0.4)), (-0.4, 0.3)
    par = law()
    before = hearing(par, plan, started(tip_mass=0.02), damping=(0.004, 0.003))
    held, free = (adapted(par, before, plan, left, (f, f)) for f in (0.0, 1.0))
    assert held.tip_mass == before.tip_mass != free.tip_mass
    old, kept, moved = (
        [joint.damping for joint in each.joints] for each in (before, held, free)
    )
    assert kept == old
    assert moved != old


def test_what_is_learned_stays_within_its_bounds():
    plan = motion((0.3, -0.5), (0.9, 0.9))
    known = Model(vehicle=TRUTH.with_joints(damping=0.003), gravity=9.8)
    par = make_centroidal(known, adaptation=5.0, tip_mass_limit=0.2).par
    y = [float(each) for each in unit_load(TRUTH, plan).efforts]
    for sign, end in ((1.0, 0), (-1.0, 1)):
        load, friction = started(), started()
        for _ in range(100):
            load = adapted(
                par, load, plan, tuple(-sign * 20.0 * each for each in y), FREE
            )
            friction = adapted(par, friction, plan, (sign * 20.0, sign * 20.0), FREE)
        assert load.tip_mass == pytest.approx(-sign * 0.2)
        # back to no damping at all, or to the highest
        assert [joint.damping for joint in friction.joints] == pytest.approx(
            [p[end] for p in par.parts.adaptation.damping_limits]
        )
    # what is doubted acts as what is learned: back to none is less of the rest alone
    rows = zip(
        par.parts.adaptation.damping_limits, par.parts.adaptation.doubted, strict=True
    )
    assert [low - doubted for (low, _), doubted in rows] == pytest.approx(
        [-0.003, -0.003]
    )


def planned_at(scenario, time):
    """The plan of the joint mode for a vehicle that is where it should be, at a time of
    a scenario.
    """
    par, reference = scenario.controller.par, scenario.reference
    state = trimmed_state(scenario.plant, reference.at(time).position, 0.0, (0.1, -0.2))
    # rotors that stand have no drag, whose change with the attitude the plan leaves out
    state = dataclasses.replace(state, rotor_speeds=(0.0,) * len(state.rotor_speeds))
    nothing = Disturbance(force=Vec3(0.4, -0.3, 0.2), torque=ZERO, efforts=(0.0, 0.0))
    signals = [Taylor.of_derivatives(each) for each in derivatives(reference, time)]
    return demanded(par, state, signals, nothing, nothing.force).planned


def derivatives(trajectory, time):
    """x, y, z, yaw and joints with four derivatives."""
    at = trajectory.at(time)
    base = [at.position, at.velocity, at.acceleration, at.jerk, at.snap]
    rows = [[float(v) for v in each] for each in zip(*base, strict=True)]
    arm = zip(
        at.joints,
        at.joint_rates,
        at.joint_accelerations,
        at.joint_jerks,
        at.joint_snaps,
        strict=True,
    )
    return [
        *rows,
        [float(at.yaw), 0.0, 0.0, 0.0, 0.0],
        *([float(v) for v in each] for each in arm),
    ]


def test_the_plan_is_the_references_motion_at_the_attitude_its_force_asks_for():
    """Rate and angular acceleration by differences of the attitude along Case 3, the
    proper acceleration by hand.
    """
    scenario = dataclasses.replace(planned("case3"), initial=None)
    t, h = 9.3, 1e-3
    plan, before, after = (planned_at(scenario, at) for at in (t, t - h, t + h))
    R, R0, R1 = (
        np.array([array(row) for row in each.R.rows]) for each in (plan, before, after)
    )
    spin = R.T @ (R1 - R0) / (2.0 * h)
    np.testing.assert_allclose(
        array(plan.rate), [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-6
    )
    assert np.abs(array(plan.rate)).max() > 0.002
    change = (array(after.rate) - array(before.rate)) / (2.0 * h)
    np.testing.assert_allclose(array(plan.alpha), change, atol=1e-5)
    assert np.abs(change).max() > 0.001
    acceleration = array(scenario.reference.at(t).acceleration)
    up = np.array([0.0, 0.0, scenario.controller.par.model.gravity])
    np.testing.assert_allclose(
        array(plan.proper), R.T @ (acceleration + up), atol=1e-12
    )
    assert np.abs(acceleration).max() > 0.05


@pytest.mark.parametrize("mode", sampled(["tip", "joint"], 2))
def test_what_is_learned_acts_as_what_is_observed(mode):
    """A disturbance moved from the observer's memory to what is fed forward changes
    nothing of a command.
    """
    scenario = planned("case3_wind", mode=mode)
    law, par = scenario.controller.law, scenario.controller.par
    flown = fly(scenario).memory
    observed = flown.observed
    feedforward = Disturbance(
        force=observed.force, torque=observed.torque, efforts=observed.efforts
    )
    moved = dataclasses.replace(
        with_parts(
            flown,
            adaptation=dataclasses.replace(
                flown.parts.adaptation, feedforward=feedforward
            ),
        ),
        observed=dataclasses.replace(
            observed, force=ZERO, torque=ZERO, efforts=(0.0, 0.0)
        ),
        slow_force=ZERO,
    )
    none = dataclasses.replace(
        flown.parts.adaptation,
        feedforward=Disturbance(force=ZERO, torque=ZERO, efforts=(0.0, 0.0)),
    )
    plain = with_parts(
        dataclasses.replace(flown, slow_force=observed.force), adaptation=none
    )
    reading = measurement_of(observed)
    wanted = scenario.reference.at(20.0).dense()
    one, other = (
        law(memory, reading, wanted, 0.005, par=par)[1] for memory in (plain, moved)
    )
    # the slow force moves by a share of the period towards the observed one
    np.testing.assert_allclose(other.rotor_speeds, one.rotor_speeds, rtol=2e-4)
    np.testing.assert_allclose(other.efforts, one.efforts, atol=2e-4)


def test_what_is_learned_is_what_the_observer_finds_in_this_period():
    """A joint that is faster than foreseen, from a memory that knows of no
    disturbance.
    """
    scenario = planned("case3_wind")
    flown = fly(scenario).memory
    still = scenario.controller.par.parts.adaptation.start(2)
    calm = dataclasses.replace(flown.observed, efforts=(0.0, 0.0))
    reading = measurement_of(calm)
    pushed = dataclasses.replace(
        reading, joint_rates=tuple(rate + 0.1 for rate in reading.joint_rates)
    )
    memory = with_parts(dataclasses.replace(flown, observed=calm), adaptation=still)
    wanted = scenario.reference.at(20.0).dense()
    following, _ = scenario.controller.law(
        memory, pushed, wanted, 0.005, par=scenario.controller.par
    )
    assert np.abs(following.observed.efforts).min() > 1e-4
    share = (1.0 - np.exp(-34.0 * 0.005)) ** 2
    for joint, found, rate in zip(
        following.parts.adaptation.joints,
        following.observed.efforts,
        pushed.joint_rates,
        strict=True,
    ):
        v = share * rate
        whole = max(0.0, -FRICTION * 0.005 * found * v / (v * v + SLOW))
        # but for what the joint's own error takes from its weight
        assert 0.5 * whole <= joint.damping <= whole * (1.0 + 1e-9)


def measurement_of(observed):
    blank = blank_measurement(2, 4)
    names = (
        "position",
        "quaternion",
        "velocity",
        "rate",
        "joints",
        "joint_rates",
        "rotor_speeds",
    )
    return dataclasses.replace(
        blank, time=20.0, **{name: getattr(observed, name) for name in names}
    )


def test_the_largest_damping_is_that_of_the_joints_inertia():
    """Hanging straight, joint 2 carries link 2 alone, by Pinocchio."""
    pytest.importorskip("pinocchio")
    still = RandomState(
        np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(2), np.zeros(8)
    )
    M = TWINS["pinocchio"](TRUTH).mass_matrix(still)
    gains = law().parts.adaptation
    np.testing.assert_allclose(
        [high for _, high in gains.damping_limits],
        STICKIEST * np.diag(M)[6:],
        rtol=1e-10,
    )
    np.testing.assert_allclose(gains.modelled, MODELLED * np.diag(M)[6:], rtol=1e-10)


@pytest.mark.parametrize("seed", range(8))
def test_the_learned_damping_takes_no_more_than_the_joints_loop_gives(seed):
    """The arm's fastest mode under it, base and all joints free: of a long arm it
    decays as fast as the loop's damping.

    By eigenvalues of Pinocchio's mass matrix. Of arms whose modes are slow a share of
    the joints' inertias is bound.
    """
    pytest.importorskip("pinocchio")
    rng, n = np.random.default_rng([31, seed]), 1 + seed % 5
    vehicle = random_vehicle(rng, n)
    still = RandomState(
        np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(n), np.zeros(6 + n)
    )
    M, damping = TWINS["pinocchio"](vehicle).mass_matrix(still), 60.0
    gains = adaptation_gains(vehicle, 0.3, 0.2, 0, damping, (0.0,) * n)
    own = MODELLED * np.diag(M)[6:]

    def fastest(dampings):
        return np.linalg.eigvals(
            np.linalg.inv(M)[6:, 6:] @ np.diag(dampings)
        ).real.max()

    assert fastest(gains.modelled) == pytest.approx(
        min(damping, fastest(own)), rel=1e-9
    )
    np.testing.assert_allclose(
        gains.modelled / own, gains.modelled[0] / own[0], rtol=1e-9
    )
    halved = adaptation_gains(vehicle, 0.3, 0.2, 0, 0.5 * fastest(own), (0.0,) * n)
    np.testing.assert_allclose(halved.modelled, 0.5 * own, rtol=1e-9)


def test_the_damping_that_bounds_it_is_that_of_the_laws_joint_loop():
    long = Model(vehicle=skyarm.load_vehicle("hexarotor_arm6"), gravity=9.81)
    own, half = (
        make_centroidal(long, arm=(900.0, kd)).par.parts.adaptation.modelled
        for kd in (60.0, 30.0)
    )
    np.testing.assert_allclose(half, 0.5 * np.array(own), rtol=1e-9)


def loaded(scenario, kg):
    vehicle = scenario.plant.vehicle.with_payload(kg)
    return dataclasses.replace(
        scenario, plant=dataclasses.replace(scenario.plant, vehicle=vehicle)
    )


def dampings(flown):
    return [joint.damping for joint in flown.memory.parts.adaptation.joints]


NO_FRICTION = {"damping_limits": ((0.0, 0.0), (0.0, 0.0))}
"""Bounds between which no damping is learned."""


def without(scenario, **structure):
    """The scenario without parts of the adaptation."""
    par = scenario.controller.par
    par = with_parts(
        par, adaptation=dataclasses.replace(par.parts.adaptation, **structure)
    )
    return dataclasses.replace(
        scenario, controller=dataclasses.replace(scenario.controller, par=par)
    )


def sticky(scenario, damping):
    vehicle = scenario.plant.vehicle.with_joints(damping=damping)
    return dataclasses.replace(
        scenario, plant=dataclasses.replace(scenario.plant, vehicle=vehicle)
    )


@pytest.mark.parametrize("noisy", sampled([True, False], 2))
def test_a_payload_is_found(noisy):
    flown = fly(loaded(planned("case3_wind", mode="tip", noisy=noisy), 0.05))
    assert flown.memory.parts.adaptation.tip_mass == pytest.approx(0.05, abs=0.01)
    assert flown.mean("tip") < (1.6 if noisy else 0.2)


def test_without_a_payload_the_mass_stays_near_zero():
    assert (
        abs(fly(planned("case3_wind", mode="tip")).memory.parts.adaptation.tip_mass)
        < 0.002
    )


@pytest.mark.parametrize("noisy", sampled([True, False], 2))
def test_damping_is_found_and_no_longer_carries_the_joints_away(noisy):
    """0.02 N m s/rad cost 11 mrad without, and 40 for the slower observer under
    noise.
    """
    scenario = sticky(planned("case2", noisy=noisy), 0.02)
    found, plain = fly(scenario), fly(without(scenario, **NO_FRICTION))
    np.testing.assert_allclose(dampings(found), 0.02, atol=0.003)
    # means from 10 s on, which 4 s of learning precede
    assert found.mean("joint") < (11.0 if noisy else 2.5)
    assert plain.mean("joint") > 3.5 * found.mean("joint")


def test_a_load_that_nobody_knows_is_hardly_taken_for_friction():
    """Its weight is constant in a leaning base, and else goes with the position; the
    truth's own is 0.001.
    """
    flown = fly(loaded(planned("case3_wind"), 0.05))
    assert max(dampings(flown)) < 0.004
    assert flown.mean("joint") < 1.5


@pytest.mark.parametrize("mode", ["joint", "tip"])
def test_an_oscillation_of_the_loop_teaches_nothing(mode):
    """10 ms of unknown delay make it swing; in the planned motion nothing swings."""
    scenario = planned("case3_wind", mode=mode)
    flown = fly(
        dataclasses.replace(
            scenario, delays=dataclasses.replace(scenario.delays, command=0.010)
        )
    )
    assert abs(flown.memory.parts.adaptation.tip_mass) < 0.01
    assert max(dampings(flown)) < 0.01


def swinging(scenario, amplitude, hertz, duration, phase=0.0):
    arm = [
        Sine(amplitude=amplitude, frequency_hz=hertz, phase=each)
        for each in (0.0, phase)
    ]
    return dataclasses.replace(
        scenario, reference=skyarm.hover([0, 0, 1], joints=arm), duration=duration
    )


@pytest.mark.parametrize("noisy", [False, True])
def test_slow_motion_under_a_load_is_no_friction(noisy):
    """At 0.1 Hz a high-pass would turn 50 g's weight, which goes with the position,
    into 0.28 N m s/rad.
    """
    slow = without(swinging(planned("case2", noisy=noisy), 0.4, 0.1, 40.0), load=None)
    assert max(dampings(fly(loaded(slow, 0.05)))) < 0.005


@pytest.mark.thorough
def test_fast_motion_under_a_load_errs_by_half_with_what_is_learned():
    """At 3 Hz the arm hardly follows its plan, and tells of the load all the same: 4.6
    mm for 11 at the tip.
    """
    fast = loaded(
        swinging(planned("case2", mode="tip", noisy=True), 0.06, 3.0, 20.0, phase=1.0),
        0.05,
    )
    learning, plain = fly(fast), fly(without(fast, load=None, **NO_FRICTION))
    assert learning.memory.parts.adaptation.tip_mass == pytest.approx(0.05, abs=0.015)
    for what, most in (("base", 2.5), ("joint", 1.1), ("tip", 0.6)):
        assert learning.mean(what) < most * plain.mean(what)


@pytest.mark.thorough
def test_a_load_that_is_believed_and_not_there_is_taken_off():
    scenario = planned("case2", noisy=True)
    believed = Model(
        vehicle=scenario.controller.par.model.vehicle.with_payload(0.05), gravity=9.81
    )
    controller = make_centroidal(believed, delay=0.005)
    flown = fly(dataclasses.replace(scenario, controller=controller))
    assert flown.memory.parts.adaptation.tip_mass == pytest.approx(-0.05, abs=0.005)
    assert flown.mean("joint") < 10.0
