"""Tuning: the cost is what its text says, a small budget repeats, the shipped factors have the cost noted."""

from __future__ import annotations

import dataclasses
import math
import re
from importlib import resources

import numpy as np
import pytest
from scipy.stats import qmc

from skyarm.control.registry import make_controller
from skyarm.control.tuned import KNOBS, tuned_factors
from skyarm.experiments import tuning
from skyarm.experiments.tuning import Budget, Judge, cost, existing, points, tune
from skyarm.experiments.tuning_flights import FLIGHTS, Course, Score
from skyarm.simulate import run
from skyarm.simulate.metrics import Errors
from skyarm.simulate.scenario_file import load_scenario

LAW = "li_feedforward_style"
SMALL = Budget(first=8, later=4, rounds=1, elite=3)


def test_points_are_scipys_sobol_sequence():
    found = points(64, 5, 1)
    wanted = qmc.Sobol(5, scramble=False, bits=32).random(128)[1:65]
    # ours sit in the middle of their cell of 2^-32
    np.testing.assert_allclose(found, wanted, atol=2.0**-32)


def test_a_small_budget_repeats_and_is_no_worse_than_the_untouched_law(tmp_path):
    first, second = tune(LAW, SMALL), tune(LAW, SMALL)
    assert first == second
    assert first.after <= first.before
    assert first.candidates == 12
    assert tuple(first.factors) == KNOBS[LAW]
    path = tmp_path / "tuned.toml"
    path.write_text('schema = 1\n\n[law.indi]  # note\n"cutoff" = 2.0\n', encoding="utf-8")
    text = tuning.document({LAW: first}, existing(path.read_text(encoding="utf-8")))
    assert set(existing(text)) == {LAW, "indi"}
    assert '"cutoff" = 2.0' in text
    assert f"cost {first.before:.3f} -> {first.after:.3f}, 12 candidates" in text


def test_the_shipped_factors_have_the_cost_that_is_noted():
    """Factors are kept to four decimals and multiplications may be fused: 0.02 of a logarithm."""
    text = resources.files("skyarm.control").joinpath("tuned.toml").read_text(encoding="utf-8")
    before, after = map(float, re.search(rf"\[law\.{LAW}\]  # cost (\S+) -> (\S+),", text).groups())
    factors = tuned_factors()[LAW]
    logs = np.array([[0.0] * len(factors), [math.log(value) for value in factors.values()]])
    np.testing.assert_allclose(Judge(LAW, KNOBS[LAW]).costs(logs), [before, after], atol=0.02)


def test_a_flights_score_is_that_of_the_logged_flight():
    """The same flight in Python: errors against the continuous reference over [10, 20) s."""
    scenario = load_scenario("case3", duration=20.0)
    score = Course(make_controller(LAW, scenario.controller.par.model)).fly(FLIGHTS["case3"], {}, noise=0.0)
    log = run(dataclasses.replace(scenario, controller=make_controller(LAW, scenario.controller.par.model)))
    inside = log.time >= 10.0
    errors = Errors.continuous(log)
    # fused multiplications move a stable flight by 1e-9 of its errors
    assert score.base[0] == pytest.approx(errors.position[inside].mean(), rel=1e-6)
    assert score.joint[0] == pytest.approx(errors.joints[inside].mean(), rel=1e-6)
    assert score.tool[0] == pytest.approx(errors.tool[inside].mean(), rel=1e-6)
    assert score.peak[0] == pytest.approx(np.abs(errors.vector[inside, 0]).max(), rel=1e-6)
    changes = np.abs(np.diff(log.rotor_commands, axis=0)).mean(axis=1)
    assert score.jitter[0] == pytest.approx(changes[inside[1:]].mean(), rel=1e-5)


def scored(**values) -> Score:
    numbers = {"base": 0.01, "joint": 0.1, "tool": 0.0, "peak": 0.0, "jitter": 0.0, **values}
    arrays = {name: np.array([value]) for name, value in numbers.items() if name != "completed"}
    return Score(**arrays, completed=np.array([values.get("completed", True)]))


def test_the_cost_is_the_logarithm_of_base_and_joint_error_at_the_arms_length():
    assert cost(scored(), noisy=False)[0] == pytest.approx(math.log(0.01 + 0.3 * 0.1 + 1e-4))
    assert cost(scored(jitter=30.0), noisy=False) == cost(scored(), noisy=False)


def test_jitter_costs_in_a_noisy_flight_beyond_15_rad_s():
    quiet = cost(scored(jitter=14.9), noisy=True)[0]
    assert quiet == cost(scored(), noisy=True)[0]
    assert cost(scored(jitter=30.0), noisy=True)[0] - quiet == pytest.approx(1.0)


def test_a_flight_that_ends_counts_as_ten_metres():
    for lost in (scored(completed=False), scored(base=math.nan), scored(base=1e6)):
        assert cost(lost, noisy=True)[0] == pytest.approx(math.log(10.0001))
