"""Tasks whose phases wait for what the flight shows: pressed, slid, searched; alone, in
batches and in sessions.
"""

from __future__ import annotations

import copy
import dataclasses
import tomllib
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.log.flight_summary import facts, sentences
from skyarm.log.metrics.score import score
from skyarm.scenario.numbers import with_numbers
from skyarm.simulate.batch import Batch
from skyarm.simulate.check_endings import failed_phase
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.loop import run_in_python
from skyarm.simulate.reference_clock import Waits
from skyarm.simulate.stages import joined_reference
from skyarm.studies.sweep.study_file import load_study

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
DOCUMENT = tomllib.loads((EXAMPLES / "press_in_phases.toml").read_text("utf-8"))

METRICS = ("phases_done", "reference_lag_max", "ee_error_max_continuous")

TIMEOUT, SPEED = "reference.guards.0.timeout", "reference.push.speed"


@pytest.fixture(scope="module")
def scenario():
    return skyarm.load_scenario(EXAMPLES / "press_in_phases.toml", duration=7.5)


@pytest.fixture(scope="module")
def log(scenario):
    return skyarm.run(scenario)


def same(a, b):
    """Names of the arrays in which two logs differ."""
    return [
        name
        for name, array in a.arrays().items()
        if not np.array_equal(array, b.arrays()[name])
    ]


def test_each_phase_begins_when_the_flight_has_shown_what_the_one_before_asks(log):
    names, ends = zip(*log.phase_ends, strict=True)
    assert names == ("hold", "press", "slide", "retreat")
    assert "timeout" not in sentences(facts(log))[0]
    assert [each["timeout"] for each in facts(log)["phase_ends"]] == [False] * 4
    touch = log.time[np.flatnonzero(log.contact_force[:, 0] > 0.0)[0]]
    # half the force is felt for 0.1 s, then it presses for 0.5 s; the wanted force is
    # there at the end
    assert touch + 0.6 < ends[1] < touch + 1.2
    assert log.contact_force[np.searchsorted(log.time, ends[1]), 0] == pytest.approx(
        1.0, abs=0.05
    )
    # the slide takes its 3 s, and 0.2 s in which the error across is small
    assert ends[2] - ends[1] == pytest.approx(3.2, abs=0.03)
    k = np.searchsorted(log.time, ends[2])
    assert np.linalg.norm((log.tip - log.tip_reference)[k, 1:]) < 5e-3
    assert ends[3] - ends[2] == pytest.approx(1.6, abs=0.1)
    assert (log.contact_force[log.time > ends[2] + 0.3, 0] == 0.0).all()


def test_a_tip_that_touches_on_its_path_leaves_the_wall_by_a_retreat():
    """Its path begins 2 mm in front of the wall, so that without a force alone it would
    lean there.
    """
    document = copy.deepcopy(DOCUMENT) | {"duration": 5.0}
    document["world"]["surfaces"][0]["position"][0] = 0.252
    phases = document["reference"]["tip"]["path"]["phases"]
    document["reference"]["tip"]["path"]["phases"] = [*phases[:2], phases[3]]
    log = skyarm.run(skyarm.scenario_from(document))
    ends = dict(log.phase_ends)
    assert log.status == "completed"
    assert ends["retreat"] - ends["press"] == pytest.approx(1.6, abs=0.1)
    assert (log.contact_force[log.time > ends["press"] + 0.6, 0] == 0.0).all()
    assert log.tip[-1, 0] == pytest.approx(0.15, abs=2e-3)


def test_the_log_says_where_the_reference_s_clock_stands(scenario, log):
    assert (np.diff(log.path_time) >= 0.0).all()
    waits = np.diff(log.path_time) == 0.0
    assert waits.sum() / 200 == pytest.approx(
        log.time[-1] - log.path_time[-1], abs=0.02
    )
    assert np.unique(log.phase).tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    for k in (50, 250, 700, 1100, 1399):
        wanted = scenario.reference.at(float(log.path_time[k]))
        np.testing.assert_array_equal(
            log.tip_reference[k], [float(c) for c in wanted.tip]
        )


def test_python_floats_and_a_log_fly_the_same_bits(scenario, log):
    # one that waits no longer than four periods; until then it is the same flight
    hasty = with_numbers(dataclasses.replace(scenario, duration=0.7), {TIMEOUT: 0.02})
    short = run_in_python(hasty)
    assert (short.status, short.info["end_time"]) == (
        "phase_failed",
        pytest.approx(0.575),
    )
    assert short.info["cause"] == "phase 1 'press': no contact of 0.5 N within 0.02 s"
    arrays = log.arrays()
    assert [
        name
        for name, a in short.arrays().items()
        if not np.array_equal(a[:114], arrays[name][:114])
    ] == []
    assert same(skyarm.replay(log), log) == []


