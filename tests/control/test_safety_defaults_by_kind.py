"""Limits that are left out are those of the table in docs/scenario_safety.md, for
turning and for sliding joints.
"""

from __future__ import annotations

import dataclasses
import math

import pytest

from skyarm.control.catalogue import make_controller
from skyarm.control.model import Model
from skyarm.control.safety.limits import limits_for
from support.laws import ARM2, MODEL, controller


def sliding():
    """The paper's vehicle with a second joint that slides along its link."""
    first, second = ARM2.links
    joint = dataclasses.replace(second.joint, kind="prismatic")
    return dataclasses.replace(
        ARM2, links=(first, dataclasses.replace(second, joint=joint))
    )


def limits(vehicle=ARM2, law="ct_ladder", **given):
    return limits_for(
        make_controller(law, Model(vehicle=vehicle, gravity=9.81)),
        stiffness=5.0,
        damping=3.0,
        **given,
    )


def test_left_out_limits_are_the_documented_ones():
    found = limits()
    assert (found.tilt, found.climb, found.speed) == (
        pytest.approx(0.70, abs=0.005),
        0.5 * 9.81,
        4.0,
    )
    assert (found.step, found.step_speed, found.joint_pole) == (0.4, 1.5, 25.0)
    assert (found.joint_step, found.joint_slew) == ((0.5, 0.5), (3.0, 3.0))
    assert (found.joint_speed, found.lost_joint_speed) == ((12.0, 12.0), (48.0, 48.0))
    assert found.trusted_tilt == pytest.approx(1.22, abs=0.005)
    assert (found.trusted_rate, found.trusted_joint_error, found.patience) == (
        12.0,
        (0.6, 0.6),
        0.25,
    )
    assert (found.lost_rate, found.lost_speed, found.calm) == (40.0, 15.0, math.inf)
    assert found.effort == tuple(link.joint.effort_limit for link in ARM2.links)
    assert found.effort_slew == tuple(
        link.joint.effort_limit / 0.005 for link in ARM2.links
    )


def test_a_sliding_joint_has_limits_in_metres():
    found = limits(sliding())
    assert (found.joint_step, found.joint_slew) == ((0.5, 0.05), (3.0, 0.3))
    assert (found.joint_speed, found.lost_joint_speed) == ((12.0, 1.5), (48.0, 6.0))
    assert found.trusted_joint_error == (0.6, 0.1)


@pytest.mark.parametrize(
    ("lower", "upper", "margin"),
    [(-2.0, 2.0, 0.05), (-0.25, 0.25, 0.05), (-0.1, 0.1, 0.02), (0.0, 0.01, 0.001)],
)
def test_a_margin_is_a_twentieth_radian_and_never_more_than_a_tenth_of_the_range(
    lower, upper, margin
):
    assert limits(
        ARM2.with_joints(lower=lower, upper=upper)
    ).joint_margin == pytest.approx((margin, margin), rel=1e-12)


@pytest.mark.parametrize(
    "given",
    [{"stiffness": 5.0}, {"damping": 3.0}, {}, {"stiffness": 5.0, "damping": 3.0}],
)
def test_what_is_not_given_of_a_laws_stiffness_is_measured_on_it(given):
    """The paper's law pulls with its own gains: kp / m and kv / m."""
    law = controller("hybrid_computed_torque", MODEL)
    found = limits_for(law, **given)
    mass = float(ARM2.mass)
    own = {
        "stiffness": law.par.gains.position.x / mass,
        "damping": law.par.gains.velocity.x / mass,
    }
    for name, value in own.items():
        assert getattr(found, name) == pytest.approx(given.get(name, value), rel=0.05)
