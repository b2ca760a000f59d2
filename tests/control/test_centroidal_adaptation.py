"""What the centroidal law learns of a load at the tip and of friction, and what teaches it nothing."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from centroidal_flights import fly, planned

import skyarm
from law_parts import demanded, with_parts
from skyarm.algebra import Mat3, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.adaptation import AdaptationGains, Regressor, adapt, unit_load
from skyarm.control.laws.centroidal.demands import Planned
from skyarm.control.model import Model
from skyarm.reference import Sine
from skyarm.scenario.scenario_record import trimmed_state
from skyarm.sensing.measurement import blank_measurement
from thorough import sampled
from vehicles_random import TWINS, RandomState, random_state, random_vehicle, rotation_matrix

TRUTH = skyarm.load_vehicle("hummingbird_arm2_rotors")
MODEL = Model(vehicle=TRUTH, gravity=9.8)
ZERO = Vec3(0.0, 0.0, 0.0)
FREE = (1.0, 1.0, 1.0)

SMALL, WEIGHT, STICKIEST, REVOLUTE = 1e-3, 1.0, 50.0, (0.01, 0.1)
"""Constants of the page."""


def array(v):
    return np.array([float(c) for c in v])


def vec(values):
    return Vec3(*(float(v) for v in values))


def motion(angles, rates=(0.0, 0.0), accelerations=(0.0, 0.0)):
    """A level hover of the arm in motion."""
    series = tuple(Taylor.of_derivatives(each) for each in zip(angles, rates, accelerations, strict=True))
    weight = Vec3(0.0, 0.0, 9.8)
    return Planned(R=Mat3.identity(), rate=ZERO, alpha=ZERO, proper=weight, joints=series)


def law(**options):
    return make_centroidal(MODEL, **options).par


def adapted(par, learned, plan, rates, left, free, dt):
    """One period; joint rates and efforts are those of an observer."""
    return adapt(par.parts.adaptation, par, learned, plan, SimpleNamespace(joint_rates=rates, efforts=left), free, dt)


def hearing(par, plan, learned, **each):
    """Memory after the plan has been filtered for long, with further fields of the joints, a value for each."""
    for _ in range(400):
        rates = [q.derivative(1) for q in plan.joints]
        learned = adapted(par, learned, plan, rates, (0.0, 0.0), (1.0, 0.0, 0.0), 0.005)
    joints = []
    for i, joint in enumerate(learned.joints):
        joints.append(dataclasses.replace(joint, **{name: values[i] for name, values in each.items()}))
    return dataclasses.replace(learned, joints=tuple(joints))


@pytest.mark.parametrize("joints", [1, 2, 5])
def test_a_load_pushes_by_what_pinocchio_needs_more_for_it(joints):
    """Inverse dynamics with 1 kg at the tip less those without: the forces that carry it, against which it pushes."""
    pytest.importorskip("pinocchio")
    rng = np.random.default_rng([21, joints])
    vehicle, state, acceleration = random_vehicle(rng, joints), random_state(rng, joints), rng.normal(size=6 + joints)
    # the point of the load is the end effector of the vehicle without it
    carried = TWINS["pinocchio"](vehicle.with_payload(1.0)).inverse_dynamics(state, acceleration, 9.81)
    needed = carried - TWINS["pinocchio"](vehicle).inverse_dynamics(state, acceleration, 9.81)
    R = rotation_matrix(state.quaternion)
    series = tuple(
        Taylor.of_derivatives(each)
        for each in zip(state.joints.tolist(), state.velocity[6:].tolist(), acceleration[6:].tolist(), strict=True)
    )
    plan = Planned(
        R=Mat3(*(vec(row) for row in R)),
        rate=vec(state.velocity[3:6]),
        alpha=vec(acceleration[3:6]),
        proper=vec(R.T @ (acceleration[:3] + np.array([0.0, 0.0, 9.81]))),
        joints=series,
    )
    found = unit_load(vehicle, plan)
    ours = np.concatenate([array(found.force), array(found.torque), np.array(found.efforts, dtype=float)])
    np.testing.assert_allclose(ours, -needed, rtol=1e-9, atol=1e-9 * np.abs(needed).max())


def test_the_mass_moves_by_the_normalised_gradient():
    """A load dm takes torques dm y from a hovering arm of two 150 mm links: the step is rate dt dm y.y / (y.y + s)."""
    y = -9.8 * 0.15 * np.array([np.sin(0.3) + np.sin(-0.2), np.sin(-0.2)])
    par, plan = law(adaptation=0.3), motion((0.3, -0.5))
    before = hearing(par, plan, dataclasses.replace(AdaptationGains.start(None, 2), tip_mass=0.01))
    found = adapted(par, before, plan, (0.0, 0.0), tuple((0.05 * y).tolist()), FREE, 0.005)
    assert found.tip_mass - 0.01 == pytest.approx(0.3 * 0.005 * 0.05 * (y @ y) / (y @ y + SMALL), rel=1e-9)
    np.testing.assert_allclose(found.feedforward.efforts, found.tip_mass * y, rtol=1e-12)
    np.testing.assert_allclose(array(found.feedforward.force), [0.0, 0.0, -9.8 * found.tip_mass], atol=1e-15)


def test_each_joint_moves_by_the_normalised_gradient():
    """With e = d - level - slope q: damping -rate dt e qd / (qd^2 + s), level dt e, slope dt e q / (q^2 + s)."""
    par, q, qd = law(adaptation=0.0), (0.3, -0.2), (0.9, -0.4)
    plan, left = motion(q, qd), (-0.004, 0.001)
    known = {"damping": (0.002, 0.003), "level": (0.001, -0.002), "slope": (0.004, 0.002)}
    before = hearing(par, plan, AdaptationGains.start(None, 2), **known)
    found = adapted(par, before, plan, qd, left, FREE, 0.005)
    small, slow = REVOLUTE
    for i, joint in enumerate(found.joints):
        b, level, slope = (known[name][i] for name in ("damping", "level", "slope"))
        error = left[i] - level - slope * q[i]
        assert joint.damping == pytest.approx(b - 2.0 * 0.005 * error * qd[i] / (qd[i] ** 2 + slow), rel=1e-9)
        assert joint.level == pytest.approx(level + WEIGHT * 0.005 * error, rel=1e-9)
        assert joint.slope == pytest.approx(slope + WEIGHT * 0.005 * error * q[i] / (q[i] ** 2 + small), rel=1e-9)
        # friction acts against the motion
        assert found.feedforward.efforts[i] == pytest.approx(-joint.damping * qd[i], rel=1e-12)


@pytest.mark.parametrize("periods", [0, 2])
def test_a_plan_is_heard_as_late_as_the_observer_hears(periods):
    """A ramp through two stages lags by 2 / bandwidth and the age of the measurements."""
    par = make_centroidal(MODEL, delay=0.005 * periods).par
    learned = AdaptationGains.start(None, 2)
    for k in range(400):
        plan = motion((0.001 * k, 0.0), (0.2, 0.0))
        learned = adapted(par, learned, plan, (0.2, 0.0), (0.0, 0.0), FREE, 0.005)
    lag = (0.001 * 399 - learned.joints[0].twice.place) / 0.2
    # half of the period in which a sample is held, for each of the stages
    assert lag == pytest.approx(2.0 / 34.0 + 0.005 * periods, abs=0.006)


def test_what_an_actuator_at_its_limit_would_teach_is_not_learned():
    plan, left = motion((0.3, -0.5), (0.9, -0.4)), (-0.4, 0.3)
    par = law()
    before = hearing(
        par, plan, dataclasses.replace(AdaptationGains.start(None, 2), tip_mass=0.02), damping=(0.004, 0.003)
    )
    held, free = (adapted(par, before, plan, (0.9, -0.4), left, (1.0, f, f), 0.005) for f in (0.0, 1.0))
    assert held.tip_mass == before.tip_mass != free.tip_mass
    for name in ("damping", "level", "slope"):
        old, kept, moved = ([getattr(joint, name) for joint in each.joints] for each in (before, held, free))
        assert kept == old
        assert moved != old


def test_a_joint_that_does_not_follow_teaches_next_to_nothing():
    """A load holds joints off their plan, too: what they say counts less, not for nothing."""
    plan, left, par = motion((0.3, -0.5), (0.9, -0.4)), (-0.4, 0.3), law()
    learned = hearing(par, plan, dataclasses.replace(AdaptationGains.start(None, 2), tip_mass=0.02))
    for _ in range(400):
        learned = adapted(par, learned, plan, (-0.9, 0.4), (0.0, 0.0), (1.0, 0.0, 0.0), 0.005)
    found = adapted(par, learned, plan, (-0.9, 0.4), left, FREE, 0.005)
    assert found.tip_mass == pytest.approx(learned.tip_mass, abs=1e-4)
    dampings = [[joint.damping for joint in each.joints] for each in (found, learned)]
    assert dampings[0] == pytest.approx(dampings[1], abs=2e-4)


def test_what_is_learned_stays_within_its_bounds():
    plan, qd = motion((0.3, -0.5), (0.9, 0.9)), (0.9, 0.9)
    known = Model(vehicle=TRUTH.with_joints(damping=0.003), gravity=9.8)
    par = make_centroidal(known, adaptation=5.0, tip_mass_limit=0.2).par
    y = [float(each) for each in unit_load(TRUTH, plan).efforts]
    for sign, end in ((1.0, 0), (-1.0, 1)):
        load, friction = AdaptationGains.start(None, 2), AdaptationGains.start(None, 2)
        for _ in range(100):
            load = adapted(par, load, plan, qd, tuple(-sign * 20.0 * each for each in y), FREE, 0.005)
            friction = adapted(par, friction, plan, qd, (sign * 20.0, sign * 20.0), FREE, 0.005)
        assert load.tip_mass == pytest.approx(-sign * 0.2)
        # back to no damping at all, or to the highest
        assert [joint.damping for joint in friction.joints] == pytest.approx(
            [p[end] for p in par.parts.adaptation.damping_limits]
        )
    assert [low for low, _ in par.parts.adaptation.damping_limits] == [-0.003, -0.003]


def planned_at(scenario, time):
    """The plan of the joint mode for a vehicle that is where it should be, at a time of a scenario."""
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
    arm = zip(at.joints, at.joint_rates, at.joint_accelerations, at.joint_jerks, at.joint_snaps, strict=True)
    return [*rows, [float(at.yaw), 0.0, 0.0, 0.0, 0.0], *([float(v) for v in each] for each in arm)]


def test_the_plan_is_the_references_motion_at_the_attitude_its_force_asks_for():
    """Rate and angular acceleration by differences of the attitude along Case 3, the proper acceleration by hand."""
    scenario = dataclasses.replace(planned("case3"), initial=None)
    t, h = 9.3, 1e-3
    plan, before, after = (planned_at(scenario, at) for at in (t, t - h, t + h))
    R, R0, R1 = (np.array([array(row) for row in each.R.rows]) for each in (plan, before, after))
    spin = R.T @ (R1 - R0) / (2.0 * h)
    np.testing.assert_allclose(array(plan.rate), [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-6)
    assert np.abs(array(plan.rate)).max() > 0.002
    change = (array(after.rate) - array(before.rate)) / (2.0 * h)
    np.testing.assert_allclose(array(plan.alpha), change, atol=1e-5)
    assert np.abs(change).max() > 0.001
    acceleration = array(scenario.reference.at(t).acceleration)
    up = np.array([0.0, 0.0, scenario.controller.par.model.gravity])
    np.testing.assert_allclose(array(plan.proper), R.T @ (acceleration + up), atol=1e-12)
    assert np.abs(acceleration).max() > 0.05


@pytest.mark.parametrize("mode", sampled(["tip", "joint"], 2))
def test_what_is_learned_acts_as_what_is_observed(mode):
    """A disturbance moved from the observer's memory to what is fed forward changes nothing of a command."""
    scenario = planned("case3_wind", mode=mode)
    law, par = scenario.controller.law, scenario.controller.par
    flown = fly(scenario).memory
    observed = flown.observed
    feedforward = Disturbance(force=observed.force, torque=observed.torque, efforts=observed.efforts)
    moved = dataclasses.replace(
        with_parts(flown, adaptation=dataclasses.replace(flown.parts.adaptation, feedforward=feedforward)),
        observed=dataclasses.replace(observed, force=ZERO, torque=ZERO, efforts=(0.0, 0.0)),
        slow_force=ZERO,
    )
    none = dataclasses.replace(
        flown.parts.adaptation, feedforward=Disturbance(force=ZERO, torque=ZERO, efforts=(0.0, 0.0))
    )
    plain = with_parts(dataclasses.replace(flown, slow_force=observed.force), adaptation=none)
    reading = measurement_of(observed)
    wanted = scenario.reference.at(20.0).dense()
    one, other = (law(memory, reading, wanted, 0.005, par=par)[1] for memory in (plain, moved))
    # the slow force moves by a share of the period towards the observed one
    np.testing.assert_allclose(other.rotor_speeds, one.rotor_speeds, rtol=2e-4)
    np.testing.assert_allclose(other.efforts, one.efforts, atol=2e-4)