def test_a_session_goes_on_from_a_gate(scenario, log):
    session = skyarm.Session(scenario)
    for _ in range(200):
        session.step()
    assert session.now.agent.clock.waited > 0.0  # it waits for the touch
    # margins look at the reference where it stands
    row = episode_inputs(scenario).row_at(200, session.now.agent, session.now.ticks)
    assert [float(c) for c in row.reference.tip] == [
        float(c) for c in session.reference.tip
    ]
    assert (row.time, row.path_time) == (1.0, session.now.agent.clock.place / 200.0)
    held, held_place = session.snapshot(), session.now.agent.clock.place
    np.testing.assert_array_equal(
        [float(c) for c in session.reference.tip], log.tip_held[200]
    )
    assert same(session.run(), log) == []
    # another task of the same shape begins at the flight's time, at the first guard
    # that is to come
    session.restore(held)
    session.change({"reference": DOCUMENT["reference"]})
    assert (session.now.agent.clock.place, session.now.agent.clock.guard) == (
        200.0,
        1.0,
    )
    assert session.now.agent.clock.place > held_place


@pytest.fixture(scope="module")
def batch(scenario):
    """Four lanes: the scenario itself, a guard without patience, a faster tip, both."""
    values = {
        TIMEOUT: np.array([3.0, 0.5, 3.0, 0.5]),
        SPEED: np.array([0.1, 0.1, 0.2, 0.2]),
    }
    flown = Batch(
        scenario, list(values), bit_exact=True, log_every=1, metrics=METRICS, effort=0
    ).fly(values)
    return values, flown


