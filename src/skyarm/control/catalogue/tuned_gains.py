"""Tuned gains of the laws, as factors on the gains a law's maker takes by itself, so that they fit any vehicle.

How the factors in the file next to this one were found is described in docs/control_laws.md, Tuned gains.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping
from functools import lru_cache
from importlib import resources
from typing import Any

from skyarm.compile import leaves, rebuild
from skyarm.control.catalogue.law_entries import canonical_law, make_controller
from skyarm.control.controller import Controller, ControllerError
from skyarm.control.model import Model
from skyarm.files import shown
from skyarm.records.leaves import Place, parts
from skyarm.records.replace_parts import replaced
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
    "bulut2019": COMMON,
    "guo2023": COMMON,
    "li2024": COMMON,
    "kim2013": (*COMMON, "switching", "adaptation.0", "adaptation.1", "adaptation.2"),
    "l1_adaptive": (*COMMON, "predictor", "thrust_filter", "torque_filter", "joint_filter"),
    "l1_adaptive_lateral": (*COMMON, "predictor", "thrust_filter", "torque_filter", "joint_filter", "lateral_filter"),
    "indi": (*COMMON, "cutoff"),
    "hybrid_ct": COMMON,
    "admittance_pd": COMMON,
    "learned_compensator": (*COMMON, "answer"),
    "nmpc": (
        *("weights.velocity", "weights.heading", "weights.rate", "weights.joints", "weights.joint_rates"),
        *("weights.joint_accelerations", "weights.rotor_accelerations"),
        *("bandwidths.linear", "bandwidths.angular", "bandwidths.joints"),
    ),
}
"""What is tuned of each law."""


def rescale(controller: Controller, factors: Mapping[str, Any]) -> Controller:
    """The controller with the numbers below some paths of its constants multiplied; factors may be traced.

    Raises:
        ControllerError: a path that its constants do not have.
    """
    par = controller.par
    for path, factor in factors.items():
        place = tuple(path.split("."))
        numbers = _part(par, place)
        par = replaced(par, {place: rebuild(numbers, iter([mul(leaf, factor) for leaf in leaves(numbers)]))})
    return dataclasses.replace(controller, par=par)


def _part(record: Any, place: Place) -> Any:
    """What stands at a place of a law's constants."""
    for name in place:
        below = parts(record)
        if name not in below:
            raise ControllerError(f"controller.{'.'.join(place)}: the law has no such constant")
        record = below[name]
    return record


@lru_cache(maxsize=1)
def tuned_factors() -> Mapping[str, Mapping[str, float]]:
    """Factors by law and path, from the package's file."""
    text = resources.files("skyarm.control.catalogue").joinpath("tuned.toml").read_text(encoding="utf-8")
    laws: Mapping[str, Mapping[str, float]] = tomllib.loads(text)["law"]
    return laws


def make_tuned(name: str, model: Model, **options: Any) -> Controller:
    """A law with its tuned gains.

    Args:
        name: a law of the file.
        model: what it believes.
        **options: of the law's maker.

    Raises:
        ControllerError: a law that has not been tuned.
    """
    factors, name = tuned_factors(), canonical_law(name)
    if not isinstance(name, str) or name not in factors:
        raise ControllerError(f"controller.law = {shown(name)}: has no tuned gains; there are {sorted(factors)}")
    return rescale(make_controller(name, model, **options), factors[name])
