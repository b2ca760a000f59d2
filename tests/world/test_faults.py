"""Faults as records and as a scenario's tables."""

from __future__ import annotations

import pytest

import skyarm
from skyarm.reference import Sine
from skyarm.scenario.document import read_part, slot_of
from skyarm.world import Effectiveness, Fault, effectiveness_at

ARM2 = skyarm.load_vehicle("hummingbird_arm2_rotors")
FRONT = Fault(rotor="front", effectiveness=0.7, start=5.0)
ELBOW = Fault(joint="joint2", effectiveness=0.0, start=2.0)


def test_a_fault_begins_at_its_start_and_stays():
    assert [FRONT.share(t) for t in (-1.0, 4.999, 5.0, 1e6)] == [1.0, 1.0, 0.7, 0.7]


def test_untouched_actuators_are_structure_and_fold_away():
    left = effectiveness_at((FRONT, ELBOW), ARM2, 3.0)
    assert left == Effectiveness((1.0, 1, 1, 1), (1, 0.0))
    assert [type(share) for share in left.rotors] == [float, int, int, int]


def test_faults_of_one_actuator_multiply():
    twice = (FRONT, Fault(rotor="front", effectiveness=0.5, start=6.0))
    assert effectiveness_at(twice, ARM2, 7.0).rotors[0] == pytest.approx(
        0.35, rel=1e-15
    )


def test_without_faults_nothing_is_there_to_compute():
    assert effectiveness_at((), ARM2, 0.0) is None


def test_tables_become_faults():
    tables = [
        {"rotor": "front", "effectiveness": 0.7, "start": 5.0},
        {"joint": "joint2", "effectiveness": 0},
    ]
    assert read_part(slot_of("environment.faults"), tables, None) == (
        FRONT,
        Fault(joint="joint2", effectiveness=0.0, start=0.0),
    )


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({}, "environment.faults = {}: must be a list of tables"),
        ([3], r"environment.faults\[0\] = 3: must be a table"),
        (
            [{"effectiveness": 0.5}],
            r"environment.faults\[0\].rotor = '', joint = '': must name one of the two",
        ),
        (
            [{"rotor": "a", "joint": "b", "effectiveness": 0.5}],
            "must name one of the two",
        ),
        ([{"rotor": 7, "effectiveness": 0.5}], r"\[0\].rotor = 7: must be "),
        (
            [{"rotor": "a", "effectiveness": -0.1}],
            r"effectiveness = -0.1: must be at least 0",
        ),
        (
            [{"rotor": "a", "effectiveness": 1.01}],
            r"\[0\].effectiveness = 1.01: must be at most 1",
        ),
        (
            [{"rotor": "a", "effectiveness": 0.5, "start": -0.1}],
            r"\[0\].start = -0.1: must be at least 0",
        ),
        ([{"rotor": "a"}], "effectiveness: is missing"),
        (
            [{"rotor": "a", "effectiveness": 0.5, "begin": 1.0}],
            "begin = 1.0: unknown field",
        ),
    ],
)
def test_wrong_tables_are_refused_by_name(tables, words):
    with pytest.raises(ValueError, match=words):
        read_part(slot_of("environment.faults"), tables, None)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("effectiveness", "a"),
        ("effectiveness", None),
        ("effectiveness", [1]),
        ("start", (1.0,)),
        ("start", True),
    ],
)
def test_a_fault_holds_numbers(field, value):
    with pytest.raises(ValueError, match=rf"^{field} = .*: must be a number$"):
        Fault(
            **({"rotor": "front", "effectiveness": 0.5, "start": 0.0} | {field: value})
        )


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("start", -1.0, "at least 0"),
        ("effectiveness", -0.5, "at least 0"),
        ("effectiveness", 1.5, "at most 1"),
    ],
)
def test_a_fault_takes_force_away_in_flight(field, value, words):
    with pytest.raises(ValueError, match=rf"^{field} = {value}: must be {words}$"):
        Fault(
            **({"rotor": "front", "effectiveness": 0.5, "start": 0.0} | {field: value})
        )


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"effectiveness": 0.5}, r"effectiveness = 0\.5"),
        (
            {"signal": Sine(amplitude=0.5, frequency_hz=1.0)},
            r"effectiveness = \{'kind': 'sine'",
        ),
    ],
)
def test_a_joint_that_is_stuck_has_no_share_of_its_effort(fields, words):
    with pytest.raises(ValueError, match=rf"^{words}.*: must be left out beside stuck"):
        Fault(joint="joint1", stuck=True, **fields)
    assert Fault(joint="joint1", stuck=True).effectiveness == 1.0
