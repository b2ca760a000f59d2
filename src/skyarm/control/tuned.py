"""Tuned gains of the laws, as factors on the gains a law's maker takes by itself, so that they fit any vehicle.

The file beside this one is written by :mod:`skyarm.experiments.tuning`, whose docstring says how and at what cost.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib import resources
from typing import Any

from skyarm.compile import leaves, rebuild
from skyarm.control.controller import Controller, ControllerError
from skyarm.control.model import Model
from skyarm.control.registry import make_controller
from skyarm.files import shown
from skyarm.scalars import mul

COMMON = (
    "gains.position",
    "gains.velocity",
    "gains.attitude",
    "gains.rate",
    "joint_gains.stiffness",
    "joint_gains.damping",
)
"""Constants that every law with gains has; each path stands for all numbers below it, which keep their ratios."""

OBSERVER = ("observer.force", "observer.torque", "observer.joints")

KNOBS: Mapping[str, tuple[str, ...]] = {
    "decoupled_pd": COMMON,
    "hybrid_computed_torque": COMMON,
    "ct_coupled_thrust": COMMON,
    "ct_consistent": COMMON,
    "ct_observer": (*COMMON, *OBSERVER),
    "ct_feedforward": (*COMMON, *OBSERVER),
    "ct_extrapolation": (*COMMON, *OBSERVER),
    "ct_lag_inversion": (*COMMON, *OBSERVER, "lag_share"),
    "bulut_computed_torque_style": COMMON,
    "guo_center_of_inertia_style": COMMON,
    "li_feedforward_style": COMMON,
    "kim_sliding_mode_style": (*COMMON, "switching", "adaptation.0", "adaptation.1", "adaptation.2"),
    "l1_adaptive": (*COMMON, "predictor", "thrust_filter", "torque_filter", "joint_filter"),
    "l1_adaptive_lateral": (*COMMON, "predictor", "thrust_filter", "torque_filter", "joint_filter", "lateral_filter"),
    "indi": (*COMMON, "cutoff"),
    "learned_compensator_style": (*COMMON, "answer"),
    "nmpc": (
        *("weights.velocity", "weights.heading", "weights.rate", "weights.joints", "weights.joint_rates"),
        *("weights.joint_accelerations", "weights.rotor_accelerations"),
        *("bandwidths.linear", "bandwidths.angular", "bandwidths.joints"),
    ),
}
"""What is tuned of each law."""


def rescaled(controller: Controller, factors: Mapping[str, Any]) -> Controller:
    """The controller with the numbers below some paths of its constants multiplied; factors may be traced.

    Raises:
        ControllerError: a path that its constants do not have.
    """
    par = controller.par
    for path, factor in factors.items():
        par = _scaled(par, path.split("."), factor, path)
    return dataclasses.replace(controller, par=par)


def _scaled(record: Any, names: Sequence[str], factor: Any, path: str) -> Any:
    if not names:
        return rebuild(record, iter([mul(leaf, factor) for leaf in leaves(record)]))
    name = names[0]
    if isinstance(record, tuple) and name.isdigit() and int(name) < len(record):
        i = int(name)
        return (*record[:i], _scaled(record[i], names[1:], factor, path), *record[i + 1 :])
    if not dataclasses.is_dataclass(record) or name not in {field.name for field in dataclasses.fields(record)}:
        raise ControllerError(f"controller.{path}: the law has no such constant")
    part = _scaled(getattr(record, name), names[1:], factor, path)
    return dataclasses.replace(record, **{name: part})  # type: ignore[type-var]


@lru_cache(maxsize=1)
def tuned_factors() -> Mapping[str, Mapping[str, float]]:
    """Factors by law and path, from the package's file."""
    text = resources.files("skyarm.control").joinpath("tuned.toml").read_text(encoding="utf-8")
    laws: Mapping[str, Mapping[str, float]] = tomllib.loads(text)["law"]
    return laws


def tuned(name: str, model: Model, **options: Any) -> Controller:
    """A law with its tuned gains.

    Args:
        name: a law of the file.
        model: what it believes.
        **options: of the law's maker.

    Raises:
        ControllerError: a law that has not been tuned.
    """
    factors = tuned_factors()
    if not isinstance(name, str) or name not in factors:
        raise ControllerError(f"controller.law = {shown(name)}: has no tuned gains; there are {sorted(factors)}")
    return rescaled(make_controller(name, model, **options), factors[name])
