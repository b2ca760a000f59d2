"""A joint's drive: limit, viscous and smooth Coulomb friction."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skyarm.compile import trace
from skyarm.dynamics.actuators import joint_force, stop_force
from skyarm.vehicle.linkage import Joint

JOINT = Joint(name="j", effort_limit=0.5, damping=0.02, coulomb=0.03, coulomb_rate=0.1)


def test_a_resting_joint_gets_what_is_commanded():
    assert joint_force(JOINT, 0.3, 0.0) == 0.3
    assert joint_force(JOINT, -0.3, 0.0) == -0.3


def test_the_command_is_limited_on_both_sides_before_friction():
    assert joint_force(JOINT, 7.0, 0.0) == 0.5
    assert joint_force(JOINT, -7.0, 0.0) == -0.5
    # friction is no part of what the drive must give
    assert joint_force(JOINT, 7.0, -1.0) > 0.5


def test_friction_by_hand():
    # 0.02 * 0.1 + 0.03 * tanh(1), tanh(1) = 0.7615941559557649
    friction = 0.002 + 0.03 * 0.7615941559557649
    assert joint_force(JOINT, 0.0, 0.1) == pytest.approx(-friction, rel=1e-15)
    assert joint_force(JOINT, 0.0, -0.1) == pytest.approx(friction, rel=1e-15)
    assert joint_force(JOINT, 0.2, 0.1) == pytest.approx(0.2 - friction, rel=1e-15)


def test_coulomb_friction_saturates():
    """At fifty times its rate tanh is 1 to the last bit."""
    dry = Joint(name="j", coulomb=0.03, coulomb_rate=0.1)
    assert joint_force(dry, 0.0, 5.0) == -0.03
    assert joint_force(dry, 0.0, -5.0) == 0.03


def test_friction_is_smooth_through_zero():
    """Odd, with slope damping + coulomb / coulomb_rate at rest; the next term is of
    third order.
    """
    h = 1e-5
    slope = (joint_force(JOINT, 0.0, h) - joint_force(JOINT, 0.0, -h)) / (2.0 * h)
    assert slope == pytest.approx(-(0.02 + 0.03 / 0.1), rel=1e-7)
    rates = np.linspace(-0.5, 0.5, 2001)
    force = joint_force(JOINT, 0.0, rates)
    np.testing.assert_allclose(force, -force[::-1], atol=1e-16)
    assert np.all(np.diff(force) < 0.0)
    # no corner: the second difference stays below that of the sharpest bend of tanh,
    # 0.77 coulomb / rate^2
    bend = np.abs(np.diff(force, 2)) / (rates[1] - rates[0]) ** 2
    assert bend.max() <= 0.77 * 0.03 / 0.1**2 * 1.01


@given(
    rate=st.floats(-100.0, 100.0),
    damping=st.floats(0.0, 1.0),
    coulomb=st.floats(0.0, 1.0),
    coulomb_rate=st.floats(1e-3, 1.0),
)
def test_friction_only_takes_energy(rate, damping, coulomb, coulomb_rate):
    joint = Joint(name="j", damping=damping, coulomb=coulomb, coulomb_rate=coulomb_rate)
    assert joint_force(joint, 0.0, rate) * rate <= 0.0


@given(command=st.floats(-100.0, 100.0))
def test_the_drive_never_exceeds_its_limit(command):
    force = joint_force(JOINT, command, 0.0)
    assert force == max(-0.5, min(0.5, command))


def test_absent_friction_folds_away():
    free = Joint(name="j")
    assert joint_force(free, 0.25, 3.0) == 0.25
    program = trace(lambda command, rate: joint_force(free, command, rate), 0.0, 0.0)
    assert program.operations()["tanh"] == 0
    assert program.operations()["mul"] == 0
    damped = Joint(name="j", damping=0.0)  # data, kept for sweeps
    assert (
        trace(lambda c, r: joint_force(damped, c, r), 0.0, 0.0).operations()["mul"] == 1
    )


def test_a_crash_is_not_hidden_by_the_limit():
    assert math.isnan(joint_force(JOINT, math.nan, 0.0))


def test_a_batch_is_a_loop_of_singles():
    rng = np.random.default_rng(8)
    command, rate = rng.normal(size=(2, 64))
    batch = joint_force(JOINT, command, rate)
    singles = [
        joint_force(JOINT, float(c), float(r))
        for c, r in zip(command, rate, strict=True)
    ]
    # NumPy's tanh may differ from the C library's in the last bit
    np.testing.assert_allclose(batch, singles, rtol=1e-15, atol=1e-17)


@pytest.mark.parametrize(("position", "sign"), [(0.7, -1.0), (-0.6, 1.0)])
@pytest.mark.parametrize(
    ("into", "share"), [(0.0, 1.0), (2.0, 1.5), (-2.0, 0.5), (-4.0, 0.0), (-9.0, 0.0)]
)
def test_a_stop_pushes_by_hand_at_either_end(position, sign, into, share):
    """20 N m / rad over 0.1 rad is 2 N m; a quarter more or less for each rad/s into
    the stop or out of it.
    """
    stopped = Joint(
        name="j", lower=-0.5, upper=0.6, stop_stiffness=20.0, stop_damping=0.25
    )
    assert stop_force(stopped, position, -sign * into) == pytest.approx(
        2.0 * sign * share, rel=1e-12, abs=1e-12
    )
