"""Nothing is said against sound logs; damaged ones are named by channel and kind, or give the right numbers."""

from __future__ import annotations

import pytest

from judged_flights import DAMAGED, NAMED, REPAIRED, SOUND, accusations, verdict

pytest.importorskip("scipy", reason="needs the extra 'identify'")

pytestmark = pytest.mark.thorough

ACCUSED = {
    "hover with three joints": "rotors are said to be ordered otherwise",
    "hover with three joints, noisy": "rotors are said to be ordered otherwise",
    "three joints, slow, friction 25 % off": "signs of all joints are said to be turned",
    "two joints, encoders of 1.5 mrad, no rates": "signs of both joints are said to be turned",
    "two joints, gentle": "the sign of a joint is said to be turned",
    "two joints, pose of another clock": "the quaternion is said not to fit the gyro",
}
"""Sound logs that are accused today, and of what."""

MISSED = {
    "velocity in base axes": "silent: body drag is wrong",
    "velocity filtered": "wrong: the accelerometer's signs are said to be turned",
    "pose of another flight": "misread: the quaternion is said to be two seconds late",
    "pulses of 1100 to 1900": "silent: thrust and inertia are wrong",
    "times in ms": "wrong: the velocity is said to be in mm/s",
    "joints swapped": "silent: inertia is wrong",
    "zero of an encoder": "misread: signs of both joints are said to be turned",
    "joints 0.1 s late": "silent: inertia is wrong",
    "sign of an effort": "misread: two joints are said to be swapped",
    "start of another vehicle": "silent: thrust and inertia are wrong",
}
"""Damaged logs that are not told today, and what is said instead."""


def expected(names, failures):
    """Cases, those of which fail today marked."""
    return [
        pytest.param(name, marks=pytest.mark.xfail(strict=True, reason=failures[name])) if name in failures else name
        for name in names
    ]


@pytest.mark.parametrize("name", expected(SOUND, ACCUSED))
def test_nothing_is_said_against_a_sound_log(name):
    assert accusations(name) == []


@pytest.mark.parametrize("name", expected(DAMAGED, MISSED))
def test_a_damaged_log_is_named_or_gives_the_right_numbers(name):
    found, words = verdict(name)
    assert found in {NAMED, REPAIRED}, f"{found}: {words}"
