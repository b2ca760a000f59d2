"""A reference beside its plan: moved by an offset, from which it comes back in the course of later phases."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Vec3
from skyarm.reference.minimum_snap import minimum_snap
from skyarm.reference.trajectory import Reference
from skyarm.scalars import where
from skyarm.scalars.taylor import Taylor

ORDERS = ("position", "velocity", "acceleration", "jerk", "snap")


def offset_reference(
    reference: Reference, offset: Vec3, returns: Sequence[tuple[float, float]], since: Any, time: Any
) -> Reference:
    """The reference of base and tip, moved by what is left of an offset.

    Args:
        reference: as planned, at ``time`` (s).
        offset: m, world axes.
        returns: beginning and end (s) of the phases in which the reference comes back.
        since: s, where the offset began: phases before count no more.
        time: s, of the reference.
    """
    left: Any = Taylor.of_derivatives((1.0, 0.0, 0.0, 0.0, 0.0))
    for begin, end in returns:
        gone = minimum_snap((begin, end), (0.0, 1.0)).derivatives(time)
        counts = begin >= since - 1e-9
        left = left * Taylor.of_derivatives([one - where(counts, d, 0.0) for one, d in zip(ONE, gone, strict=True)])
    moved = {name: getattr(reference, name) + offset * left.derivative(order) for order, name in enumerate(ORDERS)}
    tip = tuple(c + o * left.derivative(0) for c, o in zip(reference.tip, offset, strict=False))
    return dataclasses.replace(reference, tip=tip, **moved)


ONE = (1.0, 0.0, 0.0, 0.0, 0.0)
"""The number one with its derivatives."""
