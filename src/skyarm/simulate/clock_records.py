"""What a clock whose phases wait keeps between two control periods, and what its guards look at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Vec3
from skyarm.scalars import Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class PathClock:
    """The reference's clock between two control periods; all times are control periods.

    Attributes:
        place: of the reference, now. held: of the sample that is held; () where each period publishes one.
        guard: number of the guard that comes next. waited: at its end. reached: for which it has held.
        origin: m, world axes, the tip where the phase began. failed: 1 once a phase has failed that must not.
        offset: m, of the reference since a phase ended early while it moved. since: place from which on.
        held_offset, held_since: those of the sample that is held.
    """

    place: Scalar
    held: Scalar | tuple[()]
    guard: Scalar
    waited: Scalar
    reached: Scalar
    origin: Vec3 | tuple[()]
    failed: Scalar
    offset: Vec3 | tuple[()]
    since: Scalar | tuple[()]
    held_offset: Vec3 | tuple[()]
    held_since: Scalar | tuple[()]


@dataclass(frozen=True, kw_only=True, slots=True)
class Seen:
    """What guards look at in a control period.

    Attributes:
        tip: as measured, m, world axes. goal: where the held reference wants it. push: of that reference.
        force: on the tip as the law observes it, N, world axes; None of a law that observes none.
        felt: the same as a force sensor reads it, where a guard asks for that. switches: 1 closed, in the order of
            those that ``Waits`` looks at.
    """

    tip: Vec3
    goal: Vec3
    push: tuple[Any, ...]
    force: Vec3 | None
    felt: Vec3 | None = None
    switches: tuple[Any, ...] = ()