def test_what_is_learned_is_what_the_observer_finds_in_this_period():
    """A joint that is faster than foreseen, from a memory that knows of no disturbance."""
    scenario = planned("case3_wind")
    flown = fly(scenario).memory
    still = AdaptationGains.start(None, 2)
    calm = dataclasses.replace(flown.observed, efforts=(0.0, 0.0))
    reading = measurement_of(calm)
    pushed = dataclasses.replace(reading, joint_rates=tuple(rate + 0.1 for rate in reading.joint_rates))
    memory = with_parts(dataclasses.replace(flown, observed=calm), adaptation=still)
    wanted = scenario.reference.at(20.0).dense()
    following, _ = scenario.controller.law(memory, pushed, wanted, 0.005, par=scenario.controller.par)
    assert np.abs(following.observed.efforts).min() > 1e-4
    for joint, found in zip(following.parts.adaptation.joints, following.observed.efforts, strict=True):
        # all of it is taken for constant at first, but for what the joint's own error takes from its trust
        assert 0.5 < joint.level / (WEIGHT * 0.005 * found) <= 1.0


def measurement_of(observed):
    blank = blank_measurement(2, 4)
    names = ("position", "quaternion", "velocity", "rate", "joints", "joint_rates", "rotor_speeds")
    return dataclasses.replace(blank, time=20.0, **{name: getattr(observed, name) for name in names})


