"""Keys that functions read from tables of tasks, guards and studies are those that the
pages list, with the same defaults.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from skyarm.control.laws.centroidal.contact.admittance import Detection
from skyarm.planning.plan_file import plan_arrays
from skyarm.records.files import Fields
from skyarm.reference.contact_phases import CLEARANCE, TOUCHING
from skyarm.reference.phases import KINDS, phases_table
from skyarm.reference.task import guard_from
from skyarm.reference.task_records import Guard, Setting
from skyarm.reference.tip_motion import SPEED
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
NEEDED: Mapping[str, dict[str, Any]] = {
    "hold": {"duration": 1.0},
    "go_to": {"position": HERE},
    "carry": {"position": HERE},
    "lift": {"height": 0.1},
    "pick": {"position": HERE, "payload": "box"},
    "place": {"position": HERE, "gripper": "hand"},
    "grasp": {"gripper": "hand", "center": HERE},
    "release": {"gripper": "hand"},
    "approach": {"position": HERE, "normal": [0.0, 0.0, 1.0]},
    "press": {"force": 1.0, "normal": [0.0, 0.0, 1.0]},
    "slide": {"force": 1.0, "normal": [0.0, 0.0, 1.0], "position": HERE},
    "write": {"force": 1.0, "normal": [0.0, 0.0, 1.0], "points": [HERE]},
    "search": {
        "force": 1.0,
        "normal": [0.0, 0.0, 1.0],
        "pitch": 0.001,
        "radius": 0.01,
    },
    "insert": {"force": 1.0, "normal": [0.0, 0.0, 1.0], "distance": 0.01},
    "turn": {
        "force": 1.0,
        "normal": [0.0, 0.0, 1.0],
        "angle": 1.0,
        "duration": 1.0,
        "center": HERE,
        "axis": [0.0, 0.0, 1.0],
    },
    "open": {
        "force": 1.0,
        "normal": [0.0, 0.0, 1.0],
        "angle": 1.0,
        "duration": 1.0,
        "center": HERE,
        "axis": [0.0, 0.0, 1.0],
    },
    "retreat": {},
}
AS = {"carry": "go_to", "place": "pick", "open": "turn", "release": "grasp"}
"""Kind whose keys stand with another one."""


def allowed(error: BaseException) -> set[str]:
    """Names of the message about an unknown key."""
    return set(str(error).partition("allowed: ")[2].split(", "))


@pytest.mark.parametrize("kind", KINDS)
def test_the_keys_of_a_phase_are_those_that_are_listed(kind: str) -> None:
    phase = {"kind": kind, "odd": 1, **NEEDED[kind]}
    table = {"position": [0.0, 0.0, 1.0], "phases": [phase]}
    with pytest.raises(ValueError, match="odd = 1: unknown field") as error:
        phases_table(Fields(table, "path"), Setting())
    listed = LISTED["phase"] | LISTED[kind] | LISTED.get(AS.get(kind, ""), set())
    listed |= LISTED["touching"] if kind in TOUCHING else set()
    read = allowed(error.value)
    # without a place a retreat goes out along the normal, and has no point on the way
    assert read <= listed
    assert {*NEEDED[kind], "joints", "start", "until"} <= read | {"payload", "gripper"}


@pytest.mark.parametrize("kind", KINDS)
def test_a_phase_takes_every_key_that_is_listed(kind: str) -> None:
    """The right keys beside each other: what is refused is another value of them."""
    value = {
        "via": [],
        "duration": 2.0,
        "dwell": 2.0,
        "approach": [0.0, 0.0, 0.2],
        "clearance": 0.1,
        "speed": 0.2,
        "pace": 0.01,
        "depth": 0.002,
    }
    stated = {name: value[name] for name in LISTED[kind] & {*value}}
    phase = {"kind": kind, "start": 0.5, **NEEDED[kind], **stated}
    if kind == "retreat":
        del phase["clearance"]
        phase["position"] = HERE
    table = {"position": [0.0, 0.0, 1.0], "phases": [phase]}
    assert phases_table(Fields(table, "path"), Setting()) is not None


def test_the_keys_of_a_guard_are_those_that_are_listed() -> None:
    until = {"error": 0.1, "odd": 1}
    with pytest.raises(ValueError, match="odd = 1: unknown field") as error:
        guard_from(Fields({"until": until}, "phase"), None)
    assert allowed(error.value) == LISTED["until"]
    usual = {each.name: each.default for each in TASKS if each.kind == "until"}
    bare = Guard(at=0.0)
    assert (float(usual["hold"]), float(usual["timeout"])) == (bare.hold, bare.timeout)


def test_the_keys_of_waypoints_are_those_that_are_listed() -> None:
    table = {"points": [[0.0, 0.0, 1.0], HERE], "times": [0.0, 2.0], "odd": 1}
    fields = Fields(table, "path")
    waypoints_table(fields, Setting())
    with pytest.raises(ValueError, match="odd = 1: unknown field") as error:
        fields.done()
    assert allowed(error.value) == LISTED["waypoints"] | {*LIMITS}


def test_defaults_of_the_tables_are_those_of_the_readers() -> None:
    usual = {(each.kind, each.name): each.default for each in TASKS}
    assert float(usual["touching", "speed"]) == SPEED
    assert float(usual["retreat", "clearance"]) == CLEARANCE
    assert usual["approach", "clearance"].startswith(f"{CLEARANCE:g} ")
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
