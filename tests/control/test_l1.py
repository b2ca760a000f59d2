"""The L1 law's own command, before it has estimated anything, against Pinocchio's
inverse dynamics.

L1's low-pass filters, their limits and what of them reaches the command, against NumPy
and Pinocchio.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from published_laws import (
    ARM,
    DT,
    SEEDS,
    UP,
    asked,
    gentle,
    geometric_alpha,
    joint_wish,
    measured,
    pd_specific_force,
    rotation,
    soft,
    vec,
    wanted,
)

from skyarm.algebra import Force, Vec3
from skyarm.control.catalogue import make_controller
from skyarm.control.laws.published.l1 import _advance_filters, _command, make_l1
from skyarm.control.model import Model
from support.laws import MODEL, pushes, replaced, scalars
from support.vehicles import PinocchioTwin


@pytest.mark.parametrize("law", ["l1_adaptive", "l1_adaptive lateral"])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_first_command_is_pinocchios_inverse_dynamics_of_wanted_accelerations(
    law, seed
):
    """A tilted base, a moving arm: force along body z, torque and joint efforts of base
    and joints as wanted.
    """
    controller, state, reference = soft(law), gentle(seed), wanted(seed)
    torque, thrust, efforts = asked(controller, state, reference)
    specific = pd_specific_force(controller, state, reference)
    alpha = geometric_alpha(controller, state, reference, specific)
    acceleration = np.concatenate(
        [specific - UP, alpha, joint_wish(controller, state, reference)]
    )
    whole = PinocchioTwin(ARM).inverse_dynamics(state, acceleration)
    assert thrust == pytest.approx(
        whole[:3] @ rotation(state).as_matrix()[:, 2], rel=1e-11
    )
    np.testing.assert_allclose(torque, whole[3:6], atol=1e-11)
    np.testing.assert_allclose(efforts, whole[6:], atol=1e-11)


def test_only_the_extended_law_leans_against_a_lateral_force():
    assert make_controller("l1_adaptive", MODEL).par.lateral is False
    assert make_l1(MODEL).par.lateral is False
    assert make_controller("l1_adaptive", MODEL, lateral=True).par.lateral is True


pytest.importorskip("pinocchio")

BANDS = {
    "thrust_filter": 3.0,
    "torque_filter": 7.0,
    "second_filter": 19.0,
    "joint_filter": 11.0,
    "lateral_filter": 1.5,
}
"""rad/s: no two alike, so that a filter of the wrong one shows."""

EFFORTS = (0.3, 0.5)
"""N m, limits of the two joints."""


def limited_arm():
    links = tuple(
        dataclasses.replace(
            link, joint=dataclasses.replace(link.joint, effort_limit=most)
        )
        for link, most in zip(ARM.links, EFFORTS, strict=True)
    )
    return dataclasses.replace(ARM, links=links)


def law_with_filters(name="l1_adaptive", vehicle=ARM):
    return replaced(soft(name, vehicle, **BANDS), force_limit=2.0, torque_limit=0.04)


def memory_of(law, rng, scale):
    """A memory whose every filter stands somewhere else."""
    force, torque, twice = (
        vec(scale * size * rng.normal(size=3)) for size in (1.0, 0.02, 0.02)
    )
    efforts, efforts_twice = (
        tuple((scale * 0.1 * rng.normal(size=2)).tolist()) for _ in range(2)
    )
    return dataclasses.replace(
        law.memory,
        force=force,
        thrust=float(scale * rng.normal()),
        torque=torque,
        torque_twice=twice,
        efforts=efforts,
        efforts_twice=efforts_twice,
    )


def values(of):
    """A number, a vector or a row as an array."""
    return scalars(of) if np.iterable(of) else np.array([of])


def low_pass(old, new, bandwidth, limit):
    """What is left of the old value after a period, and the limit."""
    left, old, new, limit = (
        np.exp(-bandwidth * DT),
        *(values(each) for each in (old, new, limit)),
    )
    return np.clip(left * old + (1.0 - left) * new, -limit, limit)


@pytest.mark.parametrize("scale", [0.1, 1.0, 1e4])
@pytest.mark.parametrize("seed", range(4))
def test_each_estimate_goes_through_its_own_filters_and_stops_at_its_own_limit(
    seed, scale
):
    law, rng = law_with_filters(vehicle=limited_arm()), np.random.default_rng(seed)
    memory, R = memory_of(law, rng, min(scale, 0.3)), rotation(gentle(seed)).as_matrix()
    torque, force, efforts = (
        0.1 * scale * rng.normal(size=3),
        scale * rng.normal(size=3),
        scale * rng.normal(size=2),
    )
    attitude = measured(gentle(seed)).quaternion.rotation()
    found = _advance_filters(
        memory,
        attitude,
        Force(vec(torque), vec(force)),
        tuple(efforts.tolist()),
        DT,
        law.par,
    )
    once = low_pass(memory.torque, torque, 7.0, 0.04)
    arm = low_pass(memory.efforts, efforts, 11.0, EFFORTS)
    expected = {
        "thrust": low_pass(memory.thrust, force[2], 3.0, 2.0),
        "force": low_pass(memory.force, R @ force, 1.5, 2.0),
        "torque": once,
        "torque_twice": low_pass(memory.torque_twice, once, 19.0, 0.04),
        "efforts": arm,
        "efforts_twice": low_pass(memory.efforts_twice, arm, 19.0, EFFORTS),
    }
    # rounding of one filter step, of estimates up to 1e4
    for name, value in expected.items():
        np.testing.assert_allclose(
            values(getattr(found, name)), value, rtol=1e-11, atol=1e-13, err_msg=name
        )
    if scale == 1e4:
        # each group is at its limit: the limits are part of what is tested
        assert abs(found.thrust) == 2.0
        assert np.abs(scalars(found.force)).max() == 2.0
        assert np.abs(scalars(found.torque)).max() == 0.04
        assert np.abs(scalars(found.efforts)).tolist() == list(EFFORTS)


@pytest.mark.parametrize("lateral", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_the_command_is_the_geometric_law_less_what_was_filtered_twice(seed, lateral):
    law = law_with_filters("l1_adaptive lateral" if lateral else "l1_adaptive")
    state, reference = gentle(seed), wanted(seed)
    memory = memory_of(law, np.random.default_rng(seed), 0.5)
    R = measured(state).quaternion.rotation()
    command = _command(memory, measured(state), reference, R, law.par)
    assert min(command.rotor_speeds) > 0.0
    torque, thrust = pushes(ARM, command)

    base, b3 = (
        pd_specific_force(law, state, reference),
        rotation(state).as_matrix()[:, 2],
    )
    force = scalars(memory.force)
    # against the force across body z the attitude leans, and nothing else
    up = base - (force - b3 * (force @ b3)) / float(ARM.mass) if lateral else base
    alpha = geometric_alpha(law, state, reference, up)
    at_rest = dataclasses.replace(
        state, velocity=np.concatenate([np.zeros(3), state.velocity[3:]])
    )
    whole = PinocchioTwin(ARM).inverse_dynamics(
        at_rest, np.concatenate([base - UP, alpha, joint_wish(law, state, reference)])
    )
    np.testing.assert_allclose(
        torque, whole[3:6] - scalars(memory.torque_twice), atol=1e-11
    )
    np.testing.assert_allclose(
        scalars(command.efforts), whole[6:] - scalars(memory.efforts_twice), atol=1e-11
    )
    assert thrust == pytest.approx(whole[:3] @ b3 - memory.thrust, rel=1e-11)


def test_l1_compensates_the_torque_of_a_quarter_of_the_weight_on_its_longest_arm():
    """Rotors at unlike distances, the farthest neither first nor last nor along an
    axis.
    """
    places = [
        (0.2, 0.0, 0.0),
        (0.0, 0.25, 0.01),
        (-0.3, 0.1, -0.05),
        (0.02, -0.18, 0.0),
    ]
    rotors = tuple(
        dataclasses.replace(rotor, position=Vec3(*place))
        for rotor, place in zip(ARM.rotors, places, strict=True)
    )
    vehicle = dataclasses.replace(ARM, rotors=rotors)
    par = make_controller("l1_adaptive", Model(vehicle=vehicle, gravity=3.7)).par
    weight = 3.7 * sum(float(body.mass) for body in vehicle.bodies)
    assert par.force_limit == pytest.approx(weight / 2.0, rel=1e-12)
    assert par.torque_limit == pytest.approx(
        weight / 4.0 * np.sqrt(0.3**2 + 0.1**2 + 0.05**2), rel=1e-12
    )


def test_the_law_keeps_what_its_filters_made_and_sends_the_command_of_that():
    """One step of the law from its first memory, where the estimates are zero: the
    filters only decay.
    """
    law, state, reference = law_with_filters(), gentle(5), wanted(5)
    memory = memory_of(law, np.random.default_rng(2), 0.5)
    found, command = law.law(memory, measured(state), reference, DT, par=law.par)
    R = measured(state).quaternion.rotation()
    assert (
        command == found.sent == _command(found, measured(state), reference, R, law.par)
    )
    assert found.started == 1.0
    for name, bandwidth in (("force", 1.5), ("torque", 7.0), ("efforts", 11.0)):
        decayed = scalars(getattr(memory, name)) * np.exp(-bandwidth * DT)
        np.testing.assert_allclose(
            scalars(getattr(found, name)), decayed, rtol=1e-12, err_msg=name
        )
    assert (found.quaternion, found.joints) == (
        measured(state).quaternion,
        measured(state).joints,
    )
    np.testing.assert_allclose(found.measured[3:6], state.velocity[3:6])
