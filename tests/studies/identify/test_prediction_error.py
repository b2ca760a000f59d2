"""Fits by prediction error against linear problems whose estimate and covariance are known."""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.studies.identify import prediction_error
from skyarm.studies.identify.identified_numbers import disagreement, identified_numbers, scale_of
from skyarm.studies.identify.prediction_error import ORDER, _step, fit_prediction
from skyarm.studies.identify.unknowns import Reported, Unknown

pytest.importorskip("scipy", reason="needs the extra 'identify'")

TRUE = np.array([1.5, -0.7])
VAGUE = np.array([1e3, 1e3])
STEPS = np.array([1e-4, 1e-4])


def coloured(rng, size, pole):
    """First-order autoregressive noise of unit innovations."""
    found, white = np.zeros(size), rng.normal(size=size)
    for k in range(1, size):
        found[k] = pole * found[k - 1] + white[k]
    return found


def problem(seed, size=800, pole=0.9):
    rng = np.random.default_rng(seed)
    inputs = np.stack([coloured(rng, size, 0.5), rng.normal(size=size)], axis=1)
    return inputs, inputs @ TRUE + coloured(rng, size, pole)


def solved(inputs, measured, prior=VAGUE, start=None, **words):
    def errors(numbers):
        return [(measured - inputs @ numbers)[:, None]]

    begin = np.zeros(2) if start is None else start
    return fit_prediction(errors, begin, prior, STEPS, 25, **words)


def test_the_estimate_is_that_of_generalised_least_squares():
    """Of known noise: filtered by hand, estimate and covariance in closed form."""
    inputs, measured = problem(1, 4000)
    found = solved(inputs, measured)
    x, y = inputs[1:] - 0.9 * inputs[:-1], measured[1:] - 0.9 * measured[:-1]
    exact, spread = np.linalg.solve(x.T @ x, x.T @ y), np.linalg.inv(x.T @ x)
    assert np.abs(found.values - exact).max() < 0.3 * np.sqrt(spread.diagonal().max())
    assert np.sqrt(found.curvature.diagonal()) == pytest.approx(np.sqrt(spread.diagonal()), rel=0.08)
    assert np.sqrt(found.covariance.diagonal()) == pytest.approx(np.sqrt(spread.diagonal()), rel=0.25)
    assert found.settled


def test_intervals_do_not_hang_on_the_order_of_the_flights():
    """Three stretches, no length a multiple of a block's: no block goes from one into the next."""
    parts = [problem(seed, size) for seed, size in ((1, 531), (2, 260), (3, 700))]

    def of_order(order):
        def errors(numbers):
            return [(parts[i][1] - parts[i][0] @ numbers)[:, None] for i in order]

        return fit_prediction(errors, np.zeros(2), VAGUE, STEPS, 25)

    first, second = of_order([0, 1, 2]), of_order([2, 0, 1])
    assert second.values == pytest.approx(first.values, rel=1e-7)
    assert second.covariance == pytest.approx(first.covariance, rel=1e-6)
    assert second.quantiles(np.eye(2)) == pytest.approx(first.quantiles(np.eye(2)), rel=1e-7)


def test_intervals_cover_the_truth():
    """In 90 to 98 of 100 of 200 problems, for each number."""
    inside = []
    for seed in range(200):
        found = solved(*problem(seed, 500))
        inside.append(np.abs(found.values - TRUE) <= found.quantiles(np.eye(2)) * np.sqrt(found.covariance.diagonal()))
    assert ((np.mean(inside, axis=0) >= 0.90) & (np.mean(inside, axis=0) <= 0.98)).all()


def test_intervals_cover_beside_white_noise_and_a_slow_walk():
    """Of 40 slow inputs beside a rate's noise and the walk of its sum: a filter of eight periods has 2/3 inside."""
    inside = []
    for seed in range(40):
        rng, time = np.random.default_rng(seed), 0.01 * np.arange(2000)
        inputs = np.stack([np.sin(time + seed), np.sin(2.3 * time + 2 * seed)], axis=1)
        found = solved(inputs, inputs @ TRUE + rng.normal(size=2000) + 0.02 * np.cumsum(rng.normal(size=2000)))
        inside.append(np.abs(found.values - TRUE) <= found.quantiles(np.eye(2)) * np.sqrt(found.covariance.diagonal()))
    assert 0.88 <= np.mean(inside) <= 0.99


