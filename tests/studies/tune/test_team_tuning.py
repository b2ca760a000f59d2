"""Search for the options of a team's law: its knobs, plants, scores, files, and what
cannot be tuned.
"""

from __future__ import annotations

import dataclasses
import json
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import skyarm
from skyarm.cli.commands import program
from skyarm.log.metrics.metric_catalogue import catalogue_names
from skyarm.records.identity import identity
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import LIBRARY, scenario_from
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.team_suite import TeamSuite
from skyarm.studies.flights import Rows, Work, WorkRunner, executor, fly
from skyarm.studies.tune import tuning
from skyarm.studies.tune.candidate_flights import scores
from skyarm.studies.tune.front import Point
from skyarm.studies.tune.gain_search import Effort
from skyarm.studies.tune.hover_margins import margins_of
from skyarm.studies.tune.subject import SearchSizes
from skyarm.studies.tune.team_subject import (
    FIRST_OFF,
    MASSES,
    TeamCandidates,
    grasp_numbers,
    team_flight,
)
from skyarm.studies.tune.tuning import TEAM, Tuning, TuningPlan, plan_of
from support.cables import BAR, HANGING, SWINGING, on_cables
from support.cases import sampled

FEW = SearchSizes(pool=1, semifinalists=4, further=6, points=3, unseen=6, aside=6)
EFFORT = dataclasses.replace(Effort().scale(64, 4), population=4, rounds=2)
PHASES = [
    {"kind": "hold", "duration": 2.2},
    {"kind": "lift", "height": 0.3, "duration": 1.8},
    {"kind": "hold", "duration": 2.0},
]


def short(law: str = "leader_follower", **options: Any) -> Scenario:
    """Bar that two vehicles lift, in 5 s."""
    tables: dict[str, Any] = tomllib.loads(
        (LIBRARY / "two_carry_a_bar.toml").read_text("utf-8")
    )
    tables["reference"]["object"] = {"kind": "phases", "phases": PHASES}
    tables["team"] |= {"law": law, **options}
    return scenario_from(tables | {"duration": 5.0, "windows": {"steady": [2.5, 5.0]}})


def plan(scenario: Scenario, seed: int = 0) -> TuningPlan:
    """Small search."""
    found = plan_of(scenario, True, "leader_follower", None, EFFORT, seed)
    return dataclasses.replace(found, stages=FEW)


@pytest.mark.parametrize(
    ("law", "knobs"),
    [
        (
            "object_wrench",
            {
                "pose_gain",
                "pose_shift",
                "blind",
                "blind_moments",
                "pull_gain",
                "filter",
            },
        ),
        ("leader_follower", {"virtual_mass", "damping", "stiffness"}),
        ("decentralised", {"gain", "adaptation", "filter"}),
    ],
)
def test_options_that_state_an_effect_are_tuned_from_the_defaults_of_the_law(
    law: str, knobs: set[str]
) -> None:
    changed = "filter" if "filter" in knobs else "damping"
    scenario = short(law, **{changed: 7.0})
    found = TEAM.knobs(scenario, None)
    assert {knob.path for knob in found} == knobs
    assert [knob.path for knob in TEAM.knobs(scenario, [changed])] == [changed]
    start = TEAM.centred(team_flight(scenario), found, law)
    usual = type(scenario.team)(object="bar")
    assert [knob.values for knob in start.knobs] == [
        (getattr(usual, knob.path),) for knob in found
    ]
    pairs = zip(start.knobs, start.starts["before"], strict=True)
    given = {knob.path: knob.values[0] * np.exp(log) for knob, log in pairs}
    assert given == pytest.approx(
        {knob.path: knob.values[0] for knob in start.knobs} | {changed: 7.0}
    )
    assert not np.any(start.starts[law])


@pytest.mark.parametrize(
    ("scenario", "knobs", "words"),
    [
        (
            short("own_paths"),
            None,
            (
                "team.law = 'own_paths': has no options to tune: none above 0 that"
                " states an"
            ),
        ),
        (
            short(),
            ["dampin"],
            (
                "--knobs: 'dampin': did you mean 'damping'.*must be one of"
                " virtual_mass, damping"
            ),
        ),
        (
            dataclasses.replace(short(), team=None),
            None,
            (
                "agents = left, right: must be one for a search for gains without"
                " .team.; leave the others"
            ),
        ),
        (
            short().of("left"),
            None,
            (
                "agents = left, right: must be one for a search for gains without"
                " .team.; leave"
            ),
        ),
    ],
)
def test_what_cannot_be_tuned_is_refused_in_one_line(
    scenario: Scenario, knobs: list[str] | None, words: str
) -> None:
    with pytest.raises(ValueError, match=f"^{words}.*$"):
        skyarm.tune(scenario, knobs=knobs)


