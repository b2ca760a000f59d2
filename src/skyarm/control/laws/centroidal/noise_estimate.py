"""Online estimate of the velocity sensor's noise, by which the observer of the force is slower.

The measured change of velocity less the model's is c_k = n_k - n_{k-1} + w_k, n the noise and w what the model lacks.
White noise leaves -E[c_k c_{k-1}] = s^2 of its variance; what lasts longer than a period leaves a negative number. With
e the observer's innovation and r = y - v_hat = (1 - L1) e what is left of it, c_k = e_k - r_{k-1}.

A Kalman filter of v' = d, d' = white noise of the density q^2, has poles of the size (q / N)^(1/2), N^2 = s^2 dt the
density of the noise: the bandwidth goes with (N_0 / N)^(1/2) beyond the noise N_0 that it was chosen for. The gains of
the feedback stay: control and estimation are separate.

Sources: Mehra 1970 (noise from the innovations' autocovariance); Kalman, Bucy 1961.
"""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any

from skyarm.algebra import ZERO3_DATA, Vec3
from skyarm.algebra.scalars import Scalar, clip, data, divide, maximum, sqrt
from skyarm.control.blocks.filters import double_pole
from skyarm.control.blocks.select import vector_data
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.laws.centroidal.part import Part, Step
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit

RATE = 2.0
"""1/s, rate at which the variance follows."""

GROWTH = 20.0
"""Most that one period adds, of the variance and that of ``density``: a single false reading is no noise."""


LEAST = 1e-3
"""Share of an innovation that is left, at least: an observer that takes measurements whole shows no noise."""


@immutable
class NoiseGains(Part):
    """Constant of the noise estimate: density of velocity noise up to which the observer keeps its bandwidth."""

    density: Annotated[Scalar, Unit("m/s/Hz^0.5", "of the measured velocity's noise", low=0.0, strict=True)]

    def start(self, joints: int) -> NoiseMemory:
        """Initial internal state of the noise estimate: none."""
        return NoiseMemory(residual=ZERO3_DATA, change=ZERO3_DATA, variance=0.0)

    def adjust_gains(self, memory: NoiseMemory, par: CentroidalParameters, dt: Scalar) -> CentroidalParameters:
        """Reduce the bandwidth of the force's observer for the estimated noise."""
        observer = dataclasses.replace(par.observer, force=par.observer.force * self.share(memory, dt))
        return dataclasses.replace(par, observer=observer)

    def share(self, memory: NoiseMemory, dt: Scalar) -> Any:
        """Share (0 to 1) of the nominal bandwidth of the force's observer."""
        square = self.density * self.density
        return sqrt(sqrt(divide(square, maximum(memory.variance * dt, square))))

    def learn(self, memory: NoiseMemory, step: Step) -> NoiseMemory:
        """Update the estimate of the velocity noise by one control period."""
        dt = step.dt
        fast, _ = double_pole(step.par.observer.force, dt)
        residual = step.measurement.velocity - step.observed.velocity
        change = residual * divide(1.0, maximum(1.0 - fast, LEAST)) - memory.residual
        most = GROWTH * (maximum(memory.variance, 0.0) + divide(self.density * self.density, dt))
        found = clip(change.dot(memory.change) * (-1.0 / 3.0), -most, most)
        return NoiseMemory(
            residual=vector_data(residual),
            change=vector_data(change),
            variance=data(memory.variance + (found - memory.variance) * (RATE * dt)),
        )


@immutable
class NoiseMemory:
    """State of the noise estimate: the last residual and change, and the variance."""

    residual: Annotated[Vec3, Unit("m/s", "measured less estimated velocity, world axes")]
    change: Annotated[Vec3, Unit("m/s", "measured less modelled change of velocity in a period, world axes")]
    variance: Annotated[Scalar, Unit("(m/s)^2", "of the measured velocity's noise, mean of the axes")]
