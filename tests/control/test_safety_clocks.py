"""The two clocks of the safety layer's doubt, period by period: what starts, resets and
stops each of them.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import Quaternion
from skyarm.control.safety.limits import limits_for
from skyarm.control.safety.recovery import Confidence, update_confidence
from support.laws import cases, controller, vec

DT = 0.01
LIMITS = limits_for(
    controller("hybrid_computed_torque"),
    patience=0.095,
    calm=0.195,
    trusted_tilt=1.0,
    trusted_rate=5.0,
    trusted_joint_error=[0.3, 0.4],
    lost_rate=20.0,
    lost_speed=6.0,
    lost_joint_speed=[30.0, 40.0],
)
"""Patience of nine periods and calm of nineteen, each half a period off, so that
rounding of a sum does not matter."""

NONE = Confidence(given_up=0.0, outside=0.0, calm=0.0)
GIVEN_UP = Confidence(given_up=1.0, outside=0.0, calm=0.0)
JOINTS = (0.2, -0.1)


def tilted(*angles):
    x, y, z, w = Rotation.from_rotvec(angles).as_quat()
    return Quaternion(w, x, y, z)


def reading(**changes):
    """A vehicle that hovers with its joints on their references, but for what is
    changed.
    """
    still = cases(1, seed=1)[0].measurement()
    zero = vec(np.zeros(3))
    calm = {
        "quaternion": tilted(0.0, 0.0, 0.7),
        "velocity": zero,
        "rate": zero,
        "joints": JOINTS,
    }
    return dataclasses.replace(still, **({**calm, "joint_rates": (0.0, 0.0)} | changes))


def along(axis, value):
    return vec(value * np.eye(3)[axis])


BEYOND = {
    **{
        f"tilt {axis}": {"quaternion": tilted(*(1.02 * np.eye(3)[axis]))}
        for axis in (0, 1)
    },
    "tilt both": {"quaternion": tilted(-0.75, 0.75, 0.0)},
    **{
        f"rate {axis}": {"rate": along(axis, sign * 5.1)}
        for axis, sign in enumerate((1, -1, 1))
    },
    "rate all": {"rate": vec([3.0, -3.0, 3.0])},
    "joint 0": {"joints": (0.2 + 0.31, -0.1)},
    "joint 0 down": {"joints": (0.2 - 0.31, -0.1)},
    "joint 1": {"joints": (0.2, -0.1 + 0.41)},
    "joint 1 down": {"joints": (0.2, -0.1 - 0.41)},
}
"""Each alone is beyond trust, and only just: nothing of it is calm or lost because of
another limit."""

WITHIN = {
    **{
        f"tilt {axis}": {"quaternion": tilted(*(-0.98 * np.eye(3)[axis]))}
        for axis in (0, 1)
    },
    **{f"rate {axis}": {"rate": along(axis, 4.9)} for axis in range(3)},
    "joints": {"joints": (0.2 - 0.29, -0.1 + 0.39)},
    "speed": {"velocity": vec([3.0, -3.0, 3.0])},
    "joint rates": {"joint_rates": (29.0, -39.0)},
}

LOST = {
    **{f"rate {axis}": {"rate": along(axis, -20.1)} for axis in range(3)},
    **{f"speed {axis}": {"velocity": along(axis, 6.1)} for axis in range(3)},
    "joint rate 0": {"joint_rates": (30.1, 0.0)},
    "joint rate 0 back": {"joint_rates": (-30.1, 0.0)},
    "joint rate 1": {"joint_rates": (0.0, 40.1)},
    "joint rate 1 back": {"joint_rates": (0.0, -40.1)},
}

RESTLESS = {
    **{
        f"tilt {axis}": {"quaternion": tilted(*(math.radians(15.5) * np.eye(3)[axis]))}
        for axis in (0, 1)
    },
    **{
        f"rate {axis}": {"rate": along(axis, sign * 1.02)}
        for axis, sign in enumerate((1, -1, -1))
    },
    **{
        f"speed {axis}": {"velocity": along(axis, sign * 0.51)}
        for axis, sign in enumerate((-1, 1, 1))
    },
    "joint rate 0": {"joint_rates": (1.02, 0.0)},
    "joint rate 0 back": {"joint_rates": (-1.02, 0.0)},
    "joint rate 1": {"joint_rates": (0.0, 1.02)},
    "joint rate 1 back": {"joint_rates": (0.0, -1.02)},
}
"""Trusted all of them, and none of them calm."""

CALM = {
    **{
        f"tilt {axis}": {"quaternion": tilted(*(math.radians(14.5) * np.eye(3)[axis]))}
        for axis in (0, 1)
    },
    **{f"rate {axis}": {"rate": along(axis, 0.98)} for axis in range(3)},
    **{f"speed {axis}": {"velocity": along(axis, 0.49)} for axis in range(3)},
    "joint rates": {"joint_rates": (0.98, -0.98)},
    "joints away": {"joints": (0.2 + 0.29, -0.1 - 0.39)},
}


def after(doubt, changes, periods, *, failed=False):
    for _ in range(periods):
        doubt = update_confidence(LIMITS, doubt, reading(**changes), JOINTS, failed, DT)
    return doubt


@pytest.mark.parametrize("name", BEYOND)
def test_a_law_is_given_up_after_its_patience_and_one_good_period_begins_it_anew(name):
    nine = after(NONE, BEYOND[name], 9)
    assert nine.given_up == 0.0
    assert nine.outside == pytest.approx(0.09)
    assert after(nine, BEYOND[name], 1).given_up == 1.0
    good = after(nine, {}, 1)
    assert (good.outside, good.given_up) == (0.0, 0.0)
    again = after(good, BEYOND[name], 9)
    assert (again.outside, again.given_up) == (pytest.approx(0.09), 0.0)
    assert after(again, BEYOND[name], 1).given_up == 1.0


@pytest.mark.parametrize("name", WITHIN)
def test_what_is_within_trust_never_wears_patience_out(name):
    assert after(NONE, WITHIN[name], 30) == NONE


def test_two_reasons_in_turn_wear_one_patience_out():
    doubt = NONE
    for name in list(BEYOND)[:9]:
        doubt = after(doubt, BEYOND[name], 1)
    assert doubt.outside == pytest.approx(0.09)
    assert after(doubt, BEYOND["joint 1 down"], 1).given_up == 1.0


@pytest.mark.parametrize("name", LOST)
def test_a_law_that_is_lost_is_given_up_at_once(name):
    assert after(NONE, LOST[name], 1).given_up == 1.0
    held = {key: value for key, value in LOST[name].items() if key != "rate"}
    if held:
        assert after(NONE, held, 1).outside == 0.0


def test_a_law_that_fails_is_given_up_at_once_and_stays_so():
    assert after(NONE, {}, 1, failed=True) == dataclasses.replace(GIVEN_UP, calm=0.0)
    assert after(NONE, {}, 1, failed=False) == NONE


@pytest.mark.parametrize("name", CALM)
def test_a_calm_recovery_gives_the_vehicle_back_after_its_time(name):
    nineteen = after(GIVEN_UP, CALM[name], 19)
    assert nineteen.given_up == 1.0
    assert nineteen.calm == pytest.approx(0.19)
    # while the law flies nothing is counted
    assert after(nineteen, CALM[name], 1) == NONE
    assert after(nineteen, CALM[name], 5) == NONE


@pytest.mark.parametrize("name", RESTLESS)
def test_one_restless_period_begins_the_calm_anew(name):
    nineteen = after(GIVEN_UP, {}, 19)
    shaken = after(nineteen, RESTLESS[name], 1)
    assert (shaken.given_up, shaken.calm, shaken.outside) == (1.0, 0.0, 0.0)
    assert after(shaken, {}, 19).given_up == 1.0
    assert after(shaken, {}, 20).given_up == 0.0


def test_a_law_given_up_again_waits_as_long_as_the_first_time():
    back = after(GIVEN_UP, {}, 20)
    assert back == NONE
    flown = after(back, {}, 3)
    assert flown == NONE
    again = after(flown, {}, 1, failed=True)
    assert again == GIVEN_UP
    assert after(again, {}, 19).given_up == 1.0
    assert after(again, {}, 20).given_up == 0.0


def test_while_a_law_is_doubted_calm_gives_nothing_back():
    """Joints off their references are no motion: the recovery is calm, and the law is
    not trusted.
    """
    away = {"joints": (0.2 + 0.31, -0.1)}
    doubt = after(GIVEN_UP, away, 30)
    assert doubt.given_up == 1.0
    assert doubt.calm == pytest.approx(0.3)
    assert doubt.outside == pytest.approx(0.3)
    assert after(doubt, {}, 1) == NONE
    # and calm that is long enough comes to nothing in a period in which the law fails
    assert after(doubt, {}, 1, failed=True).given_up == 1.0
