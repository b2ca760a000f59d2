"""Benchmark of the laws of a team: what its conditions change, who flies them, and what
counts as placed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.control.controller import part_of
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.files import PathLike
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.cell_flights import PLACED, SUCCESS_METRIC, Cell, successes
from skyarm.studies.compare.team_conditions import ROWS
from skyarm.studies.compare.team_suite import FLOWN, LAWS, TeamFlights, TeamSuite
from skyarm.studies.trial.trial import with_entries
from support.teams import TEAMS


def cell(
    row: str, law: str = "object_wrench", seeds: int = 3, scenario: PathLike = FLOWN
) -> TeamFlights:
    """Flights of a law under a condition."""
    (flights,) = TeamSuite(
        laws=(law,), rows=(row,), seeds=seeds, scenario=scenario
    ).plan_cells()[0]
    return flights


def tip(scenario: Scenario, agent: str, t: float) -> list[float]:
    """Desired place (m) of a vehicle's tip at a time (s)."""
    path = scenario.agents[agent].reference.tip
    assert path is not None
    return [float(signal.derivatives(t)[0]) for signal in (path.x, path.y, path.z)]


def flight(flights: TeamFlights, k: int) -> tuple[Scenario, dict[str, float]]:
    """Scenario of one flight with its numbers."""
    scenario = flights.scenario()
    numbers = {
        path: float(column[k]) for path, column in flights.values(scenario).items()
    }
    return with_numbers(scenario, numbers), numbers


def test_entries_replace_a_files_key_by_key_and_in_each_table_of_a_list() -> None:
    own = {"a": [{"x": 1, "y": 1}, {"x": 2}], "b": {"c": 1, "d": 1}, "e": 0}
    new = with_entries(own, {"a": {"x": 3}, "b": {"d": 2}, "e": [1], "f": {"g": 1}})
    assert new == {
        "a": [{"x": 3, "y": 1}, {"x": 3}],
        "b": {"c": 1, "d": 2},
        "e": [1],
        "f": {"g": 1},
    }
    assert own["a"] == [{"x": 1, "y": 1}, {"x": 2}]


def test_every_law_flies_every_condition_unless_it_says_which() -> None:
    names = [each.name for each in TeamSuite().plan_cells()[0]]
    for row, fields in ROWS.items():
        laws = [law for condition, _, law in names if condition == row]
        if row == "lost":
            assert laws == []  # of three members or more
            continue
        assert laws == [*fields.get("laws", LAWS)], row
    assert {
        (each.condition.name, each.plant)
        for each in TeamSuite().plan_cells()[0]
        if each.plant == "mujoco"
    } == {("mujoco", "mujoco")}
    assert {each.condition.episodes for each in TeamSuite(seeds=5).plan_cells()[0]} == {
        1,
        5,
    }


def test_every_law_meets_the_same_masses_one_factor_a_vehicle() -> None:
    first, other = (
        cell("masses", law, seeds=40) for law in ("own_paths", "object_wrench")
    )
    scenario = first.scenario()
    drawn = first.values(scenario)
    again = other.values(other.scenario())
    assert all(np.array_equal(drawn[path], again[path]) for path in drawn)
    factors = {}
    for agent in ("left", "right"):
        bodies = {"base": scenario.agents[agent].plant.vehicle.base}
        bodies |= {
            f"links.{link.name}.body": link.body
            for link in scenario.agents[agent].plant.vehicle.links
        }
        columns = [
            drawn[f"agents.{agent}.plant.vehicle.{at}.mass"] / float(b.mass)
            for at, b in bodies.items()
        ]
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
        assert tip(late, "right", t) == pytest.approx(
            tip(shipped, "right", t - 0.05), abs=1e-12
        )
        assert tip(late, "left", t) == tip(shipped, "left", t)
        yaw = late.agents["right"].reference.at(t).yaw
        assert yaw == pytest.approx(
            shipped.agents["right"].reference.at(t - 0.05).yaw, abs=1e-12
        )


