"""Sweeps of scenarios of several vehicles: rows are flights of their own, and messages
name the vehicle.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.studies.flights import work
from skyarm.studies.flights.fly import one_scenario
from skyarm.studies.flights.work import Work
from skyarm.studies.sweep import load_study
from skyarm.studies.sweep.plan import at_episode, fastest_plant, prepare
from skyarm.studies.sweep.runner import fly_sweep, run_sweep
from skyarm.studies.sweep.study import StudyError
from skyarm.studies.sweep.study_file import study_from
from support.teams import TEAMS, team

STIFFNESS, MASS = "world.grasps.0.stiffness", "agents.left.plant.vehicle.base.mass"

METRICS = ["tilt_max", "left/position_error_mean", "grasp_largest", "object_last_z"]


def study(**fields: Any) -> dict[str, Any]:
    """Tables of a study of the bar with random stiffness of one grasp, and mass of one
    vehicle.
    """
    return {
        "schema": 1,
        "name": "bars",
        "scenario": str(TEAMS / "bar.toml"),
        "duration": 0.3,
        "episodes": 6,
        "chunk": 4,
        "precision": "bit_exact",
        "metrics": METRICS,
        "vary": {
            STIFFNESS: {"uniform": [5000.0, 5400.0]},
            MASS: {"uniform": [0.24, 0.26]},
        },
        "success": {"left/tilt_max": 1.0},
    } | fields


def test_rows_are_flights_of_their_own_and_are_continued(tmp_path: Path) -> None:
    tables = study()
    rows = fly_sweep(tables, tmp_path / "rows")
    assert {*rows.metrics} == {
        "left/tilt_max",
        "right/tilt_max",
        "left/position_error_mean",
        "left/grasp_largest",
        "right/grasp_largest",
        "object_last_z",
    }
    law = "centroidal_joint"
    numbers = {path: rows.of(law, path) for path in (STIFFNESS, MASS)}
    for k in (0, 5):
        one = at_episode(
            study_from(tables),
            law,
            {path: column[k] for path, column in numbers.items()},
            k,
        )
        scores = skyarm.score(skyarm.run(one), METRICS)
        assert {name: rows.of(law, name)[k] for name in scores} == pytest.approx(
            scores, rel=1e-12, abs=1e-15
        )
    files = {path: path.read_bytes() for path in (tmp_path / "rows").rglob("*.parquet")}
    gone = min(files)
    gone.unlink()
    summary = run_sweep(study_from(tables), tmp_path / "rows")
    assert (summary.found, summary.flown) == (2, 4)
    assert {
        path: path.read_bytes() for path in (tmp_path / "rows").rglob("*.parquet")
    } == files


def test_the_stiffest_grasp_fixes_the_steps_of_all_episodes() -> None:
    plan = prepare(
        study_from(
            study(
                vary={STIFFNESS: {"list": [1000.0, 4.0e4]}}, design="grid", episodes=2
            )
        )
    )
    assert plan.stiffest.world is not None
    assert plan.stiffest.world.grasps[0].stiffness == 4.0e4


def test_the_fastest_joint_friction_of_any_vehicle_fixes_the_steps() -> None:
    one = skyarm.load_scenario("case1", duration=0.6)
    pair = dataclasses.replace(one, agents={"left": one.agent, "right": one.agent})
    path = "agents.right.plant.vehicle.links.0.joint.damping"
    stiffest = fastest_plant(pair, {path: (0.001, 0.5)})
    damping = {
        name: vehicle.links[0].joint.damping
        for name, vehicle in stiffest.vehicles.items()
    }
    assert damping == {
        "left": one.agent.plant.vehicle.links[0].joint.damping,
        "right": 0.5,
    }


def test_a_metric_of_the_users_for_one_vehicle_belongs_to_the_program(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looked_up: list[str] = []
    monkeypatch.setattr(work, "registrations", lambda _: {"mine": None, "other": None})
    monkeypatch.setattr(
        work, "added_metric", lambda name: looked_up.append(name) or 0.0
    )
    assert Work(
        label="a", scenario=team("bar"), metrics=("left/mine", "right/tilt_max")
    ).program
    assert looked_up == ["mine"]


def test_laws_of_a_study_fly_with_every_vehicle_and_name_its_rows() -> None:
    laws = study_from(study(controllers=["centroidal_joint", "indi"])).scenarios
    assert [*laws] == ["centroidal_joint", "indi"]
    for name, scenario in laws.items():
        assert {each.controller.name for each in scenario.agents.values()} == {name}


def test_a_flight_alone_has_the_delays_of_each_vehicle_in_whole_steps() -> None:
    path = "agents.left.delays.command"
    scenario = team("bar", duration=0.1)
    one = one_scenario(
        Work(
            label="a", scenario=scenario, columns={path: np.array([0.0034])}, alone=True
        ),
        0,
    )
    assert {name: each.delays.command for name, each in one.agents.items()} == {
        "left": 0.003,
        "right": 0.0,
    }


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        (
            {"vary": {"plant.gravity": {"uniform": [9.0, 10.0]}}},
            r"path = 'plant\.gravity': is of one agent",
        ),
        (
            {"vary": {"agents.nobody.plant.gravity": {"uniform": [9.0, 10.0]}}},
            r"agents\.nobody: must be one of left",
        ),
        (
            {"vary": {"agents.left.plant.gravty": {"uniform": [9.0, 10.0]}}},
            r"path = 'agents\.left\.plant\.gravty'",
        ),
        (
            {"vary": {"world.grasps.2.stiffness": {"uniform": [9.0, 10.0]}}},
            r"no '2' here; there are 0, 1",
        ),
        (
            {"vary": {MASS: {"uniform": [-2.0, -1.0]}}},
            r"agents\.left\.plant\.vehicle\.base\.mass",
        ),
        ({"metrics": ["lft/tilt_max"]}, r"metrics: 'lft/tilt_max': agent = 'lft'"),
        (
            {"success": {"tilt_max": 1.0}},
            r"success\.tilt_max: is no metric of this study; .*left/tilt_max",
        ),
    ],
)
def test_wrong_studies_of_a_team_are_refused_in_one_line(
    fields: dict[str, Any], words: str
) -> None:
    with pytest.raises(StudyError, match=words) as error:
        prepare(study_from(study(**fields)))
    assert "\n" not in str(error.value)


def test_a_file_of_a_study_begins_beside_the_file_of_its_team(tmp_path: Path) -> None:
    text = (
        f'schema = 1\nname = "one"\nscenario = "{TEAMS / "bar.toml"}"\nepisodes ='
        f' 1\nmetrics = ["left/tilt_max"]\n[vary]\n"{MASS}" = {{ uniform = [0.24, 0.26]'
        ' }\n[success]\n"left/tilt_max" = 0.5\n'
    )
    (tmp_path / "study.toml").write_text(text)
    assert load_study(tmp_path / "study.toml").success == {"left/tilt_max": 0.5}