def test_the_largest_damping_is_that_of_the_joints_inertia():
    """Hanging straight, joint 2 carries link 2 alone, by Pinocchio."""
    pytest.importorskip("pinocchio")
    still = RandomState(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(2), np.zeros(8))
    M = TWINS["pinocchio"](TRUTH).mass_matrix(still)
    np.testing.assert_allclose(
        [high for _, high in law().parts.adaptation.damping_limits], STICKIEST * np.diag(M)[6:], rtol=1e-10
    )


def loaded(scenario, kg):
    vehicle = scenario.plant.vehicle.with_payload(kg)
    return dataclasses.replace(scenario, plant=dataclasses.replace(scenario.plant, vehicle=vehicle))


def dampings(flown):
    return [joint.damping for joint in flown.memory.parts.adaptation.joints]


def without(scenario, **structure):
    """The scenario without parts of the adaptation."""
    par = scenario.controller.par
    par = with_parts(par, adaptation=dataclasses.replace(par.parts.adaptation, **structure))
    return dataclasses.replace(scenario, controller=dataclasses.replace(scenario.controller, par=par))


def sticky(scenario, damping):
    vehicle = scenario.plant.vehicle.with_joints(damping=damping)
    return dataclasses.replace(scenario, plant=dataclasses.replace(scenario.plant, vehicle=vehicle))


