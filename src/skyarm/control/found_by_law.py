"""Online estimates of laws, for the log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.controller import part_of
from skyarm.control.laws.centroidal.lag_estimate import lags_found
from skyarm.records.leaves import is_record


def found_by_law(memory: Any) -> Mapping[str, tuple[Any, ...]]:
    """Arrays of a log, and their numbers in the memory of a law, also of one under layers; none of most laws.

    A law tells of a load by a field ``load`` of its memory: a record with a ``mass`` (kg) and a ``place`` (m, axes of
    the tip), and of its ``inertia.moments`` (kg m^2), where it has them. Any other field of this name is the law's own
    affair.
    """
    load: Any = part_of(memory, "load")
    found = {"lag_found": lags_found(memory)}
    if is_record(load) and hasattr(load, "mass") and isinstance(getattr(load, "place", None), Vec3):
        found |= {"load_mass_found": (load.mass,), "load_place_found": tuple(load.place)}
        moments = getattr(getattr(load, "inertia", ()), "moments", None)
        found |= {"load_inertia_found": tuple(moments)} if isinstance(moments, Vec3) else {}
    return {name: numbers for name, numbers in found.items() if numbers}


def numbers_found(memory: Any) -> tuple[Any, ...]:
    """The same numbers in a row."""
    return tuple(number for numbers in found_by_law(memory).values() for number in numbers)
