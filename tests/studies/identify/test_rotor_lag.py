"""Rotor speeds from commands against an integrator, a mixture by hand and a convolution."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from skyarm.studies.identify.rotor_lag import commands_at_ends, delay_commands, integral_bends, lag_response
from skyarm.studies.identify.sampled_series import delay_series, moving_mean

PERIOD, UP, DOWN = 0.002, 0.02, 0.05


@pytest.mark.parametrize("delay", [0.0, 0.0007, 0.0033, -0.0013])
def test_the_lag_is_that_of_an_integrator(delay):
    """Another time constant up than down; over more than one of the stretches that are followed side by side."""
    integrate = pytest.importorskip("scipy.integrate")
    commands = np.random.default_rng(1).uniform(100.0, 900.0, 600)
    means, squares, ends = (rows[:, 0] for rows in lag_response(commands[:, None], PERIOD, delay, UP, DOWN))

    def of_span(t, _, y):
        target = commands[int(np.clip(np.floor((t - delay) / PERIOD), 0, len(commands) - 1))]
        return [(target - y[0]) / (UP if target > y[0] else DOWN), y[0], y[0] ** 2]

    value = commands[0]
    for k in range(len(commands)):
        # from jump to jump of the command
        late = (delay / PERIOD - np.floor(delay / PERIOD)) * PERIOD
        times = [k * PERIOD, *([k * PERIOD + late] if late else []), (k + 1) * PERIOD]
        state = [value, 0.0, 0.0]
        for first, last in pairwise(times):
            middle = 0.5 * (first + last)
            found = integrate.solve_ivp(partial(of_span, middle), (first, last), state, rtol=1e-8, atol=1e-9)
            state = found.y[:, -1].tolist()
        value = state[0]
        if k % 9 == 0 or k > 590:
            # what is forgotten of the past of a stretch is a share of exp(-6)
            assert ends[k] == pytest.approx(state[0], abs=0.0025 * 800.0)
            assert means[k] == pytest.approx(state[1] / PERIOD, abs=0.0025 * 800.0)
            assert squares[k] == pytest.approx(state[2] / PERIOD, rel=0.005)
        if 150 <= k < 250:
            # before the second stretch begins, nothing is
            assert (means[k], squares[k]) == pytest.approx((state[1] / PERIOD, state[2] / PERIOD), rel=1e-6)


def test_a_dead_time_shifts_held_commands_by_parts_of_a_period():
    commands = np.array([[1.0], [5.0], [3.0], [3.0]])
    assert delay_commands(commands, 0.01, 0.0) == pytest.approx(commands)
    # a quarter of a period late: the first quarter of each has the command before
    assert delay_commands(commands, 0.01, 0.0025)[:, 0] == pytest.approx([1.0, 4.0, 3.5, 3.0])
    assert delay_commands(commands, 0.01, 0.0125)[:, 0] == pytest.approx([1.0, 1.0, 4.0, 3.5])
    assert delay_commands(commands, 0.01, -0.01)[:, 0] == pytest.approx([5.0, 3.0, 3.0, 3.0])


def test_a_moving_mean_is_a_convolution_inside():
    rows = np.random.default_rng(2).normal(size=(40, 2))
    assert moving_mean(rows, 5)[2:-2, 1] == pytest.approx(np.convolve(rows[:, 1], np.ones(5) / 5.0, "valid"))
    assert moving_mean(rows, 5)[0] == pytest.approx(rows[:3].mean(axis=0))
    assert moving_mean(rows, 1) is rows


def test_candidates_and_rotors_have_lags_of_their_own():
    """Two candidates of two rotors at once are those one at a time; even over periods longer than a stretch."""
    commands = np.random.default_rng(3).uniform(100.0, 900.0, (300, 2))
    delays, ups, downs = np.array([0.0007, 0.004]), np.array([[0.01, 0.03], [0.02, 0.05]]), np.array([[0.02, 0.04]])
    found = lag_response(commands, PERIOD, delays, ups, downs)
    for c in range(2):
        for i in range(2):
            one = lag_response(commands[:, [i]], PERIOD, delays[c], ups[c, i], downs[0, i])
            for many, alone in zip(found, one, strict=True):
                assert many[c, :, i] == pytest.approx(alone[:, 0], rel=5e-3)
    rested = lag_response(np.full((3, 1), 7.0), 2.0, 0.0, UP, DOWN)
    assert [each.ravel().tolist() for each in rested] == [[7.0] * 3, [49.0] * 3, [7.0] * 3]


@pytest.mark.parametrize("delay", [0.0, 0.003, 0.0101, 0.0165, -0.004])
def test_a_delayed_series_lags_and_keeps_its_noise(delay):
    """A slow sine lags; white noise has the same size, which interpolation would take 5 to 50 % of."""
    time = 0.01 * np.arange(4000)
    found = delay_series(np.sin(3.0 * time)[:, None] + 0.2 * time[:, None], delay / 0.01)[:, 0]
    late = time - delay
    assert found[100:-100] == pytest.approx((np.sin(3.0 * late) + 0.2 * late)[100:-100], abs=1e-3)
    noise = np.random.default_rng(1).normal(size=(4000, 1))
    assert delay_series(noise, delay / 0.01).std() == pytest.approx(noise.std(), rel=0.01)


@pytest.mark.parametrize("delay", [0.0, 0.0005, 0.0044, -0.0031])
def test_held_commands_between_and_at_the_ends_of_periods(delay):
    """Against the same commands on a clock 1000 times as fine."""
    rng, period, finer = np.random.default_rng(2), 0.002, 1000
    commands = rng.normal(size=(20, 2))
    instants = (np.arange(20 * finer) + 0.5) / finer - delay / period
    acting = commands[np.clip(np.floor(instants).astype(int), 0, 19)].reshape(20, finer, 2)
    inside = slice(4, 16)
    bends = (np.cumsum(acting, axis=1) / finer).mean(axis=1) - 0.5 * acting.mean(axis=1)
    assert integral_bends(commands, period, delay)[inside] == pytest.approx(bends[inside], abs=2e-3)
    if abs(delay % period - period) > 0.2 * period:
        assert commands_at_ends(commands, period, delay)[inside] == pytest.approx(acting[inside, -1])


def test_the_step_at_an_end_has_no_jump():
    """A search sees on which side of an end it lies."""
    commands = np.array([[0.0], [1.0], [0.0], [0.0]])
    found = [commands_at_ends(commands, 1.0, late)[1, 0] for late in (0.79, 0.8, 0.9, 1.0, 1.1)]
    assert found == pytest.approx([1.0, 1.0, 0.5, 0.0, 0.0])
