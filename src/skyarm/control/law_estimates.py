"""Online estimates inside a control law's state (loop lags, tip load, tip force), for
logs and displays.
"""

from __future__ import annotations

from collections.abc import Mapping

from skyarm.algebra import Scalars, Vec3
from skyarm.control.controller import innermost, part_of
from skyarm.records.immutable import positional
from skyarm.records.leaves import Tree, is_record


def found_by_law(memory: Tree) -> Mapping[str, Scalars]:
    """Estimates of a control law by log array name: loop lags, tip load, tip force;
    empty without such estimates.

    A law shows a load by a field ``load`` of its memory: a record with a ``mass`` (kg)
    and a ``place`` (m, axes of the tip). Any other field of this name is not logged.
    The tip's force is logged where its standard error is known.
    """
    # laws of users have memories of classes of their own: fields go by name and shape
    load = part_of(memory, "load")
    estimates = {"lag_found": lags_found(memory)}
    if (
        is_record(load)
        and hasattr(load, "mass")
        and isinstance(getattr(load, "place", None), Vec3)
    ):
        estimates |= {
            "load_mass_found": (load.mass,),
            "load_place_found": tuple(load.place),
        }
    push = part_of(memory, "interaction")
    # a force from joint torques is as wrong as these are, 0.12 of 1 N with joints 10 %
    # weak: without its error it is no estimate to be read
    deviation = getattr(getattr(push, "scale", None), "deviation", None)
    if deviation is not None:
        estimates |= {"push_found": tuple(push.force), "push_deviation": (deviation,)}
    return {name: numbers for name, numbers in estimates.items() if numbers}


def lags_found(memory: Tree) -> Scalars:
    """Estimated lags (s) of the rotor and joint loops in a control law's state; empty
    if not estimated.

    A law shows them by a field ``lag`` of its memory: a record whose ``found`` is a
    tuple.
    """
    lag = part_of(memory, "lag")
    lags = getattr(lag, "found", None) if is_record(lag) else None
    return lags if isinstance(lags, tuple) else ()


def numbers_found(memory: Tree) -> Scalars:
    """All online estimates of a control law (loop lags, tip load, tip force) as one
    flat tuple.
    """
    return tuple(
        number for numbers in found_by_law(memory).values() for number in numbers
    )


def observed_push(memory: Tree) -> Vec3 | None:
    """Tip force (N, world axes) estimated in a control law's state; None if not
    estimated.

    The estimate is a field ``tip_force`` of the memory, or part of contact force
    control (``interaction``) or of admittance control (``admittance``).
    """
    own = innermost(memory)
    force = getattr(own, "tip_force", None)
    if isinstance(force, Vec3):
        return force
    parts = [part_of(own, part) for part in ("interaction", "admittance")]
    return next((part.force for part in parts if is_record(part)), None)


@positional
class PushAlone:
    """Tip force estimate of a control law, separate from the rest of the law's state;
    empty if not estimated.
    """

    tip_force: Vec3 | tuple[()]

    @classmethod
    def of(cls, memory: Tree) -> PushAlone:
        """Tip force estimate extracted from a control law's internal state."""
        force = observed_push(memory)
        return cls(() if force is None else force)