def require_same(found, lane, alone):
    """A lane is the flight that was flown alone."""
    flown = alone.time.size
    assert (alone.status, alone.info["end_time"]) == (
        found.status[lane],
        found.end_time[lane],
    )
    np.testing.assert_array_equal(
        found.log.state.position.x[lane][:flown], alone.position[:, 0]
    )
    # published at 50 Hz, each sample held for four periods
    pressing = np.isin(alone.phase, (1.0, 2.0))[np.arange(flown) // 4 * 4]
    np.testing.assert_array_equal(
        found.log.reference.push[0][lane][:flown] > 0.0, pressing
    )
    for name, value in score(alone, METRICS).items():
        # a lane that ended before a metric's window has none, as alone
        assert found.metrics[name][lane] == pytest.approx(
            value, rel=1e-12, nan_ok=True
        ), name


def test_a_lane_of_a_batch_waits_for_itself(batch, log):
    _, found = batch
    require_same(found, 0, log)
    assert found.status.tolist() == [
        "completed",
        "phase_failed",
        "completed",
        "phase_failed",
    ]
    # 0.55 s of the plan, the timeout, and the period in which it is noticed
    np.testing.assert_allclose(found.end_time[[1, 3]], 1.055)
    assert found.metrics["phases_done"].tolist() == [4.0, 1.0, 4.0, 1.0]
    assert (
        found.metrics["reference_lag_max"][2]
        < found.metrics["reference_lag_max"][0] - 0.2
    )


@pytest.mark.thorough
@pytest.mark.parametrize("lane", [1, 2, 3])
def test_a_batch_is_a_loop_of_single_flights(scenario, batch, lane):
    values, found = batch
    alone = skyarm.run(
        with_numbers(
            scenario, {path: float(column[lane]) for path, column in values.items()}
        )
    )
    require_same(found, lane, alone)


@pytest.mark.thorough
def test_a_phase_that_must_not_fail_ends_the_flight_and_says_why(scenario):
    away = with_numbers(scenario, {"world.surfaces.wall.position.0": 2.0})
    log = skyarm.run(away)
    assert log.status == "phase_failed"
    assert log.info["cause"] == "phase 1 'press': no contact of 0.5 N within 3 s"
    assert log.phase_ends[1:] == (("press", None), ("slide", None), ("retreat", None))
    assert any(
        "press - (timeout), slide -, retreat -" in said
        for said in sentences(facts(log))
    )
    # 0.55 s of the plan, 3 s of waiting, and the period in which it is noticed
    assert log.info["end_time"] == pytest.approx(3.555)


def test_who_joins_late_is_told_of_the_tip_at_rest_and_of_no_contact(scenario):
    late, going = (
        dataclasses.replace(scenario, tracking_start=3.0),
        scenario.reference.at(2.0),
    )
    before, after = (joined_reference(late, going, time) for time in (2.0, 3.0))
    start = scenario.reference.at(0.0)
    assert after == going
    assert before.tip == tuple(float(c) for c in start.tip)
    assert going.push[0] == 1.0
    assert before.push == (0.0, *going.push[1:])


@pytest.mark.thorough
def test_a_guard_may_let_the_task_go_on(scenario):
    away = with_numbers(scenario, {"world.surfaces.wall.position.0": 2.0})
    guard = dataclasses.replace(away.reference.guards[0], fails=False)
    on = dataclasses.replace(away.reference, guards=(guard, *away.reference.guards[1:]))
    goes_on = skyarm.run(dataclasses.replace(away, reference=on, duration=4.5))
    assert (goes_on.status, goes_on.phase_ends[1]) == (
        "completed",
        ("press", pytest.approx(4.055)),
    )
    assert any("press 4.055 s (timeout)" in said for said in sentences(facts(goes_on)))


def test_a_law_that_observes_no_force_is_told_of(scenario):
    blind = skyarm.load_scenario(
        EXAMPLES / "press_in_phases.toml", controller="paper_ct"
    )
    clock = dataclasses.replace(Waits(blind).first(), guard=1.0)
    assert failed_phase(blind, 3.0, clock) is None
    failed = dataclasses.replace(clock, failed=1.0)
    words = "phase 1 'press': no contact of 0.5 N within 3 s"
    assert failed_phase(scenario, 3.0, failed).cause == words
    assert (
        failed_phase(blind, 3.0, failed).cause
        == f"{words}; law hybrid_computed_torque observes no force"
    )


def test_a_search_ends_where_the_tip_drops_in_and_the_reference_stays_there():
    document = copy.deepcopy(DOCUMENT)
    # a slit of 2 cm, whose edge is 1 mm beside the tip
    sides = {"left": 0.522, "right": -0.499}
    size = [0.1, 1.0, 0.9]
    document["world"]["surfaces"] = [
        {"name": name, "shape": "box", "size": size, "position": [0.342, y, 0.45]}
        for name, y in sides.items()
    ]
    search = {
        "kind": "search",
        "pitch": 0.004,
        "radius": 0.012,
        "pace": 0.03,
        "depth": 0.006,
    }
    back = {"kind": "retreat", "position": [0.2, 0.0, 0.83], "duration": 1.0}
    phases = document["reference"]["tip"]["path"]["phases"]
    document["reference"]["tip"]["path"]["phases"] = [
        *phases[:2],
        search,
        {"kind": "insert", "distance": 0.02},
        back,
    ]
    scenario = skyarm.scenario_from(document | {"duration": 8.0})
    log = skyarm.run(scenario)
    ends = dict(log.phase_ends)
    assert log.status == "completed"
    planned = {phase.name: phase.end for phase in scenario.reference.phases}
    assert (
        0.1
        < ends["search"] - ends["press"]
        < planned["search"] - planned["press"] - 0.5
    )
    # no jump where the rest of the spiral is skipped, and the plan again after the
    # retreat
    steps = np.abs(np.diff(log.tip_reference, axis=0)).max(axis=1)
    k = np.searchsorted(log.time, ends["search"])
    assert steps[k - 3 : k + 3].max() < 0.03 * 1.5 / 200
    np.testing.assert_allclose(log.tip_reference[-1], [0.2, 0.0, 0.83], atol=1e-12)
    assert np.abs(log.tip_reference[k, 1:] - [0.0, 0.83]).max() > 1e-3
    gone_in = log.tip[np.searchsorted(log.time, ends["insert"]), 0] - log.tip[k, 0]
    assert gone_in > 0.019


def test_the_study_of_four_worlds_is_of_this_scenario():
    study = load_study(EXAMPLES / "press_in_four_worlds.toml")
    assert study.episodes == 4


def test_a_lane_that_ends_before_its_phases_are_replaced_has_its_own_status(scenario):
    """The clock of phases that wait is gone after the change, but not of the lane that
    fell before it.
    """
    hover = skyarm.Change(
        at=1.5,
        path="reference",
        value={"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
    )
    changed = dataclasses.replace(scenario, duration=2.0, changes=(hover,))
    gravity = np.array([9.81, 40.0])
    flown = Batch(changed, ["plant.gravity"], metrics=METRICS[2:]).fly(
        {"plant.gravity": gravity}
    )
    alone = [
        skyarm.run(with_numbers(changed, {"plant.gravity": value})) for value in gravity
    ]
    assert list(flown.status) == [log.status for log in alone]
    assert flown.status[0] == "completed" != flown.status[1]
    assert flown.end_time[1] < 1.5
