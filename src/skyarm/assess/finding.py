"""A finding: the answer to one question about a vehicle, with its number, its limit and the field it comes from."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

OK, NOTE, WARNING, FAULT = "ok", "note", "warning", "fault"

LEVELS = (OK, NOTE, WARNING, FAULT)
"""From good to bad: a note is worth knowing and no alarm; with a fault the vehicle cannot fly as it is described."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Finding:
    """A finding answers one question.

    Attributes:
        question: what was asked, in a few words.
        level: one of LEVELS.
        text: the answer in a sentence.
        field: where the number comes from in the vehicle's or scenario's file; empty where there is no single one.
        value, limit: the number found and the one it is held against, in ``unit``; NaN where there is none.
        unit: of both.
        remedy: what to change; empty where all is well.
        joints: the arm pose in which it holds, rad or m; empty where no pose matters.
    """

    question: str
    level: str
    text: str
    field: str = ""
    value: float = math.nan
    limit: float = math.nan
    unit: str = ""
    remedy: str = ""
    joints: tuple[float, ...] = ()

    def plain(self) -> dict[str, Any]:
        """The finding as plain data."""
        return asdict(self)


def worst_level(findings: Iterable[Finding]) -> str:
    """The worst level among findings; ok without any."""
    return max((each.level for each in findings), key=LEVELS.index, default=OK)


def graded(value: float, *, fault_below: float, warning_below: float) -> str:
    """Level of a number that should be large."""
    return FAULT if not value >= fault_below else WARNING if value < warning_below else OK
