"""Full-state sensor that fails: an accelerometer that is stuck, spiked, turned or old,
and readings that repeat.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from skyarm.algebra import Scalar, Vec3
from skyarm.algebra.scalars import where
from skyarm.dynamics import State
from skyarm.records.immutable import immutable
from skyarm.records.leaves import blend
from skyarm.records.units import nonnegative
from skyarm.sensing.measurement import Measurement, SensorNoise, blank_measurement
from skyarm.vehicle import Vehicle

START = 2.0
"""Time (s) at which sensors fail: laws have settled."""

OLD = 8
"""Age of the accelerometer's readings, control periods: 40 ms at 200 Hz."""

SPIKED = 0.01
"""Fraction of the accelerometer's readings that are off: two in a second at 200 Hz."""

Memory = tuple[Measurement, tuple[Vec3, ...]]
"""Last reading before a failure, and the last readings of the accelerometer, the latest
first."""


@immutable
class FaultySensors(SensorNoise):
    """Full-state sensor with failures from :data:`START` on; each is a number, 0 for
    none, that flights vary.
    """

    stuck: Annotated[
        Scalar,
        nonnegative("", "1 for an accelerometer that repeats its reading", high=1.0),
    ] = 0.0
    turned: Annotated[
        Scalar, nonnegative("", "1 for an accelerometer that is upside down", high=1.0)
    ] = 0.0
    old: Annotated[
        Scalar, nonnegative("", "1 for an accelerometer that is late", high=1.0)
    ] = 0.0
    spike: Annotated[
        Scalar,
        nonnegative(
            "m/s^2", "error along each axis of the accelerometer's spiked readings"
        ),
    ] = 0.0
    frozen: Annotated[
        Scalar, nonnegative("s", "time for which all readings repeat")
    ] = 0.0
    pose_lost: Annotated[
        Scalar,
        nonnegative("s", "time for which position, velocity and attitude repeat"),
    ] = 0.0

    def uniforms(self, vehicle: Vehicle) -> int:
        """Count of uniform random numbers per reading: those of the noise, and two for
        spikes.
        """
        return SensorNoise.uniforms(self, vehicle) + 2

    def start(self, vehicle: Vehicle) -> Memory:
        """Readings at rest."""
        blank = blank_measurement(vehicle.n, len(vehicle.rotors), len(vehicle.tilts))
        return blank, (blank.specific_force,) * OLD

    def measure(
        self,
        memory: Memory,
        t: Scalar,
        state: State,
        specific_force: Vec3,
        draws: Sequence[Scalar],
        dt: float,
    ) -> tuple[Memory, Measurement]:
        """Reading of the state with noise and failures."""
        before, past = memory
        # the last draws are of the spikes, so that the noise is that of healthy sensors
        _, true = SensorNoise.measure(
            self, (), t, state, specific_force, draws[:-2], dt
        )
        force = true.specific_force
        # a number, not a bool: flights of one program differ in it
        late = blend(self.old > 0.5, past[-1], force)
        # one number decides whether there is a spike, and the other on its sign
        off = where(
            draws[-2] < SPIKED, where(draws[-1] < 0.5, -self.spike, self.spike), 0.0
        )
        felt = Vec3(*((1.0 - 2.0 * self.turned) * f + off for f in late))
        felt = blend(self.stuck > 0.5, before.specific_force, felt)
        lost = t < START + self.pose_lost
        pose = {
            name: blend(lost, getattr(before, name), getattr(true, name))
            for name in POSE
        }
        failed = replace(true, specific_force=felt, **pose)
        failed = blend(t < START + self.frozen, replace(before, time=true.time), failed)
        now = blend(t < START, true, failed)
        return (now, (force, *past[:-1])), now


POSE = ("position", "velocity", "quaternion")
"""Quantities that motion capture, or a receiver of satellites, gives."""
