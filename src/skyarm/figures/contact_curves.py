"""Contact in pictures of flights: forces over time beside the wanted one, and when points touched and let go."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.log.flight_log import Log
from skyarm.log.periods import contact_pairs, contact_periods

Array = npt.NDArray[np.float64]

APART = 0.04
"""s: a shorter gap between two touches of a pair is no loss of contact, as for a law that presses."""


@dataclass(frozen=True, slots=True)
class Touching:
    """A pair of a surface and a point, and instants at which it touched and let go.

    Attributes:
        surface, point: names. at_tip: whether the point is the vehicle's tip.
        starts, ends: s; a touch that the flight ends with has no end.
    """

    surface: str
    point: str
    at_tip: bool
    starts: tuple[float, ...]
    ends: tuple[float, ...]


def touchings(log: Log) -> tuple[Touching, ...]:
    """Every pair that touched in a flight; periods with a gap below ``APART`` are one."""
    held: dict[tuple[str, str], list[tuple[float, float | None]]] = {}
    for period in contact_periods(log):
        found = held.setdefault((period.surface, period.point), [])
        if found and found[-1][1] is not None and period.start - found[-1][1] < APART:
            found[-1] = (found[-1][0], period.end)
        else:
            found.append((period.start, period.end))
    tips = _at_tip(log)
    return tuple(
        Touching(
            *pair,
            pair[1] in tips,
            tuple(start for start, _ in found),
            tuple(end for _, end in found if end is not None),
        )
        for pair, found in held.items()
    )


def _at_tip(log: Log) -> set[str]:
    """Names of the points at the vehicle's tip, as the log's record has them."""
    written = log.info.get("scenario_record") or {}
    points = (written.get("contact") or {}).get("points") or ()
    tip = ((written.get("world") or {}).get("vehicle") or {}).get("end_effector")
    return {str(each.get("name")) for each in points if tip and each.get("frame") == tip}


def contact_force(surface: str, point: str) -> Callable[[Log], Array | None]:
    """Log -> normal force (N,) of a pair, N; None of a flight without it."""

    def read(log: Log) -> Array | None:
        pairs = contact_pairs(log)
        if (surface, point) not in pairs or log.contact_force.shape[1] != len(pairs):
            return None
        return np.asarray(log.contact_force[:, pairs.index((surface, point))])

    return read


def wanted_force(point: str) -> Callable[[Log], Array | None]:
    """Log -> force (N,) that the reference asks of the tip, N; None where ``point`` is another one or none is asked."""

    def read(log: Log) -> Array | None:
        return wanted_push(log) if point in _at_tip(log) else None

    return read


def wanted_push(log: Log) -> Array | None:
    """Force (N,) that the reference asks of the tip, N; None where none ever is."""
    try:
        scenario = log.scenario
    except ValueError:  # of a version that kept none, or of a plugin that is not loaded
        return None
    push = getattr(scenario.trajectory, "push", None)
    if push is None:
        return None
    # of a task that waits, at the reference's own time
    times = log.path_time if log.path_time.size and scenario.trajectory.guards else log.time
    return np.array(np.broadcast_to(push.force.derivatives(times)[0], log.time.shape), float)
