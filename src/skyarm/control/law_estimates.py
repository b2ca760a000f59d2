"""Online estimates in a law's memory: for the log, and for parts with no more information than the law."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import Scalar
from skyarm.control.controller import innermost, part_of
from skyarm.records.leaves import is_record


def found_by_law(memory: Any) -> Mapping[str, tuple[Any, ...]]:
    """Arrays of a log, and their numbers in the memory of a law, also of one under layers; none of most laws.

    A law shows a load by a field ``load`` of its memory: a record with a ``mass`` (kg) and a ``place`` (m, axes of the
    tip). Any other field of this name is not logged.
    """
    load: Any = part_of(memory, "load")
    found = {"lag_found": lags_found(memory)}
    if is_record(load) and hasattr(load, "mass") and isinstance(getattr(load, "place", None), Vec3):
        found |= {"load_mass_found": (load.mass,), "load_place_found": tuple(load.place)}
    return {name: numbers for name, numbers in found.items() if numbers}


def lags_found(memory: Any) -> tuple[Scalar, ...]:
    """Lags of the rotors' and the joints' loops (s) in a law's memory, also under layers; () without them.

    A law shows them by a field ``lag`` of its memory: a record whose ``found`` is a tuple.
    """
    lag = part_of(memory, "lag")
    found = getattr(lag, "found", None) if is_record(lag) else None
    return found if isinstance(found, tuple) else ()


def numbers_found(memory: Any) -> tuple[Scalar, ...]:
    """The same numbers in a row."""
    return tuple(number for numbers in found_by_law(memory).values() for number in numbers)


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
    """Tip force estimated in a memory that only its law can read; empty for a law without an estimate."""

    tip_force: Vec3 | tuple[()]

    @classmethod
    def of(cls, memory: Any) -> PushAlone:
        """Extract the estimate from a law's memory."""
        found = observed_push(memory)
        return cls(() if found is None else found)
