"""Base class of user-defined metrics, and the quantities of one control instant from
which they are computed.

During a flight and from a log the same functions compute them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

from skyarm.algebra import Scalar, Scalars, Vec3
from skyarm.algebra.scalars import data, minimum, where
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.records.immutable import immutable
from skyarm.vehicle import Vehicle


@immutable
class MetricGoal:
    """Reference for the metrics: base position (m), joint positions, and tip position
    (m) at a level base.
    """

    position: Vec3
    joints: Scalars
    tool: Vec3


@immutable
class ActuatorLimits:
    """Limits of a vehicle's actuators.

    Attributes:
        speeds: largest speed of each rotor, rad/s. least: its least one.
        efforts: largest torque or force of each joint, N m or N; inf of a joint that is
            passive or takes setpoints.
        reference_voltage: V, of a battery that limits the rotors' speeds; None where
            none does.
    """

    speeds: Scalars
    least: Scalars
    efforts: Scalars
    reference_voltage: Scalar | None = None

    @classmethod
    def of(cls, vehicle: Vehicle, setpoints: Sequence[bool]) -> ActuatorLimits:
        """Actuator limits of a vehicle; joints marked in ``setpoints`` take setpoints
        and have no effort limit.
        """
        joints, battery = zip(vehicle.joints, setpoints, strict=True), vehicle.battery
        # an open loop scales speeds and cuts none
        if battery is not None and battery.esc == "open":
            battery = None
        return cls(
            speeds=tuple(rotor.max_speed for rotor in vehicle.rotors),
            least=tuple(data(rotor.min_speed) for rotor in vehicle.rotors),
            efforts=tuple(
                (
                    math.inf
                    if setpoint
                    # 0 marks a passive joint, which has no limit to be at
                    else where(joint.effort_limit > 0.0, joint.effort_limit, math.inf)
                )
                for joint, setpoint in joints
            ),
            reference_voltage=(
                None if battery is None else data(battery.reference_voltage)
            ),
        )

    def rotor_ranges(self, voltage: Scalars) -> list[tuple[Any, Any]]:
        """Least and largest speed of each rotor, rad/s, at the voltage of the battery.

        Args:
            voltage: V, under load, one number; () where no battery is simulated.
        """
        ranges = list(zip(self.least, self.speeds, strict=True))
        if self.reference_voltage is None or not voltage:
            return ranges
        # above it a rotor stays at its highest speed
        supply = minimum(voltage[0] / self.reference_voltage, 1.0)
        return [(least * supply, highest * supply) for least, highest in ranges]


@immutable
class MetricInstant:
    """Simulation quantities at one control instant, from which metrics are computed.

    Attributes:
        state: state of the plant. tool: its tip, world, m.
        command: issued now. before: rotor speeds commanded a period ago; those of now
            at the first instant.
        held, continuous: the reference. lag: s, of the law's governed reference behind
            it.
        phase: number of the task's phase, where phases wait. time: s.
        push: commanded push of the reference, as
            :class:`skyarm.reference.trajectory.Reference` has it.
        parts: (name, numbers) of each array of the flight's components, and of their
            constants.
        limits: limits of the plant's actuators; None where the vehicle is unknown.
    """

    state: State
    tool: Vec3
    command: Command
    before: Scalars
    held: MetricGoal
    continuous: MetricGoal
    lag: Scalar = 0.0
    phase: Scalar = 0.0
    time: Scalar = 0.0
    push: Scalars = ()
    parts: tuple[tuple[str, Scalars], ...] = ()
    limits: ActuatorLimits | None = None

    def part(self, name: str) -> Scalars:
        """Values of an array logged by a wind, force or contact model at this instant;
        () if it does not exist.
        """
        return next((numbers for each, numbers in self.parts if each == name), ())


class Metric:
    """Base class of user-defined metrics: one number per flight, accumulated over the
    control instants.

    A subclass is a frozen dataclass whose fields all have defaults. ``count`` is pure,
    over any scalar, and called at every control instant in the window while the episode
    lives; ``result`` gets the last memory, whose scalars are arrays over the episodes
    of a batch. ``words`` and ``unit`` describe it on axes and in tables.
    """

    __slots__ = ()
    words: ClassVar[str] = ""
    unit: ClassVar[str] = ""

    @property
    def window(self) -> str:
        """Name of the time window in which the metric counts, such as "steady" or
        "whole".
        """
        return "whole"

    def start(self) -> Any:
        """Return the initial accumulator of the metric: a dataclass or tuple of
        scalars, such as sums.
        """
        raise NotImplementedError(f"{type(self).__name__} must define start()")

    def count(self, memory: Any, now: MetricInstant) -> Any:
        """Return the accumulator of the metric after one more control instant."""
        raise NotImplementedError(f"{type(self).__name__} must define count()")

    def result(self, memory: Any, instants: Any, period: float) -> Any:
        """Compute the metric from the final accumulator.

        Args:
            memory: the last one.
            instants: number of counted instants.
            period: between them, s.
        """
        raise NotImplementedError(f"{type(self).__name__} must define result()")
