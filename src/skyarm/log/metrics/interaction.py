"""Metrics of contact and manipulation: commanded contact force, a gripped handle, and
moved mechanisms.

Forces are the sum of the normal forces at the vehicle's points; of several vehicles
each has its own points, gripper and grasps. An instant of a commanded contact counts
while the reference asks for a force above 0: for losses from 0.3 s after the first
touch on, for the statistics of the force from 2 s after it on, when the impact is over.
What is moved is the first object and the first mechanism of the world.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import reduce
from operator import add
from typing import Any

import numpy as np

from skyarm.algebra import ZERO3_DATA, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    absolute,
    atan2,
    cos,
    logical_and,
    maximum,
    sin,
    where,
)
from skyarm.dynamics.kinematics import out_of_axis
from skyarm.log.metrics.metric import Metric, MetricGoal, MetricInstant
from skyarm.records.arrays import AnyArray
from skyarm.records.immutable import immutable, positional

BOUNCES = 0.3
"""Time (s) after the first contact in which a loss of contact belongs to the impact."""

SETTLED = 2.0
"""Time (s) after the first contact from which the force error counts."""

BAND = 0.3
"""Relative error of the desired force below which a force counts as held; chosen. A
force is on or off: of the pressing in three shipped tasks 0.84 to 0.92 is held with
0.3, and as much but for 0.01 with half and twice of it (measured)."""

NOT_YET = 1e30
"""Time (s) of an event that has not happened."""


@immutable
class PushMemory:
    """Accumulated sums of the contact metrics: force error, contact losses and tip
    error.

    Attributes:
        first: time of the first touch during a commanded contact, s. touching: 1 during
            contact.
        losses: number of contact losses. peak: N. count: instants in the force's
            statistics.
        error, square: sums of the force's error, N, and of its square. held: instants
            within the band.
        apart, farthest: sum and largest of the tip's error across the normal, m. near:
            instants in that sum.
    """

    first: Scalar = NOT_YET
    touching: Scalar = 0.0
    losses: Scalar = 0.0
    peak: Scalar = 0.0
    count: Scalar = 0.0
    error: Scalar = 0.0
    square: Scalar = 0.0
    held: Scalar = 0.0
    apart: Scalar = 0.0
    farthest: Scalar = 0.0
    near: Scalar = 0.0


@positional
class PushTotals(Metric):
    """Accumulator of the contact metrics: force error, losses of contact and tip
    error.
    """

    def start(self) -> PushMemory:
        """Initial running sums of the contact metrics: all zero, no touch yet."""
        return PushMemory()

    def count(self, memory: PushMemory, now: MetricInstant) -> PushMemory:
        """Add one control instant to the running sums of force error, contact losses
        and tip error.
        """
        forces = now.part("contact_force")
        if not now.push or not forces:
            return memory
        # a push is force, approach speed, normal, and where it grips also grip, pivot,
        # axis
        desired, normal = now.push[0], now.push[2:5]
        force = reduce(add, forces)
        asked, touches = desired > 0.0, force > 0.0
        # the first touch of a commanded contact only
        begins = logical_and(logical_and(asked, touches), memory.first >= NOT_YET)
        first = where(begins, now.time, memory.first)
        after = now.time - first
        lost = logical_and(
            logical_and(asked, memory.touching > 0.5),
            logical_and(force <= 0.0, after >= BOUNCES),
        )
        settled = logical_and(asked, after >= SETTLED)
        error = force - desired
        near_desired = logical_and(settled, absolute(error) <= BAND * desired)
        apart = _tangential_error(now, normal)
        # after the touch, because before it the tip is on its way
        near = logical_and(asked, after >= 0.0)
        return PushMemory(
            first=first,
            touching=where(touches, 1.0, 0.0),
            losses=memory.losses + where(lost, 1.0, 0.0),
            peak=maximum(memory.peak, where(asked, force, 0.0)),
            count=memory.count + where(settled, 1.0, 0.0),
            error=memory.error + where(settled, error, 0.0),
            square=memory.square + where(settled, error * error, 0.0),
            held=memory.held + where(near_desired, 1.0, 0.0),
            apart=memory.apart + where(near, apart, 0.0),
            farthest=maximum(memory.farthest, where(near, apart, 0.0)),
            near=memory.near + where(near, 1.0, 0.0),
        )


def _tangential_error(now: MetricInstant, normal: Scalars) -> Scalar:
    """Distance of the tip from its reference parallel to the nominal surface, m."""
    away, across = now.tool - now.held.tool, Vec3(*normal)
    apart: Scalar = (away - across * away.dot(across)).norm()
    return apart


@immutable
class GripMemory:
    """Accumulated sums of the grip metrics: radial force on the handle, and lag of the
    mechanism.

    Attributes:
        held: instants in which it is held. force, largest: sum and largest of the
            radial force's size, N.
        behind: rad, by which it was furthest from where it should be. begun: 1 once the
            reference takes it along.
        x, y, z: arm of the reference about its axis then, m. turned: angle of the
            mechanism then, rad.
    """

    held: Scalar = 0.0
    force: Scalar = 0.0
    largest: Scalar = 0.0
    behind: Scalar = 0.0
    begun: Scalar = 0.0
    x: Scalar = 0.0
    y: Scalar = 0.0
    z: Scalar = 0.0
    turned: Scalar = 0.0


@positional
class GripTotals(Metric):
    """Accumulator of the grip metrics: radial force on a turning handle, and lag of the
    turned mechanism.
    """

    def start(self) -> GripMemory:
        """Initial running sums of the grip metrics: all zero, nothing gripped yet."""
        return GripMemory()

    def count(self, memory: GripMemory, now: MetricInstant) -> GripMemory:
        """Update radial force on the handle and lag of the mechanism by one control
        instant.
        """
        hinge, turned_to = now.part("mechanism_hinge"), now.part("mechanism_position")
        # a push of six numbers has no axis to turn about
        if not hinge or not now.part("gripper_pull") or len(now.push) <= 6:
            return memory
        # of several grippers the first
        taken, pull = now.part("gripper_taken")[0], now.part("gripper_pull")[:3]
        place, axis = Vec3(*hinge[:3]), Vec3(*hinge[3:])
        out = out_of_axis(now.tool, place, axis, taken > 0.5, ZERO3_DATA)
        radial = absolute(out.dot(Vec3(*pull)))
        holds = logical_and(taken > 0.5, now.push[5] > 0.5)
        pivot, about = Vec3(*now.push[6:9]), Vec3(*now.push[9:12])
        arm = now.held.tool - pivot
        # only the part across the axis turns
        arm = arm - about * about.dot(arm)
        begins = logical_and(holds, memory.begun < 0.5)
        first = Vec3(
            *(
                where(begins, a, b)
                for a, b in zip(arm, (memory.x, memory.y, memory.z), strict=True)
            )
        )
        turned = where(begins, turned_to[0], memory.turned)
        turn = atan2(about.dot(first.cross(arm)), first.dot(arm))
        # the reference's axis may point against the hinge's
        behind = where(about.dot(axis) < 0.0, -1.0, 1.0) * turn - (
            turned_to[0] - turned
        )
        # wrapped to half a turn, since a whole turn more or less is none
        behind = absolute(atan2(sin(behind), cos(behind)))
        return GripMemory(
            held=memory.held + where(holds, 1.0, 0.0),
            force=memory.force + where(holds, radial, 0.0),
            largest=maximum(memory.largest, where(holds, radial, 0.0)),
            behind=maximum(memory.behind, where(holds, behind, 0.0)),
            begun=where(holds, 1.0, memory.begun),
            x=first.x,
            y=first.y,
            z=first.z,
            turned=turned,
        )


@immutable
class PhaseMemory:
    """Index and start time (s) of the latest phase."""

    phase: Scalar = 0.0
    when: Scalar = 0.0


@positional
class PhaseTotals(Metric):
    """Metric accumulator that stores the start time of a task's latest phase."""

    def start(self) -> PhaseMemory:
        """Initial phase index and start time, before a task's first phase."""
        return PhaseMemory()

    def count(self, memory: PhaseMemory, now: MetricInstant) -> PhaseMemory:
        """Store index and start time of a task's phase when a new one begins."""
        more = now.phase > memory.phase
        return PhaseMemory(
            phase=where(more, now.phase, memory.phase),
            when=where(more, now.time, memory.when),
        )


