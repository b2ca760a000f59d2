"""Joint drives: from a setpoint to the torque on the joint, with effort limit, friction
and hard stops.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Annotated, Any, ClassVar

from skyarm.algebra import Scalar
from skyarm.algebra.scalars import (
    absolute,
    add,
    clip,
    divide,
    exp,
    maximum,
    mul,
    sub,
    tanh,
    where,
)
from skyarm.records.field_rules import checked
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import Tree
from skyarm.records.units import positive
from skyarm.vehicle import Joint


def joint_force(
    joint: Joint, command: Scalar, rate: Scalar, effectiveness: Scalar = 1
) -> Scalar:
    """Torque (N m) or force (N) on the joint: the limited command, less viscous and
    smooth Coulomb friction.

    ``effectiveness`` is the share of the drive's effort that a fault leaves; friction
    stays. The friction law c tanh(qd / v0) is smooth through zero, so that both plants
    integrate the same right-hand side.
    """
    return sub(
        mul(effectiveness, limited_effort(joint, command)), friction(joint, rate, rate)
    )


def limited_effort(joint: Joint, command: Scalar) -> Scalar:
    """Commanded joint torque (N m) or force (N) clipped to the drive's limit."""
    return clip(command, -joint.effort_limit, joint.effort_limit)


def friction(joint: Joint, rate: Scalar, dry_rate: Scalar) -> Scalar:
    """Joint friction: viscous at ``rate``, and Coulomb's c tanh(qd / v0) at
    ``dry_rate`` (rad/s or m/s).

    A law that gives it back takes the reference's rate for the dry part, whose sign
    would chatter with a measured one.
    """
    return add(
        mul(joint.damping, rate),
        mul(joint.coulomb, tanh(divide(dry_rate, joint.coulomb_rate))),
    )


def friction_per_rate(joint: Joint, rate: Scalar) -> Scalar:
    """Friction of a joint divided by its rate, N m s/rad or N s/m: Coulomb's part is
    c / v0 at rest, less beyond.
    """
    relative = divide(rate, joint.coulomb_rate)
    # tanh(x) / x is 1 there but for 3e-9, and a quotient at rest would be 0 / 0
    slow = absolute(relative) < 1e-4
    # both branches are computed, so the unused quotient must be finite, too
    share = where(slow, 1.0, divide(tanh(relative), where(slow, 1.0, relative)))
    return add(joint.damping, mul(divide(joint.coulomb, joint.coulomb_rate), share))


def stop_force(joint: Joint, position: Scalar, rate: Scalar) -> Scalar:
    """Torque (N m) or force (N) of the hard stops at a joint's limits; a constant 0
    without stops.

    k depth (1 + d speed), with the depth past the limit and the speed into the stop;
    never a pull. It begins at zero, so that integrators of both plants meet no jump,
    and takes energy away with every push.
    Source: Hunt, Crossley 1975, with a linear spring.
    """
    if not joint.has_stops:
        return 0
    k = joint.stop_stiffness
    more = mul(joint.stop_damping, rate)
    # the factor 1 + d speed stays above 0, because a stop never pulls
    above = mul(maximum(sub(position, joint.upper), 0.0), maximum(add(1.0, more), 0.0))
    below = mul(maximum(sub(joint.lower, position), 0.0), maximum(sub(1.0, more), 0.0))
    return mul(k, sub(below, above))


