"""The L1 law's own command, before it has estimated anything, against Pinocchio's inverse dynamics."""

from __future__ import annotations

import numpy as np
import pytest
from test_published_formulas import (
    ARM,
    SEEDS,
    UP,
    asked,
    gentle,
    geometric_alpha,
    joint_wish,
    pd_specific_force,
    rotation,
    soft,
    wanted,
)

from flown import MODEL
from skyarm.control.catalogue import make_controller
from skyarm.control.laws.published.l1 import make_l1
from vehicles_random import PinocchioTwin


@pytest.mark.parametrize("law", ["l1_adaptive", "l1_adaptive lateral"])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_first_command_is_pinocchios_inverse_dynamics_of_the_wanted_accelerations(law, seed):
    """A tilted base, a moving arm: force along body z, torque and joint efforts of base and joints as wanted."""
    controller, state, reference = soft(law), gentle(seed), wanted(seed)
    torque, thrust, efforts = asked(controller, state, reference)
    specific = pd_specific_force(controller, state, reference)
    alpha = geometric_alpha(controller, state, reference, specific)
    acceleration = np.concatenate([specific - UP, alpha, joint_wish(controller, state, reference)])
    whole = PinocchioTwin(ARM).inverse_dynamics(state, acceleration)
    assert thrust == pytest.approx(whole[:3] @ rotation(state).as_matrix()[:, 2], rel=1e-11)
    np.testing.assert_allclose(torque, whole[3:6], atol=1e-11)
    np.testing.assert_allclose(efforts, whole[6:], atol=1e-11)


def test_only_the_extended_law_leans_against_a_lateral_force():
    assert make_controller("l1_adaptive", MODEL).par.lateral is False
    assert make_l1(MODEL).par.lateral is False
    assert make_controller("l1_adaptive", MODEL, lateral=True).par.lateral is True
