"""Delay margins beside flights: the delay from which on the nonlinear vehicle really swings is the one foretold."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from swinging_flights import TABLE, hover, swings_from

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.catalogue import make_named
from skyarm.studies.stability.hover_delay import ENOUGH, believed_delay, hover_delay, hover_of


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
    print(f"{vehicle} {law}: {1e3 * found.margin:.2f} {1e3 * found.swings:.2f} {1e3 * flown:.2f} ms")
    assert flown == pytest.approx(found.swings, rel=0.15)


@pytest.mark.thorough
def test_a_delay_of_the_measurement_counts_as_one_of_the_commands():
    late = hover(*TABLE[1], measurement=0.010)
    found, without = hover_delay(late), hover_delay(hover(*TABLE[1]))
    assert found.swings == pytest.approx(without.swings - 0.010, abs=2e-4)
    assert swings_from(late, around(found.swings)) == pytest.approx(found.swings, rel=0.05)


def test_what_is_believed_is_what_the_law_is_told_or_the_scenario_states():
    scenario = skyarm.load_scenario("case3", controller="centroidal_tip")
    assert believed_delay(scenario) == 0.0
    told = dataclasses.replace(scenario.controller.par, delay_periods=3)
    scenario = dataclasses.replace(scenario, controller=dataclasses.replace(scenario.controller, par=told))
    assert believed_delay(scenario) == pytest.approx(0.015)
    scenario = dataclasses.replace(scenario, delays=skyarm.Delays(measurement=0.01, command=0.012))
    assert believed_delay(scenario) == pytest.approx(0.022)


@pytest.mark.parametrize(("share", "enough"), [(1.001, True), (0.999, False)])
def test_one_and_a_half_times_the_believed_delay_is_enough(share, enough):
    from skyarm.studies.stability.hover_delay import HoverDelay

    found = HoverDelay(margin=share * ENOUGH * 0.01, swings=0.1, believed=0.01, period=0.005)
    assert (found.enough, found.shortfall) == (enough, "" if enough else "below 1.5 times the believed delay")
    assert not HoverDelay(margin=0.0, swings=0.0, believed=0.0).enough
    # where none is believed: what a command of the next period takes
    found = HoverDelay(margin=share * 0.005, swings=0.1, believed=0.0, period=0.005)
    assert (found.enough, found.shortfall) == (enough, "" if enough else "below one control period, 5 ms")


def test_the_margin_of_a_law_that_finds_a_lag_is_said_to_be_that_of_before():
    from skyarm.control.safety.safety_layer import with_safety_layer
    from skyarm.studies.stability.hover_delay import HoverDelay, finds_lag

    model = skyarm.Model(vehicle=skyarm.load_vehicle("crazyflie_arm1"), gravity=9.81)
    adaptive, robust = (make_named(name, model) for name in ("centroidal_tip", "centroidal_tip_robust"))
    assert [finds_lag(each) for each in (adaptive, with_safety_layer(adaptive), robust)] == [True, True, False]
    told = HoverDelay(margin=0.01, swings=0.02, believed=0.01, period=0.005, finds_lag=True)
    words = "10 ms are believed; this is before the law finds a lag, for which it gives up bandwidth"
    assert told.sentence("law").endswith(words)
    assert told.before == ", before it finds a lag"
    plain = dataclasses.replace(told, finds_lag=False)
    assert (plain.sentence("law")[-18:], plain.before) == ("10 ms are believed", "")


def test_a_controller_made_for_a_vehicle_is_asked_in_a_hover_of_it():
    """The same loop by two ways: the controller alone, and the hover that its scenario was written for."""
    vehicle, law, _ = TABLE[1]
    believed = skyarm.Model(vehicle=skyarm.load_vehicle(vehicle), gravity=9.81)
    controller = make_named(law, believed, {"control_period": 0.005})
    alone, planned = hover_delay(hover_of(controller)), hover_delay(hover(vehicle, law, (0.0, 0.0)))
    assert alone.margin == pytest.approx(planned.margin, abs=2e-4)
    # one that is told of 10 ms hovers with measurements so old
    other = make_named("centroidal_tip", believed, {"control_period": 0.005})
    told = dataclasses.replace(other, par=dataclasses.replace(other.par, delay_periods=2))
    assert (hover_of(told).delays.measurement, believed_delay(hover_of(told))) == (0.01, 0.01)


def test_a_planar_model_is_asked_in_a_hover_of_the_body_that_moves_like_it():
    """No plant flies the paper's Table 1; its twin, with moments of inertia moved from the base to the links, does."""
    found = []
    for name in ("hummingbird_arm2", "hummingbird_arm2_twin"):
        believed = skyarm.Model(vehicle=skyarm.load_vehicle(name), gravity=9.81)
        controller = make_named("centroidal_joint", believed, {"control_period": 0.005})
        found.append(hover_delay(hover_of(controller)).margin)
        assert hover_of(controller).controller.par.model.vehicle == believed.vehicle
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def crossed(planar):
    """The arm with its second joint about another axis: the moments that a link needs would show in the motion."""
    first, second = planar.links
    turned = dataclasses.replace(second, joint=dataclasses.replace(second.joint, axis=Vec3(1.0, 0.0, 0.0)))
    return dataclasses.replace(planar, links=(first, turned))


def heavy(planar):
    """Links with more moment of inertia than the base could give: the remainder would be no body's."""
    bodies = (dataclasses.replace(each.body, inertia=each.body.inertia * 100.0) for each in planar.links)
    links = zip(planar.links, bodies, strict=True)
    return dataclasses.replace(planar, links=tuple(dataclasses.replace(link, body=body) for link, body in links))


@pytest.mark.parametrize("changed", [crossed, heavy])
def test_a_planar_model_that_no_body_moves_like_is_refused(changed):
    vehicle = changed(skyarm.load_vehicle("hummingbird_arm2"))
    controller = make_named("centroidal_joint", skyarm.Model(vehicle=vehicle, gravity=9.81), {"control_period": 0.005})
    with pytest.raises(ValueError, match="planar = True: must be false in a plant"):
        hover_of(controller)
