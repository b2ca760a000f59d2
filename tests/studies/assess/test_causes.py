"""An alarm that follows from another one becomes a note that names it, by what the two
concern.
"""

from __future__ import annotations

import pytest

from skyarm.studies.assess.causes import FOLLOWS, causes_first
from skyarm.studies.assess.finding import (
    FAULT,
    NOTE,
    UNITS,
    WARNING,
    Concern,
    Finding,
    finding_of_line,
)

FOLLOWING = [
    (Concern.THRUST_MARGIN, Concern.SENSES),
    (Concern.THRUST_MARGIN, Concern.BALANCE),
    (Concern.LIFT, Concern.THRUST_COEFFICIENT),
    (Concern.LOADED_LIFT, "links[].mass"),
    (Concern.LOADED_BALANCE, Concern.LOADED_LIFT),
    (Concern.BALANCE, "rotors[].position"),
    (Concern.SENSES, Concern.AXES),
    (Concern.AUTHORITY, "links[].inertia"),
    (Concern.AUTHORITY, Concern.THRUST_MARGIN),
    (Concern.NO_PAYLOAD, Concern.STATIC_EFFORT),
    (Concern.STATIC_EFFORT, Concern.ARM_LOADING),
    (Concern.JOINT_LIMITS, "reference.joints[]"),
    (Concern.SERVO_SPEED, Concern.JOINT_LIMITS),
    (Concern.CONTACT, "reference.base"),
    (Concern.CLEARANCE, "reference.yaw"),
    (Concern.ROTORS_IN_FLIGHT, Concern.LIFT),
    (Concern.JOINTS_IN_FLIGHT, Concern.STATIC_EFFORT),
    (Concern.BASE_LOADING, "rotors[].position"),
    (Concern.MOMENT_COEFFICIENT, "rotors[].position"),
    ("base.inertia", Concern.BASE_LOADING),
    ("rotors.max_speed", "base.mass"),
    ("rotors.axis", Concern.AXES),
    ("mass", Concern.ARM_LOADING),
]
APART = [
    # a load at the tip tells nothing of the vehicle without it
    (Concern.BALANCE, Concern.LOADED_LIFT),
    (Concern.LIFT, Concern.SENSES),  # which change no thrust
    (Concern.STATIC_EFFORT, "base.mass"),
    (Concern.CLEARANCE, "rotors[].position"),
    ("", Concern.AXES),
    (Concern.AUTHORITY, ""),
]


def alarm(concerns: str, level: str = FAULT) -> Finding:
    return Finding(
        f"question of {concerns}",
        level,
        "it is so",
        f"field of {concerns}",
        concerns=concerns,
    )


@pytest.mark.parametrize(("effect", "cause"), FOLLOWING)
def test_an_effect_is_a_note_that_names_the_field_of_its_cause(
    effect: str, cause: str
) -> None:
    first, second = causes_first([alarm(effect), alarm(cause)])
    assert (first.level, first.follows) == (NOTE, f"field of {cause}")
    assert first.text == f"it is so; follows from field of {cause}"
    assert second == alarm(cause)


@pytest.mark.parametrize(("effect", "cause"), APART)
def test_alarms_that_have_nothing_to_do_with_each_other_stay(
    effect: str, cause: str
) -> None:
    both = (alarm(effect), alarm(cause))
    assert causes_first(both) == both


def test_only_numbers_in_other_units_cause_what_is_more_severe() -> None:
    weak = alarm(Concern.SENSES, WARNING)
    assert causes_first([alarm(Concern.THRUST_MARGIN), weak])[0].level == FAULT
    units = finding_of_line(
        "links[forearm].mass = 300 kg: is more than 100; kg, not g?", UNITS, WARNING
    )
    assert units.concerns == "links[].mass"
    effect, cause = causes_first([alarm(Concern.LIFT), units])
    assert (effect.level, cause.level) == (NOTE, FAULT)


def test_every_concern_of_the_table_is_one_that_a_finding_can_have() -> None:
    stated = {*FOLLOWS, *(each for causes in FOLLOWS.values() for each in causes)}
    assert {*Concern} <= stated
