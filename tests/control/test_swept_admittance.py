"""Numbers of an admittance that a sweep sets: those that its table takes, and no
others.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import scenario_from

M, D, K = 1.0, 6.0, 9.0


def given(last):
    """A hexarotor whose tip gives way along x and y, and along z where a mass is given
    there.
    """
    law = {
        "mass": [M, M, last],
        "damping": [D, D, D * last / M],
        "stiffness": [K, K, K * last / M],
    }
    return scenario_from(
        {
            "name": "swept",
            "duration": 1.0,
            "plant": {"vehicle": "hexarotor_arm6"},
            "controller": {"law": "centroidal", "mode": "tip", "admittance": law},
            "reference": {
                "base": {"kind": "signals", "z": 1.5},
                "joints": [0.0, -0.6, -0.97, 0.0, -0.8, 0.0],
            },
        }
    )


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (
            "inertia.0",
            0.0,
            r"admittance\.tip\.inertia\[0\] = 0\.0: must be from 0\.01 to 1000",
        ),
        (
            "inertia.0",
            1e-3,
            r"tip\.inertia\[0\] = 0\.001: must be 0 or from 0\.01 to 1000",
        ),
        (
            "damping.0",
            51.0,
            r"tip\.damping\[0\] = 51\.0: must be at most 50 1/s times the inertia",
        ),
        (
            "stiffness.0",
            1e9,
            r"stiffness\[0\] = 1000000000\.0: must be at most \(50 rad/s\)\^2 times",
        ),
        (
            "stiffness.0",
            math.nan,
            r"tip\.stiffness\[0\] = nan: must be a finite number",
        ),
        (
            "stiffness.2",
            3.0,
            (
                r"tip\.stiffness\[2\] = 3\.0: must be 0 along an axis of inertia 0,"
                r" which is held"
            ),
        ),
    ],
)
def test_numbers_of_a_sweep_that_a_table_refuses_are_refused(path, value, words):
    with pytest.raises(ValueError, match=words) as caught:
        with_numbers(given(0.0), {f"controller.parts.admittance.tip.{path}": value})
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("controller.parts.admittance.")


def test_numbers_of_a_sweep_that_a_table_takes_are_taken_together():
    scenario, at = given(0.0), "controller.parts.admittance.tip"
    varied = with_numbers(
        scenario,
        {f"{at}.inertia.0": 2.0, f"{at}.stiffness.0": 5000.0, f"{at}.damping.0": 100.0},
    )
    assert varied.controller.par.parts.admittance.tip.stiffness == (5000.0, K, 0)
    lanes = with_numbers(scenario, {f"{at}.inertia.0": np.array([1.0, 2.0])})
    assert lanes.controller.par.parts.admittance.tip.inertia[0].shape == (2,)
    par = scenario.controller.par
    assert restore(plain(par)) == par
