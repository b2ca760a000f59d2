"""Rotor speeds from commands against an integrator, a mixture by hand and a convolution."""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.studies.identify.rotor_lag import delay_commands, lag_response, moving_mean

PERIOD, UP, DOWN = 0.002, 0.02, 0.05


def test_the_lag_is_that_of_an_integrator():
    """Another time constant up than down; over more than one of the stretches that are followed side by side."""
    integrate = pytest.importorskip("scipy.integrate")
    targets = np.random.default_rng(1).uniform(100.0, 900.0, (700, 1)).repeat(1, axis=0)
    targets[::7] = 900.0
    means, ends = lag_response(targets, PERIOD, UP, DOWN)
    value, area = targets[0], 0.0
    for k, target in enumerate(targets):

        def slope(_, y, target=target):
            off = target[0] - y[0]
            return [off / (UP if off > 0.0 else DOWN), y[0]]

        found = integrate.solve_ivp(slope, (0.0, PERIOD), [value[0], 0.0], rtol=1e-9, atol=1e-9)
        value, area = found.y[:1, -1], found.y[1, -1]
        assert ends[k, 0] == pytest.approx(value[0], abs=0.0025 * 800.0)
        assert means[k, 0] == pytest.approx(area / PERIOD, abs=0.0025 * 800.0)
    assert np.abs(ends[200:250, 0] - _followed(targets)[200:250]).max() < 1e-3


def _followed(targets):
    value, ends = targets[0, 0], []
    for target in targets[:, 0]:
        tau = UP if target > value else DOWN
        value = target + (value - target) * np.exp(-PERIOD / tau)
        ends.append(value)
    return np.array(ends)


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