@pytest.mark.parametrize("noisy", sampled([True, False], 2))
def test_a_payload_is_found(noisy):
    flown = fly(loaded(planned("case3_wind", mode="tip", noisy=noisy), 0.05))
    assert flown.memory.parts.adaptation.tip_mass == pytest.approx(0.05, abs=0.01)
    assert flown.mean("tip") < (1.6 if noisy else 0.2)


def test_without_a_payload_the_mass_stays_near_zero():
    assert abs(fly(planned("case3_wind", mode="tip")).memory.parts.adaptation.tip_mass) < 0.002


@pytest.mark.parametrize("noisy", sampled([True, False], 2))
def test_damping_is_found_and_no_longer_carries_the_joints_away(noisy):
    """0.02 N m s/rad cost 11 mrad without, and 40 for the slower observer under noise."""
    scenario = sticky(planned("case2", noisy=noisy), 0.02)
    found, plain = fly(scenario), fly(without(scenario, friction=False))
    np.testing.assert_allclose(dampings(found), 0.02, atol=0.003)
    # means from 10 s on, which 4 s of learning precede
    assert found.mean("joint") < (11.0 if noisy else 2.5)
    assert plain.mean("joint") > 3.5 * found.mean("joint")


def test_a_load_that_nobody_knows_is_hardly_taken_for_friction():
    """Its weight is constant in a leaning base, and else goes with the position; the truth's own is 0.001."""
    flown = fly(loaded(planned("case3_wind"), 0.05))
    assert max(dampings(flown)) < 0.004
    assert flown.mean("joint") < 1.5


