"""About which gains a search goes: the catalogue's, whatever was given; the given ones
where it has none.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from skyarm.records.identity import identity
from skyarm.records.leaves import replace_at
from skyarm.scenario.scenario_file import load_scenario
from skyarm.studies.tune.excitation import tuning_flight
from skyarm.studies.tune.gain_search import scatter
from skyarm.studies.tune.law_knobs import (
    GIVEN,
    find_knobs,
    numbers_at,
    with_catalogue_gains,
    with_constants,
)

LABEL = "centroidal_tip"
FLIGHT = tuning_flight(load_scenario("case3", controller=LABEL))


def about(flight, label=LABEL):
    return with_catalogue_gains(
        flight, find_knobs(flight.controller, flight.controller.name), label
    )


def detuned(factor):
    knobs = find_knobs(FLIGHT.controller, FLIGHT.controller.name)
    logs = np.log(np.broadcast_to(factor, len(knobs)))
    return with_constants(FLIGHT, numbers_at(knobs, logs))


@pytest.mark.parametrize("factor", [3.0, 1.0 / 3.0, 10.0])
def test_gains_that_are_off_lead_to_the_same_search_to_the_bit(factor):
    found = about(detuned(factor))
    assert identity(found.flight) == identity(FLIGHT)
    usual = about(FLIGHT)
    # flown beside the others as they were given
    row = dict(
        zip((knob.path for knob in found.knobs), found.starts[GIVEN], strict=True)
    )
    assert set(np.round(list(row.values()), 12)) == {round(math.log(factor), 12)}
    # the same candidates in the same places, also where the given gains are those of
    # the catalogue
    assert list(found.starts) == list(usual.starts) == [GIVEN, LABEL]
    assert usual.starts[GIVEN] == (0.0,) * len(usual.knobs)
    for name in list(usual.starts)[1:]:
        assert found.starts[name] == usual.starts[name]
    # nothing is scattered about the given gains
    off = scatter(
        found.knobs, 240, 0, np.array([[5.0] * len(found.knobs), *found.rows[1:]])
    )
    np.testing.assert_array_equal(scatter(found.knobs, 240, 0, found.rows)[1:], off[1:])


def test_a_start_has_the_numbers_of_its_law():
    """Of two kinds of gains, the law's own and the tuned ones."""
    flight = tuning_flight(load_scenario("case3", controller="indi"))
    found = about(flight, "indi")
    assert list(found.starts) == [GIVEN, "indi_tuned", "indi"] or list(
        found.starts
    ) == [GIVEN, "indi", "indi_tuned"]
    numbers = numbers_at(found.knobs, found.starts["indi_tuned"])
    tuned = with_constants(found.flight, numbers).controller.par
    catalogue = load_scenario("case3", controller="indi_tuned").controller.par
    assert [*tuned.gains.position] == pytest.approx([*catalogue.gains.position])
    assert tuned.joint_gains.stiffness == pytest.approx(catalogue.joint_gains.stiffness)


def test_numbers_of_other_ratios_stay_where_they_are():
    """One factor a knob cannot lead from them to the catalogue's: the search goes about
    what was given.
    """
    law = FLIGHT.controller
    other = replace_at(law.par, {("joint_gains", "stiffness", "0"): 100.0})
    flight = dataclasses.replace(FLIGHT, controller=dataclasses.replace(law, par=other))
    found = about(flight)
    assert identity(found.flight) == identity(flight)
    assert found.starts[GIVEN] == (0.0,) * len(found.knobs)


def test_a_law_that_the_catalogue_does_not_know_begins_as_it_is():
    law = dataclasses.replace(FLIGHT.controller, name="mine")
    flight = dataclasses.replace(FLIGHT, controller=law)
    found = about(flight, "mine.py:make")
    assert dict(found.starts) == {GIVEN: (0.0,) * len(found.knobs)}
    assert identity(found.flight) == identity(flight)
