"""Periods of contact and grasp in a log, and phases that timed out."""

from __future__ import annotations

import numpy as np

from skyarm.log.flown_scenario import written_at
from skyarm.log.log_columns import FlightArrays, component_labels
from skyarm.records.arrays import Mask
from skyarm.records.immutable import immutable

SAME = 1e-6
"""Path time (s) within which the reference rests at one position."""


@immutable
class ContactPeriod:
    """Period from a touch to the loss of contact: surface, contact point, times and
    forces.

    Attributes:
        surface, point: names of the pair; of the shapes of a vehicle's body the other
            body and that body.
        start: s, the first instant with a force. end: s, the first one without; None
            where the log ends before.
        peak: N, largest normal force. mean: N.
    """

    surface: str
    point: str
    start: float
    end: float | None
    peak: float
    mean: float


@immutable
class GraspPeriod:
    """Period from a grasp to its release: gripper, load, times and largest force.

    Attributes:
        gripper, held: names of the gripper and of its load.
        start: s, the first instant. end: s, the first one after it; None where the log
            ends before.
        gave_way: whether it ended because the load was more than the gripper holds.
        peak: N, largest force of the grasp.
    """

    gripper: str
    held: str
    start: float
    end: float | None
    gave_way: bool
    peak: float


def contact_periods(log: FlightArrays) -> tuple[ContactPeriod, ...]:
    """List all periods of contact in a log, ordered by start."""
    touches: list[ContactPeriod] = []
    pairs = [*zip(contact_pairs(log), log.component("contact_force").T, strict=False)]
    bodies = contact_pairs(log, array := "collision_force")
    # a pair of shapes begins with the vehicle's body
    others = [(other, body) for body, other in bodies]
    pairs += zip(others, log.component(array).T, strict=False)
    for (surface, point), force in pairs:
        for begin, end in runs_of(force > 0.0):
            inside = force[begin:end]
            touches.append(
                ContactPeriod(
                    surface=surface,
                    point=point,
                    start=float(log.time[begin]),
                    end=_time(log, end),
                    peak=float(inside.max()),
                    mean=float(inside.mean()),
                )
            )
    return tuple(sorted(touches, key=lambda each: each.start))


def contact_pairs(
    log: FlightArrays, array: str = "contact_force"
) -> tuple[tuple[str, str], ...]:
    """Names of surface and contact point for each column of the logged contact force.

    Of the array ``collision_force`` these are the names of the two bodies.
    """
    # a surface's name may have slashes itself
    cut = str.rpartition if array == "contact_force" else str.partition
    pairs = (cut(label, "/") for label in component_labels(log, array))
    return tuple((first, second) for first, _, second in pairs)


def points_at_tip(log: FlightArrays) -> frozenset[str]:
    """Names of the contact points at the vehicle's tip."""
    points = written_at(log.info, "world.points") or ()
    tip = written_at(log.info, "plant.vehicle.end_effector")
    return frozenset(
        str(each.get("name")) for each in points if tip and each.get("frame") == tip
    )


def grasp_periods(log: FlightArrays) -> tuple[GraspPeriod, ...]:
    """List all grasps in a log, ordered by start."""
    grasps = list[GraspPeriod]()
    # every third column, because an object has three, x, y and z
    bodies = [
        label.partition("/")[0]
        for label in component_labels(log, "object_position")[::3]
    ]
    bodies += component_labels(log, "mechanism_position")
    grippers = component_labels(log, "gripper_taken")
    arrays = (log.component(f"gripper_{name}").T for name in ("taken", "lost", "force"))
    for gripper, *columns in zip(grippers, *arrays, strict=False):
        taken, lost, force = columns
        # equal numbers are one load; each run of them is one grasp
        for number in np.unique(taken[taken > 0.0]):
            for begin, end in runs_of(taken == number):
                grasps.append(
                    GraspPeriod(
                        gripper=gripper,
                        # loads are counted from 1; 0 is none
                        held=bodies[int(number) - 1],
                        start=float(log.time[begin]),
                        end=_time(log, end),
                        gave_way=end < len(taken) and bool(lost[end] > lost[begin]),
                        peak=float(force[begin:end].max()),
                    )
                )
    return tuple(sorted(grasps, key=lambda each: each.start))


def timed_out(log: FlightArrays) -> frozenset[int]:
    """Indices of a task's phases that ended by timeout instead of by their end
    condition.

    A guard that is met in the very last period of its timeout counts among them.
    """
    phases = set()
    for wait in log.info.get("waits", ()) if log.path_time.size else ():
        resting = log.time[np.abs(log.path_time - wait["at"]) < SAME]
        if resting.size and resting[-1] - resting[0] > wait["timeout"] - SAME:
            phases.add(int(wait["phase"]))
    return frozenset(phases)


def runs_of(true: Mask) -> list[tuple[int, int]]:
    """Start index and exclusive end index of each run of true values in a mask."""
    # False on both sides, so that a run at an end has two edges, too
    edges = np.flatnonzero(
        np.diff(np.concatenate([[False], true, [False]]).astype(int))
    )
    return [(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]


def _time(log: FlightArrays, instant: int) -> float | None:
    return float(log.time[instant]) if instant < log.time.size else None
