"""Online estimate of the noise of velocity and accelerometer, which sets the poles of the force's observer.

The measured change of velocity less the model's is c_k = n_k - n_{k-1} + w_k, n the noise and w what the model lacks.
White noise leaves -E[c_k c_{k-1}] = s^2 of its variance, what lasts longer than a period a negative number. With
e the observer's innovation and r = y - v_hat what is left of it, c_k = e_k - r_{k-1}. For an accelerometer that reads u
beyond the model, c_k = u_k - u_{k-1}.

A Kalman filter of v' = d, d' = white noise of the density q^2, has poles of the size (q / N)^(1/2), N^2 = s^2 dt the
density of the noise: the bandwidth goes with (N_0 / N)^(1/2) beyond the noise N_0 that it was chosen for. A velocity
with noise N_v that is integrated from an accelerometer with noise N_a has the pole N_a / N_v. The gains of the feedback
stay: control and estimation are separate.

Sources: Mehra 1970 (noise from the innovations' autocovariance); Kalman, Bucy 1961.
"""

from __future__ import annotations

import dataclasses
from typing import Annotated

from skyarm.algebra import ZERO3_DATA, Vec3
from skyarm.algebra.scalars import Scalar, clip, data, divide, maximum, sqrt
from skyarm.control.blocks.select import vector_data
from skyarm.control.laws.centroidal.parameters import CentroidalParameters, OptionalPart
from skyarm.control.laws.centroidal.step_records import ObserverOutput
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.vehicle.vehicle_records import Vehicle

RATE = 2.0
"""1/s, rate at which the variances follow."""

GROWTH = 20.0
"""Most that one period adds, of the variance and of the noise that costs nothing: one false reading is no noise."""

VELOCITY = 0.0018
"""m/s/Hz^0.5, noise of the velocity up to which a force found by it alone is followed at full bandwidth, by motors as
quick as those that the gains were chosen with."""

SEEN, FELT = 0.01 * 0.005**0.5, 0.05 * 0.005**0.5
"""m/s/Hz^0.5 and m/s^2/Hz^0.5, noises of velocity and accelerometer that its bandwidths were chosen for."""

MOTOR_LAG = 0.5 * (0.0125 + 0.025)
"""s, mean time constant of the motors that the gains were chosen with."""

SLOWEST, QUICKEST = 2.0, 60.0
"""rad/s, of the pole below which velocities are believed more than the accelerometer."""


@immutable
class White:
    """Estimate of one sensor's white noise: its last reading and change, and the variance, mean of the axes."""

    last: Annotated[Vec3, Unit("m/s or m/s^2", "what was left of the last reading, world axes")] = ZERO3_DATA
    change: Annotated[Vec3, Unit("m/s or m/s^2", "beyond the model in the last period, world axes")] = ZERO3_DATA
    variance: Annotated[Scalar, Unit("(m/s)^2 or (m/s^2)^2", "of the noise")] = 0.0

    def after(self, change: Vec3, left: Vec3, density: Scalar, dt: Scalar) -> White:
        """Estimate after one more reading, that changed beyond the model, with what is left of it."""
        most = GROWTH * (maximum(self.variance, 0.0) + divide(density * density, dt))
        variance = clip(change.dot(self.change) * (-1.0 / 3.0), -most, most)
        return White(
            last=vector_data(left),
            change=vector_data(change),
            variance=data(self.variance + (variance - self.variance) * (RATE * dt)),
        )

    def share(self, density: Scalar, dt: Scalar) -> Scalar:
        """Root (0 to 1) of a density of noise over the one found."""
        square = density * density
        return sqrt(sqrt(divide(square, maximum(self.variance * dt, square))))


@immutable
class NoiseMemory:
    """State of the noise estimate of velocity and accelerometer; the latter is empty without one."""

    velocity: White = White()
    accelerometer: White | tuple[()] = ()


@immutable
class NoiseGains(OptionalPart):
    """Constants of the noise estimate."""

    density: Annotated[
        Scalar, Unit("m/s/Hz^0.5", "noise of the velocity that costs no bandwidth", low=0.0, strict=True)
    ]
    hears: bool

    def start(self, joints: int) -> NoiseMemory:
        """Initial internal state of the noise estimate: none."""
        return NoiseMemory(accelerometer=White() if self.hears else ())

    def adjust_gains(self, memory: NoiseMemory, par: CentroidalParameters, dt: Scalar) -> CentroidalParameters:
        """Reduce the bandwidths of the force's observer for the estimated noises."""
        observer, seen = par.observer, memory.velocity
        heard, noise = observer.accelerometer, memory.accelerometer
        if heard is not None and noise:
            share = noise.share(FELT, dt)
            ratio = divide(seen.share(SEEN, dt), share)
            pole = clip(heard.velocity * (ratio * ratio), SLOWEST, QUICKEST)
            heard = dataclasses.replace(heard, force=heard.force * share, velocity=pole)
        force = observer.force * seen.share(self.density, dt)
        return dataclasses.replace(par, observer=dataclasses.replace(observer, force=force, accelerometer=heard))

    def after(self, memory: NoiseMemory, seen: ObserverOutput, velocity: Vec3, dt: Scalar) -> NoiseMemory:
        """Estimates one control period later, by the velocity measured in it."""
        update, noise = seen.told, memory.accelerometer
        if noise and update.beside:
            noise = noise.after(update.beside - noise.last, update.beside, FELT, dt)
        change, left = update.innovation - memory.velocity.last, velocity - seen.observed.velocity
        return NoiseMemory(velocity=memory.velocity.after(change, left, self.density, dt), accelerometer=noise)


def noise_gains(vehicle: Vehicle, hears: bool) -> NoiseGains:
    """Constants of the noise estimate for a vehicle, with or without an accelerometer."""
    return NoiseGains(density=VELOCITY * noise_share(vehicle), hears=hears)


def noise_share(vehicle: Vehicle) -> float:
    """Scale of the velocity noise that costs no bandwidth: mean lag of the paper's motors over the slowest's.

    Inverting the lag of a motor amplifies noise of the wanted speed by about its time constant over the period.
    """
    times = (0.5 * (float(rotor.time_constant_up) + float(rotor.time_constant_down)) for rotor in vehicle.rotors)
    return MOTOR_LAG / max(MOTOR_LAG, *times)