def test_all_at_once_moves_the_supposed_grasp_and_with_it_the_path() -> None:
    drawn, numbers = flight(cell("all"), 1)
    off = numbers["team.members.1.place.x"] - 0.55
    assert 1e-4 < abs(off) <= 0.02
    shipped = skyarm.load_scenario(FLOWN)
    # not yet taken
    assert tip(drawn, "right", 1.0) == pytest.approx(
        tip(shipped, "right", 1.0), abs=1e-12
    )
    for t in (5.0, 11.0, 13.0, 18.0):
        x, y, z = tip(shipped, "right", t)
        motion = shipped.team.motion.at(t)
        away = motion.R.column(0)
        assert tip(drawn, "right", t) == pytest.approx(
            [x + off * away.x, y + off * away.y, z + off * away.z], abs=1e-9
        )
    for grasp in drawn.world.grasps:
        assert float(grasp.stiffness) == numbers["world.grasps.0.stiffness"]
        assert float(grasp.damping) == pytest.approx(
            0.6 * (0.06 * float(grasp.stiffness)) ** 0.5
        )


PLATE, UNEQUAL = TEAMS / "plate.toml", TEAMS / "unequal_bar.toml"


def test_the_last_grasp_of_any_team_is_off_along_the_body_from_all_others() -> None:
    given, changed = (
        skyarm.load_scenario(PLATE),
        cell("misplaced", scenario=PLATE).scenario(),
    )
    places = np.array([[*map(float, g.place)] for g in given.world.grasps])
    supposed = np.array([[*map(float, m.place)] for m in changed.team.members])
    assert np.allclose(supposed[:2], places[:2])
    off, away = places[2] - supposed[2], places[2] - places.mean(axis=0)
    assert np.linalg.norm(off) == pytest.approx(0.02)
    assert np.allclose(off, 0.02 * away / np.linalg.norm(away), atol=1e-9)
    # the tip goes to the grasp, and then along the path of the supposed one
    assert np.allclose(tip(changed, "right", 0.5), tip(given, "right", 0.5), atol=1e-12)
    assert np.linalg.norm(
        np.subtract(tip(given, "right", 6.0), tip(changed, "right", 6.0))
    ) == pytest.approx(0.02)


def test_of_any_team_everything_at_once_is_drawn_about_its_own_numbers() -> None:
    given, flights = skyarm.load_scenario(PLATE), cell("all", seeds=40, scenario=PLATE)
    drawn = flights.values(flights.scenario())
    masses = {"world.objects.plate.mass": 7.0}
    for name in ("front", "left", "right"):
        masses[f"agents.{name}.plant.vehicle.base.mass"] = 3.1
        masses[f"agents.{name}.plant.vehicle.links.hand.body.mass"] = 0.09
    for path, mass in masses.items():
        assert 0.8 <= (drawn[path] / mass).min() < 0.85, path
        assert 1.15 < (drawn[path] / mass).max() <= 1.2, path
    factors = np.array(
        [drawn[path] / mass for path, mass in masses.items() if "hand" not in path]
    )
    assert np.abs(np.corrcoef(factors) - np.eye(4)).max() < 0.6  # one factor of each
    assert (
        2500.0
        <= drawn["world.grasps.2.stiffness"].min()
        < drawn["world.grasps.2.stiffness"].max()
        <= 40_000.0
    )
    one, numbers = flight(flights, 3)
    assert float(one.world.grasps[0].stiffness) == numbers["world.grasps.0.stiffness"]
    force = one.environment.forces[-1].force
    assert float(force.x.height) == numbers["environment.forces.0.force.x.height"]
    # a third of the way from the lift at 2.4 s to the end at 13.4 s
    assert float(force.y.start) == pytest.approx(2.4 + 11.0 * 5 / 17, abs=1e-3)
    assert [float(f.effectiveness) for f in one.agents["right"].faults] == [
        drawn["agents.right.environment.faults.0.effectiveness"][3]
    ]
    # what the path of the tip differs by is what the team supposes
    wrong = np.subtract(
        [*map(float, one.team.members[2].place)],
        [*map(float, given.world.grasps[2].place)],
    )
    R = np.array([[float(c) for c in row] for row in given.team.motion.at(6.0).R.rows])
    assert np.allclose(
        np.subtract(tip(one, "right", 6.0), tip(given, "right", 6.0)),
        R @ wrong,
        atol=1e-9,
    )
    assert float(one.team.mass) == 7.0


