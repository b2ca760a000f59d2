"""Disturbances as functions of time: force and torque at a frame, and air velocity.

::

    [[environment.forces]]
    kind = "disturbance"
    frame = "tip"                          # default: the base
    axes = "world"                         # or "frame": along the frame's own axes
    # N, signals of time (default 0)
    force = [0, 0, { kind = "sine", amplitude = 2.0, frequency_hz = 0.5 }]
    torque = [0, 0.05, 0]                                                       # N m
    # standard deviations (default none)
    noise = { force = [0.3, 0.3, 0.3], torque = [0, 0, 0], bandwidth_hz = 2.0 }

    [[environment.air]]
    kind = "air_signals"
    # m/s, world axes
    velocity_W = [{ kind = "ramp", start = 5, duration = 2, height = 4 }, 0, 0]
    noise = { velocity = [0.5, 0.5, 0.2], bandwidth_hz = 0.5 }

Signals are those of references (:mod:`skyarm.reference.reference_tables`). They are
held for each control period. Noise is a first-order Gauss-Markov process of each
component (Brown, Hwang 2012, section 3.9); it has the deviations of what its record
has: force and torque, or velocity. A wrench moves base and joints by the principle of
virtual work (Siciliano, Sciavicco, Villani, Oriolo 2009, Robotics, section 3.8).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar

from skyarm.algebra import ZERO3, Mat3, Scalar, Scalars, Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.records.field_rules import accept_fields
from skyarm.records.immutable import immutable
from skyarm.records.words import Word
from skyarm.vehicle import BASE, Vehicle
from skyarm.world.component import Air, Component, Force, Wrench, require_frame
from skyarm.world.signal_vector import (
    NO_SIGNALS,
    ColouredNoise,
    SignalVector,
    scale_noise,
)

AXES = ("world", "frame")

Numbers = Scalars
"""Unit-variance noise; () for none."""


class NoisyComponent(Component[Numbers]):
    """Base class of environment models with optional coloured noise of ``noise_count``
    components.
    """

    __slots__ = ()

    noise: ColouredNoise | None
    noise_count: ClassVar[int]

    @property
    def uniforms(self) -> int:
        """Number of uniform random numbers that the noise draws per control period,
        rounded up to an even number.
        """
        # normal numbers are made in pairs of uniform ones (Box, Muller)
        return 0 if self.noise is None else self.noise_count + self.noise_count % 2

    def start(self, period: float, draws: Sequence[Scalar]) -> Numbers:
        """Initial noise state, drawn from its stationary distribution."""
        return () if self.noise is None else self.noise.first(draws, self.noise_count)

    def advance(
        self,
        memory: Numbers,
        t: Scalar,
        dt: float,
        state: State,
        draws: Sequence[Scalar],
    ) -> Numbers:
        """Noise state in the next control period."""
        return memory if self.noise is None else self.noise.next(memory, dt, draws)


@immutable
class Disturbance(NoisyComponent, Force[Numbers]):
    """Force and torque on one body of the vehicle as functions of time, with optional
    coloured noise.

    Attributes:
        frame: frame at whose origin the force acts; empty for the base's origin.
        axes: "world", or "frame" for those of the frame, which turn with it.
    """

    frame: str = ""
    axes: str = "world"
    force: SignalVector = NO_SIGNALS
    torque: SignalVector = NO_SIGNALS
    noise: ColouredNoise | None = None

    noise_count: ClassVar[int] = 6

    def __post_init__(self) -> None:
        accept_fields(self, "disturbance")
        if self.axes not in AXES:
            raise ValueError(f"axes = {self.axes!r}: must be one of {', '.join(AXES)}")
        if self.noise is not None:
            self.noise.require_only("force", "torque")

    def require_vehicle(self, vehicle: Vehicle, period: float, gravity: Scalar) -> None:
        """Refuse a vehicle that lacks the disturbance's frame."""
        if self.frame:
            require_frame(vehicle, self.frame)

    def wrenches(
        self,
        memory: Numbers,
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
    ) -> Sequence[Wrench]:
        """Force and torque of the disturbance on the vehicle at time ``t`` (s)."""
        force, torque = self.force.at(t), self.torque.at(t)
        if self.noise is not None:
            force = force + scale_noise(self.noise.force, memory[:3])
            torque = torque + scale_noise(self.noise.torque, memory[3:])
        # the base has no frame of its own: its axes are those of the body
        point, R, body = ZERO3, Mat3.identity(), BASE
        if self.frame:
            at = motion.vehicle.frame(self.frame)
            point, R, body = at.position, at.rotation, at.link
        if self.axes == "frame":
            force, torque = (motion.to_world(R.apply(v), body) for v in (force, torque))
        return (Wrench(force_W=force, torque_W=torque, point=point, body=body),)


@immutable
class AirSignals(NoisyComponent, Air[Numbers]):
    """Uniform air velocity as a function of time, with optional coloured noise."""

    velocity_W: Annotated[SignalVector, Word("velocity")] = NO_SIGNALS
    noise: ColouredNoise | None = None

    noise_count: ClassVar[int] = 3

    def __post_init__(self) -> None:
        accept_fields(self, "air")
        if self.noise is not None:
            self.noise.require_only("velocity")

    def velocity(self, memory: Numbers, t: Scalar, position_W: Vec3) -> Vec3:
        """Air velocity (m/s, world axes): time signals plus noise."""
        velocity = self.velocity_W.at(t)
        return (
            velocity
            if self.noise is None
            else velocity + scale_noise(self.noise.velocity, memory)
        )