def test_what_was_known_before_weighs_as_a_measurement():
    """Of a prior as sharp as the data the estimate lies in the middle."""
    inputs, measured = problem(3, 2000)
    vague = solved(inputs, measured)
    prior = np.sqrt(vague.curvature.diagonal())
    start = vague.values + prior
    found = solved(inputs, measured, prior, start)
    assert found.values == pytest.approx(vague.values + 0.5 * prior, abs=0.1 * prior.max())
    assert found.curvature.diagonal() == pytest.approx(0.5 * prior**2, rel=0.05)


def test_outliers_hardly_count():
    inputs, measured = problem(4)
    clean = solved(inputs, measured)
    spoilt = measured.copy()
    spoilt[::50] += 300.0
    assert np.abs(solved(inputs, spoilt).values - clean.values).max() < 0.2
    plain = np.linalg.lstsq(inputs, spoilt, rcond=None)[0]
    assert np.abs(plain - TRUE).max() > 0.2


def test_rows_that_are_not_used_do_not_count():
    inputs, measured = problem(5)
    used = np.ones(len(measured), dtype=bool)
    used[300:400] = False
    spoilt = measured.copy()
    spoilt[300:400] += 1e3 * np.sin(np.arange(100.0))
    assert solved(inputs, spoilt, used=[used]).values == pytest.approx(solved(inputs, measured, used=[used]).values)


@pytest.mark.parametrize("slope", [0.0, 100.0])
def test_a_level_or_slope_of_a_stretch_is_no_noise_that_hardly_changes(slope):
    """Each stretch is levelled before its filter is sought: a pole of 0.5 is found beside two levels far apart."""
    inputs, measured = problem(7, 4000, pole=0.5)

    def errors(numbers):
        rest = (measured - inputs @ numbers)[:, None]
        slow = slope * np.linspace(-1.0, 1.0, 2000)[:, None]
        return [rest[:2000] - 20.0 + slow, rest[2000:] + 20.0 - slow]

    found = fit_prediction(errors, TRUE, np.array([1e-6, 1e-6]), STEPS, 25)
    assert len(found.noise.weights) == 4000 - 2 * ORDER
    assert found.noise.filters[0, :ORDER].sum() == pytest.approx(0.5, abs=0.08)
    assert found.noise.filters[0].sum() < 0.6


def test_ramps_that_differ_from_stretch_to_stretch_cost_nothing():
    """Sums of an input beside a ramp of each stretch's own, none on the mean: the gain is found with levels only."""
    rng = np.random.default_rng(5)
    inputs = [np.cumsum(coloured(rng, 600, 0.8)) for _ in range(4)]
    ramps = [slope * np.arange(600.0) for slope in (-5.0, 4.0, -3.0, 4.0)]
    noise = [np.cumsum(coloured(rng, 600, 0.5)) for _ in range(4)]

    def errors(numbers):
        rows = zip(inputs, ramps, noise, strict=True)
        return [((1.5 - numbers[0]) * each + ramp + left)[:, None] for each, ramp, left in rows]

    def found(levels):
        return fit_prediction(errors, np.array([0.5]), VAGUE[:1], STEPS[:1], 25, levels=levels)

    levelled, plain = found([0]), found([])
    assert levelled.values[0] == pytest.approx(1.5, abs=0.06)
    assert levelled.covariance[0, 0] < 0.05 * plain.covariance[0, 0]
    # of one stretch alone the level counts, as that of the numbers' own drift does
    one = fit_prediction(lambda x: errors(x)[:1], np.array([0.5]), VAGUE[:1], STEPS[:1], 25, levels=[0])
    same = fit_prediction(lambda x: errors(x)[:1], np.array([0.5]), VAGUE[:1], STEPS[:1], 25)
    assert one.values[0] == same.values[0]


