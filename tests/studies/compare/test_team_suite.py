"""Benchmark of the laws of a team: what its conditions change, who flies them, and what counts as placed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.records.arrays import AnyArray as Array
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.cell_flights import PLACED, SUCCESS_METRIC, Cell, successes
from skyarm.studies.compare.team_suite import FLOWN, LAWS, ROWS, TeamFlights, TeamSuite, with_entries


def cell(row: str, law: str = "object_wrench", seeds: int = 3) -> TeamFlights:
    """Flights of a law under a condition."""
    (flights,) = TeamSuite(laws=(law,), rows=(row,), seeds=seeds).plan_cells()[0]
    return flights


def tip(scenario: Scenario, agent: str, t: float) -> list[float]:
    """Desired place (m) of a vehicle's tip at a time (s)."""
    path = scenario.agents[agent].reference.tip
    assert path is not None
    return [float(signal.derivatives(t)[0]) for signal in (path.x, path.y, path.z)]


def flight(flights: TeamFlights, k: int) -> tuple[Scenario, dict[str, float]]:
    """Scenario of one flight with its numbers."""
    scenario = flights.scenario()
    numbers = {path: float(column[k]) for path, column in flights.values(scenario).items()}
    return with_numbers(scenario, numbers), numbers


def test_entries_replace_those_of_a_file_key_by_key_and_in_each_table_of_a_list() -> None:
    own = {"a": [{"x": 1, "y": 1}, {"x": 2}], "b": {"c": 1, "d": 1}, "e": 0}
    new = with_entries(own, {"a": {"x": 3}, "b": {"d": 2}, "e": [1], "f": {"g": 1}})
    assert new == {"a": [{"x": 3, "y": 1}, {"x": 3}], "b": {"c": 1, "d": 2}, "e": [1], "f": {"g": 1}}
    assert own["a"] == [{"x": 1, "y": 1}, {"x": 2}]


def test_every_law_flies_every_condition_unless_it_says_which() -> None:
    names = [each.name for each in TeamSuite().plan_cells()[0]]
    for row, fields in ROWS.items():
        laws = [law for condition, _, law in names if condition == row]
        assert laws == [*fields.get("laws", LAWS)], row
    assert {(each.condition.name, each.plant) for each in TeamSuite().plan_cells()[0] if each.plant == "mujoco"} == {
        ("mujoco", "mujoco")
    }
    assert {each.condition.episodes for each in TeamSuite(seeds=5).plan_cells()[0]} == {1, 5}


def test_every_law_meets_the_same_masses_one_factor_a_vehicle() -> None:
    first, other = (cell("masses", law, seeds=40) for law in ("own_paths", "object_wrench"))
    scenario = first.scenario()
    drawn = first.values(scenario)
    again = other.values(other.scenario())
    assert all(np.array_equal(drawn[path], again[path]) for path in drawn)
    factors = {}
    for agent in ("left", "right"):
        bodies = {"base": scenario.agents[agent].plant.vehicle.base}
        bodies |= {f"links.{link.name}.body": link.body for link in scenario.agents[agent].plant.vehicle.links}
        columns = [drawn[f"agents.{agent}.plant.vehicle.{at}.mass"] / float(b.mass) for at, b in bodies.items()]
        assert np.allclose(columns, columns[0], rtol=1e-6)
        factors[agent] = columns[0]
    factors["bar"] = drawn["world.objects.bar.mass"] / 1.6
    for factor in factors.values():
        assert 0.8 <= factor.min() < 0.85
        assert 1.15 < factor.max() <= 1.2
    assert abs(np.corrcoef(factors["left"], factors["right"])[0, 1]) < 0.5
    # the team supposes the nominal mass, and the lightest bar fixes the steps
    assert float(scenario.team.mass) == 1.6
    assert float(scenario.world.objects[0].mass) == pytest.approx(1.28)


def test_a_late_clock_is_the_whole_path_of_one_member_later() -> None:
    late, _ = flight(cell("clock"), 0)
    shipped = skyarm.load_scenario(FLOWN)
    for t in (0.5, 3.2, 5.9, 8.1, 12.3, 15.2, 18.4, 19.99):
        assert tip(late, "right", t) == pytest.approx(tip(shipped, "right", t - 0.05), abs=1e-12)
        assert tip(late, "left", t) == tip(shipped, "left", t)
        yaw = late.agents["right"].reference.at(t).yaw
        assert yaw == pytest.approx(shipped.agents["right"].reference.at(t - 0.05).yaw, abs=1e-12)


def test_all_at_once_moves_the_supposed_grasp_and_with_it_the_path() -> None:
    drawn, numbers = flight(cell("all"), 1)
    off = numbers["team.members.1.place.x"] - 0.55
    assert 1e-4 < abs(off) <= 0.02
    shipped = skyarm.load_scenario(FLOWN)
    assert tip(drawn, "right", 1.0) == pytest.approx(tip(shipped, "right", 1.0), abs=1e-12)  # not yet taken
    for t in (5.0, 11.0, 13.0, 18.0):
        x, y, z = tip(shipped, "right", t)
        motion = shipped.team.motion.at(t)
        away = motion.R.column(0)
        assert tip(drawn, "right", t) == pytest.approx([x + off * away.x, y + off * away.y, z + off * away.z], abs=1e-9)
    for grasp in drawn.world.grasps:
        assert float(grasp.stiffness) == numbers["world.grasps.0.stiffness"]
        assert float(grasp.damping) == pytest.approx(0.6 * (0.06 * float(grasp.stiffness)) ** 0.5)


def test_a_team_has_placed_its_body_whatever_its_tips_do() -> None:
    def of(**columns: Array) -> list[bool]:
        metrics = {name.replace("__", "/"): np.array(column) for name, column in columns.items()}
        return successes(Cell(metrics=metrics, status=np.array(["completed", "completed", "joint_limit"]))).tolist()

    assert of(**{f"left__{SUCCESS_METRIC}": [1.0, 1.0, 0.0], PLACED: [0.019, 0.021, 0.0]}) == [True, False, False]


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        ({"laws": ("paper_ct",)}, "team-suite: 'paper_ct': must be one of own_paths"),
        ({"rows": ("nosy",)}, "team-suite: 'nosy': did you mean 'noisy'?"),
    ],
)
def test_a_wrong_name_is_refused_in_one_line(fields: dict[str, tuple[str, ...]], line: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="team-suite") as refused:
        skyarm.compare("team-suite", out=tmp_path, **fields)
    assert str(refused.value).startswith(line)
    assert "\n" not in str(refused.value)


@pytest.mark.thorough
def test_a_cell_has_the_numbers_of_its_flight(tmp_path: Path) -> None:
    found = skyarm.compare("team-suite", ["object_wrench"], tmp_path, rows=("pull",))
    record = found.document["summaries"]["pull"][FLOWN]["object_wrench"]
    log = skyarm.run(cell("pull").scenario())
    scores = skyarm.score(log, ["team", "rotor_jitter"])
    assert {name: record["metrics"][name]["mean"] for name in scores} == pytest.approx(scores, rel=1e-6)
    assert scores["team_position_last"] == pytest.approx(np.linalg.norm(log.object_position[-1] - [2.0, 0.0, 0.02]))
    assert (record["success"], record["episodes"]) == (1, 1)
    assert log.team_pull_reference.max() == 2.0
    assert "perfect state, pull of 2 N | object_wrench | 1 of 1" in found.report.markdown()
