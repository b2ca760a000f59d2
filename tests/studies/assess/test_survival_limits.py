"""Largest blow, lateness and load that short flights survive: single flights are the
oracle.
"""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.log.metrics.windows import Window, Windows
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Delays, ScenarioError, with_words
from skyarm.studies.assess.finding import FAULT, NOTE, OK
from skyarm.studies.assess.survival_limits import (
    DURATION,
    HEAVIEST,
    LATEST,
    SECTIONS,
    START,
    flight_together,
    hit_while_swinging,
    largest,
    lost,
    survival_limits,
)
from skyarm.world import TimedPayload
from skyarm.world.wind import ForceWind
from support.teams import nothing, team, with_law

SCENARIO = skyarm.load_scenario("case3", controller="paper_ct")
MASS = float(SCENARIO.agent.plant.vehicle.mass)


@pytest.fixture(scope="module")
def found():
    return largest(
        SCENARIO,
        {"blow": 3.0 * MASS, "lateness": LATEST, "load in motion": HEAVIEST * MASS},
    )


def flies(scenario):
    log = skyarm.run(scenario)
    windows = Windows(steady=Window(DURATION - 5.0, DURATION))
    metrics = skyarm.score(log, ["ee_error_last_mean_continuous", "tilt_rms"], windows)
    return not lost(metrics, log.status == "completed")


def test_the_largest_lateness_is_flown_and_the_next_section_is_lost(found):
    scenario = hit_while_swinging(SCENARIO)
    section, step = LATEST / SECTIONS, 0.001
    # a single flight is late by whole steps of the physics
    for late, good in (
        (found["lateness"] - step, True),
        (found["lateness"] + section + step, False),
    ):
        delays = Delays(command=round(late / step) * step)
        assert (
            flies(
                scenario.with_agent(dataclasses.replace(scenario.agent, delays=delays))
            )
            is good
        )


def test_the_largest_load_is_taken_in_motion_and_the_next_section_is_lost(found):
    scenario, section = hit_while_swinging(SCENARIO), HEAVIEST * MASS / SECTIONS
    for mass, good in (
        (found["load in motion"], True),
        (found["load in motion"] + section, False),
    ):
        payloads = (TimedPayload(mass=mass, pick=START),)
        assert (
            flies(
                scenario.with_agent(
                    dataclasses.replace(scenario.agent, payloads=payloads)
                )
            )
            is good
        )


def test_a_blow_is_over_within_a_period_and_changes_the_speed_by_what_it_weighs():
    scenario, blow = hit_while_swinging(SCENARIO), 0.4
    assert [(each.pick, each.mass) for each in scenario.agent.payloads] == [
        (START, 0.0)
    ]
    still = skyarm.run(scenario)
    for axis in "xyz":
        log = skyarm.run(
            with_numbers(
                scenario, {f"environment.forces.0.force.{axis}.value": blow * 200.0}
            )
        )
        before, after, later = (
            int(np.argmin(np.abs(log.time - t)))
            for t in (START, START + 0.005, START + 0.01)
        )
        change = (log.velocity - still.velocity)[:, "xyz".index(axis)]
        assert abs(change[before]) < 1e-9
        # the arm hangs on its joints and follows later
        assert change[after] == pytest.approx(blow / MASS, rel=0.25)
        assert change[later] == pytest.approx(change[after], rel=0.2)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("axis", "xyz")
def test_the_weakest_of_six_directions_counts(axis, sign, monkeypatch):
    def fly(work):
        force = work.columns[f"environment.forces.0.force.{axis}.value"]
        # a flight that is a little off as it is must come back as near as that
        error = np.where(
            sign * force > 0.5 * 2.0 * 200.0 + 1e-6, 0.16, 0.1 + 0.04 * (force != 0.0)
        )
        status = np.full(len(force), "completed")
        return {
            "ee_error_last_mean_continuous": error,
            "tilt_rms": 0.0 * error,
            "status": status,
        }

    monkeypatch.setattr("skyarm.studies.assess.survival_limits.fly", fly)
    most = {"blow": 2.0, "lateness": 0.1, "load in motion": 0.3}
    assert largest(SCENARIO, most) == pytest.approx(most | {"blow": 1.0})


def test_the_last_seconds_are_five_whatever_the_windows_of_the_scenario(monkeypatch):
    short, seen = Windows(last=0.5), []

    def fly(work):
        seen.append(work.windows.of_flight(DURATION, work.scenario.windows).last)
        none = np.zeros(1 + 8 * SECTIONS)
        return {
            "ee_error_last_mean_continuous": none,
            "tilt_rms": none,
            "status": np.full(none.size, "completed"),
        }

    monkeypatch.setattr("skyarm.studies.assess.survival_limits.fly", fly)
    largest(
        with_words(SCENARIO, windows=short),
        {"blow": 1.0, "lateness": 0.1, "load in motion": 0.1},
    )

    def flown(scenario):
        seen.append(scenario.windows.of_flight(scenario.duration).last)
        raise ScenarioError("seen")

    monkeypatch.setattr("skyarm.studies.assess.survival_limits.run", flown)
    flight_together(with_words(team("bar", duration=20.0), windows=short))
    assert seen == [5.0, 5.0]