def test_a_search_that_is_cut_off_has_not_settled(monkeypatch):
    """One turn of filter and numbers never shows that another would move them no more."""
    monkeypatch.setattr(prediction_error, "TURNS", 1)
    assert not solved(*problem(8)).settled


def test_a_search_that_is_cut_off_on_its_way_has_intervals_wider_than_its_last_moves(monkeypatch):
    """Of the logarithm of a gain, from far above it: a step of Gauss and Newton goes down by 1."""
    for name, value in (("TURNS", 3), ("FIRST", 1), ("STEPS", 1)):
        monkeypatch.setattr(prediction_error, name, value)
    inputs = np.random.default_rng(1).normal(size=(400, 2))
    measured = inputs[:, 0] + inputs[:, 1]

    def found():
        return fit_prediction(
            lambda x: [(measured - np.exp(x[0]) * inputs[:, 0])[:, None]], np.array([9.0]), VAGUE[:1], STEPS[:1], 25
        )

    wide = found()
    assert wide.values == pytest.approx([6.0], abs=0.05)
    assert not wide.settled
    monkeypatch.setattr(prediction_error, "ALTERNATE", 1)
    assert wide.covariance[0, 0] - found().covariance[0, 0] == pytest.approx(1.0 + 4.0, rel=0.05)


def test_a_noise_that_goes_to_and_fro_with_the_number_comes_to_rest(monkeypatch):
    """Two rows say 0 and 1; one counts less the nearer the number is: each turn would go 1.5 times as far back."""
    noise = np.random.default_rng(2).normal(size=(400, 2))
    noise -= noise.mean(axis=0)

    def settle(linear, *others):
        second = np.exp(3.0 * (linear.point[0] - 0.5))
        filters, weights = np.zeros((2, ORDER + prediction_error.WINDOWS)), np.ones((400 - ORDER, 2))
        return linear.point, prediction_error.Whitening(filters, np.array([1.0, second]), weights), True

    monkeypatch.setattr(prediction_error, "_settle", settle)

    def found():
        return fit_prediction(
            lambda x: [noise + np.array([0.0, 1.0]) - x[0]], np.array([0.2]), VAGUE[:1], STEPS[:1], 25
        )

    assert found().settled
    assert found().values == pytest.approx([0.5], abs=0.02)
    monkeypatch.setattr(prediction_error, "ALTERNATE", 99)
    assert not found().settled


@pytest.mark.parametrize("seed", [0, 2])
def test_a_search_ends_where_numbers_and_noise_both_rest(seed):
    """Of an input that walks as the noise does: a second search from the end of the first stays there."""
    rng = np.random.default_rng(seed)
    inputs = np.stack([np.cumsum(coloured(rng, 1500, 0.97)), rng.normal(size=1500)], axis=1)
    measured = inputs @ (50.0 * TRUE) + np.cumsum(coloured(rng, 1500, 0.5))
    found = solved(inputs, measured)
    again = solved(inputs, measured, start=found.values)
    assert found.settled
    assert (np.abs(again.values - found.values) < 0.01 * np.sqrt(found.curvature.diagonal())).all()


def test_a_step_that_is_never_better_is_damped_until_it_is_given_up():
    """Eight times, each ten times as much from 1e-5 on; the numbers stay."""
    values, found = np.array([1.0]), [np.zeros((3, 1))]
    costs = iter(range(9))
    kept, there, cost, trust = _step(
        lambda numbers: [numbers[None, :]], lambda *_: float(next(costs)), values, found, np.eye(1), np.ones(1), 0.0
    )
    assert kept is values
    assert there is found
    assert (cost, trust) == (0.0, pytest.approx(1e-5 * 10.0**8))
    better = iter((2.0, 1.0))
    moved, *_, trust = _step(lambda x: [x], lambda *_: next(better), values, found, np.eye(1), np.ones(1), 1.0)
    # half of the undamped step of 1
    assert moved == pytest.approx([0.5])
    assert trust == pytest.approx(0.1)


