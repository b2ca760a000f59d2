"""What the exact law learns of a load at the tip and of friction, and what teaches it nothing."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from exact_flights import fly, planned

import skyarm
from skyarm.algebra import Mat3, Vec3
from skyarm.control.exact import make_exact
from skyarm.control.exact.adaptation import LEVEL, SLOW, SMALL, STICKIEST, adapted, first_learned, unit_load
from skyarm.control.exact.wishes import Planned
from skyarm.control.model import Model
from skyarm.scalars.taylor import Taylor
from vehicles_random import TWINS, RandomState, random_state, random_vehicle, rotation_matrix

TRUTH = skyarm.load_vehicle("hummingbird_arm2_rotors")
MODEL = Model(vehicle=TRUTH, gravity=9.8)
ZERO = Vec3(0.0, 0.0, 0.0)
FREE = (1.0, 1.0, 1.0)


def array(v):
    return np.array([float(c) for c in v])


def vec(values):
    return Vec3(*(float(v) for v in values))


def motion(angles, rates=(0.0, 0.0), accelerations=(0.0, 0.0)):
    """A level hover of the arm in motion."""
    series = tuple(Taylor.of_derivatives(each) for each in zip(angles, rates, accelerations, strict=True))
    return Planned(
        R=Mat3.identity(), rate=ZERO, alpha=ZERO, proper=Vec3(0.0, 0.0, 9.8), joints=series, references=series
    )


def law(**options):
    return make_exact(MODEL, mode="ee", **options).par


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
        references=series,
    )
    found = unit_load(vehicle, plan)
    ours = np.concatenate([array(found.force), array(found.torque), np.array(found.efforts, dtype=float)])
    np.testing.assert_allclose(ours, -needed, rtol=1e-9, atol=1e-9 * np.abs(needed).max())


def test_the_mass_moves_by_the_normalised_gradient():
    """A load dm takes torques dm y from a hovering arm of two 150 mm links: the step is rate dt dm y.y / (y.y + s)."""
    y = -9.8 * 0.15 * np.array([np.sin(0.3) + np.sin(-0.2), np.sin(-0.2)])
    before = dataclasses.replace(first_learned(2), tip_mass=0.01)
    found = adapted(law(adaptation=0.3), before, motion((0.3, -0.5)), tuple((0.05 * y).tolist()), FREE, 0.005)
    assert found.tip_mass - 0.01 == pytest.approx(0.3 * 0.005 * 0.05 * (y @ y) / (y @ y + SMALL), rel=1e-9)
    np.testing.assert_allclose(found.efforts, found.tip_mass * y, rtol=1e-12)
    np.testing.assert_allclose(array(found.force), [0.0, 0.0, -9.8 * found.tip_mass], atol=1e-15)


def test_the_damping_moves_by_the_normalised_gradient_of_each_joint():
    """Residual torque d beyond its slow mean against the reference's rate: -rate dt (d - mean) qd / (qd^2 + s)."""
    before = dataclasses.replace(first_learned(2), damping=(0.002, 0.003), level=(0.001, -0.002))
    plan, left = motion((0.0, 0.0), (0.9, -0.4)), (-0.004, 0.001)
    found = adapted(law(adaptation=0.0, friction_adaptation=2.0), before, plan, left, FREE, 0.005)
    for i, (b, mean, qd, d) in enumerate(zip(before.damping, before.level, (0.9, -0.4), left, strict=True)):
        expected = b - 2.0 * 0.005 * (d - mean) * qd / (qd * qd + SLOW["revolute"])
        assert found.damping[i] == pytest.approx(expected, rel=1e-12)
        assert found.level[i] == pytest.approx(mean + (1.0 - np.exp(-LEVEL * 0.005)) * (d - mean), rel=1e-12)
        # friction acts against the motion
        assert found.efforts[i] == pytest.approx(-expected * qd, rel=1e-12)


def test_what_an_actuator_at_its_limit_would_teach_is_not_learned():
    plan, left = motion((0.3, -0.5), (0.9, -0.4)), (-0.4, 0.3)
    before = dataclasses.replace(first_learned(2), tip_mass=0.02, damping=(0.004, 0.003), level=(0.001, -0.002))
    par = law(friction_adaptation=2.0)
    held, free = (adapted(par, before, plan, left, (1.0, f, f), 0.005) for f in (0.0, 1.0))
    for name in ("tip_mass", "damping", "level"):
        assert getattr(held, name) == getattr(before, name)
        assert getattr(free, name) != getattr(before, name)


