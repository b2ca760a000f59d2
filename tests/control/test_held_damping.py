"""Friction over a control period: an armature that makes one step of the model exact,
and how far it is believed.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.linalg import expm

import skyarm
from skyarm.control.blocks.held_damping import (
    doubted_dampings,
    held_damping,
    joint_mobilities,
    with_held_damping,
)
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.model import Model
from skyarm.records.leaves import leaves
from skyarm.reference import Constant, Sine, Trajectory
from skyarm.scenario.numbers import with_numbers
from skyarm.simulate.batch import Batch
from support.vehicles import TWINS, RandomState, random_vehicle

DT = 0.005
ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")


@pytest.mark.parametrize("x", [1e-4, 1e-3, 0.02, 0.1, 1.0, 2.0, 7.3, 30.0, 100.0])
def test_one_step_with_the_armature_is_the_exact_motion_under_a_held_effort(x):
    """I q'' = u - d q' over the period, by the exponential of its matrix."""
    inertia, rate, effort = 0.003, 1.7, 0.2
    damping = x * inertia / DT
    armature = held_damping(damping, 1.0 / inertia, DT)
    stepped = rate + DT * (effort - damping * rate) / (inertia + armature)
    exact = expm(
        DT * np.array([[-damping / inertia, effort / inertia], [0.0, 0.0]])
    ) @ [rate, 1.0]
    assert stepped == pytest.approx(
        exact[0], abs=1e-12 * max(1.0, effort * DT / inertia) + 1e-12
    )
    if x < 30.0:
        # which share of the change is left is what the sign and size of the armature
        # decide
        assert (stepped - effort / damping) / (
            rate - effort / damping
        ) == pytest.approx(np.exp(-x), abs=3e-12)


def weight(x):
    """Of the time in the period at which the friction acts."""
    return held_damping(x, 1.0 / DT, DT) / (x * DT)


def test_the_friction_acts_amid_the_period_if_slow_and_at_its_end_if_quick():
    assert weight(1e-7) == pytest.approx(0.5, abs=1e-5)
    assert weight(1e6) == pytest.approx(1.0, abs=2e-6)
    assert held_damping(0.0, 1.0 / DT, DT) == 0.0
    rows = [weight(x) for x in np.geomspace(1e-4, 1e3, 300)]
    assert np.all(np.diff(rows) > 0.0)


@pytest.mark.parametrize("seed", range(3))
def test_a_joints_mobility_is_that_of_a_vehicle_whose_other_joints_and_base_are_free(
    seed,
):
    pytest.importorskip("pinocchio")
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng, 3).with_joints(damping=50.0)
    still = RandomState(
        np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.zeros(9)
    )
    inverse = np.linalg.inv(TWINS["pinocchio"](vehicle).mass_matrix(still))
    assert joint_mobilities(vehicle, DT) == pytest.approx(
        np.diag(inverse)[6:], rel=1e-9
    )


def with_friction(*pairs):
    links = (
        dataclasses.replace(
            link,
            joint=dataclasses.replace(
                link.joint, damping=d, coulomb=c, coulomb_rate=0.1
            ),
        )
        for link, (d, c) in zip(ARM.links, pairs, strict=True)
    )
    return dataclasses.replace(ARM, links=tuple(links))


def decays(vehicle):
    free = joint_mobilities(ARM.with_joints(damping=100.0), DT)
    return [
        link.joint.damping * m * DT for link, m in zip(vehicle.links, free, strict=True)
    ]


FREE = joint_mobilities(ARM.with_joints(damping=100.0), DT)


def test_friction_is_quick_from_a_tenth_of_decay_in_a_period():
    slow, quick = (share * 0.1 / (FREE[1] * DT) for share in (0.999, 1.001))
    assert joint_mobilities(with_friction((0.0, 0.0), (slow, 0.0)), DT) == (0, 0)
    assert joint_mobilities(with_friction((0.0, 0.0), (quick, 0.0)), DT) == (0, FREE[1])
    # dry friction by its slope at rest, and both together
    assert joint_mobilities(with_friction((0.0, 0.0), (0.0, 0.1 * quick)), DT) == (
        0,
        FREE[1],
    )
    assert joint_mobilities(with_friction((0.0, 0.0), (0.0, 0.1 * slow)), DT) == (0, 0)
    assert joint_mobilities(
        with_friction((0.0, 0.0), (0.6 * quick, 0.04 * quick)), DT
    ) == (0, FREE[1])
    assert joint_mobilities(ARM.with_joints(damping=0.0), DT) == (0, 0)
    assert joint_mobilities(skyarm.load_vehicle("hummingbird"), DT) == ()
    # a longer period makes it quicker
    assert joint_mobilities(with_friction((0.0, 0.0), (slow, 0.0)), 2.0 * DT) == (
        0,
        FREE[1],
    )