def test_a_grasp_that_is_off_is_that_of_the_team_suite() -> None:
    (cell,) = TeamSuite(
        laws=("object_wrench",), rows=("misplaced",), seeds=2
    ).plan_cells()[0]
    suite, flight = (
        cell.scenario(),
        team_flight(skyarm.load_scenario("two_carry_a_bar")),
    )
    numbers = {
        path: float(column[0])
        for path, column in grasp_numbers(flight, 1, np.array([0.02])).items()
    }
    off = with_numbers(flight, numbers)
    for scenario in (flight, off):
        assert scenario.agents["right"].noise == suite.agents["right"].noise
        assert scenario.team.position_noise == suite.team.position_noise > 0.0
        assert scenario.team.attitude_noise == suite.team.attitude_noise > 0.0
    assert [*off.team.members[1].place] == pytest.approx([0.53, 0.0, 0.02], abs=1e-9)
    for agent in ("left", "right"):
        for axis in "xyz":
            ours, theirs = (
                getattr(each.agents[agent].reference.tip, axis) for each in (off, suite)
            )
            for t in (0.0, 1.6, 2.1, 9.0, 15.0, 21.0):
                assert np.asarray(ours.derivatives(t)) == pytest.approx(
                    np.asarray(theirs.derivatives(t)), abs=1e-7
                )


def test_plants_have_in_turn_other_masses_and_the_grasp_of_each_member_off() -> None:
    flight = team_flight(short())
    plants, other = (TEAM.draw(flight, 40, seed=seed, mixed=True) for seed in (4, 5))
    mass = {
        path: column for path, column in plants.values.items() if path.endswith("mass")
    }
    assert [path for path in mass if "links" not in path] == [
        *(f"agents.{name}.plant.vehicle.base.mass" for name in ("left", "right")),
        "world.objects.bar.mass",
    ]
    factors = np.array([column / column[0] for column in mass.values()])
    assert (factors[:, plants.kinds != MASSES] == 1.0).all()
    drawn = factors[:, plants.kinds == MASSES]
    assert np.allclose(drawn[:7], drawn[0])  # one factor a vehicle
    assert 0.8 <= drawn.min() < 0.87
    assert 1.13 < drawn.max() <= 1.2
    places = np.array(
        [
            plants.values[f"team.members.{i}.place.x"] - x
            for i, x in enumerate((-0.55, 0.55))
        ]
    )
    assert plants.kinds[:5].tolist() == [0, MASSES, FIRST_OFF, FIRST_OFF + 1, 0]
    is_off = plants.kinds >= FIRST_OFF
    assert ((places[1] != 0.0) == (plants.kinds == FIRST_OFF + 1)).all()
    assert (places[:, ~is_off] == 0.0).all()
    assert np.abs(places[:, is_off]).sum(0) == pytest.approx(0.02, abs=1e-6)
    # of either member, to either side
    assert (np.abs(places[:, is_off]).max(1) > 0.01).all()
    assert {*np.sign(places[:, is_off]).ravel()} == {-1.0, 0.0, 1.0}
    assert any((plants.values[path] != other.values[path]).any() for path in mass)
    both = TEAM.draw(flight, 40, seed=4, mixed=False)
    assert (both.values["world.objects.bar.mass"] != 1.6).all()
    assert both.values["team.members.0.place.x"][0] != -0.55
    first = TEAM.draw(flight, 3, seed=4, mixed=True)
    assert all(
        np.array_equal(column, plants.values[path][:3])
        for path, column in first.values.items()
    )


