"""Running totals of a held handle during an episode: force along its radius, and lag behind its reference.

The radius is that of the true hinge of the world's first mechanism, the force that of the first gripper on it. How far
the handle should have gone is read off the reference of the tip, about the axis that the reference assumes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import Scalar, absolute, atan2, cos, logical_and, maximum, sin, where
from skyarm.log.metrics.metric import Metric
from skyarm.reference.tip_motion import out_of_axis

if TYPE_CHECKING:
    from skyarm.log.metrics.accumulate import Instant


@dataclass(frozen=True, kw_only=True, slots=True)
class GripMemory:
    """Totals of a handle so far.

    Attributes:
        held: instants in which it is held. force, largest: sum and largest of the radial force's size, N.
        behind: rad, by which it was furthest from where it should be. begun: 1 once the reference takes it along.
        x, y, z: of the reference about its axis then, m. turned: rad, of the mechanism then.
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


@dataclass(frozen=True, slots=True)
class GripTotals(Metric):
    """Radial force and lag of a handle that turns; nothing is counted where the tip never holds one."""

    def start(self) -> GripMemory:
        """Totals before any grasp."""
        return GripMemory()

    def count(self, memory: GripMemory, now: Instant) -> GripMemory:
        """Totals with one more instant."""
        if not now.hinge or not now.pull or len(now.push) <= 6:
            return memory
        taken, *pull = now.pull
        place, axis = Vec3(*now.hinge[:3]), Vec3(*now.hinge[3:])
        out = out_of_axis(now.tool, place, axis, taken > 0.5, Vec3(0.0, 0.0, 0.0))
        radial = absolute(out.dot(Vec3(*pull)))
        holds = logical_and(taken > 0.5, now.push[5] > 0.5)
        pivot, about = Vec3(*now.push[6:9]), Vec3(*now.push[9:12])
        arm = now.held.tool - pivot
        arm = arm - about * about.dot(arm)
        begins = logical_and(holds, memory.begun < 0.5)
        first = Vec3(*(where(begins, a, b) for a, b in zip(arm, (memory.x, memory.y, memory.z), strict=True)))
        turned = where(begins, now.mechanisms[0], memory.turned)
        wanted = atan2(about.dot(first.cross(arm)), first.dot(arm))
        # about the handle's own axis, and a whole turn more or less is none
        behind = where(about.dot(axis) < 0.0, -1.0, 1.0) * wanted - (now.mechanisms[0] - turned)
        behind = absolute(atan2(sin(behind), cos(behind)))
        return GripMemory(
            held=memory.held + where(holds, 1.0, 0.0),
            force=memory.force + where(holds, radial, 0.0),
            largest=maximum(memory.largest, where(holds, radial, 0.0)),
            behind=maximum(memory.behind, where(holds, behind, 0.0)),
            begun=where(holds, 1.0, memory.begun),
            x=first.x, y=first.y, z=first.z,
            turned=turned,
        )  # fmt: skip


def _of_held(memory: Any, number: Any) -> Any:
    """A number of a handle, NaN where none was held."""
    return np.where(np.asarray(memory.held) > 0, number, np.nan)


VALUES: Mapping[str, tuple[str, Callable[[Any], Any], str, str]] = {
    "grip_force_mean": (
        "grip",
        lambda held: _of_held(held, held.force / np.maximum(held.held, 1)),
        "mean radial force on the handle that is held",
        "N",
    ),
    "grip_force_max": (
        "grip",
        lambda held: _of_held(held, held.largest),
        "largest radial force on the handle that is held",
        "N",
    ),
    "grip_lag_max": ("grip", lambda held: _of_held(held, held.behind), "largest lag of the handle that is held", "rad"),
}
"""Metric -> the totals that it is made of, its value from them, its words and unit."""
