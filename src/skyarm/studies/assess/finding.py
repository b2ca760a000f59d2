"""Result of one feasibility check: value, limit, severity, and name of the parameter
concerned.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from enum import StrEnum, auto
from typing import TypedDict, Unpack

from skyarm.algebra import Scalar
from skyarm.records.arrays import Array
from skyarm.records.immutable import positional
from skyarm.view.pages import Facts

OK, NOTE, WARNING, FAULT = "ok", "note", "warning", "fault"

LEVELS = (OK, NOTE, WARNING, FAULT)
"""Levels of a finding, from good to bad: a note is no alarm; with a fault the described
vehicle cannot fly."""


UNITS = "units"
"""Name of the question about numbers that are probably in other units."""


class Concern(StrEnum):
    """Subject of a finding that can follow from other findings, or cause them."""

    BASE_LOADING = auto()
    ARM_LOADING = auto()
    AXES = auto()
    THRUST_COEFFICIENT = auto()
    MOMENT_COEFFICIENT = auto()
    SENSES = auto()
    BALANCE = auto()
    LOADED_BALANCE = auto()
    LIFT = auto()
    LOADED_LIFT = auto()
    THRUST_MARGIN = auto()
    AUTHORITY = auto()
    NO_PAYLOAD = auto()
    STATIC_EFFORT = auto()
    JOINT_LIMITS = auto()
    SERVO_SPEED = auto()
    CLEARANCE = auto()
    CONTACT = auto()
    ROTORS_IN_FLIGHT = auto()
    JOINTS_IN_FLIGHT = auto()


@positional
class Finding:
    """Result of one feasibility check, with a severity.

    Attributes:
        question: question in a few words.
        level: one of LEVELS.
        text: the answer in a sentence.
        field: origin of the number in the vehicle's or scenario's file; empty where
            there is no single one.
        remedy: suggested change; empty if ok.
        value, limit: the number found and the one it is held against, in ``unit``; NaN
            where there is none.
        unit: unit of both.
        joints: the arm pose in which it holds, rad or m; empty where no pose matters.
        concerns: a :class:`Concern`, or of a number in other units its place,
            "links[].mass"; empty for others.
        follows: field of the alarm that causes it; empty if none does.
    """

    question: str
    level: str
    text: str
    field: str = ""
    remedy: str = ""
    value: float = math.nan
    limit: float = math.nan
    unit: str = ""
    joints: Sequence[Scalar] | Array = ()
    concerns: str = ""
    follows: str = ""

    def __post_init__(self) -> None:
        """Convert the values of a check result to floats, and clear the remedy if the
        check is passed.
        """
        object.__setattr__(self, "value", float(self.value))
        object.__setattr__(self, "joints", tuple(map(float, self.joints)))
        if self.level == OK:
            object.__setattr__(self, "remedy", "")

    def plain(self) -> Facts:
        """Check result as plain data."""
        return asdict(self)


class Details(TypedDict, total=False):
    """Optional fields of a check result."""

    limit: float
    unit: str
    joints: Sequence[Scalar] | Array
    concerns: str


def worst_level(findings: Iterable[Finding]) -> str:
    """The most severe level among check results; "ok" if there are none."""
    return max((each.level for each in findings), key=LEVELS.index, default=OK)


def at_least(
    question: str,
    value: float,
    text: str,
    field: str = "",
    remedy: str = "",
    *,
    fault: float = -math.inf,
    warning: float = -math.inf,
    **more: Unpack[Details],
) -> Finding:
    """Check result for a value that must not fall below its fault and warning limits.

    Args:
        question: question that it answers.
        value: the number.
        text: the answer.
        field: origin of the number.
        remedy: remedy of an alarm.
        fault: below it the vehicle cannot fly as it is described.
        warning: below it the number is an alarm.
        more: ``unit``, ``joints``, ``concerns``; ``limit`` in place of the one that was
            passed.
    """
    # not "<": a value that is no number is a fault
    level = FAULT if not value >= fault else WARNING if value < warning else OK
    passed = fault if level == FAULT or math.isinf(warning) else warning
    return Finding(
        question, level, text, field, remedy, value, **(Details(limit=passed) | more)
    )


def at_most(
    question: str,
    value: float,
    text: str,
    field: str = "",
    remedy: str = "",
    *,
    fault: float = math.inf,
    warning: float = math.inf,
    **more: Unpack[Details],
) -> Finding:
    """Check result for a value that must not exceed its fault and warning limits."""
    mirrored = at_least(
        question, -value, text, field, remedy, fault=-fault, warning=-warning, **more
    )
    return replace(mirrored, value=value, limit=more.get("limit", -mirrored.limit))


BEHIND_A_FIELD = re.compile(r": | of | reaches ")
"""Pattern of the separator between a field and its finding in a line without an equals
sign."""


def finding_of_line(line: str, question: str, level: str) -> Finding:
    """Make a check result from a one-line warning, which names a parameter and ends
    with a hint at the remedy.
    """
    head, equals, _ = line.partition(" = ")
    field = (
        head.replace(": ", ".") if equals else BEHIND_A_FIELD.split(line, maxsplit=1)[0]
    )
    # the question at the end says what is perhaps meant; it stands behind the last
    # semicolon, else behind a colon
    said, _, hint = line.rpartition("; " if "; " in line else ": ")
    remedy = f"check it: {hint}" if said else "check it"
    return Finding(
        question,
        level,
        line,
        field,
        remedy,
        concerns=_place(field) if question == UNITS else "",
    )


def _place(field: str) -> str:
    """First and last word of a parameter of the vehicle or the reference, without
    names: "links[].mass".
    """
    parts = re.sub(r"\[[^]]*\]", "[]", field.removeprefix("plant.")).split(".")
    return ".".join(parts[:1] + parts[1:][-1:])
