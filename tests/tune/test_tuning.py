"""Tuning: the cost is what its text says, a small budget repeats, the shipped factors have the cost noted."""

from __future__ import annotations

import math
import re
from collections import Counter
from importlib import resources

import numpy as np
import pytest
from scipy.stats import qmc

from log_metrics import Errors
from skyarm.compare.suite import CASES, PAPER_CASES, conditions
from skyarm.control.catalogue import KNOBS, make_controller, rescale, tuned_factors
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate import run
from skyarm.tune import candidate_costs
from skyarm.tune import procedure as tuning
from skyarm.tune.candidate_costs import FULL, Judge, cost, untuned
from skyarm.tune.one_law import Alone, scored
from skyarm.tune.procedure import ONE_BY_ONE, Budget, budget_of, existing, points, tune
from skyarm.tune.trials import Score, Together, Trial

LAW = "li2024"
SMALL = Budget(first=8, later=4, rounds=1, elite=3)


def test_points_are_scipys_sobol_sequence():
    found = points(64, 5, 1)
    wanted = qmc.Sobol(5, scramble=False, bits=32).random(128)[1:65]
    # ours sit in the middle of their cell of 2^-32
    np.testing.assert_allclose(found, wanted, atol=2.0**-32)


@pytest.mark.thorough
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


@pytest.mark.thorough
def test_the_shipped_factors_have_the_cost_that_is_noted():
    """Factors are kept to four decimals and multiplications may be fused: 0.02 of a logarithm."""
    text = resources.files("skyarm.control").joinpath("tuned.toml").read_text(encoding="utf-8")
    before, after = map(float, re.search(rf"\[law\.{LAW}\]  # cost (\S+) -> (\S+),", text).groups())
    factors = tuned_factors()[LAW]
    logs = np.array([[0.0] * len(factors), [math.log(value) for value in factors.values()]])
    np.testing.assert_allclose(Judge(LAW).costs(logs), [before, after], atol=0.02)


def test_a_flights_score_is_that_of_the_logged_flight():
    """The same flights in Python, one with a factor: errors against the continuous reference over the window."""
    model, path = load_scenario("case3").controller.par.model, "gains.position"
    trial = Trial(case="case2_gust", sensing="noisy", seed=3, start=6.5, duration=9.0)
    found = Together(make_controller(LAW, model), [path]).fly(trial, {path: np.array([1.0, 1.7])})
    for lane, factor in enumerate((1.0, 1.7)):
        log = run(trial.scenario(rescale(make_controller(LAW, model), {path: factor})))
        assert log.info["seed"] == 3
        inside, errors = log.time >= 6.5, Errors.continuous(log)
        changes = np.abs(np.diff(log.rotor_commands, axis=0)).mean(axis=1)
        wanted = errors.position[inside].mean(), errors.joints[inside].mean(), changes[inside[1:]].mean()
        ours = found.base[lane], found.joint[lane], found.jitter[lane]
        # fused multiplications move a stable flight by 1e-9 of its errors
        assert ours == pytest.approx(wanted, rel=1e-6)
        assert scored(log, trial.window) == pytest.approx((*wanted, True), rel=1e-12)
        assert found.completed[lane]
    assert found.base[0] > 1.05 * found.base[1], "a stiffer base is blown less far"


def test_every_law_that_compiles_has_one_budget_and_one_course():
    flown = {law: budget_of(law) for law in KNOBS}
    assert {law for law, budget in flown.items() if budget != Budget()} == {"nmpc"}
    assert flown["nmpc"] == ONE_BY_ONE
    assert Counter(trial.sensing for trial in FULL) == {"perfect": 5, "noisy": 10, "late": 2}
    assert {trial.case for trial in FULL} == set(PAPER_CASES)


def test_the_noise_of_tuning_is_that_of_the_bench():
    controller = untuned(LAW)
    noisy = conditions()["noisy"].apply(CASES["case3"].build())
    for sensing, periods in (("noisy", 1), ("late", 3)):
        found = Trial(case="case3", sensing=sensing).scenario(controller)
        assert found.sensors == noisy.sensors
        assert found.delays.measurement == pytest.approx(periods * noisy.delays.measurement)
    perfect = Trial(case="case3").scenario(controller)
    assert (perfect.sensors, perfect.delays) == (CASES["case3"].build().sensors, CASES["case3"].build().delays)


TINY = tuple(
    Trial(case=case, sensing=sensing, start=0.1, duration=0.25)
    for case, sensing in (("case3_wind", "perfect"), ("case2_gust", "noisy"), ("case3", "late"))
)


