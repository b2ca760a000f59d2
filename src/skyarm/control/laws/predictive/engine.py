"""Machine code of the predictive law: made once for a belief and its options, shared by all flights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.actuation import Command
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.stepped_loop import trace_loop
from skyarm.control.laws.centroidal.interaction import InteractionGains
from skyarm.control.laws.predictive.cost import Weights
from skyarm.control.laws.predictive.fallback import Stabiliser, worst_cost
from skyarm.control.laws.predictive.kalman_observer import Bandwidths, Estimate, observe, predict
from skyarm.control.laws.predictive.linearise import Stages, examples
from skyarm.control.laws.predictive.motion_plan import Motors, motors
from skyarm.control.laws.predictive.parameters import PredictiveParameters
from skyarm.control.laws.predictive.rollout import Bounds, Rollouts
from skyarm.control.laws.predictive.solve import Riccati, Solver
from skyarm.control.laws.predictive.stance import Stance
from skyarm.control.laws.predictive.tip_contact import TipContact
from skyarm.control.model import Model
from skyarm.sensors.measurement import blank_measurement

Array = npt.NDArray[np.float64]

KEPT = 16
"""Beliefs whose machine code is kept in memory."""


class Observation:
    """The observer and what follows from commands that no measurement shows yet, on arrays of leaves.

    Args:
        model: the belief. bandwidths: of the observer. dt: control period, s.
    """

    def __init__(self, model: Model, bandwidths: Bandwidths, dt: float) -> None:
        state, _, disturbance, _ = examples(model.vehicle.n, len(model.vehicle.rotors))
        estimate = Estimate(state=state, disturbance=disturbance)
        command = Command(rotor_speeds=state.rotor_speeds, efforts=state.joints)
        reading = blank_measurement(model.vehicle.n, len(model.vehicle.rotors))

        def look(before: Estimate, _par: Any, row: Any, _uniforms: Any) -> Any:
            command, reading = row
            return observe(model, bandwidths, before, command, reading, dt), ()

        def move(before: Estimate, _par: Any, row: Any, _uniforms: Any) -> Any:
            return Estimate(state=predict(model, before, row, dt), disturbance=before.disturbance), ()

        self._look = Kernel(trace_loop(look, estimate, (), (command, reading)), Lanes(1))
        self._move = Kernel(trace_loop(move, estimate, (), command), Lanes(1))

    def at(self, before: Array, command: Array, reading: Array) -> Array:
        """Estimate at a measurement from the one a period earlier and the command that acted in between."""
        return _stepped(self._look, before, np.concatenate([command, reading])[None])

    def now(self, estimate: Array, commands: Sequence[Array]) -> Array:
        """The same after the commands that came since, a period each."""
        return _stepped(self._move, estimate, np.stack(commands)) if commands else estimate


def _stepped(kernel: Kernel, before: Array, rows: Array) -> Array:
    after, _ = kernel.run(before[:, None], np.zeros((0, 1)), rows)
    return np.ascontiguousarray(after[:, 0])


@dataclass(frozen=True, slots=True)
class Engine:
    """What the law calls; holds no memory of a flight, so that copies of a flight have it in common.

    Attributes:
        solver, observation, motors, bounds: those.
        stabiliser: what flies while no plan is trusted. most: cost of a plan that is trusted.
        stance: where the base stands aside for the tip. contact: of the tip; None where no reference asks for any.
    """

    solver: Solver
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
    """What an engine is made for: constants, the control period in s, and whether the reference may ask for contact."""

    par: PredictiveParameters
    dt: float
    push: bool

    def __deepcopy__(self, _memo: dict[int, Any]) -> Purpose:
        return self  # so that the next period knows its constants by identity

    @property
    def made_of(self) -> tuple[Any, ...]:
        """All that the engine is made of."""
        par = self.par
        shape = par.mode, par.solver, par.stages, par.horizon, par.every
        return par.model, par.weights, par.bandwidths, *shape, self.dt, par.interaction if self.push else None

    def serves(self, other: Purpose) -> bool:
        """Whether an engine that is made for this does for another."""
        same = self.par is other.par and (self.dt, self.push) == (other.dt, other.push)
        return same or self.made_of == other.made_of


def engine_for(par: PredictiveParameters, dt: float, push: bool = False) -> Engine:
    """The engine of a law at a control period of ``dt`` s, whose reference may ask for contact where ``push`` is."""
    return _engine(*Purpose(par, dt, push).made_of)


@lru_cache(maxsize=KEPT)
def _engine(
    model: Model,
    weights: Weights,
    bandwidths: Bandwidths,
    mode: str,
    solver: str,
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
    made: Solver
    if solver == "riccati":
        rollouts = Rollouts(model, weights, mode, bounds, presses)
        made = Riccati(compiled, rollouts, steps, float(weights.final), bounds)
    else:
        from skyarm.control.laws.predictive.interior_point import InteriorPoint

        made = InteriorPoint(solver, model, weights, mode, compiled, steps, bounds, presses)
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