def test_a_model_has_the_armature_of_its_quick_joints_alone():
    vehicle = with_friction((0.0005, 0.0), (0.004, 0.002))
    mobilities = joint_mobilities(vehicle, DT)
    assert (mobilities[0], mobilities[1] > 0) == (0, True)
    own = dataclasses.replace(
        vehicle.links[1],
        joint=dataclasses.replace(vehicle.links[1].joint, armature=0.01),
    )
    vehicle = dataclasses.replace(vehicle, links=(vehicle.links[0], own))
    held = with_held_damping(Model(vehicle=vehicle), mobilities, DT).vehicle
    assert held.links[0] == vehicle.links[0]
    joint, x = held.links[1].joint, 0.004 * mobilities[1] * DT
    exact = (1.0 / (1.0 - np.exp(-x)) - 1.0 / x) * DT * 0.004
    assert joint.armature == pytest.approx(0.01 + exact, rel=1e-12)
    # dry friction stops a joint within a period at most: its rate is c h / I
    assert joint.coulomb_rate == pytest.approx(max(0.1, 0.002 * mobilities[1] * DT))
    assert joint.coulomb_rate > 0.1
    assert (joint.damping, joint.coulomb) == (0.004, 0.002)
    # a gentle one keeps its own
    gentle = with_held_damping(
        Model(vehicle=with_friction((0.0, 0.0), (0.004, 1e-4))), mobilities, DT
    ).vehicle
    assert gentle.links[1].joint.coulomb_rate == 0.1
    plain = Model(vehicle=vehicle)
    assert with_held_damping(plain, (0, 0), DT) is plain


def test_damping_is_doubted_beyond_the_harmless_and_up_to_the_sure():
    unit = 1.0 / (FREE[1] * DT)
    for decay, doubted in (
        (0.0, 0.0),
        (0.999 * 0.1, 0.0),
        (1.001 * 0.1, 0.001 * 0.1),
        (1.0, 1.0 - 0.1),
        (0.999 * 5.0, 0.999 * 5.0 - 0.1),
        (1.001 * 5.0, 0.0),
        (50.0, 0.0),
    ):
        vehicle = with_friction((0.0, 0.0), (decay * unit, 0.0))
        found = doubted_dampings(vehicle, (0, FREE[1]), DT)
        assert found == pytest.approx((0.0, doubted * unit), abs=1e-12 * unit)
        assert doubted_dampings(vehicle, (0, 0), DT) == (0.0, 0.0)
    # numbers of few bits: sure from 5 to the bit on
    assert doubted_dampings(
        with_friction((4.9375, 0.0), (5.0, 0.0)), (1.0, 1.0), 1.0
    ) == (4.9375 - 0.1, 0.0)


def law(damping, **more):
    return make_centroidal(
        Model(vehicle=ARM.with_joints(damping=damping), gravity=9.81), **more
    )


@pytest.mark.parametrize("damping", [0.0, 0.003, 0.02, 0.2, 1.0])
def test_the_models_joints_and_what_is_learned_have_the_stated_damping_at_first(
    damping,
):
    controller = law(damping)
    gains, memory = controller.par.parts.adaptation, controller.memory.parts.adaptation
    begun = [joint.damping for joint in memory.joints]
    assert begun == list(gains.doubted)
    changed = gains.adjust_gains(memory, controller.par, DT).model.vehicle
    inside, rest = gains.split_damping(memory.joints)
    for link, more, own, doubted in zip(
        changed.links, rest, inside, gains.doubted, strict=True
    ):
        assert link.joint.damping + more == pytest.approx(damping, rel=1e-12, abs=1e-15)
        assert link.joint.damping == pytest.approx(
            damping - doubted + own, rel=1e-12, abs=1e-15
        )
    for (low, high), doubted in zip(gains.damping_limits, gains.doubted, strict=True):
        # back to no damping at all; what is begun with is within the bounds
        assert low == pytest.approx(doubted - damping, abs=1e-15)
        assert high >= doubted
    assert (max(gains.doubted) > 0.0) == (damping in (0.003, 0.02, 0.2))


def hovering(damping, duration=0.3, **more):
    found = skyarm.load_scenario("case3", duration=duration)
    return dataclasses.replace(found, controller=law(damping, **more))


PATHS = [
    f"controller.model.vehicle.links.{i}.joint.damping" for i, _ in enumerate(ARM.links)
]


@pytest.mark.parametrize("damping", [0.0, 0.02, 1.0])
def test_a_law_whose_model_is_changed_in_its_friction_is_that_made_for_it(damping):
    """Constants and memory, number by number."""
    changed = with_numbers(hovering(0.003), dict.fromkeys(PATHS, damping)).controller
    anew = hovering(damping).controller
    assert leaves(changed.par.parts) == pytest.approx(leaves(anew.par.parts), rel=1e-12)
    assert changed.par.mobilities == pytest.approx(anew.par.mobilities, rel=1e-12)
    assert leaves(changed.par) == pytest.approx(leaves(anew.par), rel=1e-12)
    assert leaves(changed.memory) == pytest.approx(leaves(anew.memory), rel=1e-12)


def test_a_batch_over_the_models_friction_flies_as_one_law_after_the_other():
    """Slow friction, of one joint quick, of both; of a vehicle in motion that has the
    last.
    """
    swing = Sine(amplitude=0.3, frequency_hz=2.0)
    scenario = dataclasses.replace(
        hovering(0.003), reference=Trajectory(z=Constant(1.0), joints=(swing, swing))
    )
    sticky = dataclasses.replace(
        scenario.plant, vehicle=scenario.plant.vehicle.with_joints(damping=0.02)
    )
    scenario, values = (
        dataclasses.replace(scenario, plant=sticky),
        np.array([0.001, 0.004, 0.02]),
    )
    flown, alone = (
        Batch(scenario, PATHS, effort=0, log_every=1).fly(dict.fromkeys(PATHS, values)),
        [],
    )
    for i, damping in enumerate(values):
        alone.append(
            skyarm.run(
                dataclasses.replace(scenario, controller=law(float(damping)))
            ).joints
        )
        found = np.stack([np.asarray(q)[i] for q in flown.log.state.joints], axis=-1)
        np.testing.assert_allclose(found, alone[-1], atol=1e-9)
    assert min(np.abs(alone[2] - each).max() for each in alone[:2]) > 1e-4
