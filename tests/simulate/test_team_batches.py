"""Batches of flights of several vehicles: each lane is the flight that runs alone, to
the bit.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.log.metrics.windows import Windows
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.endings import Ending
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import (
    Change,
    Delays,
    Scenario,
    ScenarioError,
    first_state,
)
from skyarm.simulate.batch import Batch, Outcome
from skyarm.simulate.check_endings import LaneEnd, statuses
from support.teams import team

METRICS = (
    "standard",
    "rotor_jitter",
    "grasp_largest",
    "object_last_z",
    "left/tilt_max",
)
STIFFNESS, MASS = "world.grasps.0.stiffness", "agents.left.plant.vehicle.base.mass"


def noisy(scenario: Scenario) -> Scenario:
    """Scenario whose vehicles measure their positions with noise."""

    def measured(agent: Any) -> Any:
        return dataclasses.replace(
            agent, noise=dataclasses.replace(agent.noise, position=0.002)
        )

    return dataclasses.replace(
        scenario,
        agents={name: measured(each) for name, each in scenario.agents.items()},
    )


def assert_as_alone(
    scenario: Scenario,
    outcome: Outcome,
    columns: Mapping[str, Sequence[float]],
    metrics: Sequence[str],
    seed: int = 0,
) -> list[str]:
    """Compare every lane with a flight of its own; return the statuses."""
    for k in range(len(outcome.status)):
        numbers = {path: float(column[k]) for path, column in columns.items()}
        one = dataclasses.replace(with_numbers(scenario, numbers), seed=seed, episode=k)
        log = skyarm.run(one)
        assert outcome.status[k] == log.status
        assert outcome.end_time[k] == log.info["end_time"]
        scores = skyarm.score(log, metrics)
        assert scores.keys() == outcome.metrics.keys()
        for name, value in scores.items():
            assert outcome.metrics[name][k] == pytest.approx(
                value, rel=1e-12, abs=1e-15, nan_ok=True
            ), name
        if log.status == "completed":
            for name, own in log.agents.items():
                last = [float(c[k]) for c in outcome.agents[name].log.state.position]
                assert last == [*own.position[-1]]
    return list(outcome.status)


def fly(
    scenario: Scenario,
    columns: Mapping[str, Sequence[float]],
    metrics: Sequence[str],
    seed: int = 0,
) -> Outcome:
    """Results of a batch with these numbers, every bit as in a flight of its own, with
    a log of the last instant.
    """
    batch = Batch(
        scenario,
        tuple(columns),
        metrics=metrics,
        bit_exact=True,
        log_every=scenario.steps - 1,
    )
    return last_of(
        batch.fly(
            {path: np.array(column) for path, column in columns.items()}, seed=seed
        )
    )


def last_of(outcome: Outcome) -> Outcome:
    """Results with the last sample of each log alone."""

    def last(own: Any) -> Any:
        state = own.log.state
        position = type(state.position)(*(np.asarray(c)[:, -1] for c in state.position))
        return dataclasses.replace(
            own,
            log=dataclasses.replace(
                own.log, state=dataclasses.replace(state, position=position)
            ),
        )

    return dataclasses.replace(
        outcome, agents={name: last(own) for name, own in outcome.agents.items()}
    )


def test_lanes_of_a_team_with_other_grasps_masses_and_noise_are_flights() -> None:
    scenario = noisy(team("bar", duration=0.4))
    columns = {STIFFNESS: [5000.0, 4980.0], MASS: [0.25, 0.251]}
    outcome = fly(scenario, columns, METRICS, seed=3)
    assert_as_alone(scenario, outcome, columns, METRICS, seed=3)
    assert len(set(outcome.metrics["left/position_error_mean"])) == 2
    assert np.all(
        outcome.metrics["left/tilt_max"] != outcome.metrics["right/grasp_largest"]
    )
    assert [name for name in outcome.metrics if name.endswith("tilt_max")] == [
        "left/tilt_max"
    ]


def two(**options: Any) -> Scenario:
    """Two vehicles with arms in one scenario, which nothing joins."""
    one, other = (
        skyarm.load_scenario(name, duration=0.6) for name in ("case1", "case3")
    )
    agents = {"left": one.agent, "right": dataclasses.replace(other.agent, **options)}
    return dataclasses.replace(one, agents=agents)


def test_the_status_of_a_lane_is_that_of_the_vehicle_that_ends_it() -> None:
    scenario = dataclasses.replace(two(), duration=1.5)
    columns = {
        "agents.left.plant.vehicle.base.mass": [0.77, 0.77, 20.0],
        "agents.right.plant.vehicle.base.mass": [0.77, 20.0, 0.77],
    }
    outcome = fly(scenario, columns, ["tilt_max"])
    statuses = assert_as_alone(scenario, outcome, columns, ["tilt_max"])
    assert statuses == ["completed", "ground", "ground"]


def test_of_two_vehicles_that_meet_an_ending_the_first_says_which() -> None:
    """Four lanes: nothing, the right one on the ground, the left one far away, and both
    at once.
    """
    scenario, lanes = two(), 4

    def end(name: str, height: list[float], x: list[float]) -> LaneEnd:
        first = first_state(scenario.of(name))
        state = rebuild(first, iter([np.full(lanes, leaf) for leaf in leaves(first)]))
        position = dataclasses.replace(
            state.position, x=np.array(x), z=np.array(height)
        )
        state = dataclasses.replace(state, position=position)
        return LaneEnd(state, np.tile([0.0, 0.0, 1.0], (lanes, 1)), None)

    ends = [
        end("left", [1.0] * 4, [0.0, 0.0, -2e3, -2e3]),
        end("right", [1.0, 0.01, 1.0, 0.01], [0.0] * 4),
    ]
    stopped = np.array([False, True, True, True])
    assert statuses(scenario, {}, ends, stopped).tolist() == [
        "completed",
        "ground",
        "diverged",
        "diverged",
    ]
    assert statuses(scenario, {}, ends[::-1], stopped).tolist() == [
        "completed",
        "ground",
        "diverged",
        "ground",
    ]


def test_numbers_of_one_vehicle_its_delay_and_its_changes_are_its_own() -> None:
    change = Change(at=0.3, path="agents.right.plant.vehicle.base.mass", value=0.9)
    scenario = dataclasses.replace(
        two(delays=Delays(longest_command=0.01)), changes=(change,)
    )
    columns = {
        "agents.right.delays.command": [0.0, 0.004],
        "changes.0.value": [0.9, 0.8],
        "agents.left.controller.gains.position.x": [5.0, 6.0],
    }
    outcome = fly(scenario, columns, ["position_error_mean"])
    single = dataclasses.replace(scenario)
    assert_as_alone(single, outcome, columns, ["position_error_mean"])


def test_a_delay_of_one_vehicle_is_that_of_its_flight_alone() -> None:
    """Nothing joins the vehicles; the delays of one divide the steps of both, which
    costs bits.
    """
    case = skyarm.load_scenario("case2_gust", duration=0.6)
    late = dataclasses.replace(case.agent, delays=Delays(longest_command=0.01))
    both, delays = (
        dataclasses.replace(case, agents={"left": late, "right": late}),
        np.array([0.0, 0.0034, 0.008]),
    )
    path, metrics = "delays.command", ["iae_position"]
    found = (
        Batch(both, [f"agents.right.{path}"], metrics=metrics)
        .fly({f"agents.right.{path}": delays})
        .metrics
    )
    one = dataclasses.replace(case, agents={"main": late})
    alone = (
        Batch(one, [path], metrics=metrics).fly({path: delays}).metrics["iae_position"]
    )
    assert np.all(np.abs(np.diff(alone)) > 1e-3 * alone[0])
    np.testing.assert_allclose(found["right/iae_position"], alone, rtol=1e-6)
    np.testing.assert_allclose(found["left/iae_position"], alone[0], rtol=1e-6)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Away(Ending):
    """Further than 5 cm from the reference."""

    status = "away"

    def fine(self, scenario: Any, state: Any, goal: Any, slack: Any) -> Any:
        apart = state.position - goal
        return apart.dot(apart) <= (0.05 - slack) * (0.05 - slack)


def test_a_status_follows_from_the_numbers_and_the_reference_of_its_vehicle() -> None:
    scenario = dataclasses.replace(team("bar", duration=0.3), endings=(Away(),))
    height, start = (
        "agents.right.reference.base.position.2",
        "agents.right.initial.position.z",
    )
    outcome = Batch(scenario, [height, start], metrics=["tilt_max"]).fly(
        {height: np.array([1.0, 1.08, 1.08]), start: np.array([1.0, 1.0, 1.08])}
    )
    assert outcome.status[:2].tolist() == ["completed", "away"]
    assert outcome.end_time[1] == 0.0
    assert outcome.end_time[2] > 0.0


def test_a_rotor_of_one_vehicle_that_is_built_too_low_touches_the_ground() -> None:
    scenario = team("bar", duration=0.1)
    scenario = dataclasses.replace(
        scenario, environment=dataclasses.replace(scenario.environment, ground=True)
    )
    path = "agents.right.plant.vehicle.rotors.front_left.position.z"
    outcome = Batch(scenario, [path], metrics=["tilt_max"], effort=0).fly(
        {path: np.array([0.0, -1.5])}
    )
    assert outcome.status.tolist() == ["completed", "ground"]


@pytest.mark.thorough
def test_a_varied_reference_is_that_of_its_vehicle() -> None:
    scenario = team("bar", duration=0.2)
    columns = {
        "agents.left.reference.base.position.2": [1.0, 1.001],
        "agents.right.reference.yaw.value": [0.0, 0.1],
    }
    metrics = ["position_error_mean", "position_error_mean_continuous"]
    assert_as_alone(scenario, fly(scenario, columns, metrics), columns, metrics)


def test_a_sole_vehicle_of_another_name_has_the_names_and_bits_of_one_without() -> None:
    one = skyarm.load_scenario("case3", duration=0.3)
    solo = dataclasses.replace(one, agents={"solo": one.agent})
    ours, theirs = (
        Batch(each, metrics=["standard"], bit_exact=True).fly({})
        for each in (solo, one)
    )
    assert [*ours.metrics] == [*theirs.metrics]
    assert all(
        np.array_equal(ours.metrics[name], theirs.metrics[name])
        for name in ours.metrics
    )
    assert all(map(np.array_equal, ours.state.position, theirs.state.position))


def test_what_is_of_one_vehicle_is_refused_of_several_in_one_line() -> None:
    outcome = Batch(team("bar", duration=0.1), metrics=["tilt_max"], effort=0).fly({})
    for name in ("state", "log"):
        words = (
            rf"^outcome\.{name}: is of one agent; outcome\.agents\[NAME\]\.{name}, of"
            r" left, right$"
        )
        with pytest.raises(ValueError, match=words):
            getattr(outcome, name)


@pytest.mark.parametrize(
    ("paths", "words"),
    [
        (
            ["plant.gravity"],
            (
                r"path = 'plant\.gravity': is of one agent, must be"
                r" agents\.NAME\.plant\.gravity"
            ),
        ),
        (
            ["agents.nobody.plant.gravity"],
            r"agents\.nobody: must be one of left, right",
        ),
        (
            ["agents.left.sensors.position"],
            r"agents\.left\.sensors\.position: is 0 in this scenario",
        ),
        (["agents.left.delays.command"], r"agents\.left\.delays"),
    ],
)
def test_wrong_paths_are_refused_in_one_line(paths: list[str], words: str) -> None:
    with pytest.raises(ScenarioError, match=words) as error:
        Batch(team("bar", duration=0.1), paths, metrics=["tilt_max"])
    assert "\n" not in str(error.value)


def test_a_delay_beyond_the_queue_of_its_vehicle_is_refused() -> None:
    path = "agents.right.delays.command"
    batch = Batch(
        two(delays=Delays(longest_command=0.01)), [path], metrics=["tilt_max"], effort=0
    )
    with pytest.raises(
        ScenarioError, match=r"values\['agents\.right\.delays\.command'\]: .*0\.01"
    ):
        batch.fly({path: np.array([0.02])})


def test_a_stiffer_grasp_than_the_code_has_steps_for_is_refused() -> None:
    batch = Batch(
        team("bar", duration=0.1), [STIFFNESS], metrics=["tilt_max"], effort=0
    )
    with pytest.raises(
        ScenarioError,
        match=r"values\['world\.grasps\.0\.stiffness'\] = 50000: requires steps of",
    ):
        batch.fly({STIFFNESS: np.array([5.0e4])})


def test_a_lane_with_stiffer_grasps_than_the_file_takes_the_steps_that_they_need() -> (
    None
):
    """The floor has the shortest steps, so a batch takes any grasp up to them: calm
    steps go by each lane's own.
    """
    scenario = dataclasses.replace(
        skyarm.load_scenario("two_carry_a_bar"), duration=5.0, windows=Windows()
    )
    stiff, metrics = (
        [1e4, 1.4e5],
        [
            "team_pull_max",
            "team_position_mean",
            "team_position_last",
            "left/rotor_jitter",
        ],
    )
    paths = [f"world.grasps.{i}.stiffness" for i in (0, 1)]
    found = fly(scenario, dict.fromkeys(paths, stiff), metrics)
    for lane, value in enumerate(stiff):
        one = with_numbers(scenario, dict.fromkeys(paths, value))
        for name, alone in skyarm.score(skyarm.run(one), metrics).items():
            assert found.metrics[name][lane] == pytest.approx(alone, rel=1e-9), name
