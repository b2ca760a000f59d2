"""Online estimate of velocity and accelerometer noise, which sets the poles of the
force observer.

The measured change of velocity less the model's is c_k = n_k - n_{k-1} + w_k, n the
noise and w what the model lacks. White noise leaves -E[c_k c_{k-1}] = s^2 of its
variance, what lasts longer than a period a negative number. With e the observer's
innovation and r = y - v_hat what is left of it, c_k = e_k - r_{k-1}. For an
accelerometer that reads u beyond the model, c_k = u_k - u_{k-1}.

A Kalman filter of v' = d, d' = white noise of the density q^2, has poles of the size
(q / N)^(1/2), N^2 = s^2 dt the density of the noise: the bandwidth goes with (N_0 /
N)^(1/2) beyond the noise N_0 that it was chosen for. A velocity with noise N_v that is
integrated from an accelerometer with noise N_a has the pole N_a / N_v. The gains of the
feedback stay: control and estimation are separate.

Sources: Mehra 1970 (noise from the innovations' autocovariance); Kalman, Bucy 1961.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from skyarm.algebra import ZERO3_DATA, Scalar, Vec3
from skyarm.algebra.scalars import clip, divide, maximum, sqrt
from skyarm.control.laws.centroidal.parameters import CentroidalParameters, OptionalPart
from skyarm.control.laws.centroidal.step_records import ObserverOutput
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data
from skyarm.records.units import Unit, positive
from skyarm.vehicle import Vehicle

RATE = 2.0
"""Filter rate (1/s) of the noise variances; chosen: a hundred readings of 5 ms."""

GROWTH = 20.0
"""Largest contribution of one period to a noise variance, over estimated and tolerated
variance. One false reading is no noise. Chosen."""

VELOCITY = 0.0018
"""Velocity noise density (m/s/Hz^0.5) up to which the force observer keeps its full
bandwidth. That is without an accelerometer, by motors as quick as those that the gains
were chosen with."""

SEEN, FELT = 0.01 * 0.005**0.5, 0.05 * 0.005**0.5
"""Noise densities of velocity and accelerometer (m/s/Hz^0.5, m/s^2/Hz^0.5) for which
bandwidths were chosen."""

MOTOR_LAG = 0.5 * (0.0125 + 0.025)
"""Mean time constant (s) of the motors for which the gains were chosen."""

SLOWEST, QUICKEST = 2.0, 60.0
"""Bounds (rad/s) of the bandwidth below which measured velocities outweigh the
accelerometer; chosen."""


DEVIATIONS = 27.0
"""Square of an innovation over the variance of an axis that noise hardly exceeds: three
deviations of three axes."""


@immutable
class White:
    """Estimate of one sensor's white noise: last residual, last change, and variance as
    the mean of the axes.
    """

    last: Annotated[
        Vec3, Unit("m/s or m/s^2", "residual of the last reading, world axes")
    ] = ZERO3_DATA
    change: Annotated[
        Vec3,
        Unit(
            "m/s or m/s^2",
            "change of the reading beyond the model in the last period, world axes",
        ),
    ] = ZERO3_DATA
    variance: Annotated[
        Scalar,
        Unit(
            "(m/s)^2 or (m/s^2)^2",
            "variance of the sensor's white noise, mean of the axes",
        ),
    ] = 0.0

    def after(self, change: Vec3, left: Vec3, density: Scalar, dt: Scalar) -> White:
        """Noise estimate updated by a sensor reading: its unmodelled ``change``, and
        the residual ``left``.
        """
        most = GROWTH * (maximum(self.variance, 0.0) + divide(density * density, dt))
        # a mean over three axes; what lasts longer than a period makes it negative, so
        # it is bounded on both sides
        variance = clip(change.dot(self.change) * (-1.0 / 3.0), -most, most)
        moved = self.variance + (variance - self.variance) * (RATE * dt)
        return as_data(White(last=left, change=change, variance=moved))

    def share(self, density: Scalar, dt: Scalar) -> Scalar:
        """Square root of the ratio of a nominal to the estimated noise density, at most
        1.
        """
        square = density * density
        return sqrt(sqrt(divide(square, maximum(self.variance * dt, square))))


@immutable
class NoiseMemory:
    """State of the noise estimate of velocity and accelerometer; the latter is empty
    without one.
    """

    velocity: White = White()
    accelerometer: White | tuple[()] = ()


@immutable
class NoiseGains(OptionalPart):
    """Constants of the noise estimate."""

    density: Annotated[
        Scalar,
        positive(
            "m/s/Hz^0.5",
            "noise density of the velocity that leaves the observer its full bandwidth",
            effect="higher values keep the bandwidth with noisier sensors",
        ),
    ]
    hears: bool

    def start(self, joints: int) -> NoiseMemory:
        """Initial internal state of the noise estimate: zero variances."""
        return NoiseMemory(accelerometer=White() if self.hears else ())

    def adjust_gains(
        self, memory: NoiseMemory, par: CentroidalParameters, dt: Scalar
    ) -> CentroidalParameters:
        """Reduce the bandwidths of the force observer for the estimated noises."""
        observer, seen = par.observer, memory.velocity
        heard, noise = observer.accelerometer, memory.accelerometer
        if heard is not None and noise:
            share, calm = noise.share(FELT, dt), seen.share(SEEN, dt)
            ratio = divide(calm, share)
            pole = clip(heard.velocity * (ratio * ratio), SLOWEST, QUICKEST)
            # five deviations of the noise that is there: its square root is the share
            agreement = divide(heard.agreement, calm * calm)
            heard = replace(
                heard, force=heard.force * share, velocity=pole, agreement=agreement
            )
        force = observer.force * seen.share(self.density, dt)
        # noise is no blow
        jump = sqrt(maximum(observer.jump * observer.jump, DEVIATIONS * seen.variance))
        observer = replace(observer, force=force, accelerometer=heard, jump=jump)
        return replace(par, observer=observer)

    def after(
        self, memory: NoiseMemory, seen: ObserverOutput, velocity: Vec3, dt: Scalar
    ) -> NoiseMemory:
        """Noise estimates one control period later, from the measured velocity and the
        observer's output.
        """
        update, noise = seen.corrections, memory.accelerometer
        if noise and update.beside:
            noise = noise.after(update.beside - noise.last, update.beside, FELT, dt)
        # c_k = e_k - r_{k-1}; the innovation counts as far as it was believed, so does
        # what is left of it
        change = update.innovation - memory.velocity.last
        left = (velocity - seen.observed.velocity) * update.known
        return NoiseMemory(
            velocity=memory.velocity.after(change, left, self.density, dt),
            accelerometer=noise,
        )


def noise_share(vehicle: Vehicle) -> float:
    """Factor (0 to 1) on the tolerated velocity noise: nominal motor time constant over
    that of the slowest motor.

    Inverting the lag of a motor amplifies noise of the wanted speed by about its time
    constant over the period.
    """
    times = (
        0.5 * (float(rotor.time_constant_up) + float(rotor.time_constant_down))
        for rotor in vehicle.rotors
    )
    return MOTOR_LAG / max((MOTOR_LAG, *times))
