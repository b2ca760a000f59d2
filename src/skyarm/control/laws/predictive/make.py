"""The predictive law with its options checked."""

from __future__ import annotations

import importlib
from typing import Any

from skyarm.actuation import make_mixer
from skyarm.algebra import Vec3
from skyarm.control.controller import Controller, ControllerError
from skyarm.control.laws.centroidal.interaction import interaction_gains
from skyarm.control.laws.predictive.cost import MODES, Weights
from skyarm.control.laws.predictive.kalman_observer import Bandwidths
from skyarm.control.laws.predictive.law import PredictiveMemory, nmpc
from skyarm.control.laws.predictive.parameters import BANDWIDTHS, WEIGHTS, PredictiveParameters
from skyarm.control.model import Model
from skyarm.control.options import positive, two
from skyarm.files import shown
from skyarm.records.leaves import parts
from skyarm.reference import Trajectory

SOLVERS = ("riccati", "fatrop", "ipopt")

MOST_STAGES = 200

THRESHOLDS = (0.3, 0.1)
"""N along the normal, above which a tip touches and below which it is lost, where nobody says others."""


def make_predictive_controller(
    model: Model,
    *,
    mode: str = "tool",
    solver: str = "riccati",
    weights: Weights = WEIGHTS,
    bandwidths: Bandwidths = BANDWIDTHS,
    stages: int = 14,
    horizon: float = 0.65,
    every: int = 2,
    delay_periods: int = 0,
    preview: str | Trajectory = "samples",
    interaction: tuple[float, float] | None = None,
) -> Controller:
    """Whole-body model predictive control of a belief; the options are those of :class:`PredictiveParameters`.

    ``interaction``: N along the normal, above which the tip touches and below which it is lost; twice 0 for a law that
    knows nothing of a push, and the only pair allowed where no tip is led. Left out: :data:`THRESHOLDS` where one is.

    Raises:
        ControllerError: an option with a wrong value, or solver "fatrop" or "ipopt" without the extra 'casadi'.
    """
    for name, value, allowed in (("mode", mode, MODES), ("solver", solver, SOLVERS)):
        if value not in allowed:
            raise ControllerError(f"controller.{name} = {shown(value)}: must be one of {list(allowed)}")
    for name, count, least, most in (
        ("stages", stages, 2, MOST_STAGES),
        ("every", every, 1, MOST_STAGES),
        ("delay_periods", delay_periods, 0, 100),
    ):
        if not isinstance(count, int) or isinstance(count, bool) or not least <= count <= most:
            raise ControllerError(f"controller.{name} = {shown(count)}: must be a whole number from {least} to {most}")
    if every >= stages:
        raise ControllerError(f"controller.every = {every}: must be less than controller.stages = {stages}")
    if not isinstance(preview, Trajectory) and preview != "samples":
        raise ControllerError(f"controller.preview = {shown(preview)}: must be 'samples' or a Trajectory")
    if not isinstance(horizon, (int, float)) or isinstance(horizon, bool) or not 0.05 <= horizon <= 5.0:
        raise ControllerError(f"controller.horizon = {shown(horizon)}: must be a number of s from 0.05 to 5")
    _require_numbers("weights", weights, Weights, zero=True)
    _require_numbers("bandwidths", bandwidths, Bandwidths)
    if solver != "riccati":
        _require_casadi(solver)
    leads = mode == "tool" and bool(model.vehicle.end_effector) and model.vehicle.n > 0
    if interaction is None:
        interaction = THRESHOLDS if leads else (0.0, 0.0)
    thresholds = two("interaction", interaction, zero=True)
    par = PredictiveParameters(
        model=model,
        mixer=make_mixer(model.vehicle),
        weights=weights,
        bandwidths=bandwidths,
        mode=mode,
        solver=solver,
        stages=stages,
        horizon=float(horizon),
        every=every,
        delay_periods=delay_periods,
        preview=preview,
        interaction=interaction_gains(thresholds, "tool" if leads else "joints", model.vehicle, leading="tool"),
    )
    tip = mode == "tool"
    memory = PredictiveMemory(tip_force=None if par.interaction is None else Vec3(0.0, 0.0, 0.0))
    return Controller(name="nmpc", law=nmpc, par=par, memory=memory, compiled=False, keeps_tip=tip)


def _require_numbers(name: str, record: Any, kind: type, *, zero: bool = False) -> None:
    """A record of the kind whose numbers are above zero (or at least zero)."""
    if not isinstance(record, kind):
        raise ControllerError(f"controller.{name} = {shown(record)}: must be {kind.__name__}")
    for field, value in parts(record).items():
        positive(f"{name}.{field}", value, zero=zero)


def _require_casadi(solver: str) -> None:
    """Say now, not in flight, that a library is missing."""
    try:
        importlib.import_module("skyarm.compile.casadi.casadi_shooting")
    except ImportError as error:
        raise ControllerError(f"controller.solver = '{solver}': {error}, or take solver 'riccati'") from None
