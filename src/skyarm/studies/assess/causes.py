"""Ordering of check alarms by cause: an alarm that follows from another one is
downgraded to a note.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace

from skyarm.studies.assess.finding import (
    FAULT,
    LEVELS,
    NOTE,
    UNITS,
    WARNING,
    Concern,
    Finding,
)

ALARMS = (WARNING, FAULT)


# numbers of the vehicle, not of its model, a sensor, the start or the air
ARM_WEIGHT = {"links[].mass", Concern.ARM_LOADING}
WEIGHT = {"base.mass", Concern.BASE_LOADING} | ARM_WEIGHT
PLACES = {
    f"{body}.{place}" for body in ("base", "links[]") for place in ("com", "position")
}
LOADS = WEIGHT | PLACES
ROTORS = {
    "rotors.max_speed",
    "rotors[].position",
    "rotors[].max_speed",
    "rotors[].thrust_coefficient",
    "rotors[].thrust_table",
    "rotors[].moment_coefficient",
}
INERTIA = {"base.inertia", "links[].inertia"}
MARGIN = {Concern.LIFT, Concern.LOADED_LIFT, Concern.THRUST_MARGIN}
LIFT = LOADS | ROTORS | {Concern.THRUST_COEFFICIENT, Concern.AXES}
THRUST = LIFT | {Concern.SENSES, Concern.BALANCE, Concern.LOADED_BALANCE}
BALANCE = LOADS | ROTORS | {Concern.SENSES, Concern.AXES}
FOLLOWED = LOADS | INERTIA | {"reference", Concern.JOINT_LIMITS}

FOLLOWS: Mapping[str, AbstractSet[str]] = {
    "base.inertia": {Concern.BASE_LOADING},
    "rotors.max_speed": WEIGHT | {Concern.THRUST_COEFFICIENT},
    "rotors.axis": {Concern.AXES},
    "mass": {Concern.BASE_LOADING, Concern.ARM_LOADING},
    Concern.SENSES: {Concern.AXES},
    Concern.BASE_LOADING: {"base.mass", "links[].mass", "rotors[].position"},
    Concern.ARM_LOADING: {"base.mass", "links[].mass", "rotors[].position"},
    Concern.THRUST_COEFFICIENT: {"rotors[].position", "rotors[].moment_coefficient"},
    Concern.MOMENT_COEFFICIENT: {"rotors[].position", "rotors[].moment_coefficient"},
    Concern.BALANCE: BALANCE,
    Concern.LOADED_BALANCE: BALANCE | {Concern.LOADED_LIFT},
    Concern.LIFT: LIFT,
    Concern.LOADED_LIFT: LIFT,
    Concern.THRUST_MARGIN: THRUST,
    Concern.STATIC_EFFORT: ARM_WEIGHT | {"links[].com", "links[].position"},
    Concern.AUTHORITY: THRUST | INERTIA | MARGIN,
    Concern.NO_PAYLOAD: THRUST | MARGIN | {Concern.STATIC_EFFORT},
    Concern.JOINT_LIMITS: {"reference.joints[]"},
    Concern.SERVO_SPEED: {"reference.joints[]", Concern.JOINT_LIMITS},
    Concern.CONTACT: FOLLOWED,
    Concern.CLEARANCE: {"reference", Concern.JOINT_LIMITS},
    Concern.ROTORS_IN_FLIGHT: FOLLOWED | THRUST | MARGIN,
    Concern.JOINTS_IN_FLIGHT: FOLLOWED | {Concern.STATIC_EFFORT},
}
"""What an alarm concerns -> what the alarms concern from which it can follow; a word
alone is a whole table."""


def causes_first(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Downgrade each alarm that follows from another alarm to a note that names the
    other one as its cause.

    A fault is so stated once; what follows from no other alarm stays one. An alarm
    causes none that is more severe, but numbers in other units do, and then are as
    severe themselves.
    """
    linked = list(findings)
    for i, each in enumerate(findings):
        causes = FOLLOWS.get(each.concerns, frozenset()) if each.level in ALARMS else ()
        for j, other in enumerate(findings):
            enough = other.level in (
                FAULT,
                each.level,
                WARNING if other.question == UNITS else FAULT,
            )
            if (
                i == j
                or not enough
                # also the first word: whatever stands in the reference counts as the
                # reference
                or not {other.concerns, other.concerns.partition(".")[0]} & {*causes}
            ):
                continue
            linked[i] = replace(
                each,
                level=NOTE,
                text=f"{each.text}; follows from {other.field}",
                follows=other.field,
            )
            if linked[j].level != NOTE:
                linked[j] = replace(
                    linked[j], level=max(linked[j].level, each.level, key=LEVELS.index)
                )
            break
    return tuple(linked)
