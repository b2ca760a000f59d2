"""Ordering of check alarms by cause: an alarm that follows from another one is downgraded to a note."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from skyarm.studies.assess.finding import FAULT, LEVELS, NOTE, UNITS, WARNING, Finding

ALARMS = (WARNING, FAULT)

# numbers of the vehicle, not of its model, a sensor, the start or the air
MASS = r"^units (plant\.)?((base|links)\S*\.)?mass:|^weight on the rotors' discs"
LOADS = rf"{MASS}|^units (plant\.)?(base|links)\S*\.(com|position):"
ARM = r"^units (plant\.)?links\S*\.(mass|com|position):|^weight on the rotors' discs links"
ROTORS = r"^units (plant\.)?rotors\S*\.(position|max_speed|thrust_\w+|moment_coefficient):"
AXES = "^axes of the rotors"
LIFT = rf"{LOADS}|{ROTORS}|^thrust coefficient|{AXES}"
THRUST = rf"{LIFT}|^senses of rotation|^balance of the rotors"
INERTIA = r"^units (plant\.)?(base|links)\S*\.inertia:"

FOLLOWS = {
    r"^units (plant\.)?base\.inertia": r"^weight on the rotors' discs base",
    r"^units (plant\.)?rotors\.max_speed": rf"{MASS}|^thrust coefficient",
    r"^units (plant\.)?rotors\.axis|^senses of rotation": AXES,
    r"^units (plant\.)?mass": r"^weight on the rotors' discs",
    r"^weight on the rotors": r"^units (plant\.)?((base|links)\S*\.mass|rotors\S*\.position):",
    r"^(thrust|moment) coefficient": r"^units (plant\.)?rotors\S*\.(position|moment_coefficient):",
    r"^balance of the rotors": rf"{LOADS}|{ROTORS}|^senses of rotation|{AXES}",
    r"^balance of the rotors with": r"^thrust margin with .*: cannot lift",
    r"^thrust margin .*cannot lift": LIFT,
    r"^thrust margin (?!.*cannot lift)": THRUST,
    r"static effort": ARM,
    r"authority": rf"{THRUST}|{INERTIA}|^thrust margin",
    r"^largest payload \S+ none": rf"{THRUST}|^thrust margin|static effort",
    r"^reference within joint limits|servo's speed": r"^units reference\.joints",
    r"servo's speed": r"^reference within joint limits",
    r"^\w+ along the reference": rf"{LOADS}|{INERTIA}|^units reference|^reference within joint limits",
    r"^clearance": r"^units reference|^reference within joint limits",
    r"^rotors along the reference": rf"{THRUST}|^thrust margin",
    r"^joints along the reference": r"static effort",
}
"""Question, field and text of an alarm, as a pattern -> patterns of alarms that can cause it."""


def causes_first(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Downgrade each alarm that follows from another alarm to a note that names the other one as its cause.

    A fault is so stated once; what follows from no other alarm stays one. An alarm causes none that is more severe,
    but numbers in other units do, and then are as severe themselves.
    """
    linked = list(findings)
    for i, each in enumerate(findings):
        causes = [why for what, why in FOLLOWS.items() if re.search(what, f"{each.question} {each.field} {each.text}")]
        for j, other in enumerate(findings):
            enough = other.level in (FAULT, each.level, WARNING if other.question == UNITS else FAULT)
            words = f"{other.question} {other.field}: {other.text}"
            if i == j or not enough or each.level not in ALARMS or not any(re.search(why, words) for why in causes):
                continue
            linked[i] = replace(each, level=NOTE, text=f"{each.text}; follows from {other.field}")
            if linked[j].level != NOTE:
                linked[j] = replace(linked[j], level=max(linked[j].level, each.level, key=LEVELS.index))
            break
    return tuple(linked)
