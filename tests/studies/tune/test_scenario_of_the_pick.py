"""The scenario that a tuning writes under the picked law: it flies that law to the last
digit of each gain.
"""

from __future__ import annotations

import json
import tomllib

import pytest
from typer.testing import CliRunner

import skyarm
from skyarm.cli.commands import program
from skyarm.studies.tune import tuning
from skyarm.studies.tune.excitation import draw_plants
from skyarm.studies.tune.front import LoopMargins, Point, Required
from support.cases import sampled

MARGINS = LoopMargins(delay=0.02, rotors=(0.5, 2.0), joints=(0.5, 2.0))
FOUND = list[tuning.Tuning]()


@pytest.fixture(autouse=True)
def one_point(monkeypatch):
    """A search in which one point is found, with gains of many digits."""

    def search(plan, **_):
        logs = tuple(0.1 / (3.0 + i) for i in range(len(plan.knobs)))
        point = Point(
            logs=logs,
            error=0.1,
            tip=0.1,
            jitter=1.0,
            effort=1.0,
            lost=0.0,
            saturated=0.0,
            margins=MARGINS,
        )
        plants, required = (
            draw_plants(plan.flight, 4, seed=0),
            Required(delay=0.01, gain=1.5),
        )
        found = tuning.Tuning(
            plan=plan,
            before=point,
            points=(point,),
            picked=0,
            required=required,
            plants=plants,
            aside={},
        )
        FOUND.append(found)
        return FOUND[-1]

    monkeypatch.setattr(tuning, "tune_plan", search)


def tune(*words):
    return CliRunner().invoke(
        program(["tune"]), ["tune", *words], catch_exceptions=False
    )


@pytest.mark.parametrize(
    "words",
    sampled(["", "--laws paper_pd", "--laws own.toml"], 3, keep=["--laws own.toml"]),
)
def test_the_scenario_of_the_pick_flies_the_tuned_law_to_the_bit(
    words, tmp_path, monkeypatch
):
    laws = tuple(words.split())
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.toml").write_text(
        'schema = 1\n[law]\npreset = "paper_ct"\n[gains]\n"gains.position" = 5.0\n'
    )
    result = tune("case3", *laws, "--out", "found", "--json")
    assert json.loads(result.stdout)["best"] == "found/best.toml"
    scenario = skyarm.load_scenario(
        "case3", controller=laws[1] if laws else None, duration=0.5
    )
    wanted = skyarm.run(scenario.with_controller(FOUND[-1].controller))
    log = skyarm.run(skyarm.load_scenario("found/best.toml", duration=0.5))
    assert log.info["digest"] == wanted.info["digest"]
    assert log.position.tobytes() == wanted.position.tobytes()
    assert log.position.tobytes() != skyarm.run(scenario).position.tobytes()


def test_of_a_vehicle_gains_alone_are_written(tmp_path):
    result = tune("hummingbird", "--laws", "decoupled_pd", "--out", str(tmp_path))
    assert "skyarm run SCENARIO --laws" in result.stdout
    assert not (tmp_path / "best.toml").exists()


def test_why_no_scenario_is_written_is_one_line_beside_the_gains(tmp_path):
    (tmp_path / "best.toml").write_text("of an earlier search")
    skyarm.save_log(
        skyarm.run(skyarm.load_scenario("case3", duration=0.05)),
        tmp_path / "flight.npz",
    )
    result = tune(str(tmp_path / "flight.npz"), "--out", str(tmp_path))
    (line,) = (
        each
        for each in result.stderr.splitlines()
        if "no scenario under the picked law" in each
    )
    assert "base: scenario = " in line
    assert not (tmp_path / "best.toml").exists()
    assert tomllib.loads((tmp_path / "tuned.toml").read_text("utf-8"))["gains"]
