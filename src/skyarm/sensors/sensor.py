"""Sensors: a reading from the true state, at the sensor's own rate, with its own memory and delay."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Vec3
from skyarm.dynamics.state import State
from skyarm.vehicle.vehicle_records import Vehicle


class Sensor:
    """A sensor reads the true state. A subclass is a frozen dataclass of numbers with pure, traceable functions.

    The loop measures at the sensor's own instants, k / ``frequency`` from 0 on, holds the reading in between, and hands
    it to the estimator ``latency`` later. Until the first reading has arrived the estimator sees that one.
    """

    __slots__ = ()

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
        self, memory: Any, t: Any, state: State, specific_force: Vec3, draws: Sequence[Any], dt: float
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
