"""Controllers by name: which function makes each law's controller, and what it is in one line."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from skyarm.control.controller import Controller, ControllerError
from skyarm.control.model import Model
from skyarm.files import shown

__all__ = ["LAWS", "Controller", "ControllerError", "Entry", "make_controller"]


@dataclass(frozen=True, slots=True)
class Entry:
    """Where a law's maker is found; it is imported when it is asked for.

    Attributes:
        title: the law in one line.
        module: under skyarm.control. maker: function (model, **options) -> Controller; its keyword arguments are the
            law's options.
        fixed: options that the name itself fixes.
    """

    title: str
    module: str
    maker: str
    fixed: tuple[tuple[str, Any], ...] = ()

    def function(self) -> Callable[..., Controller]:
        """The maker."""
        found: Callable[..., Controller] = getattr(importlib.import_module(f"skyarm.control.{self.module}"), self.maker)
        return found

    def options(self) -> tuple[str, ...]:
        """Names of the options that may be given."""
        fixed = {name for name, _ in self.fixed}
        parameters = inspect.signature(self.function()).parameters.values()
        return tuple(p.name for p in parameters if p.kind is p.KEYWORD_ONLY and p.name not in fixed)


def _paper(name: str, title: str) -> Entry:
    return Entry(title, "paper", "make_paper_controller", (("name", name),))


LAWS: Mapping[str, Entry] = {
    "rotors_position": _paper("rotors_position", "RotorS's geometric position controller, joints free"),
    "decoupled_pd": _paper("decoupled_pd", "the paper's baseline: RotorS's controller and joint PD, no coupling"),
    "hybrid_computed_torque": _paper(
        "hybrid_computed_torque", "the paper's law: geometric accelerations through the coupled inverse dynamics"
    ),
    "hybrid_computed_torque_euler": _paper(
        "hybrid_computed_torque_euler", "the same in the paper's Euler-angle equations"
    ),
    "nmpc": Entry("whole-body model predictive control", "predictive.law", "make_predictive_controller"),
    "learned_compensator_style": Entry(
        "the paper's law and a network for what its model leaves out", "learned.law", "make_learned_controller"
    ),
}


def make_controller(name: str, model: Model, **options: Any) -> Controller:
    """A controller by its law's name.

    Args:
        name: a key of ``LAWS``.
        model: what it believes.
        options: as the law's maker takes them, for example ``gains``, ``joint_gains``, ``mixer_policy`` of the paper's
            laws (:func:`skyarm.control.paper.make_paper_controller`).

    Raises:
        ControllerError: unknown law, an option the law does not have, or one with a wrong value.
        AllocationError: the model's rotors do not span torque and thrust.
    """
    if not isinstance(name, str) or name not in LAWS:
        raise ControllerError(f"controller.law = {shown(name)}: must be one of {sorted(LAWS)}")
    if not isinstance(model, Model):
        raise ControllerError(f"model = {shown(model)}: must be a Model of vehicle and gravity")
    entry = LAWS[name]
    for option in options:
        if option not in entry.options():
            raise ControllerError(f"controller.{option}: law '{name}' has no such option; it has {entry.options()}")
    return entry.function()(model, **options, **dict(entry.fixed))