def test_every_number_is_a_note_with_its_unit():
    findings = survival_limits(SCENARIO)
    assert [(each.question, each.level, each.unit) for each in findings] == [
        ("largest blow", NOTE, "N s"),
        ("largest lateness", NOTE, "ms"),
        ("largest load in motion", NOTE, "kg"),
    ]
    blow, late, load = findings
    assert 0.0 < blow.value <= blow.limit == pytest.approx(5.0 * MASS)
    assert f"survives {late.value:.3g} ms of the commands" in late.text
    assert 0.0 < load.value < load.limit


def test_a_law_that_does_not_survive_calm_air_is_a_fault():
    scenario = SCENARIO.with_delays(Delays(command=0.045))
    (found,) = survival_limits(scenario)
    assert (found.level, found.field) == (FAULT, "controller")
    assert "is lost while it swings slowly in calm air" in found.text


def test_what_no_batch_flies_is_not_known():
    (found,) = survival_limits(skyarm.load_scenario("case1", controller="nmpc"))
    assert (found.level, found.text.startswith("not known: ")) == (NOTE, True)


def test_a_flight_is_lost_by_an_ending_by_its_distance_or_by_its_tilt():
    metrics = {
        "ee_error_last_mean_continuous": np.array([0.4, 0.4, 0.6, 0.4, np.nan]),
        "tilt_rms": np.array([0.1, 0.1, 0.1, 2.0, 0.1]),
    }
    completed = np.array([True, False, True, True, True])
    assert lost(metrics, completed).tolist() == [False, True, True, True, True]
    assert lost(metrics, completed, 0.1).all()


@pytest.mark.parametrize(
    "name",
    [
        "write_on_wall",
        "push_button",
        pytest.param("slide_up", marks=pytest.mark.thorough),
    ],
)
def test_the_world_of_a_scenario_is_left_out(name):
    scenario = skyarm.load_scenario(name)
    alone = hit_while_swinging(scenario)
    assert (scenario.world is None, alone.world) == (False, None)
    assert flies(alone)


def test_flights_take_a_law():
    with pytest.raises(
        ValueError,
        match=(
            "--flights: must be left out unless a scenario of one vehicle states"
            " the law"
        ),
    ):
        skyarm.check("hummingbird_arm2", flights=True)
    with pytest.raises(
        ValueError,
        match=r"--payload = 0.1: must be left out beside --flights: state payloads in",
    ):
        skyarm.check(SCENARIO, flights=True, payload=0.1)
    found = skyarm.check(SCENARIO, flights=True)
    assert [each.question for each in found.findings][-3:] == [
        "largest blow",
        "largest lateness",
        "largest load in motion",
    ]
    assert found.flies


def test_vehicles_that_hold_a_body_fly_their_scenario_in_calm_air():
    calm = team("bar", duration=2.0)
    storm = with_words(calm, wind=ForceWind(force_W=Vec3(0.0, 0.0, -400.0)))
    assert skyarm.run(storm).status != "completed"
    (found,) = flight_together(storm)
    assert (found.level, found.text) == (OK, "they fly together for 2 s")
    falling = with_law(calm, nothing)
    log = skyarm.run(falling)
    (found,) = flight_together(falling)
    assert (found.level, found.field) == (FAULT, "agents")
    assert found.text.startswith(f"lost in calm air by {log.time[-1]:.3g} s: ")


def test_no_more_than_half_a_minute_is_flown_and_an_unknown_law_is_said(monkeypatch):
    flown = []

    def refuse(scenario):
        flown.append(scenario.duration)
        raise ScenarioError("controller: is not here")

    monkeypatch.setattr("skyarm.studies.assess.survival_limits.run", refuse)
    (found,) = flight_together(team("bar", duration=600.0))
    assert (found.level, found.text) == (NOTE, "not known: controller: is not here")
    assert flown == [30.0]


@pytest.mark.parametrize(("off", "level"), [(0.4, OK), (0.6, FAULT)])
def test_a_held_body_that_stays_behind_is_lost_although_the_flight_ends_well(
    off, level, monkeypatch
):
    unfinished = (SimpleNamespace(reference="phase"),)  # a longer flight is cut
    agents = {"left": SimpleNamespace(shortfall=SimpleNamespace(unreached=unfinished))}
    time = np.arange(0.0, 20.0, 0.1)
    error = np.where(time > 14.5, off, 5.0)[:, None]
    log = SimpleNamespace(
        status="completed", agents=agents, time=time, team_position_error=error
    )
    monkeypatch.setattr("skyarm.studies.assess.survival_limits.run", lambda _: log)
    (found,) = flight_together(team("long_bar"))
    assert found.level == level
    assert (f"the body is {off:.3g} m off" in found.text) is (level == FAULT)


def test_a_scenario_with_a_fault_is_not_flown_and_says_so():
    found = skyarm.check(SCENARIO.with_delays(Delays(command=0.045)), flights=True)
    assert not found.flies
    assert (found.findings[-1].question, found.findings[-1].text) == (
        "flight in calm air",
        "not flown: a fault above",
    )
