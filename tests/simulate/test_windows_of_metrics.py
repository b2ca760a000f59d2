"""When metrics look: as asked, as the scenario says, or the flight after its first
third; never past its end.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.log.metrics.metric_catalogue import GROUPS, metric_names
from skyarm.log.metrics.windows import NAMES, Window, Windows
from skyarm.paper import flights as paper
from skyarm.paper.published import CASES
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate import run
from skyarm.simulate.batch import Batch
from skyarm.studies.compare.suite import CASES as SUITE
from skyarm.studies.sweep.study_file import StudyError, study_from
from support.flights import document
from support.logs import Errors, tracking

PAPER = Windows(
    steady=Window(10.0, 20.0),
    transient=Window(0.0, 8.0),
    gust=Window(5.0, 20.0),
    hover=Window(4.0, 5.9),
    holds=(Window(9.0, 12.0), Window(16.0, 19.0)),
    last=5.0,
)
"""Barakou et al. 2026, section 5 and Table 2."""


@pytest.mark.parametrize("case", CASES)
def test_the_paper_s_cases_have_the_paper_s_windows(case):
    found = load_scenario(case).windows
    assert found == PAPER
    assert (found.steady, found.transient, found.gust) == (
        paper.STEADY,
        paper.TRANSIENT,
        paper.GUST,
    )
    assert (found.hover, found.holds) == (paper.HOVER, paper.HOLDS)
    built = SUITE[case].build()
    flown = SUITE[case].windows.of_flight(built.duration, built.windows)
    expected = Window(7.5, 20.0) if case == "case2_gust" else Window(5.0, 20.0)
    assert (flown.steady, flown.gust, flown.last) == (Window(10.0, 20.0), expected, 5.0)


def test_where_nobody_says_metrics_look_at_the_flight_after_its_first_third():
    found = Windows().of_flight(6.0)
    after = Window(2.0, 6.0)
    assert all(getattr(found, name) == after for name in ("steady", "gust", "hover"))
    assert (found.transient, found.holds, found.last) == (
        Window(0.0, 2.0),
        (after,),
        4.0,
    )
    assert Windows().of_flight(30.0).last == 5.0
    masks = found.masks(np.arange(0.0, 6.0, 0.5))
    assert masks["steady"].sum() == 8
    assert masks["transient"].sum() == 4
    assert masks["last"].sum() == 8


def test_a_window_of_the_scenario_that_ends_with_the_flight_lies_within_it():
    own = Windows(
        steady=Window(3.0, 6.0), holds=(Window(1.0, 2.0), Window(5.0, 6.0)), last=6.0
    )
    found = Windows().of_flight(6.0, own)
    assert (found.steady, found.holds, found.last) == (own.steady, own.holds, own.last)
    shorter = Windows().of_flight(5.99, own)
    assert (shorter.steady.stop, shorter.holds, shorter.last < 5.0) == (
        5.99,
        (shorter.steady,),
        True,
    )
    own.require_within(6.0)
    assert Windows(last=5.0).of_flight(3.0).last == 2.0, (
        "the page's default, in a flight that is shorter than it"
    )


def test_what_is_asked_goes_before_the_scenario_s_own_and_that_before_the_general():
    own = Windows(steady=Window(1.0, 2.0), gust=Window(1.0, 9.0))
    found = Windows(transient=Window(0.0, 0.5)).of_flight(6.0, own)
    assert (found.transient, found.steady) == (Window(0.0, 0.5), Window(1.0, 2.0))
    assert found.gust == Window(2.0, 6.0), (
        "the scenario's own ends after this flight, which was shortened"
    )
    assert Windows(steady=Window(3.0, 4.0)).of_flight(6.0, own).steady == Window(
        3.0, 4.0
    )


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (
            {"steady": Window(10.0, 20.0)},
            r"windows\.steady = \[10, 20\) s: must end within the flight of 6 s",
        ),
        (
            {"holds": (Window(1.0, 2.0), Window(5.0, 7.0))},
            r"windows\.holds = .*\[5, 7\) s: must end within",
        ),
        ({"last": 7.0}, r"windows\.last = 7 s: must end within the flight of 6 s"),
    ],
)
def test_a_window_past_the_end_is_refused(asked, words):
    with pytest.raises(ValueError, match=words):
        Windows(**asked).of_flight(6.0)
    with pytest.raises(ValueError, match=words):
        Batch(scenario_from(document("case1", duration=6.0)), windows=Windows(**asked))
    assert Windows(steady=Window(5.0, 6.0), last=6.0).of_flight(6.0).steady == Window(
        5.0, 6.0
    )


def test_a_scenario_file_with_a_window_past_its_end_is_refused():
    with pytest.raises(
        ScenarioError,
        match=r"windows\.transient = \[0, 7\) s: must end within the flight of 6 s",
    ):
        scenario_from(
            document("case1", duration=6.0, windows={"transient": [0.0, 7.0]})
        )
    # what takes the place of the file's duration shortens the flight, not the file
    shortened = scenario_from(
        document("case1", duration=8.0, windows={"steady": [6.0, 7.0]}),
        replaced={"duration": 1},
    )
    assert Windows().of_flight(shortened.duration, shortened.windows).steady.stop == 1.0


@pytest.mark.parametrize(
    "wrong",
    [
        {"windows": {"steady": [2.0, 1.0]}},
        {"windows": {"steady": [1.0]}},
        {"windows": {"holds": 3}},
        {"windows": {"last": 0.0}},
        {"windows": {"steadi": [0.0, 1.0]}},
        {"windows": 3},
    ],
)
def test_a_window_that_is_none_is_refused_in_one_line(wrong):
    with pytest.raises(ScenarioError, match="windows") as caught:
        scenario_from(document("case1", duration=6.0, **wrong))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [3, "x", [1.0, 2.0], (1.0, 2.0)])
def test_records_of_windows_refuse_what_is_none(value):
    for name in (*NAMES, "holds"):
        with pytest.raises(ValueError, match=rf"windows\.{name}(\[0\])? = "):
            Windows(**{name: value})
    with pytest.raises(ValueError, match=r"window\.start = "):
        Window(math.nan, 1.0)
    with pytest.raises(ScenarioError, match="windows = "):
        dataclasses.replace(load_scenario("case1"), windows=value)


def test_no_metric_of_a_short_flight_is_undefined_without_a_word():
    """A flight of 1 s without windows: every metric of every group is a number, over a
    log and in a batch.

    Those of contact and of teams are apart: without contact, or without a carried body,
    they have no number.
    """
    groups = tuple(name for name in GROUPS if name not in ("contact", "team"))
    scenario = scenario_from(document("case2", duration=1.0))
    log = run(scenario)
    found = skyarm.score(log, groups)
    assert all(math.isfinite(value) for value in found.values()), found
    assert all(math.isnan(value) for value in skyarm.score(log, ["team"]).values())
    flown = Batch(scenario, metrics=groups, bit_exact=True).fly(
        {}, episodes=np.array([0])
    )
    assert set(flown.metrics) == set(metric_names(groups, 2))
    for name, value in found.items():
        assert flown.metrics[name][0] == pytest.approx(value, rel=1e-9, abs=1e-15), name
    third = tracking(log, Errors.held(log), Window(1.0 / 3.0, 1.0))
    assert found["position_error_mean"] == pytest.approx(
        third["position_error_mean"], rel=1e-12
    )


def test_a_log_keeps_the_windows_of_its_scenario():
    scenario = scenario_from(
        document("case2", duration=1.0, windows={"steady": [0.5, 0.75]})
    )
    log = run(scenario)
    assert log.info["windows"]["steady"] == [0.5, 0.75]
    own = tracking(log, Errors.held(log), Window(0.5, 0.75))["position_error_mean"]
    assert skyarm.score(log)["position_error_mean"] == pytest.approx(own, rel=1e-12)
    asked = Windows(steady=Window(0.8, 0.9))
    other = tracking(log, Errors.held(log), asked.steady)["position_error_mean"]
    assert (
        skyarm.score(log, windows=asked)["position_error_mean"]
        == pytest.approx(other, rel=1e-12)
        != own
    )
    with pytest.raises(
        ValueError,
        match=r"windows\.steady = \[0\.8, 1\.5\) s: must end within the flight of 1 s",
    ):
        skyarm.score(log, windows=Windows(steady=Window(0.8, 1.5)))


STUDY = {
    "schema": 1,
    "name": "s",
    "scenario": "case2",
    "episodes": 2,
    "controllers": ["paper_ct"],
}


def test_a_study_s_windows_are_its_own_or_the_scenario_s():
    assert study_from(STUDY).document["windows"]["steady"] == [10.0, 20.0]
    asked = study_from(STUDY | {"windows": {"steady": [12.0, 13.0]}}).document[
        "windows"
    ]
    assert (asked["steady"], asked["transient"]) == ([12.0, 13.0], [0.0, 8.0])
    assert study_from(STUDY | {"duration": 6.0}).document["windows"]["steady"] == [
        2.0,
        6.0,
    ]
    with pytest.raises(
        StudyError,
        match=r"windows\.steady = \[12, 13\) s: must end within the flight of 6 s",
    ):
        study_from(STUDY | {"duration": 6.0, "windows": {"steady": [12.0, 13.0]}})
