"""A joint drive whose torque follows its setpoint with a first-order lag, as a current loop or a soft gear makes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.actuation.drive import TorqueDrive
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, exp


@dataclass(frozen=True, slots=True)
class LaggedTorqueMemory:
    """Torque at the end of the period that has begun, and its mean in that period, N m or N."""

    following: Scalar
    mean: Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class LaggedTorque(TorqueDrive):
    """A lagged torque obeys T d(torque)/dt = setpoint - torque; within a control period its exact mean acts.

    The impulse of every period is that of the continuous lag. The joint's own effort limit acts on the torque, not on
    the setpoint, which is a torque: laws fly it as they are.
    """

    time_constant: Annotated[Scalar, Unit("s", "of the first-order lag", low=0.0, strict=True)]

    def __post_init__(self) -> None:
        accept_fields(self, "lagged_torque")

    def start(self, position: Any) -> LaggedTorqueMemory:
        """No torque yet."""
        return LaggedTorqueMemory(0.0, 0.0)

    def begin(self, position: Any, setpoint: Any, dt: float) -> LaggedTorqueMemory:
        """The torque that has held the joint before the first command."""
        return LaggedTorqueMemory(setpoint, setpoint)

    def settled(self, memory: LaggedTorqueMemory, position: Any, setpoint: Any) -> LaggedTorqueMemory:
        """The setpoint itself."""
        return LaggedTorqueMemory(setpoint, setpoint)

    def advance(self, memory: LaggedTorqueMemory, setpoint: Any, position: Any, rate: Any, dt: float) -> Any:
        """The lag of one period, exactly: from the torque at its begin, towards a setpoint that is held."""
        share: Any = dt / self.time_constant
        left = exp(-share)
        before = memory.following - setpoint
        return LaggedTorqueMemory(setpoint + before * left, setpoint + before * ((1.0 - left) / share))

    def effort(self, memory: LaggedTorqueMemory, setpoint: Any, position: Any, rate: Any) -> Any:
        """Mean torque of the period."""
        return memory.mean