def test_of_a_number_that_few_blocks_tell_the_interval_is_wider():
    """By the blocks that tell it: 32 of a steady input, two of one that is there for two blocks only."""
    rng = np.random.default_rng(6)
    inputs = rng.normal(size=(800 + ORDER, 2))
    inputs[: 300 + ORDER, 1] = inputs[350 + ORDER :, 1] = 0.0
    found = solved(inputs, inputs @ TRUE + rng.normal(size=800 + ORDER))
    steady, brief = found.quantiles(np.eye(2))
    assert steady == pytest.approx(2.04, abs=0.02)
    assert 2.8 < brief < 4.6


@pytest.mark.parametrize(("apart", "expected"), [(0.0, 1.0), (0.4, 5.5), (-0.4, 5.5)])
def test_intervals_are_wider_by_what_flights_disagree(apart, expected):
    """Two flights of white noise and known input: the ratio of Birge by the closed form of the regression of each."""
    rng, flights = np.random.default_rng(4), []
    for own in (1.0 - apart / 2, 1.0 + apart / 2):
        inputs = rng.normal(size=400)
        flights.append((inputs, own * inputs + rng.normal(size=400)))

    def errors(numbers):
        return [(y - x * numbers[0])[:, None] for x, y in flights]

    found = fit_prediction(errors, np.array([0.5]), VAGUE[:1], STEPS[:1], 25)
    unknown = Unknown(name="a", unit="", start=0.5, spread=1.0)
    scale = scale_of(found, [unknown], [Reported(name="a", unit="", parts=("a",))], {})
    after = np.array([found.curvature[0, 0]])
    (ratio,) = disagreement(found, scale, after, ["one", "other"])
    (a, va), (b, vb) = (((x @ y) / (x @ x), 1.0 / (x @ x)) for x, y in flights)
    assert ratio == pytest.approx(max(abs(a - b) / np.sqrt(va + vb), 1.0), rel=0.2)
    assert ratio == pytest.approx(expected, rel=0.3)
    assert disagreement(found, scale, after, ["one", "one"]) == pytest.approx([1.0])
    (wide,), _ = identified_numbers(found, scale, 0.01, 0.01, ["one", "other"])
    (narrow,), _ = identified_numbers(found, scale, 0.01, 0.01, ["one", "one"])
    assert (wide.high - wide.low) / (narrow.high - narrow.low) == pytest.approx(wide.widened, rel=0.1)


def test_what_was_known_before_pulls_each_flight_by_its_length():
    """Two flights of one slope, far from what was known: each alone is the ridge estimate of its own data."""
    rng, start, known = np.random.default_rng(6), -1.0, 0.1**-2.0
    flights = [(x, x + rng.normal(size=x.size)) for x in (rng.normal(size=400), rng.normal(size=200))]

    def errors(numbers):
        return [(y - x * numbers[0])[:, None] for x, y in flights]

    found = fit_prediction(errors, np.array([start]), np.array([0.1]), STEPS[:1], 25)
    unknown = Unknown(name="a", unit="", start=start, spread=0.1)
    scale = scale_of(found, [unknown], [Reported(name="a", unit="", parts=("a",))], {})
    (ratio,) = disagreement(found, scale, np.array([found.curvature[0, 0]]), ["long", "short"])
    (a, va), (b, vb) = (((x @ y + known * start) / (x @ x + known), 1.0 / (x @ x + known)) for x, y in flights)
    assert ratio == pytest.approx(abs(a - b) / np.sqrt(va + vb), rel=0.25)
    assert ratio > 2.0


def test_flights_that_agree_better_than_noise_narrow_no_interval():
    x = np.random.default_rng(7).normal(size=300)
    y = x + np.random.default_rng(8).normal(size=300)
    found = fit_prediction(lambda a: [(y - x * a[0])[:, None]] * 2, np.array([0.5]), np.array([1e3]), STEPS[:1], 25)
    unknown = Unknown(name="a", unit="", start=0.5, spread=1.0)
    scale = scale_of(found, [unknown], [Reported(name="a", unit="", parts=("a",))], {})
    assert disagreement(found, scale, np.array([found.curvature[0, 0]]), ["one", "same"]).tolist() == [1.0]
