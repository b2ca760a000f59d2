"""The force at the tip that a law observes, for those who may know no more than the law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.controller import innermost, part_of
from skyarm.records.leaves import is_record


def observed_push(memory: Any) -> Vec3 | None:
    """Force on the tip (N, world axes) that a law's memory holds; None of a law that observes none.

    A law says it in a field ``tip_force`` of its memory, or presses on surfaces (``interaction``), or gives way
    (``admittance``).
    """
    own = innermost(memory)
    found = getattr(own, "tip_force", None)
    if isinstance(found, Vec3):
        return found
    parts: list[Any] = [part_of(own, part) for part in ("interaction", "admittance")]
    return next((part.force for part in parts if is_record(part)), None)


@dataclass(frozen=True, slots=True)
class PushAlone:
    """What others may know of a memory that only its law can read: the tip's force; empty of a law that tells none."""

    tip_force: Vec3 | tuple[()]

    @classmethod
    def of(cls, memory: Any) -> PushAlone:
        """That of a law's memory."""
        found = observed_push(memory)
        return cls(() if found is None else found)
