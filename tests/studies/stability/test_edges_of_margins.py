"""Where the search for a margin begins and ends: delays between steps, the longest
delay looked at, whole flights.
"""

from __future__ import annotations

import dataclasses
import importlib
import math

import numpy as np
import pytest
from hand_made import T, double_integrator

from skyarm.control.controller import ControllerError
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.studies.stability.frozen_scenario import nominal
from skyarm.studies.stability.hover_delay import hover_delay_if_known
from skyarm.studies.stability.margins import (
    LONGEST,
    STRIDE,
    delay_margin,
    gain_edge,
    radius,
)

MARGINS = importlib.import_module("skyarm.studies.stability.margins")
STEP = 0.001
"""s, between the delays of the loop by hand."""


@pytest.mark.parametrize("part", [-0.5, -0.4, -0.1, -1e-3, 1e-3, 0.1, 0.4, 0.5])
@pytest.mark.parametrize("steps", [1, 3, 5, 12])
def test_a_delay_on_either_side_of_a_step_is_refused(steps, part):
    with pytest.raises(
        ValueError, match=r"^delay = .*: must be a whole number of 0\.001 s"
    ):
        radius(double_integrator(), extra_delay=(steps + part) * STEP)
    with pytest.raises(ValueError, match="must be a whole number"):
        radius(double_integrator(delay=(steps + part) * STEP))


def test_a_delay_is_a_whole_number_of_steps_to_rounding():
    for steps in range(1, 40):
        for away in (-1.0, 0.0, 1.0):
            delay = steps * STEP + away * 1e-13
            assert radius(double_integrator(), extra_delay=delay) == radius(
                double_integrator(delay=steps * STEP)
            )


def test_delays_up_to_the_longest_are_looked_at_and_none_beyond(monkeypatch):
    """A loop that is stable up to a delay of our choice: a margin at the longest delay
    is told, one beyond is none.
    """
    asked = []

    def stable_below(edge):
        def found(loop, extra_delay=0.0, **_):
            asked.append(extra_delay)
            return 0.9 if extra_delay < edge - 1e-9 else 1.1

        return found

    loop = double_integrator()
    for edge, expected in (
        (LONGEST - STEP, LONGEST - 1.5 * STEP),
        (LONGEST, LONGEST - 0.5 * STEP),
    ):
        monkeypatch.setattr(MARGINS, "radius", stable_below(edge))
        # half way, as 1 is half way between 0.9 and 1.1
        assert delay_margin(loop) == pytest.approx(expected, abs=1e-12)
    monkeypatch.setattr(MARGINS, "radius", stable_below(LONGEST + STEP))
    asked.clear()
    assert delay_margin(loop) == math.inf
    assert max(asked) == pytest.approx(LONGEST, abs=1e-12)
    assert sorted(asked) == pytest.approx(np.arange(101) * STEP, abs=1e-12)


@pytest.mark.parametrize("period", [0.004, T, 0.0065, 0.03])
def test_the_longest_delay_is_the_same_for_every_period(monkeypatch, period):
    """To the nearest whole step; 0.1 s is 76.9 steps of 1.3 ms, and 16.7 of 6 ms."""
    asked = []
    monkeypatch.setattr(
        MARGINS,
        "radius",
        lambda loop, extra_delay=0.0: asked.append(extra_delay) or 0.5,
    )
    assert (
        delay_margin(dataclasses.replace(double_integrator(), period=period))
        == math.inf
    )
    assert abs(max(asked) - LONGEST) <= 0.5 * period / 5 + 1e-12


@pytest.mark.parametrize("edge", [1.1, 1.25, 3.0, 80.0])
def test_a_gain_margin_is_found_on_both_sides(edge):
    """Unstable above ``edge`` and below its inverse; 20 halvings of a stride leave 1e-6
    of it.
    """

    def is_unstable(gain):
        return gain > edge or gain < 1.0 / edge

    low, high = (
        gain_edge(is_unstable, 1.0 / STRIDE, 0.01),
        gain_edge(is_unstable, STRIDE, 100.0),
    )
    assert high == pytest.approx(edge, rel=1e-6)
    assert low == pytest.approx(1.0 / edge, rel=1e-6)
    assert not any(map(is_unstable, (low, high))), (
        "the last gain that is tolerated, not the first that is not"
    )


def test_no_gain_beyond_the_limit_is_looked_at():
    asked = []
    assert gain_edge(asked.append, STRIDE, 100.0) == 100.0
    assert gain_edge(asked.append, 1.0 / STRIDE, 0.5) == 0.5
    assert (min(asked), max(asked)) == (0.5, 100.0)


def test_rotors_and_joints_with_delays_of_their_own_are_refused_in_one_line():
    case = load_scenario("case1")
    late = dataclasses.replace(
        case, delays=dataclasses.replace(case.delays, joints=0.003)
    )
    with pytest.raises(
        ScenarioError,
        match=r"^delays\.rotors, delays\.joints: must be left out of margins",
    ):
        nominal(late)


def test_an_autopilot_has_no_margins_and_its_check_says_so():
    flown = load_scenario("case1", controller="px4")
    with pytest.raises(
        ControllerError, match=r"^autopilot 'px4': flies alone .* margin needs a law"
    ):
        nominal(flown)
    assert "a margin needs a law" in hover_delay_if_known(flown)
