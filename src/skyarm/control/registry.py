"""Controllers by name: which function makes each law's controller, and what it is in one line."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from skyarm.control.controller import Controller, ControllerError
from skyarm.control.model import Model, Terms
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
        more: name of a tuple in the module: further options, which the maker takes as ``**changes``.
    """

    title: str
    module: str
    maker: str
    fixed: tuple[tuple[str, Any], ...] = ()
    more: str = ""

    def function(self) -> Callable[..., Controller]:
        """The maker."""
        found: Callable[..., Controller] = getattr(self._module(), self.maker)
        return found

    def options(self) -> tuple[str, ...]:
        """Names of the options that may be given."""
        fixed = {name for name, _ in self.fixed}
        parameters = inspect.signature(self.function()).parameters.values()
        named = tuple(p.name for p in parameters if p.kind is p.KEYWORD_ONLY and p.name not in fixed)
        return (*named, *getattr(self._module(), self.more)) if self.more else named

    def _module(self) -> Any:
        return importlib.import_module(f"skyarm.control.{self.module}")


def _paper(name: str, title: str) -> Entry:
    return Entry(title, "paper", "make_paper_controller", (("name", name),))


def _step(name: str, title: str) -> Entry:
    return Entry(title, "steps.maker", "make_stepped", (("name", name),))


LAWS: Mapping[str, Entry] = {
    "rotors_position": _paper("rotors_position", "RotorS's geometric position controller, joints free"),
    "decoupled_pd": _paper("decoupled_pd", "the paper's baseline: RotorS's controller and joint PD, no coupling"),
    "hybrid_computed_torque": _paper(
        "hybrid_computed_torque", "the paper's law: geometric accelerations through the coupled inverse dynamics"
    ),
    "hybrid_computed_torque_euler": _paper(
        "hybrid_computed_torque_euler", "the same in the paper's Euler-angle equations"
    ),
    "nmpc": Entry("whole-body model predictive control", "predictive.maker", "make_predictive_controller"),
    "learned_compensator_style": Entry(
        "the paper's law and a network for what its model leaves out", "learned.law", "make_learned_controller"
    ),
    "ct_level_gravity": Entry(
        "the paper's text to the letter: joint gravity at R = 1",
        "paper",
        "make_paper_controller",
        (("name", "hybrid_computed_torque"), ("terms", Terms(full_gravity=False))),
    ),
    "ct_coupled_thrust": _step("ct_coupled_thrust", "computed torque, thrust along the coupled force"),
    "ct_consistent": _step("ct_consistent", "and the base's acceleration that the real thrust gives"),
    "ct_observer": _step("ct_observer", "and a disturbance observer on base and joints"),
    "ct_feedforward": _step("ct_feedforward", "and desired body rate and acceleration from the force's derivatives"),
    "ct_extrapolation": _step("ct_extrapolation", "and held reference samples continued to the present"),
    "ct_lag_inversion": _step("ct_lag_inversion", "and rotor commands that undo the motors' lag"),
    "bulut_computed_torque_style": Entry(
        "computed torque on position, Euler angles and joints, translation decoupled in the mass matrix",
        "rivals.bulut",
        "make_bulut",
    ),
    "guo_center_of_inertia_style": Entry(
        "SE(3) control of the centre of mass with the locked inertia, joints as servos", "rivals.guo", "make_guo"
    ),
    "li_feedforward_style": Entry(
        "geometric base with variable inertia and feed-forward of the arm's reaction, joints as servos",
        "rivals.li",
        "make_li",
    ),
    "kim_sliding_mode_style": Entry(
        "adaptive sliding mode through the coupled inverse dynamics", "rivals.kim", "make_kim"
    ),
    "l1_adaptive": Entry(
        "L1 adaptive augmentation: predictor, piecewise-constant adaptation, low-pass; matched forces only",
        "rivals.l1",
        "make_l1",
        (("lateral", False),),
    ),
    "l1_adaptive_lateral": Entry(
        "the same, the force across body z compensated through the attitude",
        "rivals.l1",
        "make_l1",
        (("lateral", True),),
    ),
    "indi": Entry(
        "incremental nonlinear dynamic inversion of base and joints with its filters", "rivals.indi", "make_indi"
    ),
    "exact": Entry(
        "centre-of-mass tracking, consistent computed torque, disturbance observer: joints or tip exact",
        "exact.maker",
        "make_exact",
        more="ENTRIES",
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
    for option, value in options.items():
        if option not in entry.options():
            there = ", ".join(entry.options())
            raise ControllerError(
                f"controller.{option} = {shown(value)}: law '{name}' has no such option; it has {there}"
            )
    made = entry.function()(model, **options, **dict(entry.fixed))
    # a maker of several laws may not know under which name it was asked
    return dataclasses.replace(made, name=name) if made.name in LAWS else made


def suited(law: str, known: Mapping[str, Any]) -> dict[str, Any]:
    """Those of some options that a law has."""
    options = LAWS[law].options()
    return {name: value for name, value in known.items() if name in options}