TOTALS: Mapping[str, Metric] = {
    "push": PushTotals(),
    "grip": GripTotals(),
    "phases": PhaseTotals(),
}
"""Totals by name, as those of registered metrics."""


Quantity = Callable[[MetricInstant, MetricGoal], Scalar | None]
"""Function (instant, reference) -> number that is totalled; None in a flight without
it."""


def _of_part(name: str, index: int, absent: Scalar | None = None) -> Quantity:
    """Make a function that reads one component of an array logged by a contact or
    gripper model.
    """
    return lambda now, _: now.part(name)[index] if now.part(name) else absent


def _pull_error(now: MetricInstant, _: MetricGoal) -> Scalar:
    """Largest error of a team's pull along the lines of its grasps (N); NaN without a
    team.
    """
    rows = zip(now.part("team_pull"), now.part("team_pull_reference"), strict=True)
    errors = [absolute(pull - desired) for pull, desired in rows]
    return reduce(maximum, errors) if errors else math.nan


QUANTITIES: Mapping[str, Quantity] = {
    "contact": lambda now, _: (
        reduce(add, now.part("contact_force")) if now.part("contact_force") else None
    ),
    "collision": lambda now, _: reduce(maximum, now.part("collision_force") or (0.0,)),
    **{
        f"object_{axis}": _of_part("object_position", i) for i, axis in enumerate("xyz")
    },
    "mechanism": _of_part("mechanism_position", 0),
    "grasp": lambda now, _: (
        reduce(maximum, now.part("grasp_force")) if now.part("grasp_force") else None
    ),
    "tip_height": lambda now, _: now.tool.z,
    "team_position": _of_part("team_position_error", 0, math.nan),
    "team_turn": _of_part("team_turn_error", 0, math.nan),
    "team_pull": _pull_error,
    "load_share": _of_part("load_share", 0, math.nan),
}
"""Quantity -> function: force at all points (N), largest one of two bodies (N),
position of the first object (m), coordinate of the first mechanism, largest force at a
grasp (N), height of the tip (m); of a team the errors of its body's place (m),
direction (rad) and pull (N), and the vehicle's share of the load."""

