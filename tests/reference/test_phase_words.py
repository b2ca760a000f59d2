"""The described keys of the phases of a task, and of ``until``, are those that the
program reads.
"""

from __future__ import annotations

import re
from typing import Any

import pytest

from skyarm.records.files import Fields
from skyarm.reference.contact_phases import TOUCHING
from skyarm.reference.phases import KINDS, phases_table
from skyarm.reference.task_records import Setting
from skyarm.scenario.word_texts import GUARDS, PHASES

PUSH = {"force": 1.0, "normal": [-1.0, 0.0, 0.0]}
TURN = {"angle": 1.0, "duration": 2.0, "center": [1.0, 0.0, 0.0], "axis": [0.0, 0.0, 1]}
THERE = {"position": [1.0, 0.5, 1.0]}
FORMS: dict[str, tuple[dict[str, Any], ...]] = {
    "hold": ({"duration": 1.0},),
    "go_to": (THERE,),
    "carry": (THERE,),
    "lift": ({"height": 0.3},),
    "pick": (THERE | {"payload": "box"}, THERE | {"gripper": "hand"}),
    "place": (THERE | {"payload": "box"}, THERE | {"gripper": "hand"}),
    "grasp": ({"payload": "box"}, {"gripper": "hand", "center": [0.5, 0.0, 1.0]}),
    "release": ({"payload": "box"}, {"gripper": "hand"}),
    "approach": (THERE,),
    "press": (PUSH,),
    "slide": (PUSH | THERE,),
    "write": (PUSH | {"points": [[0.0, 1.0, 1.0], [0.0, 2.0, 1.0]]},),
    "search": (PUSH | {"pitch": 0.01, "radius": 0.02},),
    "insert": (PUSH | {"distance": 0.01},),
    "turn": (TURN, PUSH | TURN),
    "open": (TURN, PUSH | TURN),
    "retreat": ({"duration": 1.0}, THERE),
}
"""Kind of a phase -> its forms, with what they require."""


def read(phase: dict[str, Any]) -> set[str]:
    """Keys that are allowed, by the refusal of one that is none."""
    tables = {"phases": [phase], "position": [0.0, 0.0, 1.0]}
    with pytest.raises(ValueError, match="unknown field; allowed: ") as caught:
        phases_table(Fields(tables, "path"), Setting(duration=50.0))
    return set(re.split(", ", str(caught.value).rpartition("allowed: ")[2])) - {"kind"}


def described(kind: str) -> set[str]:
    groups = {"every", *(["contact"] if kind in TOUCHING else [])}
    return {
        each.name
        for each in PHASES
        if each.kind in groups or kind in each.kind.split(", ")
    }


@pytest.mark.parametrize("kind", KINDS)
def test_the_described_keys_of_a_phase_are_those_that_are_read(kind: str) -> None:
    forms = [read({"kind": kind, **form, "no_key": 1}) for form in FORMS[kind]]
    assert set().union(*forms) == described(kind)


def test_every_kind_of_a_description_is_a_phase() -> None:
    named = {name for each in PHASES for name in each.kind.split(", ")}
    assert named - {"every", "contact"} <= {*KINDS}
    assert set(FORMS) == {*KINDS}


def test_the_described_keys_of_until_are_those_that_are_read() -> None:
    until = {"error": 0.01, "no_key": 1}
    found = read({"kind": "hold", "duration": 1.0, "until": until})
    assert found == {each.name for each in GUARDS}
