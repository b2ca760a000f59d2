"""Laws by name: which function makes each law's controller, its options, and what it is in one line."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from skyarm.control.controller import Controller, ControllerError
from skyarm.control.law_checks import check_made, check_maker, made_by
from skyarm.control.model import Model, Terms
from skyarm.files import must_be_one_of, shown
from skyarm.registry.registrations import canonical, full_name, registrations

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
        given: the maker itself, in place of its module and name.
    """

    title: str
    module: str
    maker: str
    fixed: tuple[tuple[str, Any], ...] = ()
    more: str = ""
    given: Callable[..., Controller] | None = None

    def function(self) -> Callable[..., Controller]:
        """The maker."""
        found: Callable[..., Controller] = self.given or getattr(self._module(), self.maker)
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
    return Entry(title, "laws.paper.make", "make_paper_controller", (("name", name),))


def _step(name: str, title: str) -> Entry:
    return Entry(title, "laws.ladder.make", "make_stepped", (("name", name),))


BEARS_UNDRIVEN = ("rotors_sim_position", "decoupled_pd", "guo2023")
"""Laws that hold the base whatever the joints do; the others count on the joints' torques and fall with a slung load
whose joints nothing drives (``tests/assess/test_hanging_joints.py`` flies them)."""


GONE: Mapping[tuple[str, str], str] = {
    ("centroidal", "arm_scaling"): "joint_limits = true keeps the joints off motions that rotors cannot hold"
}
"""Options of earlier versions, and what stands in their place."""

SHIPPED_LAWS: Mapping[str, Entry] = {
    "rotors_sim_position": _paper("rotors_sim_position", "RotorS's geometric position controller, joints free"),
    "decoupled_pd": _paper("decoupled_pd", "the paper's baseline: RotorS's controller and joint PD, no coupling"),
    "hybrid_computed_torque": _paper(
        "hybrid_computed_torque", "the paper's law: geometric accelerations through the coupled inverse dynamics"
    ),
    "hybrid_computed_torque_euler": _paper(
        "hybrid_computed_torque_euler", "the same in the paper's Euler-angle equations"
    ),
    "nmpc": Entry("whole-body model predictive control", "laws.predictive.make", "make_predictive_controller"),
    "learned_compensator": Entry(
        "the paper's law and a network for what its model leaves out", "laws.learned.law", "make_learned_controller"
    ),
    "ct_level_gravity": Entry(
        "the paper's text to the letter: joint gravity at R = 1",
        "laws.paper.make",
        "make_paper_controller",
        (("name", "hybrid_computed_torque"), ("terms", Terms(full_gravity=False))),
    ),
    "ct_coupled_thrust": _step("ct_coupled_thrust", "computed torque, thrust along the coupled force"),
    "ct_consistent": _step("ct_consistent", "and the base's acceleration that the real thrust gives"),
    "ct_observer": _step("ct_observer", "and a disturbance observer on base and joints"),
    "ct_feedforward": _step("ct_feedforward", "and desired body rate and acceleration from the force's derivatives"),
    "ct_extrapolation": _step("ct_extrapolation", "and held reference samples continued to the present"),
    "ct_lag_inversion": _step("ct_lag_inversion", "and rotor commands that undo the motors' lag"),
    "bulut2019": Entry(
        "computed torque on position, Euler angles and joints, translation decoupled in the mass matrix",
        "laws.published.bulut",
        "make_bulut",
    ),
    "guo2023": Entry(
        "SE(3) control of the centre of mass with the locked inertia, joints as servos",
        "laws.published.guo",
        "make_guo",
    ),
    "li2024": Entry(
        "geometric base with variable inertia and feed-forward of the arm's reaction, joints as servos",
        "laws.published.li",
        "make_li",
    ),
    "kim2013": Entry("adaptive sliding mode through the coupled inverse dynamics", "laws.published.kim", "make_kim"),
    "l1_adaptive": Entry(
        "L1 adaptive augmentation: predictor, piecewise-constant adaptation, low-pass; matched forces only",
        "laws.published.l1",
        "make_l1",
        (("lateral", False),),
    ),
    "l1_adaptive_lateral": Entry(
        "the same, the force across body z compensated through the attitude",
        "laws.published.l1",
        "make_l1",
        (("lateral", True),),
    ),
    "indi": Entry(
        "incremental nonlinear dynamic inversion of base and joints with its filters",
        "laws.published.indi",
        "make_indi",
    ),
    "admittance_pd": Entry(
        "the paper's baseline on a reference that a virtual mass moves until the wanted force acts",
        "laws.pressing.admittance_pd",
        "make_admittance_pd",
    ),
    "hybrid_ct": Entry(
        "the paper's law across a surface's normal, a force along it",
        "laws.pressing.hybrid_ct",
        "make_hybrid_ct",
    ),
    "centroidal": Entry(
        "centroidal computed torque with disturbance observer: joints or tip on their references",
        "laws.centroidal.make",
        "make_centroidal",
        more="ENTRIES",
    ),
}