def test_a_member_of_three_is_lost_and_of_two_the_condition_is_left_out(
    tmp_path: Path,
) -> None:
    lost = cell("lost", scenario=PLATE).scenario()
    assert [float(g.release) for g in lost.world.grasps] == [
        np.inf,
        np.inf,
        pytest.approx(5.635),
    ]
    suite = TeamSuite(rows=("lost", "messages", "perfect"), laws=("own_paths",))
    planned, refused = suite.plan_cells()
    assert [each.name[0] for each in planned] == ["perfect"]
    assert refused == {
        "lost": "takes three members or more, not 2",
        "messages": "is of object_wrench alone",
    }
    with pytest.raises(
        ValueError, match=r"^team-suite: lost takes three members or more, not 2$"
    ):
        TeamSuite(rows=("lost",)).plan_cells()


def edited(tmp_path: Path, *changes: tuple[str, str]) -> Path:
    """File of the unequal pair with other text."""
    text = UNEQUAL.read_text("utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "own.toml"
    path.write_text(text, "utf-8")
    return path


def test_options_of_the_own_law_stay_and_other_laws_get_those_that_they_have(
    tmp_path: Path,
) -> None:
    words = (
        'law = "object_wrench"',
        'law = "object_wrench"\npull_gain = 0.05\nrise = 1.1\nposition_noise = 0.2',
    )
    own = edited(
        tmp_path,
        words,
        (
            "[agents.right]",
            (
                "[agents.right.controller]\nlaw = 'centroidal'\nmode = 'tip'\nbandwidth"
                " = 1.0\ncarrying = 0.6"
            ),
        ),
    )
    team = cell("perfect", scenario=own).scenario().team
    # noise is that of the conditions
    assert (team.pull_gain, team.rise, team.position_noise) == (0.05, 1.1, 0)
    follower = cell("perfect", "leader_follower", scenario=own).scenario().team
    assert (follower.rise, follower.virtual_mass) == (1.1, 0.444)
    alone = cell("noisy", "own_paths", scenario=own).scenario()
    assert type(alone.team).__name__ == "Team"
    assert float(alone.team.position_noise) == 0.001
    assert all(
        part_of(each.controller.par, "carrying") is None
        for each in alone.agents.values()
    )


def test_noise_and_delays_of_a_file_make_way_for_those_of_a_condition(
    tmp_path: Path,
) -> None:
    noisy = "[sensors]\nposition = 0.3\n\n[agents.right]\ndelays = { command = 0.01 }\n"
    own = edited(tmp_path, ("[agents.right]", noisy))
    perfect = cell("perfect", scenario=own).scenario()
    assert all(float(each.noise.position) == 0.0 for each in perfect.agents.values())
    assert float(perfect.agents["right"].delays.command) == 0.0
    late = cell("commands", scenario=own).scenario()
    assert [float(late.agents[n].delays.command) for n in ("left", "right")] == [
        0.0,
        0.02,
    ]
    assert float(late.agents["left"].noise.position) == 0.001


def test_conditions_that_do_not_fit_a_file_are_left_out_and_said(
    tmp_path: Path,
) -> None:
    fixed = edited(tmp_path, ("stiffness = 1e4", 'kind = "fixed"\nstiffness = 1e4'))
    assert TeamSuite(
        rows=("perfect", "fixed"), laws=("object_wrench",), scenario=fixed
    ).plan_cells()[1] == {"fixed": "takes ball grasps, not fixed"}
    pulls = edited(
        tmp_path,
        ('law = "object_wrench"', 'law = "object_wrench"\ninternal_forces = [1.0]'),
    )
    planned, refused = TeamSuite(
        rows=("perfect", "pull"), laws=("object_wrench",), scenario=pulls
    ).plan_cells()
    assert [each.name[0] for each in planned] == ["perfect"]
    assert refused == {
        "pull object_wrench": (
            "team.internal_force = 2: must be left out beside internal_forces"
        )
    }
    found = {
        "summaries": {"perfect": {"unequal_bar": {}}},
        "plant": "rigid_body",
        "seeds": 1,
        "seed": 0,
    }
    report = TeamSuite(scenario=pulls).report(found | {"not_flown": refused}).markdown()
    assert (
        "not flown: pull object_wrench team.internal_force = 2: must be left out"
        in report
    )


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (
            [("close = 1.4", "")],
            (
                "own.toml: world.grasps.close of 'bar': must be above 0 in one of them"
                " for team-suite"
            ),
        ),
        (
            [
                ('[team]\nlaw = "object_wrench"\nobject = "bar"', ""),
                ("[reference.object]", "[reference.x]"),
            ],
            "own.toml: ",
        ),
    ],
)
def test_a_scenario_without_such_a_team_is_refused_in_one_line(
    changes: list[tuple[str, str]], line: str, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match="own") as refused:
        TeamSuite(rows=("perfect",), scenario=edited(tmp_path, *changes)).plan_cells()
    assert line in str(refused.value)
    assert "\n" not in str(refused.value)
    with pytest.raises(
        ValueError,
        match=r"^case3: team: must be stated for team-suite, whose laws share a load$",
    ):
        TeamSuite(scenario="case3").plan_cells()