@pytest.mark.parametrize("mode", ["joint", "tip"])
def test_an_oscillation_of_the_loop_teaches_nothing(mode):
    """10 ms of unknown delay make it swing; in the planned motion nothing swings."""
    scenario = planned("case3_wind", mode=mode)
    flown = fly(dataclasses.replace(scenario, delays=dataclasses.replace(scenario.delays, command=0.010)))
    assert abs(flown.memory.parts.adaptation.tip_mass) < 0.01
    assert max(dampings(flown)) < 0.01


def swinging(scenario, amplitude, hertz, duration, phase=0.0):
    arm = [Sine(amplitude=amplitude, frequency_hz=hertz, phase=each) for each in (0.0, phase)]
    return dataclasses.replace(scenario, reference=skyarm.hover([0, 0, 1], joints=arm), duration=duration)


@pytest.mark.parametrize("noisy", [False, True])
def test_slow_motion_under_a_load_is_no_friction(noisy):
    """At 0.1 Hz a high-pass would turn 50 g's weight, which goes with the position, into 0.28 N m s/rad."""
    slow = without(swinging(planned("case2", noisy=noisy), 0.4, 0.1, 40.0), load=None)
    assert max(dampings(fly(loaded(slow, 0.05)))) < 0.005


@pytest.mark.thorough
def test_fast_motion_under_a_load_stays_what_it_is_without_learning():
    """At 3 Hz the arm does not follow its plan, and what it does says nothing about it: only the joints err more."""
    fast = loaded(swinging(planned("case2", mode="tip", noisy=True), 0.06, 3.0, 20.0, phase=1.0), 0.05)
    learning, plain = fly(fast), fly(without(fast, load=None, friction=False))
    for what, most in (("base", 1.1), ("joint", 1.9), ("tip", 1.1)):
        assert learning.mean(what) < most * plain.mean(what)


@pytest.mark.thorough
def test_a_load_that_is_believed_and_not_there_is_taken_off():
    scenario = planned("case2", noisy=True)
    believed = Model(vehicle=scenario.controller.par.model.vehicle.with_payload(0.05), gravity=9.81)
    controller = make_centroidal(believed, delay=0.005)
    flown = fly(dataclasses.replace(scenario, controller=controller))
    assert flown.memory.parts.adaptation.tip_mass == pytest.approx(-0.05, abs=0.005)
    assert flown.mean("joint") < 10.0


def test_a_joint_off_its_plan_teaches_less_but_never_nothing():
    """Mean squares of 1.9 planned and 0.1 that count as slow: twice the deviation over both, inverse and squared."""
    joint = AdaptationGains.start(None, 1).joints[0]
    weights = [dataclasses.replace(joint, moving=1.9, off=off).trust(0.1) for off in (0.0, 1.0, 19.0)]
    assert weights == pytest.approx([1.0, 1 / 4, 1 / 400])


def test_how_a_joint_follows_is_a_mean_square_of_half_a_second():
    """Of a plan of 0.9 rad/s that is missed by 0.7 rad/s, after 0.1 s: shares 1 - exp(-2 * 0.1) of both squares."""
    joint = AdaptationGains.start(None, 1).joints[0]
    for _ in range(20):
        joint = joint.filtered(Regressor(load=0.0, place=0.0, rate=0.9), 0.2, 0.1, 0.005)
    assert (joint.moving, joint.off) == pytest.approx([(1.0 - np.exp(-0.2)) * each**2 for each in (0.9, 0.7)])