SHARED = frozenset(
    (
        "object_x",
        "object_y",
        "object_z",
        "mechanism",
        "collision",
        "team_position",
        "team_turn",
        "team_pull",
    )
)
"""Quantities of the world, which are the same for all vehicles of a flight."""


def _share(total: Scalar, count: Scalar) -> AnyArray:
    """Divide a sum by a count; NaN for a count of zero."""
    return np.where(
        np.asarray(count) > 0,
        # at least 1, so that zero counts divide without a warning
        np.asarray(total) / np.maximum(np.asarray(count), 1),
        np.nan,
    )


def _ripple(memory: PushMemory) -> AnyArray:
    """RMS deviation of the contact force from its mean, N."""
    mean = _share(memory.error, memory.count)
    return np.asarray(
        # rounding can leave the variance below zero
        np.sqrt(np.maximum(_share(memory.square, memory.count) - mean * mean, 0.0))
    )


def _if_met(memory: PushMemory, number: Scalar) -> AnyArray:
    """Return the value of a contact metric, or NaN if no commanded contact occurred."""
    return np.where(np.asarray(memory.first) < NOT_YET, np.asarray(number), np.nan)


def _if_gripped(memory: GripMemory, number: Scalar) -> AnyArray:
    """Return the value of a grip metric, or NaN if the tip never gripped a handle."""
    return np.where(np.asarray(memory.held) > 0, np.asarray(number), np.nan)


HELD = "fraction of the time with the contact force within 30 % of the commanded one"

TOTALED: Mapping[str, tuple[str, Callable[[Any], AnyArray], str, str]] = {
    "contact_error_mean": (
        "push",
        lambda of: _share(of.error, of.count),
        "mean signed error of contact force",
        "N",
    ),
    "contact_ripple": ("push", _ripple, "RMS of the contact force about its mean", "N"),
    "contact_held": ("push", lambda of: _share(of.held, of.count), HELD, ""),
    "contact_peak": (
        "push",
        lambda of: _if_met(of, of.peak),
        "largest contact force while contact is commanded",
        "N",
    ),
    "contact_losses": (
        "push",
        lambda of: _if_met(of, of.losses),
        "number of losses of contact",
        "losses",
    ),
    "contact_first": (
        "push",
        lambda of: _if_met(of, of.first),
        "time of the first touch",
        "s",
    ),
    "contact_tip_mean": (
        "push",
        lambda of: _share(of.apart, of.near),
        "mean tip error along the surface in contact",
        "m",
    ),
    "contact_tip_max": (
        "push",
        lambda of: _if_met(of, of.farthest),
        "largest tip error along the surface in contact",
        "m",
    ),
    "phases_time": (
        "phases",
        lambda of: np.asarray(of.when),
        "time at which the latest phase ended, whether or not all have",
        "s",
    ),
    "grip_force_mean": (
        "grip",
        lambda of: _if_gripped(of, of.force / np.maximum(np.asarray(of.held), 1)),
        "mean radial force on the gripped handle",
        "N",
    ),
    "grip_force_max": (
        "grip",
        lambda of: _if_gripped(of, of.largest),
        "largest radial force on the gripped handle",
        "N",
    ),
    "grip_lag_max": (
        "grip",
        lambda of: _if_gripped(of, of.behind),
        "largest lag angle of the gripped handle",
        "rad",
    ),
}
"""Metric -> its totals, function from them to its value, description and unit."""
