"""Delay margins beside flights: the delay from which on the nonlinear vehicle really
swings is the one foretold.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from swinging_flights import TABLE, hover, swings_from

import skyarm
from skyarm.studies.stability.hover_delay import ENOUGH, believed_delay, hover_delay


def around(delay):
    """Delays about one that is foretold, 5 per cent apart."""
    return delay * np.arange(0.7, 1.35, 0.05)


def test_flights_swing_from_the_delay_on_that_is_foretold():
    scenario = hover(*TABLE[1])
    found = hover_delay(scenario)
    flown = swings_from(scenario, around(found.swings))
    assert flown == pytest.approx(found.swings, rel=0.05)
    # with the worse time constant of the rotors it is said too early, never too late
    assert found.margin <= flown


@pytest.mark.thorough
@pytest.mark.parametrize(("vehicle", "law", "joints"), TABLE)
def test_every_row_of_the_table_is_within_15_per_cent(vehicle, law, joints):
    scenario = hover(vehicle, law, joints)
    found = hover_delay(scenario)
    flown = swings_from(scenario, around(found.swings))
    print(
        f"{vehicle} {law}: {1e3 * found.margin:.2f} {1e3 * found.swings:.2f}"
        f" {1e3 * flown:.2f} ms"
    )
    assert flown == pytest.approx(found.swings, rel=0.15)


@pytest.mark.thorough
def test_a_delay_of_the_measurement_counts_as_one_of_the_commands():
    late = hover(*TABLE[1], measurement=0.010)
    found, without = hover_delay(late), hover_delay(hover(*TABLE[1]))
    assert found.swings == pytest.approx(without.swings - 0.010, abs=2e-4)
    assert swings_from(late, around(found.swings)) == pytest.approx(
        found.swings, rel=0.05
    )


def test_what_is_believed_is_what_the_law_is_told_or_the_scenario_states():
    scenario = skyarm.load_scenario("case3", controller="centroidal_tip")
    assert believed_delay(scenario) == 0.0
    told = dataclasses.replace(scenario.controller.par, delay_periods=3)
    scenario = dataclasses.replace(
        scenario, controller=dataclasses.replace(scenario.controller, par=told)
    )
    assert believed_delay(scenario) == pytest.approx(0.015)
    scenario = dataclasses.replace(
        scenario, delays=skyarm.Delays(measurement=0.01, command=0.012)
    )
    assert believed_delay(scenario) == pytest.approx(0.022)


@pytest.mark.parametrize(("share", "enough"), [(1.001, True), (0.999, False)])
def test_one_and_a_half_times_the_believed_delay_is_enough(share, enough):
    from skyarm.studies.stability.hover_delay import HoverDelay

    found = HoverDelay(
        margin=share * ENOUGH * 0.01, swings=0.1, believed=0.01, period=0.005
    )
    assert (found.enough, found.shortfall) == (
        enough,
        "" if enough else "below 1.5 times the nominal delay",
    )
    assert not HoverDelay(margin=0.0, swings=0.0, believed=0.0).enough
    # where none is believed: what a command of the next period takes
    found = HoverDelay(margin=share * 0.005, swings=0.1, believed=0.0, period=0.005)
    assert (found.enough, found.shortfall) == (
        enough,
        "" if enough else "below one control period, 5 ms",
    )
