"""When a log's points touched its surfaces, and how strongly: first touches, losses, peaks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.log.log_columns import touched_surfaces


@dataclass(frozen=True, kw_only=True, slots=True)
class ContactPeriod:
    """A contact period lasts from a touch to the loss of contact, as the control instants of a log show it.

    Attributes:
        surface, point: names of the pair.
        start: s, the first instant with a force. end: s, the first one without; None where the log ends before.
        peak: N, largest normal force. mean: N.
    """

    surface: str
    point: str
    start: float
    end: float | None
    peak: float
    mean: float


def contact_periods(log: Log) -> tuple[ContactPeriod, ...]:
    """All periods of contact in a log, by their beginnings; empty of a flight without a world."""
    found: list[ContactPeriod] = []
    for (surface, point), force in zip(contact_pairs(log), log.contact_force.T, strict=False):
        touching = np.concatenate([[False], force > 0.0, [False]])
        begins, ends = (np.flatnonzero(np.diff(touching.astype(int)) == sign) for sign in (1, -1))
        for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
            inside = force[begin:end]
            found.append(
                ContactPeriod(
                    surface=surface, point=point, start=float(log.time[begin]),
                    end=float(log.time[end]) if end < len(force) else None,
                    peak=float(inside.max()), mean=float(inside.mean()),
                )
            )  # fmt: skip
    return tuple(sorted(found, key=lambda each: each.start))


def contact_pairs(log: Log) -> tuple[tuple[str, str], ...]:
    """Surface and point of each column of ``contact_force``."""
    world = log.info.get("scenario_record") or {}
    held: Any = world.get("contact") if isinstance(world, Mapping) else None
    points = [str(each["name"]) for each in (held or {}).get("points") or ()]
    return tuple((surface, point) for surface in touched_surfaces(held or {}) for point in points)
