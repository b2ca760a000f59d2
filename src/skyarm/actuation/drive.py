"""Joint drives: from a joint's setpoint to the effort of its actuator, before limit and friction."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, ClassVar


class Drive:
    """A drive is the actuator of one joint. A subclass is a frozen dataclass of numbers with pure, traceable functions.

    ``advance`` steps the memory once per control period; ``effort`` is evaluated at every stage of the integrator with
    the memory held. The joint's own effort limit, its friction and its faults act on what ``effort`` gives.
    """

    __slots__ = ()

    largest_step: float | None = None
    """Longest integration step that it bears, s; None for any. May be a field, or a property of the other numbers."""

    takes: ClassVar[str] = ""
    """Unit of the setpoint, that of a revolute joint before that of a prismatic one: ``rad or m``; for logs."""

    @classmethod
    def require_stated(cls, stated: Collection[str]) -> None:
        """Refuse a file's table that leaves out what others of its numbers need; ``stated`` are those that it has.

        Raises:
            ValueError: one line that begins with the field.
        """

    def why_short_steps(self) -> str:
        """The numbers from which a very short ``largest_step`` follows, in words; empty where that is a field."""
        return ""

    def start(self, position: Any) -> Any:
        """First memory, a record or tuple of scalars; ``position`` is the joint's at the start, rad or m."""
        return ()

    def begin(self, position: Any, setpoint: Any, dt: float) -> Any:
        """First memory of a drive that needs to know more: the setpoint before the first command, the period (s)."""
        return self.start(position)

    def settled(self, memory: Any, position: Any, setpoint: Any) -> Any:
        """A memory like ``memory``, of a drive that has heard a setpoint long ago: what a belief of it starts from."""
        return memory

    def advance(self, memory: Any, setpoint: Any, position: Any, rate: Any, dt: float) -> Any:
        """Memory for the period of ``dt`` (s) that begins with this position and rate; the setpoint is its mean."""
        return memory

    def effort(self, memory: Any, setpoint: Any, position: Any, rate: Any) -> Any:
        """Torque (N m) or force (N) on the joint."""
        raise NotImplementedError(f"{type(self).__name__} must say its effort")

    def largest_effort(self) -> Any:
        """Largest torque (N m) or force (N) that it gives a joint at rest; infinite where it states none."""
        return math.inf

    def standing(self, effort: Any, position: Any) -> Any:
        """The setpoint that holds the arm before the first command arrives, from the torque that holds it."""
        return position

    def setpoint(self, memory: Any, effort: Any, position: Any, rate: Any, dt: float) -> Any:
        """The setpoint with which the drive gives an effort, by which torque laws fly it.

        The inverse of ``effort`` after ``advance`` from ``memory`` with it, at this position and rate for ``dt`` (s).
        """
        return self.standing(effort, position)


@dataclass(frozen=True, kw_only=True, slots=True)
class TorqueDrive(Drive):
    """The setpoint is the torque or force."""

    takes: ClassVar[str] = "N m or N"

    def effort(self, memory: Any, setpoint: Any, position: Any, rate: Any) -> Any:
        """The setpoint itself."""
        return setpoint

    def standing(self, effort: Any, position: Any) -> Any:
        """The torque that holds the arm."""
        return effort


TORQUE_DRIVE = TorqueDrive()
