"""Endings of a user's own beside the library's: in flight, with their cause, and in
each lane of a batch.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.endings import Ending
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.scenario.scenario_record import first_state
from skyarm.simulate import run
from skyarm.simulate.batch import Batch
from skyarm.simulate.check_endings import LaneEnd, endings_of, find_ending, statuses
from skyarm.simulate.loop import run_in_python
from support.components import Ceiling, same_logs
from support.flights import document

UP = {
    "kind": "signals",
    "z": [1.0, {"kind": "ramp", "start": 0.1, "duration": 1.0, "height": 1.0}],
}
RISING = dataclasses.replace(
    scenario_from(document("case1", duration=1.5, reference__base=UP)),
    endings=(Ceiling(height=1.2),),
)


@dataclass(frozen=True, kw_only=True)
class Away(Ending):
    """Too far from the goal; it says no cause of its own."""

    distance: float = 0.1
    status = "away"

    def fine(self, scenario: Any, state: Any, goal: Vec3, slack: Any) -> Any:
        apart = state.position - goal
        return apart.dot(apart) <= (self.distance - slack) * (self.distance - slack)


@pytest.fixture(scope="module")
def free():
    return run(dataclasses.replace(RISING, endings=()))


@pytest.mark.parametrize(
    ("fly", "plant"),
    [(run, "rigid_body"), (run_in_python, "rigid_body"), (run, "mujoco")],
    ids=["code", "py", "mujoco"],
)
def test_an_ending_comes_at_the_first_instant_that_is_not_fine(fly, plant, free):
    free = (
        free
        if plant == "rigid_body"
        else run(dataclasses.replace(RISING, endings=(), kind=plant))
    )
    first = int(np.argmax(free.position[:, 2] > 1.2))
    assert first > 20
    log = fly(dataclasses.replace(RISING, kind=plant))
    assert (log.status, log.time.size, log.info["end_time"]) == (
        "ceiling",
        first,
        first / 200,
    )
    assert log.info["cause"] == f"z = {free.position[first, 2]:.3f} m passed 1.2"
    assert log.position.tobytes() == free.position[:first].tobytes()


def test_an_ending_that_never_comes_changes_nothing(free):
    log = run(
        dataclasses.replace(RISING, endings=(Ceiling(height=50.0), Away(distance=30.0)))
    )
    assert log.status == "completed"
    assert same_logs(log, free)


def test_an_ending_without_a_cause_says_its_status():
    log = run(dataclasses.replace(RISING, endings=(Away(distance=0.02),)))
    assert log.status == log.info["cause"] == "away"
    assert np.linalg.norm(log.position - log.position_held, axis=1).max() <= 0.02


def test_the_librarys_endings_come_first_and_then_the_users_in_their_order():
    scenario = dataclasses.replace(
        RISING, endings=(Ceiling(height=1.2), Away(distance=0.5))
    )
    names = [ending.status for ending in endings_of(scenario)]
    own = [
        "diverged",
        "joint_limit",
        "controller_undefined",
        "ground",
        "rotor_contact",
        "body_contact",
    ]
    assert names == [*own, "ceiling", "away"]
    base = np.array(leaves(first_state(scenario)))

    def status(**numbers):
        x = base.copy()
        for place, value in numbers.items():
            x[int(place[1:])] = value
        found = find_ending(scenario, 0.0, x.tolist(), [0.0, 0.0, 1.0])
        return found.status if found else "completed"

    assert status() == "completed"
    assert status(_2=1.4) == "ceiling"
    assert status(_2=2.0) == "ceiling", "and away"
    assert status(_0=0.6) == "away"
    assert status(_2=2.0, _7=np.inf) == status(_2=np.nan) == "diverged"


def test_a_state_that_is_not_a_number_is_never_fine():
    scenario = dataclasses.replace(RISING, ground=False)
    state = dataclasses.replace(
        first_state(scenario), position=Vec3(0.0, 0.0, float("nan"))
    )
    assert not Ceiling().fine(scenario, state, Vec3(0.0, 0.0, 1.0), 0)


def test_lanes_of_a_batch_end_as_single_flights_do_each_with_its_own_limit():
    heights = np.array([1.2, 1.5, 9.0, 0.5])
    batch = Batch(RISING, ("endings.0.height",), bit_exact=True)
    outcome = batch.fly({"endings.0.height": heights}, episodes=np.zeros(4, dtype=int))
    for lane, height in enumerate(heights.tolist()):
        log = run(with_numbers(RISING, {"endings.0.height": height}))
        assert (outcome.status[lane], outcome.end_time[lane]) == (
            log.status,
            log.info["end_time"],
        )
    assert outcome.status.tolist() == ["ceiling", "ceiling", "completed", "ceiling"]
    assert outcome.end_time[3] == 0.0


def test_statuses_of_lanes_are_those_of_single_states_in_their_order():
    scenario = dataclasses.replace(
        RISING, endings=(Ceiling(height=1.2), Away(distance=0.5))
    )
    rng = np.random.default_rng(0)
    states = np.repeat(np.array(leaves(first_state(scenario)))[None, :], 300, axis=0)
    states[:, 2] = rng.choice([1.0, 1.3, 0.05, np.nan, 1.9], 300)
    states[:, 0] = rng.choice([0.0, 0.7, -2e3], 300, p=[0.6, 0.3, 0.1])
    goals = np.tile([0.0, 0.0, 1.0], (300, 1))
    wanted = [
        find_ending(scenario, 0.0, x, goal)
        for x, goal in zip(states.tolist(), goals.tolist(), strict=True)
    ]
    named = [each.status if each else "completed" for each in wanted]
    assert set(named) == {"completed", "diverged", "ground", "ceiling", "away"}
    state = rebuild(first_state(scenario), iter(list(states.T)))
    assert (
        statuses(
            scenario, {}, [LaneEnd(state, goals, None)], np.zeros(300, dtype=bool)
        ).tolist()
        == named
    )


def test_a_lane_inside_an_own_limit_that_machine_code_found_outside_keeps_its_cause():
    scenario = load_scenario("case1")
    scenario = dataclasses.replace(scenario, endings=(Ceiling(height=1.0 + 1e-8),))
    state = rebuild(
        first_state(scenario),
        iter([np.full(1, leaf) for leaf in leaves(first_state(scenario))]),
    )
    goals = np.array([[0.0, 0.0, 1.0]])
    assert statuses(
        scenario, {}, [LaneEnd(state, goals, None)], np.array([True])
    ).tolist() == ["ceiling"]
    assert statuses(
        scenario, {}, [LaneEnd(state, goals, None)], np.array([False])
    ).tolist() == ["completed"]
