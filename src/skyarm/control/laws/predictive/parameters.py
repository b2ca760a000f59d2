"""Constants of the predictive law, and their values where nobody says others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from skyarm.actuation import Mixer
from skyarm.control.laws.centroidal.interaction import InteractionGains
from skyarm.control.laws.predictive.cost import Weights
from skyarm.control.laws.predictive.kalman_observer import Bandwidths
from skyarm.control.model import Model
from skyarm.records.units import Unit
from skyarm.reference import Trajectory

WEIGHTS = Weights(
    position=10.0,
    velocity=2.0,
    heading=2.0,
    rate=0.2,
    joints=5.0,
    joint_rates=0.2,
    joint_accelerations=0.005,
    tool=50.0,
    rotor_accelerations=3e-4,
    final=0.2,
)

BANDWIDTHS = Bandwidths(linear=25.0, angular=30.0, joints=40.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class PredictiveParameters:
    """Constants of the law.

    Attributes:
        model: the belief. mixer: of the belief; the law does not use it.
        weights, mode: of the cost. bandwidths: of the observer.
        solver: "riccati", "fatrop" or "ipopt".
        stages: of the horizon, which grow by one factor from the ``every``-th on. horizon: s.
        every: control periods from one solution to the next. delay_periods: known age of measurements, control periods.
        preview: "samples", or the trajectory if it is known.
        interaction: of pressing on surfaces; None for a law that knows nothing of a push.
    """

    model: Model
    mixer: Mixer
    weights: Weights
    bandwidths: Bandwidths
    mode: str
    solver: str
    stages: int
    horizon: Annotated[float, Unit("s")]
    every: int
    delay_periods: int
    preview: str | Trajectory
    interaction: InteractionGains | None = None