class Drive:
    """Base class of joint drives: frozen dataclasses of numbers with pure, traceable
    methods.

    ``advance`` steps the memory once per control period; ``effort`` is evaluated at
    every stage of the integrator with the memory held. The joint's own effort limit,
    its friction and its faults act on what ``effort`` gives.
    """

    __slots__ = ()

    registered_as = "drive"

    largest_step: float | None = None
    """Longest stable integration step (s) of the drive; None for no limit. May be a
    field or a property."""

    takes: ClassVar[str] = ""
    """Unit of the setpoint, for logs: that of a revolute joint, then that of a
    prismatic one, as in ``rad or m``."""

    takes_torque: ClassVar[bool] = False
    """True if the setpoint is the torque or force of the joint."""

    @classmethod
    def require_stated(cls, stated: Collection[str]) -> None:
        """Refuse stated parameters of a drive if one of them requires another that is
        missing.

        Raises:
            ValueError: one line that begins with the field.
        """

    def why_short_steps(self) -> str:
        """Text with the parameters that force a very short integration step; empty if
        unknown.
        """
        return ""

    def start(self, position: Scalar) -> Tree:
        """Initial state of the drive for a joint at ``position`` (rad or m), as a
        dataclass or tuple of scalars.
        """
        return ()

    def begin(self, position: Scalar, setpoint: Scalar, dt: float) -> Tree:
        """Initial state of a drive that also depends on the first setpoint and the
        control period (s).
        """
        return self.start(position)

    def steady_memory(self, memory: Any, position: Scalar, setpoint: Scalar) -> Any:
        """Steady internal state of the drive under a constant setpoint, of the same
        type as ``memory``.
        """
        return memory

    def advance(
        self, memory: Any, setpoint: Scalar, position: Scalar, rate: Scalar, dt: float
    ) -> Any:
        """Drive state for the control period of ``dt`` (s) that begins now, under the
        mean setpoint of the period.
        """
        return memory

    def effort(
        self, memory: Any, setpoint: Scalar, position: Scalar, rate: Scalar
    ) -> Scalar:
        """Torque (N m) or force (N) of the drive on the joint."""
        raise NotImplementedError(f"{type(self).__name__} must define effort()")

    def largest_effort(self) -> Scalar:
        """Largest torque (N m) or force (N) on a joint at rest; infinite if
        unlimited.
        """
        return math.inf

    def standing(self, effort: Scalar, position: Scalar) -> Scalar:
        """Setpoint that holds a motionless joint before the first command, from the
        holding torque.

        That torque itself for a drive that takes torques, else the joint's position.
        """
        return effort if self.takes_torque else position

    def setpoint(
        self, memory: Any, effort: Scalar, position: Scalar, rate: Scalar, dt: float
    ) -> Scalar:
        """Setpoint by which the drive gives a desired torque or force, for control laws
        that command torque.

        The inverse of ``effort`` after ``advance`` from ``memory`` with it, at this
        position and rate for ``dt`` (s).
        """
        return self.standing(effort, position)


@immutable
class TorqueDrive(Drive):
    """Ideal torque drive: its setpoint is the torque or force."""

    takes: ClassVar[str] = "N m or N"
    takes_torque: ClassVar[bool] = True

    def effort(
        self, memory: Any, setpoint: Scalar, position: Scalar, rate: Scalar
    ) -> Scalar:
        """Torque or force on the joint, which is the setpoint itself."""
        return setpoint


TORQUE_DRIVE = TorqueDrive()


@positional
class LaggedTorqueMemory:
    """Torque of a lagged drive at the end of the current control period, and its mean,
    N m or N.
    """

    following: Scalar
    mean: Scalar


@immutable
@checked("lagged_torque")
class LaggedTorque(TorqueDrive):
    """Torque drive with first-order lag, T d(torque)/dt = setpoint - torque; its mean
    over a period acts on the joint.

    The impulse of every period is that of the continuous lag. The joint's own effort
    limit acts on the torque, not on the setpoint, which is a torque: laws fly it as
    they are.
    """

    time_constant: Annotated[
        Scalar,
        positive(
            "s",
            "time constant of the first-order lag from commanded to applied effort",
            effect="longer lags make the joint loop oscillate sooner",
        ),
    ]

    def start(self, position: Scalar) -> LaggedTorqueMemory:
        """Initial state of a lagged torque drive: zero torque."""
        return LaggedTorqueMemory(0.0, 0.0)

    def begin(
        self, position: Scalar, setpoint: Scalar, dt: float
    ) -> LaggedTorqueMemory:
        """Initial state of a lagged torque drive: the torque that held the joint before
        the first command.
        """
        return LaggedTorqueMemory(setpoint, setpoint)

    def steady_memory(
        self, memory: LaggedTorqueMemory, position: Scalar, setpoint: Scalar
    ) -> LaggedTorqueMemory:
        """Steady state of a lagged torque drive: the torque equals the setpoint."""
        return LaggedTorqueMemory(setpoint, setpoint)

    def advance(
        self,
        memory: LaggedTorqueMemory,
        setpoint: Scalar,
        position: Scalar,
        rate: Scalar,
        dt: float,
    ) -> LaggedTorqueMemory:
        """Solve the first-order lag exactly over one control period of constant
        setpoint.
        """
        # the mean over the period, not the end value, because the plant holds one
        # effort
        share = dt / self.time_constant
        left = exp(-share)
        before = memory.following - setpoint
        return LaggedTorqueMemory(
            setpoint + before * left, setpoint + before * ((1.0 - left) / share)
        )

    def effort(
        self,
        memory: LaggedTorqueMemory,
        setpoint: Scalar,
        position: Scalar,
        rate: Scalar,
    ) -> Scalar:
        """Mean torque (N m) or force (N) over the control period."""
        return memory.mean