def __getattr__(name: str) -> Any:
    """A shipped law's entry as an attribute, which is how the registry finds it."""
    if name in SHIPPED_LAWS:
        return SHIPPED_LAWS[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


class _Laws(Mapping[str, Entry]):
    """Every registered law by name."""

    def __getitem__(self, name: str) -> Entry:
        """Where the law's maker is found, also by an alias; KeyError for a name that is not registered."""
        row = registrations("law")[canonical("law", name)]
        found = row.load()
        return found if isinstance(found, Entry) else Entry(row.title, "", "", given=found)

    def __iter__(self) -> Iterator[str]:
        return iter(registrations("law"))

    def __len__(self) -> int:
        return len(registrations("law"))


LAWS: Mapping[str, Entry] = _Laws()
"""Laws by name: those that ship, and those that were registered."""


def make_controller(name: str, model: Model, **options: Any) -> Controller:
    """Make a controller by its law's name.

    Args:
        name: a key of ``LAWS``.
        model: what it believes.
        options: as the law's maker takes them, for example ``gains``, ``joint_gains``, ``mixer_policy`` of the paper's
            laws (:func:`skyarm.control.laws.paper.make.make_paper_controller`).

    Raises:
        ControllerError: unknown law, an option the law does not have, or one with a wrong value.
        AllocationError: the model's rotors do not span torque and thrust.
    """
    if not isinstance(name, str) or name not in LAWS:
        raise ControllerError(f"controller.law = {shown(name)}: {must_be_one_of(LAWS, name, 'skyarm list')}")
    if not isinstance(model, Model):
        raise ControllerError(f"model = {shown(model)}: must be a Model of vehicle and gravity")
    name = full_name("law", name)
    entry = LAWS[name]
    for option, value in options.items():
        if option not in entry.options():
            raise ControllerError(f"controller.{option} = {shown(value)}: {no_option(name, option, entry.options())}")
    maker = entry.function()
    check_maker(maker, name, options | dict(entry.fixed))
    made: Controller = made_by(maker, name, model, options | dict(entry.fixed))
    check_made(maker, name, made)
    # a maker of several laws may not know under which name it was asked
    return dataclasses.replace(made, name=name) if made.name in LAWS else made


def no_option(law: str, option: str, there: Iterable[str]) -> str:
    """Refusal of an option that a law does not have, or has no more."""
    instead = GONE.get((law, option))
    return f"is gone; {instead}" if instead else f"law {law!r} has no such option; it has {', '.join(there)}"


def canonical_law(name: Any) -> Any:
    """The law's own name where an alias or an old name is given, with a warning for an old one."""
    return full_name("law", name)


def suitable_options(law: str, known: Mapping[str, Any]) -> dict[str, Any]:
    """Those of some options that a law has."""
    options = LAWS[law].options()
    return {name: value for name, value in known.items() if name in options}
