"""Margins of many sets of gains by one code, and the functions of the library that give
margins.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.studies.stability.flight_margins import SettledHover
from skyarm.studies.stability.hover_delay import hover_delay
from skyarm.studies.tune.excitation import of_vehicle

PATHS = ("controller.gains.position.x", "controller.gains.attitude.y")


@pytest.fixture(scope="module")
def scenario():
    return skyarm.load_scenario("case1", controller="paper_ct", duration=0.5)


@pytest.fixture(scope="module")
def hovers(scenario):
    return SettledHover(scenario, PATHS)


def test_each_set_has_the_margins_of_a_controller_made_with_it(scenario, hovers):
    from skyarm.scenario.numbers import number_at, with_numbers

    base = [number_at(scenario, path) for path in PATHS]
    values = {
        path: value * np.array([1.0, 1.6])
        for path, value in zip(PATHS, base, strict=True)
    }
    found = hovers.margins(np.stack(list(values.values()), axis=1))
    for k in range(2):
        numbers = {path: float(column[k]) for path, column in values.items()}
        alone = skyarm.margins(with_numbers(scenario, numbers), 0).instants[0]
        one = found[k]
        assert one is not None
        assert one.delay == pytest.approx(alone.delay, rel=1e-6)
        assert one.swings == pytest.approx(alone.swings, rel=1e-6)
        assert one.gain("joint_gain") == pytest.approx(
            alone.gain("joint_gain"), rel=1e-6
        )
        several = [
            next(e for e in each.by_lag["up"].together if e.name == "all commands")
            for each in (one, alone)
        ]
        assert several[0].disk == pytest.approx(several[1].disk, rel=1e-6)
    assert found[0].delay != pytest.approx(found[1].delay, rel=1e-3)


def test_a_hover_that_diverges_has_no_margins(hovers):
    none, unstable = hovers.margins(np.array([[math.nan, 1.0], [-50.0, -900.0]]))
    assert none is None
    assert (unstable.delay, unstable.gain("joint_gain")) == (0.0, (1.0, 1.0))


@pytest.mark.thorough
def test_what_a_law_learns_is_held_also_under_guard():
    from skyarm.control.safety import with_safety_layer
    from skyarm.studies.stability.frozen_scenario import without_adaptation

    learning = skyarm.load_scenario("case3", controller="centroidal_tip")
    guarded = dataclasses.replace(
        learning, controller=with_safety_layer(learning.controller)
    )
    for scenario in (learning, guarded):
        par = scenario.controller.par
        assert getattr(par, "inner", par).parts.adaptation.load is not None
        held = without_adaptation(scenario).controller.par
        held = getattr(held, "inner", held)
        adaptation = held.parts.adaptation
        assert adaptation.load is None
        assert all(limits == (0.0, 0.0) for limits in adaptation.damping_limits)


def test_a_hover_says_its_delay_margin_as_its_margins_do(scenario):
    found, whole = skyarm.hover_delay(scenario), skyarm.margins(scenario, 0).instants[0]
    assert (found.margin, found.swings) == (whole.delay, whole.swings)
    late = dataclasses.replace(scenario, delays=skyarm.Delays(measurement=0.025))
    assert not skyarm.hover_delay(late).enough


def test_a_vehicle_without_drag_and_joints_has_margins():
    """Nothing pushes it along x and y, which is no reason for a measurement to have two
    numbers less.
    """
    bare = skyarm.load_vehicle("hummingbird")
    free = [
        dataclasses.replace(each, drag_coefficient=0, rolling_moment_coefficient=0)
        for each in bare.rotors
    ]
    scenario = of_vehicle(dataclasses.replace(bare, rotors=tuple(free)), "decoupled_pd")
    assert 0.01 < hover_delay(scenario).margin < 0.1