@pytest.mark.thorough
def test_a_law_judged_one_by_one_costs_what_it_costs_in_a_batch():
    """The same law both ways, in this process and in two others."""
    paths = ("gains.position", "joint_gains.damping")
    factors = {paths[0]: np.array([1.0, 0.5, 3.0]), paths[1]: np.array([1.0, 2.0, 0.4])}
    together = Together(untuned(LAW), paths)
    wanted = [together.fly(trial, factors) for trial in TINY]
    for workers in (1, 2):
        for ours, theirs in zip(Alone(LAW, workers=workers).fly_all(TINY, factors), wanted, strict=True):
            for field in ("base", "joint", "jitter", "completed"):
                np.testing.assert_allclose(getattr(ours, field), getattr(theirs, field), rtol=1e-6)


@pytest.mark.thorough
def test_a_law_that_does_not_compile_is_tuned_on_a_small_budget_and_says_so():
    budget = Budget(first=2, later=1, rounds=1, elite=1, reach=3.0, trials=TINY[:1])
    found = tune("nmpc", budget)
    assert tuple(found.factors) == KNOBS["nmpc"]
    assert found.candidates == 3
    assert found.after <= found.before
    assert all(1.0 / 3.0 - 1e-4 <= factor <= 3.0 for factor in found.factors.values())
    assert "3 candidates, on the smaller budget" in tuning.document({"nmpc": found}, {})


def test_the_weights_of_an_uncompiled_law_take_their_factors():
    law = untuned("nmpc")
    changed = rescale(law, dict.fromkeys(KNOBS["nmpc"], 2.0)).par
    assert changed.weights.joints == 2.0 * law.par.weights.joints
    assert changed.weights.position == law.par.weights.position
    assert changed.weights.tool == law.par.weights.tool
    assert changed.bandwidths.angular == 2.0 * law.par.bandwidths.angular


@pytest.mark.parametrize(
    ("base", "joint", "completed", "wanted"),
    [
        (0.19, 0.19, True, 0.0),
        (0.21, 0.0, True, 1.0),
        (0.0, 0.21, True, 1.0),
        (0.0, 0.0, False, 1.0),
        (math.nan, 0.0, True, 1.0),
    ],
)
def test_a_late_flight_costs_one_where_it_is_lost(monkeypatch, base, joint, completed, wanted):
    class Flown:
        def fly_all(self, trials, factors):
            late = score(base=base, joint=joint, completed=completed)
            return [late if trial.sensing == "late" else score() for trial in trials]

    monkeypatch.setattr(candidate_costs, "_flyer", lambda law, workers: Flown())
    found = Judge(LAW, TINY).costs(np.zeros((1, len(KNOBS[LAW]))))[0]
    assert found == pytest.approx(cost(score(), noisy=False)[0] + wanted)


def score(**values) -> Score:
    numbers = {"base": 0.01, "joint": 0.1, "jitter": 0.0, **values}
    arrays = [np.array([numbers[name]]) for name in ("base", "joint", "jitter")]
    return Score(*arrays, np.array([values.get("completed", True)]))


def test_the_cost_is_the_logarithm_of_base_and_joint_error_at_the_arms_length():
    assert cost(score(), noisy=False)[0] == pytest.approx(math.log(0.01 + 0.3 * 0.1 + 1e-4))
    assert cost(score(jitter=30.0), noisy=False) == cost(score(), noisy=False)


def test_jitter_costs_in_a_noisy_flight_beyond_15_rad_s():
    quiet = cost(score(jitter=14.9), noisy=True)[0]
    assert quiet == cost(score(), noisy=True)[0]
    assert cost(score(jitter=30.0), noisy=True)[0] - quiet == pytest.approx(1.0)


def test_a_flight_that_ends_counts_as_ten_metres():
    for lost in (score(completed=False), score(base=math.nan), score(base=1e6)):
        assert cost(lost, noisy=True)[0] == pytest.approx(math.log(10.0001))


def test_a_path_stands_for_the_numbers_below_it_and_for_no_structure():
    controller = load_scenario("case1", controller="ct_ladder").controller
    places = Together(controller, ["joint_gains", "observer.force", "steps", "model.vehicle.rotors.0"]).places
    stiffness, damping = controller.par.joint_gains.stiffness, controller.par.joint_gains.damping
    assert places["joint_gains"] == {
        ("joint_gains", name, str(i)): value
        for name, row in (("stiffness", stiffness), ("damping", damping))
        for i, value in enumerate(row)
    }
    assert places["observer.force"] == {("observer", "force"): controller.par.observer.force}
    assert places["steps"] == {}
    found = places["model.vehicle.rotors.0"]
    assert ("model", "vehicle", "rotors", "0", "max_speed") in found
    assert all(isinstance(value, float) for value in found.values())
