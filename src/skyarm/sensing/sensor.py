"""Interface of sensors: readings of the true state at the sensor's own rate and
delay.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar

from skyarm.algebra import ZERO3, ZERO3_DATA, Motion, Scalar, Vec3
from skyarm.algebra.scalars import same
from skyarm.dynamics.state import State
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree
from skyarm.records.units import Unit
from skyarm.vehicle import Vehicle

BasePosition = Annotated[Vec3, Unit("m", "position of the base origin, world axes")]


FrameForce = Annotated[Vec3, Unit("N", "force at the frame, axes of the frame")]

FrameTorque = Annotated[
    Vec3, Unit("N m", "torque about the frame's origin, axes of the frame")
]


@immutable
class Push:
    """External wrench at a vehicle frame: resultant of all external forces on the
    frame's link and the links beyond.
    """

    force: FrameForce
    torque: FrameTorque


NO_PUSH = Push(force=ZERO3_DATA, torque=ZERO3_DATA)
"""External wrench of zero."""


def at_origin(place: Vec3) -> bool:
    """True if a point of the base is the base origin, of exact zeros in the compiled
    code.
    """
    return all(same(each, 0) for each in place)


def specific_force_at(place: Vec3, base: Motion, rate: Vec3) -> Vec3:
    """Specific force at a point of the base, base axes: f + alpha x r + omega x (omega
    x r).

    Args:
        place: r, point of the base, m, base axes.
        base: proper acceleration f (m/s^2) of the base origin and angular acceleration
            alpha (rad/s^2), base axes.
        rate: omega, angular velocity, rad/s, base axes.

    Source: Goldstein 1980, section 4-10.
    """
    if at_origin(place):
        return base.linear
    return base.linear + base.angular.cross(place) + rate.cross(rate.cross(place))


class Sensor:
    """Base class of sensors: frozen dataclasses of numbers with pure, traceable
    methods.

    The loop measures at the sensor's own instants, k / ``frequency`` from 0 on, holds
    the reading in between, and hands it to the estimator ``latency`` later. Until the
    first reading has arrived the estimator sees that one.
    """

    __slots__ = ()

    registered_as = "sensor"

    feels: str | None = None
    """Vehicle frame at which ``feel`` reads the external wrench; None for a sensor of
    the vehicle's state."""

    @property
    def mounted_at(self) -> Vec3:
        """Point of the base (m, base axes) whose specific force ``measure`` takes; the
        base origin if left out.
        """
        return ZERO3

    @property
    def turned_by(self) -> Vec3:
        """Roll, pitch and yaw (rad) of the axes of the reading in the base; zero for
        base axes.
        """
        return ZERO3

    sees: ClassVar[bool] = False
    """True for a camera or lidar: its pictures follow from the poses of all bodies, and
    are no part of a control period."""

    senses: ClassVar[str] = ""
    """``"wrench"``, if the reading is a :class:`ForceReading`, or ``"switch"``, if it
    is a :class:`SwitchReading`."""

    @property
    def frequency(self) -> float:
        """Sampling rate, Hz; must divide the control rate, 0 for one reading each
        control period.
        """
        return 0.0

    @property
    def latency(self) -> float:
        """Delay until a reading arrives, s; a whole number of control periods."""
        return 0.0

    def require_vehicle(self, vehicle: Vehicle) -> None:
        """Refuse a vehicle that the sensor's parameters do not fit.

        Raises:
            ValueError: one line with field, value and what is allowed.
        """

    def uniforms(self, vehicle: Vehicle) -> int:
        """Count of uniform random numbers in (0, 1) that one reading draws."""
        return 0

    def start(self, vehicle: Vehicle) -> Any:
        """Initial internal state, a dataclass or tuple of scalars; ``()`` for a sensor
        without one.
        """
        return ()

    def measure(
        self,
        memory: Any,
        t: Scalar,
        state: State,
        specific_force: Vec3,
        draws: Sequence[Scalar],
        dt: float,
    ) -> tuple[Tree, Tree]:
        """Take one reading of the true state; return the sensor's next internal state
        and the reading.

        Args:
            memory: internal state after the last reading.
            t: s.
            state: the truth.
            specific_force: specific force at :attr:`mounted_at`, base axes, m/s^2.
            draws: ``uniforms(vehicle)`` numbers.
            dt: s between readings.

        Returns:
            memory, and the reading: a record or tuple of scalars of one shape.
        """
        raise NotImplementedError(f"{type(self).__name__} must define measure()")

    def feel(
        self, memory: Any, t: Scalar, push: Push, draws: Sequence[Scalar], dt: float
    ) -> tuple[Tree, Tree]:
        """Take one reading of a force sensor; ``push`` is the true wrench at the
        sensor's frame.
        """
        raise NotImplementedError(f"{type(self).__name__} must define feel()")

    def take(
        self,
        memory: Any,
        t: Scalar,
        state: State,
        specific_force: Vec3,
        push: Push,
        draws: Sequence[Scalar],
        dt: float,
    ) -> tuple[Tree, Tree]:
        """Take one reading of the true state, or of the external wrench for a force
        sensor.
        """
        if self.feels is None:
            return self.measure(memory, t, state, specific_force, draws, dt)
        return self.feel(memory, t, push, draws, dt)
