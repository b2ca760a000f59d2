"""When a log's grippers held something, what, and how each grasp ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyarm.log.flight_log import Log


@dataclass(frozen=True, kw_only=True, slots=True)
class GraspPeriod:
    """A grasp period lasts from taking hold to letting go, as the control instants of a log show it.

    Attributes:
        gripper, held: names of the gripper and of what it holds.
        start: s, the first instant. end: s, the first one after it; None where the log ends before.
        gave_way: whether it ended because the load was more than the gripper bears.
        peak: N, largest force of the grasp.
    """

    gripper: str
    held: str
    start: float
    end: float | None
    gave_way: bool
    peak: float


def grasp_periods(log: Log) -> tuple[GraspPeriod, ...]:
    """All grasps in a log, by their beginnings; empty of a flight without grippers."""
    grippers, bodies = _names(log)
    found: list[GraspPeriod] = []
    for i, gripper in enumerate(grippers):
        if i >= log.gripper_taken.shape[1]:
            break
        taken, lost, force = log.gripper_taken[:, i], log.gripper_lost[:, i], log.gripper_force[:, i]
        edges = np.flatnonzero(np.diff(taken, prepend=0.0, append=0.0))
        for begin, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            number = int(taken[begin])
            if number:
                last = end >= len(taken)
                found.append(
                    GraspPeriod(
                        gripper=gripper, held=bodies[number - 1], start=float(log.time[begin]),
                        end=None if last else float(log.time[end]),
                        gave_way=not last and bool(lost[end] > lost[begin]),
                        peak=float(force[begin:end].max()),
                    )
                )  # fmt: skip
    return tuple(sorted(found, key=lambda each: each.start))


def _names(log: Log) -> tuple[list[str], list[str]]:
    """Of the grippers, and of what they may hold in the order of its numbers."""
    world = log.info.get("scenario_record") or {}
    held: Any = world.get("contact") if isinstance(world, Mapping) else None
    grippers, objects = ([str(each["name"]) for each in (held or {}).get(of) or ()] for of in ("grippers", "objects"))
    return grippers, objects