@pytest.mark.thorough
def test_flights_of_a_batch_are_those_flown_alone() -> None:
    flight, crew = team_flight(short()), WorkRunner()
    plants = TEAM.draw(flight, 3, seed=1, mixed=True)
    flights = TeamCandidates(flight, TEAM.knobs(flight, None), plants, crew, seed=3)
    logs = np.array([[0.0, 0.0, 0.0], [-1.0, -1.5, -2.0]])
    (whole,) = flights._works("all", logs, plants)
    rows = crew.rows([whole])[0]
    alone = [
        dataclasses.replace(
            whole,
            label=f"alone{k}",
            columns={
                path: np.asarray(column)[k : k + 1]
                for path, column in whole.columns.items()
            },
            episodes=whole.episodes[k : k + 1],
        )
        for k in (2, 5)
    ]
    single = crew.rows(alone)
    for name in whole.metrics:
        assert [float(each[name][0]) for each in single] == [
            rows[name][2],
            rows[name][5],
        ], name
    flown = flights.fly("all", logs)
    assert flown.pull == pytest.approx(rows["team_pull_rms"].reshape(2, 3))
    assert flown.error == pytest.approx(
        np.sqrt(flown.pull * rows["team_position_mean"].reshape(2, 3))
    )
    jitter = [
        rows[name]
        for name in whole.metrics
        if catalogue_names([name]) == {"rotor_jitter"}
    ]
    assert flown.jitter == pytest.approx(np.max(jitter, 0).reshape(2, 3))
    # what the search counts is what a flight has in double precision
    numbers = {
        path: float(np.asarray(column)[5]) for path, column in whole.columns.items()
    }
    scenario = dataclasses.replace(
        with_numbers(flight, numbers), seed=3, episode=int(whole.episodes[5])
    )
    log = skyarm.run(scenario)
    steady = (log.time >= 2.5) & (log.time < 5.0)
    assert float(log.team_position_error[steady].mean()) == pytest.approx(
        float(flown.tip[1, 2]), rel=0.03
    )
    pull = (log.team_pull - log.team_pull_reference)[steady]
    assert float(np.sqrt((pull**2).mean())) == pytest.approx(
        float(flown.pull[1, 2]), rel=0.03
    )


@pytest.fixture(scope="module")
def found() -> Tuning:
    """Result of a small search."""
    return tuning.tune_plan(plan(short()), workers=2)


@pytest.mark.thorough
def test_tuned_options_are_no_worse_than_the_defaults_under_seeds_not_tuned_on(
    found: Tuning,
) -> None:
    flight = found.plan.flight
    plants = TEAM.draw(flight, 12, seed=77, mixed=True)
    flights = TeamCandidates(flight, found.plan.knobs, plants, WorkRunner(), seed=77)
    before, after = scores(
        flights.fly("unseen", np.array([found.before.logs, found.pick.logs]))
    ).error
    assert after < before
    assert found.meets


@pytest.mark.thorough
def test_the_result_flies_as_a_scenario_with_the_options(found: Tuning) -> None:
    scenario = found.under(short(), found.pick)
    assert {
        k.path: getattr(scenario.team, k.path) for k in found.plan.knobs
    } == pytest.approx(
        {
            k.path: k.values[0] * np.exp(log)
            for k, log in zip(found.plan.knobs, found.pick.logs, strict=True)
        }
    )
    assert (scenario.team.position_noise, scenario.agents["left"].noise) == (
        0,
        short().agents["left"].noise,
    )
    assert skyarm.run(scenario).status == "completed"


def rows_of(work: Work) -> Rows:
    """Rows in place of flights: errors least at options half as large, which every
    plant shifts a little.
    """
    options = [
        c
        for path, c in work.columns.items()
        if path.startswith("team.") and "members" not in path
    ]
    away = 1e-3 * (1.0 + sum(np.log(2.0 * np.asarray(c) / 20.0) ** 2 for c in options))
    away = away * (1.0 + 0.1 * np.asarray(work.columns["world.objects.bar.mass"]))
    numbers = {name: away * (1.0 + 0.1 * i) for i, name in enumerate(work.metrics)}
    tilt = {name: 0.0 * away for name in work.metrics if "tilt" in name}
    status = np.full(len(away), "completed")
    return {
        **fly._leading_columns(work),
        **numbers,
        **tilt,
        "status": status,
        "end_time": 0.0 * away,
    }


