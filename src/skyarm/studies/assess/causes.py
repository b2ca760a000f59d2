"""Order of alarms by cause: what follows from an alarm that stands already is a note, not one more alarm."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from skyarm.studies.assess.finding import FAULT, LEVELS, NOTE, UNITS, WARNING, Finding

ALARMS = (WARNING, FAULT)

DYNAMICS = r"units \S*(mass|inertia|com|position|speed|thrust|coefficient)"
THRUST = rf"{DYNAMICS}|weight on the rotors|thrust coefficient|senses of rotation|balance of the rotors"

FOLLOWS = {
    r"units (base\.inertia|rotors\.max_speed)": r"units mass",
    r"weight on the rotors|thrust coefficient|moment coefficient": DYNAMICS,
    r"balance of the rotors": rf"{DYNAMICS}|senses of rotation",
    r"thrust margin": THRUST,
    r"static effort": rf"{DYNAMICS}|weight on the rotors' discs links",
    r"authority": rf"{THRUST}|thrust margin",
    r"largest payload \S+ none": rf"{THRUST}|thrust margin|static effort",
    r"reference within joint limits": r"units reference",
    r"^\w+ along the reference|servo's speed": rf"{THRUST}|units ref|within joint limits|thrust margin|static effort",
}
"""Question, field and text of an alarm -> question and field of alarms that cause it, as patterns."""


def causes_first(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Findings in which an alarm that follows from another one is a note that names its cause.

    A fault is so stated once; what follows from no other alarm stays one. An alarm causes none that is more severe,
    but numbers in other units do, and then are as severe themselves.
    """
    found = list(findings)
    for i, each in enumerate(findings):
        causes = [why for what, why in FOLLOWS.items() if re.search(what, f"{each.question} {each.field} {each.text}")]
        for j, other in enumerate(findings):
            enough = other.level in (FAULT, each.level, WARNING if other.question == UNITS else FAULT)
            words = f"{other.question} {other.field}"
            if i == j or not enough or each.level not in ALARMS or not any(re.search(why, words) for why in causes):
                continue
            found[i] = replace(each, level=NOTE, text=f"{each.text}; follows from {other.field}")
            if found[j].level != NOTE:
                found[j] = replace(found[j], level=max(found[j].level, each.level, key=LEVELS.index))
            break
    return tuple(found)
