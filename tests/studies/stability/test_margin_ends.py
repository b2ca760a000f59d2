"""Margins at their ends: an unstable loop has none; and the edges of a map are those of
its own axes.
"""

from __future__ import annotations

import dataclasses
import math

import pytest
from hand_made import KD, T, double_integrator

from skyarm.studies.stability import margins
from skyarm.studies.stability.flight_margins import Evidence, LinearisedInstant
from skyarm.studies.stability.margins import EDGE, radius
from skyarm.studies.stability.margins_report import margins_page

HIGHEST = 2.0 / (KD * T)
"""Gain below which the double integrator is stable, by Jury."""


def with_gain(factor):
    loop = double_integrator()
    return dataclasses.replace(loop, u_y=loop.u_y * factor)


@pytest.mark.parametrize(
    "factor", [1.001 * HIGHEST, 1.3 * HIGHEST, 50.0 * HIGHEST, -1.0]
)
def test_a_loop_that_is_unstable_as_it_is_has_no_margin_to_either_side(factor):
    """Though a lower gain would make it stable: margins are of the loop as it is."""
    loop = with_gain(factor)
    assert radius(loop) > EDGE
    found = margins(loop)
    assert (found.rotor_gain, found.joint_gain, found.delay) == (
        (1.0, 1.0),
        (1.0, 1.0),
        0.0,
    )


@pytest.mark.parametrize("factor", [0.999 * HIGHEST, 0.5 * HIGHEST, 1.0])
def test_a_stable_loop_bears_what_is_left_of_the_highest_gain(factor):
    found = margins(with_gain(factor))
    assert found.rotor_gain == pytest.approx((0.0, HIGHEST / factor), rel=1e-6)
    assert found.delay > 0.0


def test_a_page_says_that_a_delay_is_beyond_those_looked_at():
    loop = dataclasses.replace(margins(with_gain(0.01)), delay=math.inf)
    hover = LinearisedInstant(
        hover=True, time=5.0, by_lag={"up": loop}, swings=math.inf
    )
    found = Evidence(
        controller="law", scenario="case", instants=(hover,), completed=True
    )
    text = margins_page(found, [])
    assert "delay margin more than 100 ms; small swings grow from more than 100" in text
