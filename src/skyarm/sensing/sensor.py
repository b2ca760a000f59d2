"""Sensors: a reading from the true state, at the sensor's own rate, with its own memory and delay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import Scalar
from skyarm.dynamics.state import State
from skyarm.records.units import Unit
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class Push:
    """External wrench at a frame of the vehicle: everything that acts beyond it, as one force and torque."""

    force: Annotated[Vec3, Unit("N", "axes of the frame")]
    torque: Annotated[Vec3, Unit("N m", "about its origin, axes of the frame")]


NO_PUSH = Push(force=Vec3(0.0, 0.0, 0.0), torque=Vec3(0.0, 0.0, 0.0))
"""Nothing pushes."""


class Sensor:
    """A sensor reads the true state. A subclass is a frozen dataclass of numbers with pure, traceable functions.

    The loop measures at the sensor's own instants, k / ``frequency`` from 0 on, holds the reading in between, and hands
    it to the estimator ``latency`` later. Until the first reading has arrived the estimator sees that one.
    """

    __slots__ = ()

    feels: str | None = None
    """Name of a frame of the vehicle: the sensor reads what pushes there, by ``feel``; None reads the state."""

    @property
    def frequency(self) -> float:
        """Readings a second, Hz; must divide the control rate. 0: one each control period."""
        return 0.0

    @property
    def latency(self) -> float:
        """Age of a reading when it arrives, s; a whole number of control periods."""
        return 0.0

    def require_vehicle(self, vehicle: Vehicle) -> None:
        """Refuse numbers of the sensor that do not fit the true vehicle.

        Raises:
            ValueError: one line with field, value and what is allowed.
        """

    def uniforms(self, vehicle: Vehicle) -> int:
        """Random numbers uniform in (0, 1) that one reading of this vehicle draws."""
        return 0

    def start(self, vehicle: Vehicle) -> Any:
        """First memory: a record or tuple of scalars; ``()`` for a sensor without one."""
        return ()

    def measure(
        self, memory: Any, t: Scalar, state: State, specific_force: Vec3, draws: Sequence[Scalar], dt: float
    ) -> tuple[Any, Any]:
        """One reading.

        Args:
            memory: after the last reading.
            t: s.
            state: the truth.
            specific_force: of the base origin, base axes, m/s^2.
            draws: ``uniforms(vehicle)`` numbers.
            dt: s between readings.

        Returns:
            memory, and the reading: a record or tuple of scalars of one shape.
        """
        raise NotImplementedError(f"{type(self).__name__} must say what it measures")

    def feel(self, memory: Any, t: Scalar, push: Push, draws: Sequence[Scalar], dt: float) -> tuple[Any, Any]:
        """One reading of a force sensor, in place of ``measure``; ``push`` is the truth at its frame."""
        raise NotImplementedError(f"{type(self).__name__} must say what it feels")

    def take(
        self, memory: Any, t: Scalar, state: State, specific_force: Vec3, push: Push, draws: Sequence[Scalar], dt: float
    ) -> tuple[Scalar, Scalar]:
        """One reading, of the state or of what pushes at the sensor's frame."""
        if self.feels is None:
            return self.measure(memory, t, state, specific_force, draws, dt)
        return self.feel(memory, t, push, draws, dt)