def test_what_is_learned_stays_within_its_bounds():
    par, plan = law(adaptation=100.0, friction_adaptation=100.0, tip_mass_limit=0.2), motion((0.3, -0.5), (0.9, 0.9))
    for sign, mass, share in ((1.0, 0.0, 0.0), (-1.0, 0.2, 1.0)):
        learned = first_learned(2)
        for _ in range(200):
            # against the load's torques or with them, against the motion or with it
            y = unit_load(TRUTH, plan).efforts
            learned = adapted(par, learned, plan, tuple(-sign * 5.0 * float(e) for e in y), FREE, 0.005)
        assert learned.tip_mass == pytest.approx(mass)
        learned = first_learned(2)
        for _ in range(200):
            learned = adapted(par, learned, plan, (sign * 5.0, sign * 5.0), FREE, 0.005)
        assert learned.damping == pytest.approx(tuple(share * most for most in par.damping_limit))


def test_the_largest_damping_is_that_of_the_joints_inertia():
    """Hanging straight, joint 2 carries link 2 alone, by Pinocchio."""
    pytest.importorskip("pinocchio")
    still = RandomState(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(2), np.zeros(8))
    M = TWINS["pinocchio"](TRUTH).mass_matrix(still)
    np.testing.assert_allclose(law().damping_limit, STICKIEST * np.diag(M)[6:], rtol=1e-10)


def loaded(scenario, kg):
    vehicle = scenario.world.vehicle.with_payload(kg)
    return dataclasses.replace(scenario, world=dataclasses.replace(scenario.world, vehicle=vehicle))


def sticky(scenario, damping):
    vehicle = scenario.world.vehicle.with_joints(damping=damping)
    return dataclasses.replace(scenario, world=dataclasses.replace(scenario.world, vehicle=vehicle))


@pytest.mark.parametrize("noisy", [False, True])
def test_a_payload_is_found(noisy):
    flown = fly(loaded(planned("case3_wind", mode="ee", noisy=noisy), 0.05))
    assert flown.memory.learned.tip_mass == pytest.approx(0.05, abs=0.01)
    assert flown.mean("tip") < (1.6 if noisy else 0.2)


def test_without_a_payload_the_mass_stays_near_zero():
    assert 0.0 <= fly(planned("case3_wind", mode="ee")).memory.learned.tip_mass < 0.005


@pytest.mark.parametrize("noisy", [False, True])
def test_damping_is_found_and_no_longer_carries_the_joints_away(noisy):
    """0.02 N m s/rad cost 11 mrad without, and 40 for the slower observer under noise."""
    scenario = sticky(planned("case2", noisy=noisy), 0.02)
    without = dataclasses.replace(scenario.controller.par, adapts_friction=False)
    found = fly(scenario)
    plain = fly(dataclasses.replace(scenario, controller=dataclasses.replace(scenario.controller, par=without)))
    np.testing.assert_allclose(found.memory.learned.damping, 0.02, atol=0.002)
    # means from 10 s on, which 4 s of learning precede
    assert found.mean("joint") < (6.0 if noisy else 2.5)
    assert plain.mean("joint") > 4.0 * found.mean("joint")


def test_a_load_that_nobody_knows_is_hardly_taken_for_friction():
    """Its weight in a leaning base is constant, its inertia follows the acceleration; the truth's own is 0.001."""
    flown = fly(loaded(planned("case3_wind"), 0.05))
    assert max(flown.memory.learned.damping) < 0.006
    assert flown.mean("joint") < 1.5


@pytest.mark.parametrize("mode", ["joint", "ee"])
def test_an_oscillation_of_the_loop_teaches_nothing(mode):
    """10 ms of unknown delay make the stiff preset swing; in the planned motion nothing swings."""
    scenario = planned("case3_wind", mode=mode)
    flown = fly(dataclasses.replace(scenario, delays=dataclasses.replace(scenario.delays, command=0.010)))
    assert flown.memory.learned.tip_mass < 0.01
    assert max(flown.memory.learned.damping) < 0.01