@pytest.mark.parametrize(
    "stage", sampled(["round 1", "the best once more", "plants and a path"], 3)
)
def test_an_interrupted_search_ends_as_if_it_had_not_been(
    stage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pyarrow")
    flown: list[str] = []

    def fly_together(works: Sequence[Work], threads: int) -> list[Rows]:
        flown.extend(work.label for work in works)
        return [rows_of(work) for work in works]

    def stop(_done: int, _total: int, last: str) -> None:
        if last.startswith(stage):
            raise KeyboardInterrupt

    monkeypatch.setattr(executor, "fly_together", fly_together)
    whole = tuning.tune_plan(plan(short()), folder=tmp_path / "whole")
    every = flown.copy()
    flown.clear()
    with pytest.raises(KeyboardInterrupt):
        tuning.tune_plan(plan(short()), folder=tmp_path / "other", progress=stop)
    before = flown.copy()
    assert before == every[: len(before)]
    assert 0 < len(before) < len(every)
    flown.clear()
    other = tuning.tune_plan(plan(short()), folder=tmp_path / "other")
    assert flown == every[len(before) :]
    assert (other.before, other.points, other.picked, other.aside) == (
        whole.before,
        whole.points,
        whole.picked,
        whole.aside,
    )
    files = [
        {p.name: p.read_bytes() for p in (tmp_path / name / "rows").iterdir()}
        for name in ("whole", "other")
    ]
    assert files[0] == files[1]


def test_the_command_writes_scenarios_that_fly_and_no_file_of_gains(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Tuning] = []

    def search(asked: TuningPlan, **_: Any) -> Tuning:
        none = dataclasses.replace(margins_of(None), why_none="none")
        points = tuple(
            Point(
                logs=(0.1 / (3.0 + k),) * len(asked.knobs),
                error=0.1,
                tip=0.004,
                pull=0.25,
                jitter=1.0 + k,
                effort=0.0,
                lost=0.0,
                saturated=0.0,
                margins=none,
            )
            for k in range(2)
        )
        plants, required = (
            TEAM.draw(asked.flight, 3, seed=0, mixed=True),
            TEAM.required(asked.flight),
        )
        seen.append(
            Tuning(
                plan=asked,
                before=points[0],
                points=points,
                picked=1,
                required=required,
                plants=plants,
                aside={},
            )
        )
        return seen[-1]

    monkeypatch.setattr(tuning, "tune_plan", search)
    monkeypatch.chdir(tmp_path)
    words = [
        "tune",
        "two_carry_a_bar",
        "--knobs",
        "pull_gain",
        "--out",
        "found",
        "--json",
    ]
    said = json.loads(
        CliRunner().invoke(program(words), words, catch_exceptions=False).stdout
    )
    (found,) = seen
    assert (said["best"], said["gains"], said["required"]) == (
        "found/best.toml",
        None,
        {},
    )
    assert said["front"][1]["pull_n"] == 0.25
    assert said["front"][1]["gains"] == {
        "pull_gain": pytest.approx(0.12 * np.exp(0.1 / 4.0), rel=1e-5)
    }
    assert (found.plan.label, found.plan.effort.plants, found.plan.stages) == (
        "object_wrench",
        8,
        TEAM.stages,
    )
    assert {path.name for path in (tmp_path / "found").iterdir()} == {
        *("best.toml", "front_1.toml", "front_2.toml", "tune.html"),
    }
    wanted = found.under(skyarm.load_scenario("two_carry_a_bar"), found.pick)
    assert identity(skyarm.load_scenario("found/best.toml")) == identity(wanted)
    assert identity(skyarm.load_scenario("found/front_1.toml")) != identity(wanted)
    page = (tmp_path / "found" / "tune.html").read_text("utf-8")
    assert "position error, 90 % of plants, mm" in page
    assert "RMS pull error, N" in page
    assert "[team]\npull_gain = " in page
    assert "margin of the" not in page


def test_a_flight_of_a_team_is_refused_since_no_scenario_can_be_written_from_it(
    tmp_path: Path,
) -> None:
    skyarm.save_log(
        skyarm.run(dataclasses.replace(short(), duration=0.05)), tmp_path / "flight.npz"
    )
    words = ["tune", str(tmp_path / "flight.npz"), "--out", str(tmp_path / "out")]
    with pytest.raises(
        ValueError,
        match=(
            r"^scenario = .*flight.npz': must be a scenario \(.toml\) or a shipped"
            r" one.*$"
        ),
    ):
        CliRunner().invoke(program(words), words, catch_exceptions=False)
    assert not (tmp_path / "out").exists()


def test_a_cables_grasp_is_off_at_the_body_and_the_team_supposes_its_place() -> None:
    places = {"left": (0.0, 0.19, 0.0097), "right": (0.0, -0.19, 0.0097)}
    tables = on_cables(
        BAR, places, team=SWINGING, motion={"phases": HANGING}, duration=2.0
    )
    scenario = scenario_from(tables)
    assert "swing" in {knob.path for knob in TEAM.knobs(scenario, None)}
    values = grasp_numbers(team_flight(scenario), 1, np.array([0.02]))
    moved = {path: float(column[0]) for path, column in values.items()}
    assert moved == pytest.approx(
        {
            "world.grasps.1.place.x": 0.0,
            "world.grasps.1.place.y": -0.21,
            "world.grasps.1.place.z": 0.0097,
        },
        abs=1e-9,
    )
    plants = TEAM.draw(team_flight(scenario), 9, seed=0, mixed=True)
    knobs = TEAM.knobs(scenario, None)
    flown = TeamCandidates(team_flight(scenario), knobs, plants, WorkRunner()).fly(
        "few", np.zeros((1, len(knobs)))
    )
    assert not flown.lost.any()
    assert (flown.tip < 0.05).all()
