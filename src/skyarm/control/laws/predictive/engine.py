"""Constants of the predictive law and its machine code, made once for a model and options and shared by all flights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from skyarm.actuation import Command, Mixer
from skyarm.control.laws.centroidal.interaction import InteractionGains
from skyarm.control.laws.predictive.compiled import Compiled
from skyarm.control.laws.predictive.cost import Weights
from skyarm.control.laws.predictive.fallback import Stabiliser, worst_cost
from skyarm.control.laws.predictive.linearise import Bounds, Rollouts, Stages, examples
from skyarm.control.laws.predictive.observer import Bandwidths, Estimate, observe, predict
from skyarm.control.laws.predictive.prediction import Motors, motors
from skyarm.control.laws.predictive.preview import Stance
from skyarm.control.laws.predictive.riccati import Riccati
from skyarm.control.laws.predictive.tip_contact import TipContact
from skyarm.control.model import Model
from skyarm.records.units import Unit
from skyarm.reference import Trajectory
from skyarm.sensors.measurement import blank_measurement

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
    stages: Annotated[int, Unit("", low=2, high=200)]
    horizon: Annotated[float, Unit("s", low=0.05, high=5.0)]
    every: Annotated[int, Unit("control periods", "from one solution to the next", low=1, high=200)]
    delay_periods: Annotated[int, Unit("control periods", "known age of the measurement", low=0, high=100)]
    preview: str | Trajectory
    interaction: InteractionGains | None = None


Array = npt.NDArray[np.float64]

KEPT = 16
"""Beliefs whose machine code is kept in memory."""


class Observation:
    """The observer and the effect of commands that no measurement shows yet, on arrays of leaves.

    Args:
        model: the belief. bandwidths: of the observer. dt: control period, s.
    """

    def __init__(self, model: Model, bandwidths: Bandwidths, dt: float) -> None:
        state, _, disturbance, _ = examples(model.vehicle.n, len(model.vehicle.rotors))
        estimate = Estimate(state=state, disturbance=disturbance)
        command = Command(rotor_speeds=state.rotor_speeds, efforts=state.joints)
        reading = blank_measurement(model.vehicle.n, len(model.vehicle.rotors))
        self.at = Compiled(
            lambda before, command, reading: observe(model, bandwidths, before, command, reading, dt),
            *(estimate, command, reading),
        )
        """Estimate at a measurement from the one a period earlier and the command that acted in between."""
        self._advance = Compiled(lambda before, command: predict(model, before, command, dt), estimate, command)

    def now(self, estimate: Array, commands: Sequence[Array]) -> Array:
        """The same after the commands that came since, a period each."""
        for command in commands:
            state = self._advance(estimate, command)
            estimate = np.concatenate([state, estimate[len(state) :]])
        return estimate


@dataclass(frozen=True, slots=True)
class Engine:
    """Compiled parts of the law, without memory of a flight: copies of a flight share them.

    Attributes:
        solver, observation, motors, bounds: those.
        stabiliser: what flies while no plan is trusted. most: cost of a plan that is trusted.
        stance: where the base stands aside for the tip. contact: of the tip; None where no reference asks for any.
    """

    solver: Riccati
    observation: Observation
    motors: Motors
    bounds: Bounds
    stabiliser: Stabiliser
    most: float
    stance: Stance
    contact: TipContact | None = None

    def __deepcopy__(self, _memo: dict[int, Any]) -> Engine:
        return self  # machine code is not copied


@dataclass(frozen=True, slots=True)
class Purpose:
    """Key of an engine: constants, the control period in s, and whether the reference may request contact."""

    par: PredictiveParameters
    dt: float
    push: bool

    def __deepcopy__(self, _memo: dict[int, Any]) -> Purpose:
        return self  # so that the next period knows its constants by identity

    @property
    def made_of(self) -> tuple[Any, ...]:
        """All that the engine is made of."""
        par = self.par
        shape = par.mode, par.stages, par.horizon, par.every
        return par.model, par.weights, par.bandwidths, *shape, self.dt, par.interaction if self.push else None

    def serves(self, other: Purpose) -> bool:
        """Whether an engine that is made for this does for another."""
        same = self.par is other.par and (self.dt, self.push) == (other.dt, other.push)
        return same or self.made_of == other.made_of


def engine_for(par: PredictiveParameters, dt: float, push: bool = False) -> Engine:
    """The engine of a law at a control period of ``dt`` s; with ``push`` the reference may request contact."""
    return _engine(*Purpose(par, dt, push).made_of)


@lru_cache(maxsize=KEPT)
def _engine(
    model: Model,
    weights: Weights,
    bandwidths: Bandwidths,
    mode: str,
    stages: int,
    horizon: float,
    every: int,
    dt: float,
    interaction: InteractionGains | None,
) -> Engine:
    vehicle = model.vehicle
    steps = stage_lengths(stages, every, horizon, dt)
    bounds = Bounds(
        np.array([float(link.joint.effort_limit) for link in vehicle.links]),
        np.array([float(rotor.max_speed) for rotor in vehicle.rotors]),
    )
    scales = np.array([*(1000.0,) * len(vehicle.rotors), *(0.1,) * vehicle.n])
    presses = interaction is not None
    compiled = Stages(model, weights, mode, scales, presses)
    rollouts = Rollouts(model, weights, mode, bounds, presses)
    made = Riccati(compiled, rollouts, steps, float(weights.final), bounds)
    most = worst_cost(weights, mode, vehicle.n, horizon)
    seen = Observation(model, bandwidths, dt)
    contact = TipContact(model, interaction, dt) if interaction is not None else None
    lags = motors(vehicle.rotors, dt)
    return Engine(made, seen, lags, bounds, Stabiliser(model), most, Stance(model, mode), contact)


def stage_lengths(stages: int, every: int, horizon: float, dt: float) -> Array:
    """Lengths of the stages, s: control periods until the next solution, then growing by one factor."""
    powers = np.maximum(np.arange(stages) - every + 1, 0)
    low, high = 1.0, 10.0
    for _ in range(60):
        factor = 0.5 * (low + high)
        low, high = (factor, high) if dt * np.sum(factor**powers) < horizon else (low, factor)
    return np.asarray(dt * low**powers)
