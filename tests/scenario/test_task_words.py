"""Keys that functions read from tables of motions, studies and suites are those that
the pages list, with the same defaults.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest

from skyarm.control.laws.centroidal.contact.admittance import Detection
from skyarm.planning.plan_file import plan_arrays
from skyarm.records.files import Fields
from skyarm.reference.task_records import Setting
from skyarm.reference.waypoints import LIMITS, waypoints_table
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.word_texts import TASKS
from skyarm.studies.compare.suite_file import load_suite
from skyarm.studies.sweep.distributions import distribution_from
from skyarm.studies.sweep.study import Study
from skyarm.studies.sweep.study_file import study_from
from skyarm.studies.trial.trial import MOTIONS

LISTED: dict[str, set[str]] = {}
for _word in TASKS:
    LISTED.setdefault(_word.kind, set()).add(_word.name)

HERE = [1.0, 0.0, 1.0]


def allowed(error: BaseException) -> set[str]:
    """Names of the message about an unknown key."""
    return set(str(error).partition("allowed: ")[2].split(", "))


def test_the_keys_of_waypoints_are_those_that_are_listed() -> None:
    table = {"points": [[0.0, 0.0, 1.0], HERE], "times": [0.0, 2.0], "odd": 1}
    fields = Fields(table, "path")
    waypoints_table(fields, Setting())
    with pytest.raises(ValueError, match="odd = 1: unknown field") as error:
        fields.done()
    assert allowed(error.value) == LISTED["waypoints"] | {*LIMITS}


def test_defaults_of_the_tables_are_those_of_the_readers() -> None:
    usual = {(each.kind, each.name): each.default for each in TASKS}
    assert float(usual["admittance", "threshold"]) == Detection().threshold
    assert int(usual["study", "chunk"]) == Study.__dataclass_fields__["chunk"].default


def test_the_keys_of_an_admittance_are_those_that_are_listed() -> None:
    three = [1.0, 1.0, 1.0]
    table = {"mass": three, "damping": three, "stiffness": three, "odd": 1}
    document = {
        "name": "x",
        "duration": 1.0,
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "controller": {"law": "centroidal", "mode": "tip", "admittance": table},
    }
    with pytest.raises(ValueError, match="odd = 1: unknown field") as error:
        scenario_from(document)
    assert allowed(error.value) | {"normal"} == LISTED["admittance"]


def test_the_keys_of_a_study_are_those_that_are_listed() -> None:
    document = {"schema": 1, "name": "x", "scenario": "case3", "episodes": 1, "odd": 1}
    with pytest.raises(ValueError, match="odd = 1: unknown field") as error:
        study_from(document)
    assert allowed(error.value) == LISTED["study"]


def test_the_keys_of_a_suite_and_of_a_trial_are_those_that_are_listed(
    tmp_path: Path,
) -> None:
    for suite, trial, kind in (("odd = 1", "", "suite"), ("", "odd = 1", "trial")):
        file = tmp_path / "suite.toml"
        text = f'[suite]\n{suite}\n[[trials]]\nname = "push"\n{trial}\n'
        file.write_text(text, "utf-8")
        with pytest.raises(ValueError, match="odd = 1: unknown field") as error:
            load_suite(file)
        assert allowed(error.value) == LISTED[kind]


def test_the_motions_of_a_trial_are_those_that_are_listed() -> None:
    assert {*MOTIONS["bases"]} == LISTED["base"]
    assert {*MOTIONS["arms"]} == LISTED["arm"]
    text = {each.name: each.allowed for each in TASKS if each.kind == "trial"}
    assert set(re.findall(r"\w+", text["base"])) - {"or"} == {*MOTIONS["bases"]}
    assert set(re.findall(r"\w+", text["arm"])) - {"or"} == {*MOTIONS["arms"]}


def test_the_arrays_of_a_plan_are_those_that_are_listed() -> None:
    made = re.findall(r'^        "(\w+)": ', inspect.getsource(plan_arrays), re.M)
    assert {*made} == LISTED["plan_file"]


def test_the_distributions_are_those_that_are_listed() -> None:
    with pytest.raises(ValueError, match="odd") as error:
        distribution_from({"odd": 1}, "vary.x")
    assert LISTED["distribution"] <= set(re.findall(r"\w+", str(error.value)))
