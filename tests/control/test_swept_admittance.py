"""Numbers of an admittance that a sweep sets: those that its table takes, and no others."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import scenario_from

J, D, K = 0.05, 0.3, 0.45


def given(last):
    """A hexarotor whose tip gives way along x and about x and y, and about z where an inertia is given there."""
    ratio = last / J
    turns = {"inertia": [J, J, last], "damping": [D, D, D * ratio], "stiffness": [K, K, K * ratio]}
    along = {"mass": [1.0, 0.0, 0.0], "damping": [6.0, 0.0, 0.0], "stiffness": [9.0, 0.0, 0.0]}
    return scenario_from(
        {
            "name": "swept",
            "duration": 1.0,
            "plant": {"vehicle": "hexarotor_arm6"},
            "controller": {"law": "centroidal", "mode": "tip", "admittance": {**along, "rotation": turns}},
            "reference": {"base": {"kind": "signals", "z": 1.5}, "joints": [0.0, -0.6, -0.97, 0.0, -0.8, 0.0]},
        }
    )


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("rotation.arm.length", 0.0, r"rotation\.arm\.length = 0\.0: must be at least 0\.001"),
        ("rotation.arm.length", 1e-200, r"rotation\.arm\.length = 1e-200: must be at least 0\.001"),
        ("rotation.arm.idle", -0.02, r"rotation\.arm\.idle = -0\.02: must be at least 0\.0001"),
        ("rotation.arm.idle", 0.0, r"rotation\.arm\.idle = 0\.0: must be at least 0\.0001"),
        ("rotation.body.inertia.0", 0.0, r"rotation\.body\.inertia\[0\] = 0\.0: must be from 0\.001 to 100"),
        ("rotation.body.inertia.1", 9e-4, r"body\.inertia\[1\] = 0\.0009: must be 0 or from 0\.001 to 100"),
        ("rotation.body.inertia.1", 101.0, r"body\.inertia\[1\] = 101\.0: must be 0 or from 0\.001 to 100"),
        ("rotation.body.damping.2", 2.6, r"body\.damping\[2\] = 2\.6: must be at most 50 1/s times the inertia"),
        ("rotation.body.stiffness.0", 1e9, r"stiffness\[0\] = 1000000000\.0: must be at most \(50 rad/s\)\^2 times"),
        ("rotation.body.stiffness.0", math.nan, r"body\.stiffness\[0\] = nan: must be a finite number"),
        ("tip.inertia.0", 0.0, r"admittance\.tip\.inertia\[0\] = 0\.0: must be from 0\.01 to 1000"),
        ("tip.inertia.0", 1e-3, r"tip\.inertia\[0\] = 0\.001: must be 0 or from 0\.01 to 1000"),
        ("tip.damping.0", 51.0, r"tip\.damping\[0\] = 51\.0: must be at most 50 1/s times the inertia"),
        ("tip.stiffness.1", 3.0, r"tip\.stiffness\[1\] = 3\.0: must be 0 along an axis of inertia 0, which is held"),
    ],
)
def test_numbers_of_a_sweep_that_a_table_refuses_are_refused(path, value, words):
    scenario = given(J)
    with pytest.raises(ValueError, match=words) as caught:
        with_numbers(scenario, {f"controller.parts.admittance.{path}": value})
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("controller.parts.admittance.")


def test_numbers_of_a_sweep_that_a_table_takes_are_taken_together():
    scenario = given(0.0)
    at = "controller.parts.admittance.rotation.body"
    varied = with_numbers(scenario, {f"{at}.inertia.0": 1.0, f"{at}.stiffness.0": 2500.0, f"{at}.damping.0": 50.0})
    assert varied.controller.par.parts.admittance.rotation.body.stiffness == (2500.0, K, 0)
    assert (
        with_numbers(scenario, {f"{at}.stiffness.0": 0.0}).controller.par.parts.admittance.rotation.body.inertia[2] == 0
    )
    lanes = with_numbers(scenario, {f"{at}.inertia.0": np.array([0.05, 0.1])})
    assert lanes.controller.par.parts.admittance.rotation.body.inertia[0].shape == (2,)
    par = scenario.controller.par
    assert restore(plain(par)) == par


def test_the_table_of_turning_that_the_page_shows_is_one():
    page = (Path(__file__).parents[2] / "docs" / "giving_way.md").read_text("utf-8")
    (shown,) = re.findall(r"^```toml\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    document = {
        "name": "turned",
        "duration": 1.0,
        "plant": {"vehicle": "hexarotor_arm6"},
        "reference": {"base": {"kind": "signals", "z": 1.5}, "joints": [0.0, -0.6, -0.97, 0.0, -0.8, 0.0]},
    }
    law = {"law": "centroidal", "mode": "tip", **tomllib.loads(shown)["controller"]}
    gains = scenario_from({**document, "controller": law}).controller.par.parts.admittance
    assert [float(each) for each in gains.rotation.body.inertia] == [J] * 3
    assert [float(each) for each in gains.rotation.body.stiffness] == [K] * 3