def test_a_short_flight_of_an_own_team_has_its_name_and_titles(tmp_path: Path) -> None:
    own = edited(
        tmp_path,
        ("duration = 22.0", "duration = 1.8"),
        ("steady = [3.0, 20.0]", "steady = [1.5, 1.8]"),
    )
    found = skyarm.compare(
        "team-suite",
        ["object_wrench"],
        tmp_path / "out",
        rows=("soft", "lost"),
        seeds=2,
        scenario=own,
    )
    record = found.document["summaries"]["soft"]["unequal_bar"]["object_wrench"]
    assert (record["completed"], record["episodes"]) == (2, 2)
    text = found.report.markdown()
    assert "Laws of a team, unequal_bar on rigid_body" in text
    assert (
        "a grasp 2 cm off, a quarter of the stiffness | object_wrench | 2 of 2" in text
    )
    assert "not flown: lost takes three members or more, not 2" in text


def test_a_team_has_placed_its_body_whatever_its_tips_do() -> None:
    def of(**columns: Array) -> list[bool]:
        metrics = {
            name.replace("__", "/"): np.array(column)
            for name, column in columns.items()
        }
        return successes(
            Cell(
                metrics=metrics,
                status=np.array(["completed", "completed", "joint_limit"]),
            )
        ).tolist()

    assert of(
        **{f"left__{SUCCESS_METRIC}": [1.0, 1.0, 0.0], PLACED: [0.019, 0.021, 0.0]}
    ) == [True, False, False]


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        ({"laws": ("paper_ct",)}, "team-suite: 'paper_ct': must be one of own_paths"),
        ({"rows": ("nosy",)}, "team-suite: 'nosy': did you mean 'noisy'?"),
    ],
)
def test_a_wrong_name_is_refused_in_one_line(
    fields: dict[str, tuple[str, ...]], line: str, tmp_path: Path
) -> None:
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
    assert {name: record["metrics"][name]["mean"] for name in scores} == pytest.approx(
        scores, rel=1e-6
    )
    assert scores["team_position_last"] == pytest.approx(
        np.linalg.norm(log.object_position[-1] - [2.0, 0.0, 0.02])
    )
    assert (record["success"], record["episodes"]) == (1, 1)
    assert log.team_pull_reference.max() == 2.0
    assert (
        "perfect state, pull of 2 N | object_wrench | 1 of 1" in found.report.markdown()
    )
